"""Detection of markers that were not seen, which software writes at (0, 0, 0), kilometres away or at a fixed place."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

from motions.checks.distances import MIDDLE

Positions = dict[str, Float[np.ndarray, "3 frames"]]

ORIGIN = "IJ"
"""Landmark at the origin of the thorax frame: a file in that frame has it at (0, 0, 0) throughout."""

_OF_THORAX = (ORIGIN, "PX", "C7", "T8", "SC")
"""Landmarks that hardly move in the thorax frame."""

_THORAX = (ORIGIN, "PX", "C7", "T8", MIDDLE)

COMPANIONS = (
    _OF_THORAX,
    ("SC", "AC"),
    ("AC", "AA", "TS", "AI", "GH"),
    ("GH", "EM", "EL"),
)
"""Groups of landmarks that move together: the landmarks of a bone with those of its joints."""

FARTHEST_MM = 16_000.0
"""Maximum coordinate in mm: no laboratory extends 16 m from its origin. -16512 and 9999999 mean a missing marker."""

FEWEST_FRAMES = 3
"""Minimum number of successive frames at exactly the same place: two may be equal by rounding."""

FEWEST_TOGETHER = 5
"""Minimum number of such frames of several landmarks at once: a body at rest may have a few by rounding."""

_STEPS_OF_FILE = 1.5
"""Minimum movement of all others while several landmarks stand still, in units of the file's last digit: one unit is
the rounding of a body at rest, which is 10 mm in a file of whole centimetres."""

MOVED_MM = 1.0
"""Minimum distance (mm) that each landmark that moves with a missing one goes while the missing one stands still.
Smaller movements are noise of a body at rest, rounded by the file, and do not matter."""

_STILL_MM = 20.0
"""Maximum movement (mm) of the thorax's landmarks in the thorax frame: noise of the skin, and the movement of SC. A
landmark that goes farther was exchanged with another."""


def never_seen(lab_mm: Mapping[str, Float[np.ndarray, "3 frames"]]) -> dict[str, Bool[np.ndarray, " frames"]]:
    """Find, for each landmark, the frames in which its position means 'not seen'; frames with NaN are not among them.

    Such a position is

    - exactly (0, 0, 0), except for IJ if IJ is there in every frame;
    - beyond ``FARTHEST_MM``;
    - exactly one place while IJ and all landmarks that move with this one go by ``MOVED_MM``. In the thorax frame the
      thorax stands still and does not count;
    - exactly one place each of several landmarks while IJ and all others go (``_held_together``).
    """
    in_thorax_frame = ORIGIN in lab_mm and not lab_mm[ORIGIN].any()
    exchanged = any(_goes_mm(lab_mm[name]) > _STILL_MM for name in _OF_THORAX if name in lab_mm)
    free = {name: place for name, place in lab_mm.items() if not in_thorax_frame or name not in (ORIGIN, "SC")}
    found = _held_together(free, _THORAX)
    for name, place in lab_mm.items():
        groups = [group for group in COMPANIONS if name in group]
        others = {other for group in (*groups, (ORIGIN,)) for other in group if other != name}
        if in_thorax_frame:
            others = set() if exchanged or name in _OF_THORAX else others.difference(_OF_THORAX)
        moving = [lab_mm[other] for other in sorted(others) if other in lab_mm] if ORIGIN in lab_mm else []
        found[name] = _unseen(name, place) | _held(place, moving) | found.get(name, False)
    return found


def never_seen_of_cluster(
    markers_mm: Mapping[str, Float[np.ndarray, "3 frames"]],
    others_mm: Mapping[str, Float[np.ndarray, "3 frames"]],
    thorax: Collection[str],
) -> dict[str, np.ndarray]:
    """Find the frames in which each marker of a cluster was not seen, like ``never_seen``: all markers move as one.

    ``others_mm``: all other landmarks and markers of clusters; ``thorax`` names those of the thorax.
    """
    held = _held_together({**others_mm, **markers_mm}, thorax)
    return {
        name: _unseen(name, place)
        | _held(place, [other for also, other in markers_mm.items() if also != name])
        | held[name]
        for name, place in markers_mm.items()
    }


def _unseen(name: str, place: Float[np.ndarray, "3 frames"]) -> Bool[np.ndarray, " frames"]:
    zero = (place == 0.0).all(axis=0)
    if name == ORIGIN and zero.all():
        zero = np.zeros_like(zero)
    return zero | (np.abs(place) > FARTHEST_MM).any(axis=0)  # NaN compares false


def _held(
    place: Float[np.ndarray, "3 frames"], others: Sequence[Float[np.ndarray, "3 frames"]]
) -> Bool[np.ndarray, " frames"]:
    """Find the frames in which a landmark stands still while no other does and all go by ``MOVED_MM``.

    Landmarks that stand still together show that the body stands still.
    """
    found = np.zeros(place.shape[1], bool)
    for first, last in runs_at_one_place(place):
        go_mm = [_goes_mm(other[:, first : last + 1]) for other in others]
        found[first : last + 1] = any(mm > 0.0 for mm in go_mm) and all(np.isnan(mm) or mm > MOVED_MM for mm in go_mm)
    for other in others if found.any() else ():
        for first, last in runs_at_one_place(other):
            found[first : last + 1] = False
    return found


def _held_together(positions: Positions, thorax: Collection[str]) -> dict[str, Bool[np.ndarray, " frames"]]:
    """Find the frames in which several landmarks or markers stand still while all others go, such as a lost scapula.

    The thorax moves with every breath. While nothing of it was measured, or one of ``thorax`` stands still too, the
    body is at rest, or the frame is that of the thorax.
    """
    found = {name: np.zeros(place.shape[1], bool) for name, place in positions.items()}
    least_mm = max(MOVED_MM, _STEPS_OF_FILE * _step_mm(positions))
    each = [run for place in positions.values() for run in runs_at_one_place(place, FEWEST_TOGETHER)]
    for first, last in dict.fromkeys(each):  # landmarks that stand still together have the same run
        here = {name: place[:, first : last + 1] for name, place in positions.items()}
        if not any(_goes_mm(here[name]) > least_mm for name in thorax if name in here):
            continue
        still = [name for name, place in here.items() if (place == place[:, :1]).all()]
        go_mm = {name: _goes_mm(place) for name, place in here.items() if name not in still}
        if len(still) > 1 and not set(still) & set(thorax) and not any(mm <= least_mm for mm in go_mm.values()):
            for name in still:
                found[name][first : last + 1] = True
    return found


def _step_mm(positions: Positions) -> float:
    """Compute the smallest step of a coordinate between frames, mm: one unit of the last digit in a file of few."""
    steps = [np.abs(np.diff(place, axis=1)) for place in positions.values()]
    return min((float(one[one > 0.0].min()) for one in steps if (one > 0.0).any()), default=0.0)


def runs_at_one_place(place: Float[np.ndarray, "3 frames"], fewest: int = FEWEST_FRAMES) -> list[tuple[int, int]]:
    """List the first and last frame of each run of at least ``fewest`` with a landmark at exactly one place."""
    same = (place[:, 1:] == place[:, :-1]).all(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int))).reshape(-1, 2).tolist()
    return [(first, last) for first, last in edges if last + 1 - first >= fewest]


def _goes_mm(place: Float[np.ndarray, "3 frames"]) -> float:
    """Compute the largest range of a landmark along an axis, in mm; NaN if it was not measured."""
    known = place[:, np.isfinite(place).all(axis=0)]
    return float(np.ptp(known, axis=1).max()) if known.shape[1] else np.nan
