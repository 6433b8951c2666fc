"""A marker that was not seen, as capture software writes it: at (0, 0, 0), kilometres away, or still at one place."""

from collections.abc import Mapping

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


def never_seen(lab_mm: Mapping[str, Float[np.ndarray, "3 frames"]]) -> dict[str, Bool[np.ndarray, " frames"]]:
    """Tell in which frames each landmark has a position that says that it was not seen; NaN is not among them.

    It is so at exactly (0, 0, 0), but for IJ where it is so in every frame; beyond FARTHEST_MM; and where it stays at
    exactly one place while none of the landmarks that move with it does, nor the thorax (IJ), still in its own frame.
    """
    still = {name: _still(place) for name, place in lab_mm.items()}
    return {name: _unseen(name, place) | _alone(name, still) for name, place in lab_mm.items()}


def never_seen_of_cluster(markers_mm: Mapping[str, Float[np.ndarray, "3 frames"]]) -> dict[str, np.ndarray]:
    """Tell in which frames each marker of a cluster was not seen, as ``never_seen``: all of them move together."""
    still = {name: _still(place) for name, place in markers_mm.items()}
    moving = {name: ~np.any([still[other] for other in still if other != name], axis=0) for name in still}
    return {name: _unseen(name, place) | (still[name] & moving[name]) for name, place in markers_mm.items()}


def _unseen(name: str, place: Float[np.ndarray, "3 frames"]) -> Bool[np.ndarray, " frames"]:
    zero = (place == 0.0).all(axis=0)
    if name == ORIGIN and zero.all():
        zero = np.zeros_like(zero)
    return zero | (np.abs(place) > FARTHEST_MM).any(axis=0)  # NaN is no larger


def _still(place: Float[np.ndarray, "3 frames"]) -> Bool[np.ndarray, " frames"]:
    """In which frames a landmark is at exactly the place where it is in FEWEST_FRAMES in a row or more."""
    same = (place[:, 1:] == place[:, :-1]).all(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    found = np.zeros(place.shape[1], bool)
    for first, last in edges.reshape(-1, 2):
        found[first : last + 1] = last + 1 - first >= FEWEST_FRAMES
    return found


def _alone(name: str, still: Mapping[str, Bool[np.ndarray, " frames"]]) -> Bool[np.ndarray, " frames"]:
    """Where it is still and all of its companions move: one that is still with others is where the body is still."""
    groups = [group for group in COMPANIONS if name in group]
    others = {other for group in (*groups, (ORIGIN,)) for other in group if other != name and other in still}
    if not others or ORIGIN not in still:
        return np.zeros_like(still[name])
    return still[name] & ~np.any([still[other] for other in others], axis=0)
