"""A contour through a stack of slices: drawn in one slice, propagated to its neighbours, corrected where it fails.

The contour of a slice is the line around which the contour of the next slice is searched (thesis 2.3), forward and
backward from the first slice with drawn clicks. Further drawn clicks, and corrections, replace the contour of their
slice, and propagation continues from the new contour. Propagation fails where two slices differ by more than the width
of the band, and mostly in the slices after them too. A part of the contour then lies on no edge; ``doubtful`` detects
such slices.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from models.person.contours.band import Settings
from models.person.contours.closed_contour import (
    Contour,
    Correction,
    corrected_contour,
    drawn_contour,
    found_contour,
)
from models.person.contours.edge_path import Slopes

DOUBTFUL = 0.5
"""Limit of a contour's weakest edge, as a share of the mean over the drawn slices, below which the contour should be
checked. In simulated stacks the share is below a tenth where the contour lost its bone or a part of it, and nine tenths
where it is sound."""


@dataclass(frozen=True)
class SliceClicks:
    """Clicks in one slice, in pixels."""

    drawn: Float[np.ndarray, "2 clicks"] | None = None
    corrections: tuple[Correction, ...] = ()


def follow(
    slopes_of_slice: Callable[[int], Slopes], count: int, clicks: Mapping[int, SliceClicks], settings: Settings
) -> dict[int, Contour]:
    """Find the contour of every slice, by its index from 0.

    ValueError where a slice has no contour, with its number from 1, or where no slice has drawn clicks.
    """
    drawn = [k for k in sorted(clicks) if clicks[k].drawn is not None]
    if not drawn:
        raise ValueError("no slice has clicks to draw a contour from")
    first = drawn[0]
    found: dict[int, Contour] = {}
    _onward(found, range(first, count), slopes_of_slice, clicks, settings)
    _onward(found, range(first, -1, -1), slopes_of_slice, clicks, settings)
    return dict(sorted(found.items()))


def _onward(found: dict[int, Contour], order: Iterable[int], slopes_of_slice, clicks, settings: Settings) -> None:
    """Find the contours of slices in this order, each from the contour of the slice before."""
    before: Contour | None = None
    for k in order:
        if k not in found:
            try:
                found[k] = _of_slice(slopes_of_slice(k), before, clicks.get(k, SliceClicks()), settings)
            except ValueError as error:
                raise ValueError(f"slice {k + 1}: {error}") from error
        before = found[k]


def _of_slice(slopes: Slopes, before: Contour | None, clicks: SliceClicks, settings: Settings) -> Contour:
    if clicks.drawn is not None:
        contour = drawn_contour(slopes, clicks.drawn, settings)
    elif before is not None:
        contour = found_contour(slopes, before.points_px, settings)
    else:
        raise ValueError("there is no contour to go on from")
    return corrected_contour(slopes, contour, clicks.corrections, settings)


def doubtful(found: Mapping[int, Contour], clicks: Mapping[int, SliceClicks]) -> list[int]:
    """List the slices without clicks (indices from 0) whose weakest edge is below ``DOUBTFUL`` times the mean weakest
    edge of the drawn slices."""
    drawn = [found[k].weakest for k, one in clicks.items() if one.drawn is not None]
    least = DOUBTFUL * float(np.mean(drawn))
    return [k for k, one in found.items() if k not in clicks and one.weakest < least]
