"""The candidate unmodelled effects: every module here that has an ``EFFECT``.

To add one, add a file with an ``EFFECT = Effect(...)``; nothing has to be registered.
"""

import importlib
import pkgutil

from models.effects.effect import NOTHING_AT_WORK, AtWork, Effect, ExtendedGirdle

_MODULES = [importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__)]

EFFECTS: dict[str, Effect] = {module.EFFECT.name: module.EFFECT for module in _MODULES if hasattr(module, "EFFECT")}
"""Every effect by its name."""

__all__ = ["EFFECTS", "NOTHING_AT_WORK", "AtWork", "Effect", "ExtendedGirdle"]
