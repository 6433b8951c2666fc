"""A marker that was not seen, as capture software writes it: at (0, 0, 0), kilometres away, or still at one place."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

Positions = dict[str, Float[np.ndarray, "3 frames"]]

ORIGIN = "IJ"
"""The landmark that is the origin of the thorax frame: in a file of that frame it is (0, 0, 0) in every frame."""

COMPANIONS = (
    ("IJ", "PX", "C7", "T8", "SC"),
    ("SC", "AC"),
    ("AC", "AA", "TS", "AI", "GH"),
    ("GH", "EM", "EL"),
)
"""Landmarks that move together: those of a bone with those of its joints."""

FARTHEST_MM = 16_000.0
"""No laboratory is 16 m from its origin to a side; -16512 and 9999999 stand for a marker that was not seen."""

FEWEST_FRAMES = 3
"""Frames at exactly the same place, of which two may be so by rounding."""


MOVED_MM = 1.0
"""How far all that moves with a landmark goes while it stands still. Less is the noise of a body at rest, rounded by
the file, and does not matter."""


def never_seen(lab_mm: Mapping[str, Float[np.ndarray, "3 frames"]]) -> dict[str, Bool[np.ndarray, " frames"]]:
    """Tell in which frames each landmark has a position that says that it was not seen; NaN is not among them.

    It is so at exactly (0, 0, 0), but for IJ where it is so in every frame; beyond FARTHEST_MM; and where it stays at
    exactly one place while all landmarks that move with it go by MOVED_MM, and the thorax (IJ), still in its own frame.
    """
    found = {}
    for name, place in lab_mm.items():
        groups = [group for group in COMPANIONS if name in group]
        others = {other for group in (*groups, (ORIGIN,)) for other in group if other != name}
        moving = [lab_mm[other] for other in sorted(others) if other in lab_mm] if ORIGIN in lab_mm else []
        found[name] = _unseen(name, place) | _held(place, moving)
    return found


def never_seen_of_cluster(markers_mm: Mapping[str, Float[np.ndarray, "3 frames"]]) -> dict[str, np.ndarray]:
    """Tell in which frames each marker of a cluster was not seen, as ``never_seen``: all of them move together."""
    return {
        name: _unseen(name, place) | _held(place, [other for also, other in markers_mm.items() if also != name])
        for name, place in markers_mm.items()
    }


def _unseen(name: str, place: Float[np.ndarray, "3 frames"]) -> Bool[np.ndarray, " frames"]:
    zero = (place == 0.0).all(axis=0)
    if name == ORIGIN and zero.all():
        zero = np.zeros_like(zero)
    return zero | (np.abs(place) > FARTHEST_MM).any(axis=0)  # NaN is no larger


def _held(
    place: Float[np.ndarray, "3 frames"], others: Sequence[Float[np.ndarray, "3 frames"]]
) -> Bool[np.ndarray, " frames"]:
    """In which frames a landmark stands still, while none of the others does and all go by MOVED_MM: one that is still
    with others is where the body is still."""
    found = np.zeros(place.shape[1], bool)
    for first, last in _runs_at_one_place(place):
        go_mm = [_goes_mm(other[:, first : last + 1]) for other in others]
        found[first : last + 1] = any(mm > 0.0 for mm in go_mm) and all(np.isnan(mm) or mm > MOVED_MM for mm in go_mm)
    for other in others if found.any() else ():
        for first, last in _runs_at_one_place(other):
            found[first : last + 1] = False
    return found


def _runs_at_one_place(place: Float[np.ndarray, "3 frames"]) -> list[tuple[int, int]]:
    """The first and the last of FEWEST_FRAMES or more in a row in which a landmark is at exactly one place."""
    same = (place[:, 1:] == place[:, :-1]).all(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int))).reshape(-1, 2).tolist()
    return [(first, last) for first, last in edges if last + 1 - first >= FEWEST_FRAMES]


def _goes_mm(place: Float[np.ndarray, "3 frames"]) -> float:
    """How far a landmark goes along an axis; NaN where it was not measured."""
    known = place[:, np.isfinite(place).all(axis=0)]
    return float(np.ptp(known, axis=1).max()) if known.shape[1] else np.nan
