"""Ranges of the distances between landmarks in living people, and the landmarks to blame for distances out of range.

**Ranges.** The ranges hold for adults, from about the 0.1st to the 99.9th percentile: mean -+ 3.1 SD of women and of
men, widened by 10 mm for a landmark that is palpated through the skin beside its true place, with 3 mm of noise. If a
distance is not published, its range is assumed around the two measurements of one cadaver (thesis, Table 4.2), for a
large and a small person.

**Children.** A person with all distances short alike is a small one. The ranges shrink with the median ratio of the
distances to the middles of their ranges, from ``MATURE`` down to ``SMALLEST``. At 6-8 years a sternum has 68 %, the
thoracic spine 73 % of its final length (622 people, 6-18 years, Eur. Spine J. 28 (2019), optoelectronic moulding of the
thorax).
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

Pair = tuple[str, str]
Positions = Mapping[str, Float[np.ndarray, "3 frames"]]
"""Landmarks by name; NaN where not measured."""

FROM_IJ_MM = (60.0, 1000.0)
"""Range, in mm, of the distance of a surface's farthest point from IJ; not for the SC joint, which lies beside IJ.
Centimetres taken for mm are at most 45, and points beyond the range are in another frame than the landmarks."""


@dataclass(frozen=True)
class Range:
    """Range of a distance in adults, with its source."""

    low_mm: float
    high_mm: float
    source: str

    @property
    def middle_mm(self) -> float:
        """Middle of the range."""
        return (self.low_mm + self.high_mm) / 2.0

    @property
    def sd_mm(self) -> float:
        """SD of the distance: three SD reach from the middle to either end."""
        return (self.high_mm - self.low_mm) / 6.0


MIDDLE = "PX_T8"
"""Name of the midpoint of PX and T8, if a mapping file gives it instead of the two."""

_TABLE_4_2 = "assumed about thesis Table 4.2, where it is"

RANGES: dict[Pair, Range] = {
    ("IJ", "PX"): Range(
        90.0,
        260.0,
        "manubrium and body 133 (women) and 154 +- 13 mm (men), n = 200, Atesoglu et al., Folia Morphol. 77 (2018) "
        "489-497; with the xiphoid process 163 and 192 mm (60 CTs)",
    ),
    ("IJ", "C7"): Range(80.0, 210.0, f"{_TABLE_4_2} 136 and 149 mm"),
    ("IJ", "T8"): Range(120.0, 310.0, f"{_TABLE_4_2} 232 and 182 mm"),
    ("PX", "C7"): Range(185.0, 400.0, f"{_TABLE_4_2} 244 and 309 mm"),
    ("PX", "T8"): Range(115.0, 340.0, f"{_TABLE_4_2} 193 and 216 mm; depth of the chest"),
    ("C7", "T8"): Range(100.0, 290.0, f"{_TABLE_4_2} 228 and 145 mm"),
    ("IJ", MIDDLE): Range(110.0, 280.0, f"{_TABLE_4_2} 164 and 165 mm"),
    ("C7", MIDDLE): Range(140.0, 330.0, f"{_TABLE_4_2} 215 and 216 mm"),
    ("SC", "IJ"): Range(5.0, 60.0, f"{_TABLE_4_2} 25 and 26 mm"),
    ("SC", "AC"): Range(
        105.0,
        195.0,
        "149 +- 10 mm from end to end, n = 68, Bernat et al., Surg. Radiol. Anat. 36 (2014); 108-181 mm, n = 257, "
        "Kathmandu Univ. Med. J. 9 (2011) 193-197",
    ),
    ("AC", "TS"): Range(
        80.0,
        170.0,
        "spine of the scapula to the tip of the acromion 129 +- 9 mm, n = 97, Siriraj Med. J. 56 (2004); AC lies up to "
        "25 mm medial of the tip; Table 4.2: 129 and 126 mm",
    ),
    ("AC", "AI"): Range(115.0, 230.0, f"{_TABLE_4_2} 186 and 185 mm"),
    ("TS", "AI"): Range(
        70.0,
        165.0,
        "height of the scapula 139 +- 11 mm (the same 97), 136 +- 12 mm, n = 150, CBMJ 14 (2025) 141-145, less the "
        "30-45 mm above its spine; Table 4.2: 119 and 123 mm",
    ),
    ("AA", "TS"): Range(80.0, 175.0, "as AC-TS: AA is the corner of the acromion"),
    ("AA", "AI"): Range(110.0, 230.0, "as AC-AI"),
    ("AC", "AA"): Range(5.0, 75.0, "acromion 44 +- 5 by 25 +- 4 mm (the same 97)"),
    ("GH", "AC"): Range(15.0, 85.0, f"{_TABLE_4_2} 45 and 54 mm"),
    ("GH", "EM"): Range(
        200.0,
        360.0,
        "humerus 307 +- 21 mm at most, men, n = 120, Akman et al., Turk. J. Med. Sci. 36 (2006) 81-85, less 20-35 mm; "
        "Table 4.2: 290-293 mm",
    ),
    ("GH", "EL"): Range(200.0, 360.0, "as GH-EM"),
    ("EM", "EL"): Range(35.0, 115.0, f"{_TABLE_4_2} 68 and 66 mm; markers stand on the skin"),
}
"""Ranges in adults, mm."""

MATURE, SMALLEST = 0.85, 0.5
"""Sizes of a person as a share of an adult's: from ``MATURE`` on the ranges are an adult's, and below ``SMALLEST`` the
landmarks are no person's."""

LARGEST = 1.5
"""Size, as a share of an adult's, above which the landmarks are no person's."""

UNDECIDED = 9.0
"""Difference of sums of squares, (3 SD)^2, by which an explanation must be better than the next to stand alone."""

_MOST_BLAMED = 3
"""Maximum number of landmarks wrong at once; beyond it, all landmarks of bad distances are named."""


def distances_mm(positions: Positions, pairs: Iterable[Pair]) -> Float[np.ndarray, "pairs frames"]:
    """Compute the distances of pairs of landmarks; NaN where one was not measured."""
    with np.errstate(over="ignore"):  # positions so far away are no landmarks
        return np.stack([np.linalg.norm(positions[a] - positions[b], axis=0) for a, b in pairs])


def size_of(medians_mm: Mapping[Pair, float]) -> float:
    """Compute the size of the person as a share of an adult's: the median ratio of distances to the middles of their
    ranges; 1 if no distance is known."""
    if not medians_mm:
        return 1.0
    return float(np.median([mm / RANGES[pair].middle_mm for pair, mm in medians_mm.items()]))


def size_of_ranges(size: float) -> float:
    """Return the factor of the ranges for a person of this size: below 1 only for a child."""
    return max(size, SMALLEST) if size < MATURE else 1.0


def in_range(
    pairs: Iterable[Pair], mm: Float[np.ndarray, " pairs *frames"], factor: float
) -> Bool[np.ndarray, " pairs *frames"]:
    """Check which distances are within their ranges times ``factor``; NaN is not."""
    low, high = np.array([(RANGES[pair].low_mm, RANGES[pair].high_mm) for pair in pairs]).T * factor
    shape = (-1,) + (1,) * (mm.ndim - 1)
    return (mm >= low.reshape(shape)) & (mm <= high.reshape(shape))


def blamed(bad: Collection[frozenset[str]], off: Mapping[Pair, float]) -> list[tuple[str, ...]]:
    """Find the landmarks that explain bad distances: the smallest sets with a landmark in each of these distances.

    ``off`` is the deviation of each distance from its expected value, in SD. Among sets of equal size, the best one
    leaves the smallest sum of squared deviations of the other distances. Return all sets that are not worse by
    ``UNDECIDED``, the best first.
    """
    names = sorted({name for one in bad for name in one})
    for count in range(1, _MOST_BLAMED + 1):
        found = [c for c in combinations(names, count) if all(one & set(c) for one in bad)]
        if found:
            left = [sum(z * z for pair, z in off.items() if not set(pair) & set(c)) for c in found]
            order = np.argsort(left, kind="stable")
            return [found[k] for k in order if left[k] - left[order[0]] < UNDECIDED]
    return [tuple(names)]
