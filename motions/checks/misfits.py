"""Check of a whole trial for landmarks that no person has: which are to blame or swapped, and which unit is likely."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from motions.checks.distances import (
    LARGEST,
    MIDDLE,
    RANGES,
    SMALLEST,
    UNDECIDED,
    Pair,
    Positions,
    blamed,
    distances_mm,
    in_range,
    size_of,
    size_of_ranges,
)

THORAX = ("IJ", "PX", "C7", "T8")

MIDLINE_MM = 40.0
"""Maximum distance in mm of PX and T8 from the plane through IJ, C7 and the midpoint of PX and T8: all four lie in the
midline. Table 4.2 has 10 mm; a curved spine (scoliosis) puts T8 some centimetres beside it. Assumed: 40 mm turn the
thorax by 12 degrees."""


SHOULDER = ("SC", "AC", "AA", "TS", "AI", "GH")
"""Landmarks that stay on their side of the midline, however the arm moves."""

BEYOND_MM, SC_BEYOND_MM = 20.0, 5.0
"""Maximum distances in mm beyond the midline: of a landmark of the shoulder, and of SC. Only errors of the midline
itself, which goes through IJ, put a landmark beyond it; SC lies beside IJ (Table 4.2: by 20 and 21 mm)."""

_BESIDE_IT: Pair = ("IJ", "SC")
"""Landmarks whose exchange puts SC within millimetres of the other shoulder's SC, and tilts the midline through IJ."""

_TILT_MM = 6.0
"""Distance in mm of PX from the midline, away from the shoulder, above which IJ and SC may be exchanged. In the cadaver
of the thesis (Table 4.2) it is 15 by MRI and 31 by dissection with IJ and SC exchanged, 2 and 10 otherwise. Below the
limit an exchange is rare."""

_OF_ACROMION: Pair = ("AC", "AA")

_MOST_SAID = 8
"""Maximum number of distances in a message."""

_LEAST_AREA_MM2 = 1.0
"""Lower bound (mm^2) of the length by which a normal is divided: points on a line span no plane, and no landmark is
then beside it."""


@dataclass(frozen=True)
class Misfit:
    """Distances and positions that no person has, and the landmarks that would explain them."""

    said: tuple[str, ...]
    """Messages, such as 'TS is 229 mm from AC, in people 80 to 170'."""
    blamed: tuple[tuple[str, ...], ...]
    """Sets of landmarks that each explain all messages; several if it is undecided which."""
    swapped: Pair | None
    """Pair of landmarks whose exchange leaves no misfit, and a likelier person than any other exchange."""
    or_swapped: Pair | None = None
    """Pair of landmarks that may be swapped instead, of which one is blamed."""

    @property
    def cause(self) -> str:
        """Text about what is wrong."""
        more = f"; and {len(self.said) - _MOST_SAID} more" if len(self.said) > _MOST_SAID else ""
        listed = "; ".join(self.said[:_MOST_SAID]) + more
        return listed if self.swapped else f"{self._blame} cannot be right: {listed}"

    @property
    def remedy(self) -> str:
        """Text about what to do."""
        if self.swapped:
            return f"Are {self.swapped[0]} and {self.swapped[1]} swapped? With them exchanged nothing of this is left"
        look = f"Look at {self._blame}: is the marker lost, another one, of the other shoulder, or in another unit?"
        return f"{look} Or are {' and '.join(self.or_swapped)} swapped?" if self.or_swapped else look

    @property
    def _blame(self) -> str:
        return " or ".join(" and ".join(names) for names in self.blamed)

    @property
    def landmarks(self) -> tuple[str, ...]:
        """All landmarks that may be wrong."""
        return tuple(dict.fromkeys(name for names in self.blamed for name in names))


def misfit(positions: Positions) -> Misfit | None:
    """Find what no person has in the medians over a trial (see ``motions.checks.distances``); None if nothing."""
    with np.errstate(over="ignore", invalid="ignore"):  # coordinates may be as large as floats go
        return _misfit(positions)


def _misfit(positions: Positions) -> Misfit | None:
    medians = medians_mm(positions)
    bad = _bad(positions, medians) if medians else {}
    if not bad:
        return None
    off = _off(medians)
    blame = blamed(list(bad), off)
    without = sum(z * z for pair, z in off.items() if not set(pair) & set(blame[0]))
    beyond = len(blame) == 1 and frozenset(blame[0]) in bad  # across the midline: an exchange may mend it by chance
    if beyond and blame[0] == ("SC",) and _tilts(positions) and _mends(positions, medians, _BESIDE_IT):
        return Misfit(tuple(bad.values()), (("SC",), ("IJ",)), None, _BESIDE_IT)
    if _angle_before_joint(positions) and _mends(positions, medians, _OF_ACROMION):
        return Misfit(tuple(bad.values()), tuple(blame), _OF_ACROMION)
    return Misfit(tuple(bad.values()), tuple(blame), None if beyond else _swapped(positions, medians, without))


def medians_mm(positions: Positions) -> dict[Pair, float]:
    """Compute the median of each distance over the frames, leaving out pairs that were never measured together."""
    pairs = [pair for pair in RANGES if all(name in positions for name in pair)]
    if not pairs:
        return {}
    known = distances_mm(positions, pairs)
    return {
        pair: float(np.median(row[np.isfinite(row)])) for pair, row in zip(pairs, known, strict=True) if any_of(row)
    }


def any_of(row: np.ndarray) -> bool:
    """Check whether any value of the row was measured."""
    return bool(np.isfinite(row).any())


def likely_unit(positions: Positions, factors: Mapping[str, float]) -> str | None:
    """Return the first unit in ``factors`` that makes distances of no person's size a person's.

    Return None if no unit does, or if the size is a person's already.
    """
    medians = medians_mm(positions)
    if SMALLEST <= size_of(medians) <= LARGEST:
        return None
    return next((unit for unit, factor in factors.items() if SMALLEST <= size_of(medians) * factor <= LARGEST), None)


def _bad(positions: Positions, medians: Mapping[Pair, float]) -> dict[frozenset[str], str]:
    """Return the messages about all that no person has, keyed by the landmarks of each."""
    factor = size_of_ranges(size_of(medians))
    pairs = list(medians)
    good = in_range(pairs, np.array(list(medians.values())), factor)
    found = {
        frozenset(pair): f"{pair[1]} is {medians[pair]:.0f} mm from {pair[0]}, in people "
        f"{RANGES[pair].low_mm * factor:.0f} to {RANGES[pair].high_mm * factor:.0f}"
        for pair, one in zip(pairs, good, strict=True)
        if not one
    }
    wrong = {name for names in found for name in names}
    if not {"IJ", "C7"} <= set(positions) or wrong & {*THORAX, MIDDLE}:
        return found  # no midline plane, or a wrong one
    found |= _angle_before_joint(positions)
    return found | _beside_midline(positions) | _other_shoulder(positions)


def _across(positions: Positions) -> Float[np.ndarray, "3 frames"]:
    """Compute the unit normal, to the right or left, of the plane through IJ, C7 and the midpoint of PX and T8."""
    IJ, C7 = positions["IJ"], positions["C7"]
    middle = positions[MIDDLE] if MIDDLE in positions else (positions["PX"] + positions["T8"]) / 2.0
    across = np.cross(C7 - IJ, middle - IJ, axis=0)
    return across / np.maximum(np.linalg.norm(across, axis=0), _LEAST_AREA_MM2)


def _beside_midline(positions: Positions) -> dict[frozenset[str], str]:
    if MIDDLE in positions:
        return {}
    beside = np.abs(np.sum(_across(positions) * (positions["PX"] - positions["IJ"]), axis=0))
    if not any_of(beside) or np.nanmedian(beside) <= MIDLINE_MM:
        return {}
    said = f"IJ, PX, C7 and T8 are not in one plane: PX and T8 are {np.nanmedian(beside):.0f} mm beside the midline"
    return {frozenset(THORAX): f"{said}, in people up to {MIDLINE_MM:.0f}"}


def _lateral_mm(positions: Positions, names: Iterable[str]) -> dict[str, float]:
    """Compute signed distances in mm from the midline; landmarks never measured with the thorax are left out."""
    across, found = _across(positions), {}
    for name in names:
        if name in positions:
            mm = np.sum(across * (positions[name] - positions["IJ"]), axis=0)
            if any_of(mm):
                found[name] = float(np.nanmedian(mm))
    return found


def _other_shoulder(positions: Positions) -> dict[frozenset[str], str]:
    """Find landmarks that are not on the side of the midline where most of the shoulder is."""
    lateral = _lateral_mm(positions, SHOULDER)
    side = np.sign(np.median([*lateral.values()])) if lateral else 0.0
    return {
        frozenset((name,)): f"{name} is {abs(mm):.0f} mm beyond the midline, where the other shoulder's is"
        for name, mm in lateral.items()
        if side * mm < -(SC_BEYOND_MM if name == "SC" else BEYOND_MM)
    }


def _angle_before_joint(positions: Positions) -> dict[frozenset[str], str]:
    """Find an AA that is nearer to IJ than AC is: behind and beside AC, it is farther from IJ in people."""
    if not {"IJ", "AC", "AA"} <= set(positions):
        return {}
    joint, corner = distances_mm(positions, [("IJ", "AC"), ("IJ", "AA")])
    nearer = joint - corner
    if not any_of(nearer) or np.nanmedian(nearer) <= 0.0:
        return {}
    return {frozenset(("AC", "AA")): f"AA is {np.nanmedian(nearer):.0f} mm nearer to IJ than AC, in people farther"}


def _off(medians: Mapping[Pair, float]) -> dict[Pair, float]:
    """Compute the deviation of each distance from the middle of its range, in SD of a person of this size."""
    factor = size_of_ranges(size_of(medians))
    return {pair: (mm / factor - RANGES[pair].middle_mm) / RANGES[pair].sd_mm for pair, mm in medians.items()}


def _tilts(positions: Positions) -> bool:
    """Check whether PX lies so far beside the midline that IJ may lie beside it."""
    if MIDDLE in positions:
        return True
    lateral = _lateral_mm(positions, ("PX", *SHOULDER[1:]))
    side = np.sign(np.median([mm for name, mm in lateral.items() if name != "PX"]))
    return bool(-side * lateral["PX"] > _TILT_MM)


def _mends(positions: Positions, as_they_are: Mapping[Pair, float], pair: Pair) -> dict[Pair, float] | None:
    """Return the median distances after an exchange of two landmarks if no misfit is left then; else None."""
    exchanged = {**positions, pair[0]: positions[pair[1]], pair[1]: positions[pair[0]]}
    medians = medians_mm(exchanged)
    return medians if set(medians) == set(as_they_are) and not _bad(exchanged, medians) else None


def _swapped(positions: Positions, as_they_are: Mapping[Pair, float], without: float) -> Pair | None:
    """Find the pair whose exchange leaves no misfit.

    Return None if there is no such pair, if another pair is nearly as likely, or if the person is likelier without the
    blamed landmarks: ``without`` is the sum of squares of the distances that are then left.
    """
    likely: dict[Pair, float] = {}
    for pair in combinations(positions, 2):
        if medians := _mends(positions, as_they_are, pair):
            likely[pair] = sum(z * z for z in _off(medians).values())
    best = sorted(likely, key=lambda pair: likely[pair])
    if not best or likely[best[0]] > without + UNDECIDED:
        return None
    return None if len(best) > 1 and likely[best[1]] - likely[best[0]] < UNDECIDED else best[0]
