"""Measured (and simulated) motions of the shoulder girdle: rotations, files, the scapulo-humeral rhythm."""

import jax

from motions.errors import InputError
from motions.formats.any_file import read_trial
from motions.motion_csv.reading import MotionStream, read_motions
from motions.motion_csv.writing import write_motions
from motions.table import ANGLES, LANDMARKS, Motions

# The fits are exact in double precision only; no module of the project makes an array before this line.
jax.config.update("jax_enable_x64", True)

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
