"""The candidate unmodelled effects: every module in a folder here that has an ``EFFECT``.

To add one, add a file with an ``EFFECT = Effect(...)`` to the folder that says what it changes: the thorax, a joint, a
bone or the measurement. Nothing has to be registered.
"""

import importlib
import pkgutil

from models.effects.effect import Effect
from models.effects.extended_girdle import NO_ACTIVE_EFFECTS, ActiveEffects, ExtendedGirdle
from models.effects.prior import EffectPrior

_FOLDERS = [importlib.import_module(f"{__name__}.{one.name}") for one in pkgutil.iter_modules(__path__) if one.ispkg]

_MODULES = [
    importlib.import_module(f"{folder.__name__}.{one.name}")
    for folder in _FOLDERS
    for one in pkgutil.iter_modules(folder.__path__)
]

EFFECTS: dict[str, Effect] = {
    effect.name: effect for effect in sorted((module.EFFECT for module in _MODULES), key=lambda effect: effect.name)
}
"""Every effect by its name, in alphabetical order."""

__all__ = ["EFFECTS", "NO_ACTIVE_EFFECTS", "ActiveEffects", "Effect", "EffectPrior", "ExtendedGirdle"]
