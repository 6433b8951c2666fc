"""Labels of a landmark file, from the options of ``girdle convert`` and ``girdle model``."""

from collections.abc import Sequence
from pathlib import Path

from motions.errors import InputError, named
from motions.formats.any_file import elevations
from motions.landmarks.acromion import ROTATIONS
from motions.landmarks.estimated_landmarks import GH_OFFSETS, OFFSETS
from motions.landmarks.mapping import UNITS_MM
from motions.landmarks.sampled_postures import Labels
from motions.motion_csv.cells import SIDES


def asked_labels(
    subject: str, motion: str, side: str, at: str, aa_to_ac: str, sc_from_ij: str, gh_from_ac: str = ""
) -> Labels:
    """Create the labels from the options; raise an InputError that names an option with an invalid value."""
    if side not in SIDES:
        raise InputError("--side", None, f"the side is '{side}'", "Say left or right")
    rotation = named(aa_to_ac, ROTATIONS, "--aa-to-ac", "rotation") if aa_to_ac else None
    offset = named(sc_from_ij, OFFSETS, "--sc-from-ij", "offset") if sc_from_ij else None
    gh = named(gh_from_ac, GH_OFFSETS, "--gh-from-ac", "offset") if gh_from_ac else None
    return Labels(subject, motion, SIDES[side], _elevations(at), rotation, aa_to_ac, offset, gh)


def asked_unit_mm(surface_unit: str, surfaces: Sequence[Path | None]) -> float:
    """Return the unit of the surfaces, mm; raise an InputError for an unknown one, and for one without a surface."""
    unit_mm = named(surface_unit, UNITS_MM, "--surface-unit", "unit")
    if unit_mm != 1.0 and not any(surfaces):
        cause = "there is no surface that could have this unit"
        raise InputError("--surface-unit", None, cause, "Give the surfaces, or leave it out")
    return unit_mm


def _elevations(at: str) -> tuple[float, ...]:
    """Read the numbers of ``--at``, each once, in ascending order."""
    words = [word for word in at.split(",") if word.strip()]
    found = elevations([float("nan")] if at and not words else words)
    if found is None:
        cause = f"'{at}' is not a list of elevations"
        raise InputError("--at", None, cause, "Give degrees from 0 to 180 separated by commas, as in --at 30,60,90")
    return found
