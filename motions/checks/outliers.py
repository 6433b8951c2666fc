"""Landmark outliers and exchanged labels in some frames of a trial, by a robust fit of the distances.

**Reference.** The reference of a distance within one bone is fitted over the frames in which it is a person's. The
middle of the shortest half of these distances (Rousseeuw & Leroy, Robust regression and outlier detection (1987), 4.1)
is right if up to half of the frames are wrong. The reference and its SD are the median and SD of distances near this
middle.

**Outliers.** A frame has an outlier where a distance is farther from its reference than k SD and than a minimum limit.
Skin moves slowly, so a run of such frames counts only if a jump begins or ends it. The landmarks to blame are the
fewest that are in all of these distances (``motions.checks.distances.blamed``).

**Swaps.** If the exchange of two landmarks corrects every distance of a frame, their labels are exchanged there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from motions.checks.distances import (
    RANGES,
    Pair,
    Positions,
    blamed,
    distances_mm,
    in_range,
    size_of,
    size_of_ranges,
)

RIGID: tuple[Pair, ...] = tuple(pair for pair in RANGES if pair not in (("SC", "IJ"), ("GH", "AC")))
"""Pairs of landmarks on one bone."""

NEARLY_RIGID: tuple[Pair, ...] = (
    *(("SC", name) for name in ("IJ", "C7", "PX", "T8")),
    *(("GH", name) for name in ("AC", "TS", "AI")),
)
"""Pairs across a joint, with one landmark beside its centre."""

RIGID_MM, NEARLY_RIGID_MM = 10.0, 25.0
"""Minimum limits, in mm, of the deviation of a distance from its reference. 10 mm turn the scapula by 5 degrees; SC and
GH move by some millimetres in their joints, and a regression for GH adds to this."""

FALSE_ALARM = 0.005
"""Probability of an outlier in a sound trial, if distances have a normal distribution."""

_SD_OF_HALF = 1.4826
"""Ratio of the SD to half the width of the shortest half, for normal values."""

_NEAR_SD = 3.0
"""Deviation from the middle, in SD, up to which distances count for the median and SD."""

_MORE_THAN_STEPS = 1.5
"""Maximum ratio of the SD to the SD from steps between frames, few of which begin or end an outlier: if nearly half of
the frames are wrong, the shortest half is wide."""

_FEW = 10.0
"""Constant in the factor 1 + 10/(n - 1) on the limit of n frames: the SD of few frames is uncertain, and the largest of
many distances has to stay below the limit. The constant is from simulation (scripts/research/landmarks)."""

_LEAST_SD_MM = 0.5
"""Minimum SD of a distance in mm: in SDs of landmarks without noise, every deviation is large."""

_LEAST_IN_RANGE = 4
"""Minimum number of frames in which a distance is a person's; with fewer, all frames give the reference."""

_JUMP = 0.5
"""Minimum change of the distance where an outlier begins or ends, as a share of its deviation."""

_JUMP_FRAMES, _JUMP_SHARE = 5, 0.05
"""Maximum number of frames of a jump, such as after a filter; in a short trial, this share of its frames."""

_FEWEST = 4
"""Minimum number of frames of a distance for a reference."""


@dataclass(frozen=True)
class Reference:
    """Reference of each distance, as most frames have it, and the limit of the deviation from it."""

    pairs: tuple[Pair, ...]
    mm: Float[np.ndarray, " pairs"]
    limit_mm: Float[np.ndarray, " pairs"]
    sd_mm: Float[np.ndarray, " pairs"]

    def off(self, positions: Positions) -> Float[np.ndarray, "pairs frames"]:
        """Compute the absolute deviations from the references, over the limits; NaN where not measured."""
        return np.abs(distances_mm(positions, self.pairs) - self.mm[:, None]) / self.limit_mm[:, None]


@dataclass(frozen=True)
class Outlier:
    """Landmarks that are not at their place in some frames."""

    landmarks: tuple[str, ...]
    """Landmarks to blame; if it is undecided, all that may be to blame."""
    frames: Int[np.ndarray, " frames"]
    """Frames, counted from 0."""
    swapped: bool
    """True where the two landmarks have exchanged their labels."""
    size_mm: float
    """Largest deviation of a distance; of a swap, the largest distance between the two landmarks."""


def find_outliers(positions: Positions) -> list[Outlier]:
    """Find the frames in which landmarks are outliers or swapped. Positions are in any frame, mm."""
    reference = fit_reference(positions)
    if not reference.pairs:
        return []
    off = reference.off(positions)
    wrong = _jumping(off)
    flagged = np.flatnonzero(wrong.any(axis=0))
    swaps = list(_swaps(positions, reference, flagged))
    left = np.setdiff1d(flagged, np.concatenate([[], *(swap.frames for swap in swaps)]))
    return [*swaps, *_blamed_frames(reference, off, wrong, left.astype(int))]


def fit_reference(positions: Positions) -> Reference:
    """Fit the distances within bones, robustly over the frames."""
    pairs = [pair for pair in (*RIGID, *NEARLY_RIGID) if all(name in positions for name in pair)]
    if not pairs:
        return Reference((), *np.zeros((3, 0)))
    distances = distances_mm(positions, pairs)
    factor = size_of_ranges(_size(pairs, distances))
    found, count = [], distances.size
    for pair, row in zip(pairs, distances, strict=True):
        known = row[np.isfinite(row)]
        if pair in RANGES:
            possible = known[in_range([pair], known[None], factor)[0]]
            known = possible if len(possible) >= _LEAST_IN_RANGE else known
        if len(known) >= _FEWEST:
            least = RIGID_MM if pair in RIGID else NEARLY_RIGID_MM
            found.append((pair, _middle_limit_sd(known, least, count)))
    return Reference(tuple(pair for pair, _ in found), *np.array([one for _, one in found]).reshape(-1, 3).T)


def _size(pairs: list[Pair], distances: Float[np.ndarray, "pairs frames"]) -> float:
    medians = {
        pair: float(np.nanmedian(row))
        for pair, row in zip(pairs, distances, strict=True)
        if pair in RANGES and np.isfinite(row).any()
    }
    return size_of(medians)


def _middle_limit_sd(known: Float[np.ndarray, " n"], least_mm: float, count: int) -> tuple[float, float, float]:
    """Fit the reference of a distance, the limit of the deviation from it and its SD.

    The limit is k SD, but at least ``least_mm``; hardly one of ``count`` distances of a sound trial exceeds it.
    """
    ordered = np.sort(known)
    half = len(ordered) // 2 + 1
    widths = ordered[half - 1 :] - ordered[: len(ordered) - half + 1]
    first = int(np.argmin(widths))
    middle = (ordered[first] + ordered[first + half - 1]) / 2.0
    of_half, of_steps = widths[first] / 2.0, float(np.median(np.abs(np.diff(known)))) / np.sqrt(2.0)
    sd = _SD_OF_HALF * min(of_half, _MORE_THAN_STEPS * of_steps)
    near = ordered[np.abs(ordered - middle) <= max(_NEAR_SD * sd, least_mm)]
    sd = float(near.std(ddof=1)) if len(near) > 1 else 0.0
    k = np.sqrt(2.0 * np.log(count / FALSE_ALARM)) * (1.0 + _FEW / max(len(near) - 1, 1))
    return float(np.median(near)), max(float(k * sd), least_mm), max(sd, _LEAST_SD_MM)


def _jumping(off: Float[np.ndarray, "pairs frames"]) -> Bool[np.ndarray, "pairs frames"]:
    """Find the distances beyond their limits, in runs that a jump begins or ends, or throughout the trial."""
    wrong = np.zeros(off.shape, bool)
    for row, flags in zip(off, wrong, strict=True):
        known = np.flatnonzero(np.isfinite(row))
        value = row[known]
        lag = max(1, min(_JUMP_FRAMES, int(_JUMP_SHARE * len(known))))
        for first, last in runs(value > 1.0):
            inside = value[first : last + 1]
            before, after = value[:first][-1 - (lag - 1) // 2 :][:1], value[last + 1 :][: 1 + (lag - 1) // 2][-1:]
            steps = [*(inside[: 1 + lag // 2][-1] - before), *(inside[-1 - lag // 2 :][0] - after)]
            flags[known[first : last + 1]] = not steps or max(steps) > _JUMP * np.median(inside)
    return wrong


def runs(flags: Bool[np.ndarray, " frames"]) -> list[tuple[int, int]]:
    """List the first and last frame of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]


def _swaps(positions: Positions, reference: Reference, flagged: Int[np.ndarray, " frames"]) -> Iterator[Outlier]:
    """Yield pairs of landmarks with exchanged labels, one after the other.

    Each is the pair whose exchange corrects the largest number of the frames that are still flagged.
    """
    while len(flagged):
        here = {name: place[:, flagged] for name, place in positions.items()}
        mended = {pair: _mended(here, reference, pair) for pair in combinations(positions, 2)}
        pair = max(mended, key=lambda one: int(mended[one].sum()))
        if not mended[pair].any():
            return
        frames = flagged[mended[pair]]
        size = float(np.linalg.norm(positions[pair[0]][:, frames] - positions[pair[1]][:, frames], axis=0).max())
        yield Outlier(pair, frames, True, size)
        flagged = flagged[~mended[pair]]


def _mended(here: Positions, reference: Reference, pair: Pair) -> Bool[np.ndarray, " frames"]:
    a, b = pair
    off = reference.off({**here, a: here[b], b: here[a]})
    return np.logical_not((off > 1.0).any(axis=0)) & np.isfinite(here[a] + here[b]).all(axis=0)


def _blamed_frames(
    reference: Reference, off: np.ndarray, wrong: Bool[np.ndarray, "pairs frames"], left: Int[np.ndarray, " frames"]
) -> Iterator[Outlier]:
    """Yield the landmarks to blame in each run of the frames ``left``, joining runs with equal blame."""
    flags = np.isin(np.arange(off.shape[1]), left)
    by_blame: dict[frozenset[str], list[int]] = {}
    for first, last in runs(flags):
        frames = slice(first, last + 1)
        by_blame.setdefault(_blame(reference, off[:, frames], wrong[:, frames]), []).extend(range(first, last + 1))
    for names, frames in by_blame.items():
        rows = [any(name in pair for name in names) for pair in reference.pairs]
        size = float(np.nanmax((off[rows] * reference.limit_mm[rows, None])[:, frames]))
        yield Outlier(tuple(sorted(names)), np.array(frames), False, size)


def _blame(
    reference: Reference, off: Float[np.ndarray, "pairs run"], wrong: Bool[np.ndarray, "pairs run"]
) -> frozenset[str]:
    """Return all landmarks that may be to blame for a run of frames.

    The distances to explain are wrong in most frames of the run; if there are none, in any frame.
    """
    most = 2 * wrong.sum(axis=1) > wrong.shape[1]
    bad = [frozenset(reference.pairs[k]) for k in np.flatnonzero(most if most.any() else wrong.any(axis=1))]
    known = np.isfinite(off).any(axis=1)
    in_sd = off[known] * (reference.limit_mm / reference.sd_mm)[known, None]
    z = np.sqrt(np.nanmean(in_sd**2, axis=1)).tolist()
    by_pair = {reference.pairs[k]: value for k, value in zip(np.flatnonzero(known), z, strict=True)}
    return frozenset(name for names in blamed(bad, by_pair) for name in names)
