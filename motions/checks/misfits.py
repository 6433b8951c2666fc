"""A whole trial whose landmarks are no person's: which are to blame, whether two are swapped, which unit it may be."""

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
"""Of PX and T8 from the plane through IJ, C7 and their own middle: these four lie in the midline. Table 4.2 has 10 mm;
a curved spine (scoliosis) puts T8 some centimetres beside it. Assumed: 40 mm turn the thorax by 12 degrees."""


SHOULDER = ("SC", "AC", "AA", "TS", "AI", "GH")
"""Landmarks that stay on their side of the midline, however the arm moves."""

BEYOND_MM, SC_BEYOND_MM = 20.0, 5.0
"""On the other side of the midline no landmark of a shoulder is: but for errors of the midline, which goes through IJ
beside SC (Table 4.2: 20 and 21 mm)."""

_BESIDE_IT: Pair = ("IJ", "SC")
"""Exchanged, SC is where that of the other shoulder is, but for some millimetres. The midline through IJ tilts then."""

_TILT_MM = 6.0
"""Of PX from the midline, to the side without the shoulder: in the cadaver of the thesis (Table 4.2) 15 mm by MRI, 31
by dissection with IJ and SC exchanged, else 2 and 10. Below it, exchanged ones are rare."""

_OF_ACROMION: Pair = ("AC", "AA")

_MOST_SAID = 8
"""Distances in a message."""

_LEAST_AREA_MM2 = 1.0
"""Three points on a line span no plane, and nothing is beside it."""


@dataclass(frozen=True)
class Misfit:
    """What no person has, and the landmarks that would explain it."""

    said: tuple[str, ...]
    """Such as 'TS is 229 mm from AC, in people 80 to 170'."""
    blamed: tuple[tuple[str, ...], ...]
    """Landmarks that explain it together; several where it is not decided."""
    swapped: Pair | None
    """The two that leave nothing of this when they are exchanged, and a likelier person than any others do."""
    or_swapped: Pair | None = None
    """Two that may be swapped instead, of which one is blamed."""

    @property
    def cause(self) -> str:
        """Say what is wrong."""
        more = f"; and {len(self.said) - _MOST_SAID} more" if len(self.said) > _MOST_SAID else ""
        listed = "; ".join(self.said[:_MOST_SAID]) + more
        return listed if self.swapped else f"{self._blame} cannot be right: {listed}"

    @property
    def remedy(self) -> str:
        """Say what to do."""
        if self.swapped:
            return f"Are {self.swapped[0]} and {self.swapped[1]} swapped? With them exchanged nothing of this is left"
        look = f"Look at {self._blame}: is the marker lost, another one, of the other shoulder, or in another unit?"
        return f"{look} Or are {' and '.join(self.or_swapped)} swapped?" if self.or_swapped else look

    @property
    def _blame(self) -> str:
        return " or ".join(" and ".join(names) for names in self.blamed)

    @property
    def landmarks(self) -> tuple[str, ...]:
        """All that may be wrong."""
        return tuple(dict.fromkeys(name for names in self.blamed for name in names))


def misfit(positions: Positions) -> Misfit | None:
    """Find what no person has in the medians over a trial (see ``motions.checks.distances``); None if nothing."""
    with np.errstate(over="ignore", invalid="ignore"):  # of what is as far away as numbers go
        return _misfit(positions)


def _misfit(positions: Positions) -> Misfit | None:
    medians = medians_mm(positions)
    bad = _bad(positions, medians) if medians else {}
    if not bad:
        return None
    off = _off(medians)
    blame = blamed(list(bad), off)
    without = sum(z * z for pair, z in off.items() if not set(pair) & set(blame[0]))
    beyond = len(blame) == 1 and frozenset(blame[0]) in bad  # of the other shoulder: an exchange may mend it by chance
    if beyond and blame[0] == ("SC",) and _tilts(positions) and _mends(positions, medians, _BESIDE_IT):
        return Misfit(tuple(bad.values()), (("SC",), ("IJ",)), None, _BESIDE_IT)
    if _angle_before_joint(positions) and _mends(positions, medians, _OF_ACROMION):
        return Misfit(tuple(bad.values()), tuple(blame), _OF_ACROMION)
    return Misfit(tuple(bad.values()), tuple(blame), None if beyond else _swapped(positions, medians, without))


def medians_mm(positions: Positions) -> dict[Pair, float]:
    """Take the median of each distance over the frames; without those that were in no frame measured together."""
    pairs = [pair for pair in RANGES if all(name in positions for name in pair)]
    if not pairs:
        return {}
    known = distances_mm(positions, pairs)
    return {
        pair: float(np.median(row[np.isfinite(row)])) for pair, row in zip(pairs, known, strict=True) if any_of(row)
    }


def any_of(row: np.ndarray) -> bool:
    """Tell whether something in the row was measured."""
    return bool(np.isfinite(row).any())


def likely_unit(positions: Positions, factors: Mapping[str, float]) -> str | None:
    """Give the unit, by its factor, in which the distances would be a person's where they are not; else None."""
    medians = medians_mm(positions)
    if SMALLEST <= size_of(medians) <= LARGEST:
        return None
    return next((unit for unit, factor in factors.items() if SMALLEST <= size_of(medians) * factor <= LARGEST), None)


def _bad(positions: Positions, medians: Mapping[Pair, float]) -> dict[frozenset[str], str]:
    """The landmarks of each bad distance, or of another thing that no person has, and what is said of it."""
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
        return found  # no plane, or none that is one
    found |= _angle_before_joint(positions)
    return found | _beside_midline(positions) | _other_shoulder(positions)


def _across(positions: Positions) -> Float[np.ndarray, "3 frames"]:
    """The unit vector to the right or left: across the plane of IJ, C7 and the middle of PX and T8. IJ is in it."""
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
    """How far landmarks are from the midline, to one side; without those that were not measured with the thorax."""
    across, found = _across(positions), {}
    for name in names:
        if name in positions:
            mm = np.sum(across * (positions[name] - positions["IJ"]), axis=0)
            if any_of(mm):
                found[name] = float(np.nanmedian(mm))
    return found


def _other_shoulder(positions: Positions) -> dict[frozenset[str], str]:
    """Landmarks that are not on the side of the midline on which most of the shoulder is."""
    lateral = _lateral_mm(positions, SHOULDER)
    side = np.sign(np.median([*lateral.values()])) if lateral else 0.0
    return {
        frozenset((name,)): f"{name} is {abs(mm):.0f} mm beyond the midline, where the other shoulder's is"
        for name, mm in lateral.items()
        if side * mm < -(SC_BEYOND_MM if name == "SC" else BEYOND_MM)
    }


def _angle_before_joint(positions: Positions) -> dict[frozenset[str], str]:
    """AA, behind and beside AC, is farther from IJ than AC is."""
    if not {"IJ", "AC", "AA"} <= set(positions):
        return {}
    joint, corner = distances_mm(positions, [("IJ", "AC"), ("IJ", "AA")])
    nearer = joint - corner
    if not any_of(nearer) or np.nanmedian(nearer) <= 0.0:
        return {}
    return {frozenset(("AC", "AA")): f"AA is {np.nanmedian(nearer):.0f} mm nearer to IJ than AC, in people farther"}


def _off(medians: Mapping[Pair, float]) -> dict[Pair, float]:
    """How far each distance is from the middle of its range, in SD of a person of this size."""
    factor = size_of_ranges(size_of(medians))
    return {pair: (mm / factor - RANGES[pair].middle_mm) / RANGES[pair].sd_mm for pair, mm in medians.items()}


def _tilts(positions: Positions) -> bool:
    """Tell whether PX lies so far beside the midline that IJ may lie beside it."""
    if MIDDLE in positions:
        return True
    lateral = _lateral_mm(positions, ("PX", *SHOULDER[1:]))
    side = np.sign(np.median([mm for name, mm in lateral.items() if name != "PX"]))
    return bool(-side * lateral["PX"] > _TILT_MM)


def _mends(positions: Positions, as_they_are: Mapping[Pair, float], pair: Pair) -> dict[Pair, float] | None:
    """The distances with two landmarks exchanged, if no bad one is left then."""
    exchanged = {**positions, pair[0]: positions[pair[1]], pair[1]: positions[pair[0]]}
    medians = medians_mm(exchanged)
    return medians if set(medians) == set(as_they_are) and not _bad(exchanged, medians) else None


def _swapped(positions: Positions, as_they_are: Mapping[Pair, float], without: float) -> Pair | None:
    """The two whose exchange mends all.

    None where others do as well, or where the person is likelier ``without`` the landmarks that are blamed.
    """
    likely: dict[Pair, float] = {}
    for pair in combinations(positions, 2):
        if medians := _mends(positions, as_they_are, pair):
            likely[pair] = sum(z * z for z in _off(medians).values())
    best = sorted(likely, key=lambda pair: likely[pair])
    if not best or likely[best[0]] > without + UNDECIDED:
        return None
    return None if len(best) > 1 and likely[best[1]] - likely[best[0]] < UNDECIDED else best[0]
