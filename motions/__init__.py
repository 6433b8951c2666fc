"""Measured and simulated motions of the shoulder girdle: rotations, files and the scapulo-humeral rhythm.

All names but ``InputError`` are imported lazily, because the help of the command line needs none of them.
"""

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

from motions.errors import InputError

if TYPE_CHECKING:
    from motions.formats.any_file import read_trial
    from motions.motion_csv.reading import MotionStream, read_motions
    from motions.motion_csv.writing import write_motions
    from motions.table import ANGLES, LANDMARKS, Motions

# The fits need double precision, so it is switched on before any module of the project makes an array. JAX reads the
# environment variable at import; if JAX is already imported, its configuration is updated instead.
os.environ["JAX_ENABLE_X64"] = "1"
if "jax" in sys.modules:
    sys.modules["jax"].config.update("jax_enable_x64", True)

__all__ = [
    "ANGLES",
    "LANDMARKS",
    "InputError",
    "MotionStream",
    "Motions",
    "read_motions",
    "read_trial",
    "write_motions",
]

_HOMES = {
    "motions.formats.any_file": ("read_trial",),
    "motions.motion_csv.reading": ("MotionStream", "read_motions"),
    "motions.motion_csv.writing": ("write_motions",),
    "motions.table": ("ANGLES", "LANDMARKS", "Motions"),
}


def __getattr__(name: str) -> Any:
    home = next((module for module, names in _HOMES.items() if name in names), None)
    if home is None:
        raise AttributeError(f"module 'motions' has no attribute {name!r}")
    return getattr(importlib.import_module(home), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
