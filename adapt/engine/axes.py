"""Axes before the problems (postures of a subject, points of a thorax), for functions written for one place.

On arrays, the function runs on all places at once; in machine code, in a loop over the places.
"""

from collections.abc import Callable
from typing import Any

import jax

from adapt.engine.simd_values import MemoryRow, SimdValue
from motions.arrays import Array, xp


def along(like: Any, counted: Any = None) -> "WholeAxis | AxisLoop":
    """Return the axis whose places are those of ``like``; ``counted``: mask of the places that count in sums and
    maxima."""
    return AxisLoop(like, counted) if isinstance(like, MemoryRow) else WholeAxis(counted)


class WholeAxis:
    """All places of an axis at once; the axis is the first one of each array."""

    def __init__(self, counted: Array | None):
        self._counted = counted

    def reduced(self, function: Callable[..., tuple[Any, Any, Any]], *trees: Any) -> tuple[Any, Any, Any]:
        """Apply the function to each place of the trees and reduce its results.

        The function returns three trees: values to be summed over the places that count, values whose maximum is wanted
        (0 if no place counts), and values to be kept for each place.
        """
        sums, worst, kept = function(*trees)
        total = jax.tree.map(lambda x: xp.sum(self._of_counted(x), axis=0), sums)
        return total, jax.tree.map(lambda x: xp.max(self._of_counted(x), axis=0, initial=0.0), worst), kept

    def advanced(self, taken: Array, function: Callable[..., tuple[Any, Any, Any]], old: Any, *trees: Any):
        """Apply and reduce the function as ``reduced`` does; in the ``taken`` problems the kept values replace ``old``.

        ``old`` is the function's first tree.
        """
        sums, worst, kept = self.reduced(function, old, *trees)
        return sums, worst, jax.tree.map(lambda new, before: xp.where(taken, new, before), kept, old)

    def _of_counted(self, x: Array) -> Array:
        return x if self._counted is None else xp.where(self._counted, x, 0.0)


class AxisLoop:
    """Machine-code counterpart of ``WholeAxis``: a loop over the places."""

    def __init__(self, like: MemoryRow, counted: MemoryRow | None):
        self._builder, self._length, self._counted = like.builder, like.length, counted

    def reduced(self, function: Callable[..., tuple[Any, Any, Any]], *trees: Any) -> tuple[Any, Any, Any]:
        """Write the loop of ``WholeAxis.reduced``; the kept values go to scratch memory."""
        return self._written(function, trees, lambda kept, _: kept, None)

    def advanced(self, taken: SimdValue, function: Callable[..., tuple[Any, Any, Any]], old: Any, *trees: Any):
        """Write the loop of ``WholeAxis.advanced``; the kept values go to the memory of ``old``."""

        def merged(new: list[SimdValue], before: list[SimdValue]) -> list[SimdValue]:
            return [self._builder.where(taken, a, b) for a, b in zip(new, before, strict=True)]

        return self._written(function, (old, *trees), merged, old)

    def _written(self, function, trees, merged, into) -> tuple[Any, Any, Any]:
        builder = self._builder
        before_loop = builder.instructions.insertion_point()
        with builder.loop(self._length, "posture" if self._counted else "point") as index:
            here = jax.tree.map(lambda row: row.load(index), trees)
            sums, worst, kept = function(*here)
            counts = self._counted.load(index) if self._counted else None
            sums = jax.tree.map(lambda x: self._total(x, builder.add, counts, before_loop), sums)
            worst = jax.tree.map(lambda x: self._total(x, builder.maximum, counts, before_loop), worst)
            kept, tree = jax.tree.flatten(jax.tree.map(builder.broadcast, kept))
            if into is None:
                rows = [builder.scratch_row(self._length, x.is_mask) for x in kept]
            else:
                rows = jax.tree.leaves(into)
                kept = merged(kept, jax.tree.leaves(here[0]))
            for row, x in zip(rows, kept, strict=True):
                row.store(index, x)
        return *jax.tree.map(self._after_loop, (sums, worst)), jax.tree.unflatten(tree, rows)

    def _total(self, x: Any, join: Callable[..., SimdValue], counts: SimdValue | None, before_loop: list[str]) -> Any:
        """Return the address of a running total that starts at 0, or x where x is 0 by construction."""
        builder = self._builder
        if builder.is_zero(x):
            return x
        if counts is not None:
            x = builder.where(counts, x, 0.0)
        address = builder.variable()
        before_loop.append(builder.store_instruction(address, builder.broadcast(0.0)))
        builder.store(address, join(builder.load(address, is_mask=False), x))
        return address

    def _after_loop(self, total: Any) -> Any:
        return self._builder.load(total, is_mask=False) if isinstance(total, str) else total


def stacked(components: Any) -> Any:
    """Stack components into one array where they are arrays; return anything else unchanged."""
    if not isinstance(components, (list, tuple)) or type(components[0]) in (SimdValue, MemoryRow):
        return components
    return xp.stack(components)
