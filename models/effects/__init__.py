"""The candidate unmodelled effects: every module in a folder here that has an ``EFFECT``.

To add one, add a file with an ``EFFECT = Effect(...)`` to the folder that says what it changes: the measurement, a
bone, a joint or the thorax. Nothing has to be registered. One with bone angles in ``may_follow`` has a second course.
"""

import importlib
import pkgutil

from models.effects.by_posture import by_posture
from models.effects.effect import Effect
from models.effects.extended_girdle import NO_ACTIVE_EFFECTS, ActiveEffects, AnyGirdle, ExtendedGirdle
from models.effects.prior import EffectPrior
from models.effects.set_numbers import NUMBER_EFFECTS

_FOLDERS = ("measurement", "bones", "joints", "thorax")
"""In the order in which effects act: from what was measured to the bones, then the joints between them."""


def _of_folder(folder: str) -> list[Effect]:
    package = importlib.import_module(f"{__name__}.{folder}")
    modules = (
        importlib.import_module(f"{package.__name__}.{one.name}") for one in pkgutil.iter_modules(package.__path__)
    )
    return [course for module in modules for course in _courses(module.EFFECT)]


def _courses(effect: Effect) -> list[Effect]:
    return [effect, by_posture(effect)] if effect.may_follow else [effect]


_BY_FOLDER = {folder: _of_folder(folder) for folder in _FOLDERS}
_BY_FOLDER["bones"] += NUMBER_EFFECTS.values()

EFFECTS: dict[str, Effect] = {effect.name: effect for folder in _FOLDERS for effect in _BY_FOLDER[folder]}
"""Every effect by its name, in the order in which they act: of several, the same result whoever lists them."""

__all__ = ["EFFECTS", "NO_ACTIVE_EFFECTS", "ActiveEffects", "AnyGirdle", "Effect", "EffectPrior", "ExtendedGirdle"]
