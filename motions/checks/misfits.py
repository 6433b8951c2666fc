"""A whole trial whose landmarks are no person's: which are to blame, whether two are swapped, which unit it may be."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from motions.checks.distances import (
    LARGEST,
    RANGES,
    SMALLEST,
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
    """The two that leave nothing of this when they are exchanged; None if not exactly one pair does."""

    @property
    def landmarks(self) -> tuple[str, ...]:
        """All that may be wrong."""
        return tuple(dict.fromkeys(name for names in self.blamed for name in names))


def misfit(positions: Positions) -> Misfit | None:
    """Find what no person has in the medians over a trial (see ``motions.checks.distances``); None if nothing."""
    medians = medians_mm(positions)
    if not medians:
        return None
    bad = _bad(positions, medians)
    if not bad:
        return None
    off = {pair: (mm - RANGES[pair].middle_mm) / RANGES[pair].sd_mm for pair, mm in medians.items()}
    return Misfit(tuple(bad.values()), tuple(blamed(list(bad), off)), _swapped(positions))


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
    if not medians or SMALLEST <= size_of(medians) <= LARGEST:
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
    found |= _beside_midline(positions)
    if any({"AC", "IJ"} & names and "SC" not in names for names in found):
        return found  # it may be AC or IJ that is wrong
    return found | _other_sternal_end(positions, medians)


def _beside_midline(positions: Positions) -> dict[frozenset[str], str]:
    if any(name not in positions for name in THORAX):
        return {}
    IJ, PX, C7, T8 = (positions[name] for name in THORAX)
    across = np.cross(
        C7 - IJ, (PX + T8) / 2.0 - IJ, axis=0
    )  # to the plane; its length is 0 where the three are on a line
    beside = np.abs(np.sum(across * (PX - IJ), axis=0)) / np.maximum(np.linalg.norm(across, axis=0), _LEAST_AREA_MM2)
    if not any_of(beside) or np.nanmedian(beside) <= MIDLINE_MM:
        return {}
    said = f"IJ, PX, C7 and T8 are not in one plane: PX and T8 are {np.nanmedian(beside):.0f} mm beside the midline"
    return {frozenset(THORAX): f"{said}, in people up to {MIDLINE_MM:.0f}"}


def _other_sternal_end(positions: Positions, medians: Mapping[Pair, float]) -> dict[frozenset[str], str]:
    """SC is nearer to AC than IJ is (Table 4.2: by 22 and 19 mm); SC of the other shoulder is not."""
    if ("SC", "AC") not in medians or "IJ" not in positions:
        return {}
    from_ij = distances_mm(positions, [("IJ", "AC")])[0]
    if not any_of(from_ij) or np.nanmedian(from_ij) >= medians["SC", "AC"]:
        return {}
    said = f"SC is {medians['SC', 'AC']:.0f} mm from AC, IJ only {np.nanmedian(from_ij):.0f}"
    return {frozenset(("SC",)): f"{said}: SC may be that of the other shoulder"}


def _swapped(positions: Positions) -> Pair | None:
    found = [
        (a, b)
        for a, b in combinations(positions, 2)
        if not _bad(exchanged := {**positions, a: positions[b], b: positions[a]}, medians_mm(exchanged))
    ]
    return found[0] if len(found) == 1 else None
