"""Problems of a joint fit: each is one subject with the postures to which it is adapted; the problems of a group share
amplitudes."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import take_problems
from adapt.solvers.projection.nearest_posture import THERE, Nearest, nearest_postures, with_whole_slopes
from adapt.solvers.projection.thorax_term import Thorax
from adapt.solvers.unmeasured import UNMEASURED_SD
from models.effects import Effect
from models.girdle import Girdle


class Shared(NamedTuple):
    """Amplitudes that the problems of a group share. Groups may have different amplitudes: an amplitude that a group
    does not have does nothing at its rows."""

    channels: Int[np.ndarray, "some own groups"]
    """Channels in which each amplitude acts; amplitudes with fewer channels than others are padded with channels of
    strength 0."""
    columns: Float[np.ndarray, "some own rows"]
    """Strength in these channels at each row, per unit of the amplitude."""
    scale: Float[np.ndarray, "own groups"]
    mean: Float[np.ndarray, "own groups"]
    """Prior of the amplitudes: ``scale`` and ``mean`` in the term ((a - mean) / scale)^2 of E."""

    def of(self, groups: Bool[np.ndarray, " groups"], rows: Bool[np.ndarray, " rows"]) -> "Shared":
        """Select some groups, which have these rows."""
        channels, columns = self.channels[..., groups], self.columns[..., rows]
        return Shared(channels, columns, self.scale[:, groups], self.mean[:, groups])


def acting(
    columns: Float[np.ndarray, "own channels rows"],
) -> tuple[Int[np.ndarray, "some own"], Float[np.ndarray, "some own rows"]]:
    """Find the channels in which each amplitude acts at any row, and its strength there (``Shared``)."""
    acts = columns.any(axis=2)
    channels = np.argsort(~acts, axis=1, kind="stable")[:, : acts.sum(axis=1).max(initial=0)]
    return channels.T, np.take_along_axis(columns, channels[..., None], 1).swapaxes(0, 1)


@dataclass(frozen=True)
class GroupedProblems:
    """Rows of all problems, one problem after the other."""

    girdle: Girdle
    """Girdle of each problem, (component, problems)."""
    thorax: Thorax
    bounds_mm: tuple[Float[np.ndarray, "adapted problems"], Float[np.ndarray, "adapted problems"]]
    effects: tuple[Effect, ...]
    strengths: Float[np.ndarray, "channels rows"]
    """Given strengths, to which the shared amplitudes add."""
    angles: Float[np.ndarray, "6 rows"]
    """Measured angles s, rad."""
    measured: Bool[np.ndarray, "6 rows"]
    weights: Float[np.ndarray, " rows"]
    """Weights of |y|^2 in E."""
    problem: Int[np.ndarray, " rows"]
    """Problem of each row."""
    group: Int[np.ndarray, " problems"]
    strengths_are_known: bool = False
    """True where no slopes in the strengths are needed."""
    unmeasured_sd: float = UNMEASURED_SD

    @cached_property
    def _starts(self) -> Int[np.ndarray, " problems"]:
        return np.searchsorted(self.problem, np.arange(len(self.group)))

    @cached_property
    def _girdle_of_rows(self) -> Girdle:
        return take_problems(self.girdle, self.problem)

    def _girdle_at(self, theta_mm: Float[np.ndarray, "adapted problems"]) -> Girdle:
        return self._girdle_of_rows.with_adapted(theta_mm[:, self.problem])

    def sums(self, values: Float[np.ndarray, "... rows"]) -> Float[np.ndarray, "... problems"]:
        """Sum values over the rows of each problem."""
        return np.add.reduceat(values, self._starts, axis=-1)

    @cached_property
    def _places(self) -> Int[np.ndarray, "problems most"]:
        """Rows of each problem, padded with the index after the last row of all."""
        counts = np.bincount(self.problem, minlength=len(self.group))
        number = np.arange(counts.max())
        return np.where(number < counts[:, None], self._starts[:, None] + number, len(self.problem))

    def products(self, x: Float[np.ndarray, "3 n rows"]) -> Float[np.ndarray, "n n problems"]:
        """Compute x'x over the rows of each problem."""
        padded = np.zeros((x.shape[2] + 1, *x.shape[:2]))
        padded[:-1] = np.moveaxis(x, 2, 0)
        own = padded[self._places].reshape(len(self.group), -1, x.shape[1])
        return np.moveaxis(np.swapaxes(own, 1, 2) @ own, 0, -1)

    def nearest(self, theta_mm, strengths, start=None, there=THERE) -> Nearest:
        """Find the nearest postures of all rows at these parameters, (adapted, problems)."""
        girdle = self._girdle_at(theta_mm)
        return nearest_postures(
            girdle,
            self.effects,
            strengths,
            self.angles,
            self.measured,
            start,
            self.strengths_are_known,
            there,
            self.unmeasured_sd,
        )

    def with_whole_slopes(self, theta_mm, strengths, near: Nearest) -> Nearest:
        """Replace the slopes of y by those that include the movement of the nearest postures."""
        girdle = self._girdle_at(theta_mm)
        return with_whole_slopes(girdle, self.effects, strengths, self.angles, self.measured, near, self.unmeasured_sd)

    def of(self, groups: Bool[np.ndarray, " groups"]) -> "GroupedProblems":
        """Select some groups."""
        problems = groups[self.group]
        rows = problems[self.problem]
        girdle, thorax, bounds = take_problems((self.girdle, self.thorax, self.bounds_mm), problems)
        return replace(
            self,
            girdle=girdle,
            thorax=thorax,
            bounds_mm=bounds,
            strengths=self.strengths[:, rows],
            angles=self.angles[:, rows],
            measured=self.measured[:, rows],
            weights=self.weights[rows],
            problem=np.cumsum(problems)[self.problem[rows]] - 1,
            group=np.cumsum(groups)[self.group[problems]] - 1,
        )
