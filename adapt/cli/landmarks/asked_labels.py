"""Labels of a landmark file, from the options of ``girdle convert`` and ``girdle model``."""

from motions.errors import InputError, named
from motions.formats.any_file import elevations
from motions.landmarks.acromion import ROTATIONS
from motions.landmarks.sampled_postures import Labels
from motions.landmarks.stand_ins import GH_OFFSETS, OFFSETS
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


def _elevations(at: str) -> tuple[float, ...]:
    """Read the numbers of ``--at``, each once, in ascending order."""
    words = [word for word in at.split(",") if word.strip()]
    found = elevations([float("nan")] if at and not words else words)
    if found is None:
        cause = f"'{at}' is not a list of elevations"
        raise InputError("--at", None, cause, "Give degrees from 0 to 180 separated by commas, as in --at 30,60,90")
    return found
