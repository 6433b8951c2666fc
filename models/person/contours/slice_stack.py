"""A contour through a stack of slices: drawn in one, propagated to its neighbours, corrected where it fails.

The contour of a slice is where that of the next one is looked for (thesis 2.3), forward from the first slice with
clicks and backward from it. A slice that is drawn anew goes on with what was drawn; one with corrections with what they
gave. Where two slices differ by more than the band is wide, propagation fails, mostly in the slices after it too. Then
a part of the contour lies on no edge, which ``doubtful`` looks for.
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
"""Share of the weakest edge of the slices that were drawn, below which a contour should be looked at. In simulated
stacks a contour that lost its bone, or a part of it, has less than a tenth, a sound one nine tenths."""


@dataclass(frozen=True)
class SliceClicks:
    """What was clicked in one slice, pixels."""

    drawn: Float[np.ndarray, "2 clicks"] | None = None
    corrections: tuple[Correction, ...] = ()


def follow(
    slopes_of_slice: Callable[[int], Slopes], count: int, clicks: Mapping[int, SliceClicks], settings: Settings
) -> dict[int, Contour]:
    """Find the contour of every slice, by its number from 0.

    ValueError that names the slice (from 1) where there is no contour, or where no slice has drawn clicks.
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
    """Go through slices in this order, each from the contour of the one before."""
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
    """Name the slices without clicks, from 0, whose weakest edge is below ``DOUBTFUL`` of the mean of those that were
    drawn."""
    drawn = [found[k].weakest for k, one in clicks.items() if one.drawn is not None]
    least = DOUBTFUL * float(np.mean(drawn))
    return [k for k, one in found.items() if k not in clicks and one.weakest < least]
