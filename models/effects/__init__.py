"""The candidate unmodelled effects: the ``EFFECT`` of every module in the folders here.

To add an effect, add a file with an ``EFFECT = Effect(...)`` to the folder of what the effect changes: the measurement,
a bone, a joint or the thorax. Nothing has to be registered. An effect with bone angles in ``may_follow`` gets a second
basis.
"""

import importlib
import pkgutil

from models.effects.by_posture import by_posture
from models.effects.effect import Effect
from models.effects.extended_girdle import NO_ACTIVE_EFFECTS, ActiveEffects, AnyGirdle, ExtendedGirdle
from models.effects.prior import EffectPrior
from models.effects.set_numbers import NUMBER_EFFECTS

_FOLDERS = ("measurement", "bones", "joints", "thorax")
"""Folders in the order in which their effects act: from the measurement to the bones, joints and thorax."""


def _of_folder(folder: str) -> list[Effect]:
    package = importlib.import_module(f"{__name__}.{folder}")
    modules = (
        importlib.import_module(f"{package.__name__}.{one.name}") for one in pkgutil.iter_modules(package.__path__)
    )
    return [effect for module in modules for effect in _with_bases(module.EFFECT)]


def _with_bases(effect: Effect) -> list[Effect]:
    return [effect, by_posture(effect)] if effect.may_follow else [effect]


_BY_FOLDER = {folder: _of_folder(folder) for folder in _FOLDERS}
_BY_FOLDER["bones"] += NUMBER_EFFECTS.values()

EFFECTS: dict[str, Effect] = {effect.name: effect for folder in _FOLDERS for effect in _BY_FOLDER[folder]}
"""All effects by name, in the order in which they act: the result does not depend on the order in which a user lists
them."""

__all__ = ["EFFECTS", "NO_ACTIVE_EFFECTS", "ActiveEffects", "AnyGirdle", "Effect", "EffectPrior", "ExtendedGirdle"]
