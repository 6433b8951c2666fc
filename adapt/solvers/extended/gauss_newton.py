"""Adaptations of several subjects with effects at work, with amplitudes that are given or that subjects share.

    a* = argmin_a sum_i v_i min_theta E_i(theta, a) + sum ((a - mean) / scale)^2,   E_i = D + w mean(J_p) within bounds

J_p is the squared distance to the nearest closed posture, so its slope in theta and a needs no derivative of that
posture (envelope theorem), and damped Gauss-Newton steps with y of ``extended.nearest_posture`` follow; the rest of
the curvature is learnt on the way (``extended.secant``). Part i is one subject with the postures that it is adapted to;
the parts of a group share a.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from adapt.solvers.extended.arrow_step import Quadratic, Step, lowest
from adapt.solvers.extended.nearest_posture import Nearest, nearest_postures
from adapt.solvers.extended.secant import secant
from adapt.solvers.extended.thorax_term import Thorax, ThoraxPart
from models.adapted_parameters import ADAPTED
from models.effects import Effect
from models.girdle import Girdle

_N = len(ADAPTED)

_OPEN_MM = 0.05
_OPEN_COST = 100.0
"""A posture whose chain stays open by more than this costs the square of it, mm^2, times this: a wall, not a slope."""

_FIRST_DAMPING, _LESS, _MORE, _LEAST_AFTER_FAILURE = 1e-3, 0.1, 30.0, 1e-2

_STUCK = 0.1
"""A step with more damping than this is short because it must be, not because it is the last."""

_SAME = 1e-12
"""Relative rounding of E: a step that changes it by less is no step up."""


class Shared(NamedTuple):
    """Amplitudes that the parts of a group share."""

    columns: Float[np.ndarray, "own channels rows"]
    """Strength in each channel at each row of an amplitude of 1."""
    scale: Float[np.ndarray, " own"]
    mean: Float[np.ndarray, " own"]
    """Of their prior."""


@dataclass(frozen=True)
class Parts:
    """The rows of all parts, one part after the other."""

    girdle: Girdle
    """(component, parts)."""
    thorax: Thorax
    bounds_mm: tuple[Float[np.ndarray, "#parts adapted"], Float[np.ndarray, "#parts adapted"]]
    effects: tuple[Effect, ...]
    strengths: Float[np.ndarray, "channels rows"]
    """Of what is given."""
    measured_deg: Float[np.ndarray, "6 rows"]
    sd: Float[np.ndarray, "6 rows"]
    weights: Float[np.ndarray, " rows"]
    """Of |y|^2 in E."""
    part: Int[np.ndarray, " rows"]
    group: Int[np.ndarray, " parts"]
    importance: Float[np.ndarray, " parts"]
    """v: of E in what the amplitudes minimise."""
    strengths_are_known: bool = False
    """Nothing asks for slopes in them."""

    @cached_property
    def _starts(self) -> Int[np.ndarray, " parts"]:
        return np.searchsorted(self.part, np.arange(len(self.group)))

    def sums(self, values: Float[np.ndarray, "rows ..."]) -> Float[np.ndarray, "parts ..."]:
        """Add up the rows of each part."""
        return np.add.reduceat(values, self._starts, axis=0)

    def nearest(self, theta_mm, strengths, start_deg=None) -> Nearest:
        """Find the nearest postures of all rows at these parameters, (parts, adapted)."""
        adapted = self.girdle.with_adapted(np.ascontiguousarray(theta_mm.T))
        of_rows = jax.tree.map(lambda x: np.ascontiguousarray(x[..., self.part]), adapted)
        return nearest_postures(
            of_rows, self.effects, strengths, self.measured_deg, self.sd, start_deg, self.strengths_are_known
        )


class End(NamedTuple):
    """Where the steps ended."""

    theta_mm: Float[np.ndarray, "parts adapted"]
    amplitude: Float[np.ndarray, "groups own"]
    E: Float[np.ndarray, " parts"]
    nearest: Nearest
    slope: Float[np.ndarray, "parts adapted"]
    """dE/dtheta, 0 where a bound holds it."""
    steps: int
    settled: bool


class _Point(NamedTuple):
    near: Nearest
    E: np.ndarray
    total: np.ndarray
    thorax: ThoraxPart


@dataclass(frozen=True)
class _Objective:
    """E of every part with the prior of the shared amplitudes, as a function of theta and the amplitudes a."""

    parts: Parts
    shared: Shared

    @cached_property
    def used(self) -> Int[np.ndarray, " used"]:
        """The channels that the amplitudes act in."""
        return np.flatnonzero(np.abs(self.shared.columns).max(axis=(0, 2), initial=0.0) > 0.0)

    @cached_property
    def columns(self) -> Float[np.ndarray, "own used rows"]:
        """Strength in these channels of an amplitude of 1."""
        return self.shared.columns[:, self.used]

    def at(self, theta, a, start_deg) -> _Point:
        """Evaluate it."""
        parts, strengths = self.parts, self.parts.strengths
        if len(self.used):
            strengths = strengths.copy()
            strengths[self.used] += np.einsum("rk,kcr->cr", a[parts.group][parts.part], self.columns)
        near = parts.nearest(theta, strengths, start_deg)
        thorax = parts.thorax(theta)
        opened = np.where(near.open_mm > _OPEN_MM, np.minimum(near.open_mm, 1.0) ** 2, 0.0)
        E = thorax.D + parts.sums(parts.weights * (near.y**2).sum(axis=1) + _OPEN_COST * opened)
        E = np.where(np.isfinite(E), E, np.inf)
        prior = (((a - self.shared.mean) / self.shared.scale) ** 2).sum(axis=1)
        total = np.bincount(parts.group, E * parts.importance, len(a)) + prior
        return _Point(near, E, total, thorax)

    def slopes(self, at: _Point) -> tuple[Float[np.ndarray, "rows 3 n"], Float[np.ndarray, "parts n"]]:
        """Give Z, dy in theta and the amplitudes, and the gradient of E of every part in them."""
        by_amplitude = np.einsum("ric,kcr->rik", at.near.by_channel[:, :, self.used], self.columns)
        Z = np.concatenate([at.near.by_theta, by_amplitude], axis=2)
        gradient = self.parts.sums((at.near.y[:, None, :] @ self._weighted(Z))[:, 0])
        gradient[:, :_N] += at.thorax.gradient
        return Z, gradient

    def matrix(self, at: _Point, Z) -> Float[np.ndarray, "parts n n"]:
        """Compute the Gauss-Newton matrix of E of every part."""
        matrix = self.parts.sums(np.swapaxes(self._weighted(Z), 1, 2) @ Z)
        matrix[:, :_N, :_N] += at.thorax.matrix
        return matrix

    def step(self, gradient, matrix, theta, a, damping: Float[np.ndarray, " groups"]) -> Step:
        """Find the lowest point of the damped quadratic model within the bounds; the matrix is changed."""
        parts, shared = self.parts, self.shared
        trace = np.einsum("pii->p", matrix[:, :_N, :_N])
        matrix[:, range(_N), range(_N)] += (damping[parts.group] * trace)[:, None]
        lower, upper = parts.bounds_mm
        return lowest(
            Quadratic(gradient, matrix, parts.importance, parts.group),
            len(a),
            2.0 * (a - shared.mean) / shared.scale**2,
            np.eye(len(shared.scale)) * (2.0 / shared.scale**2) * (1.0 + damping[:, None, None]),
            (lower - theta, upper - theta),
        )

    def _weighted(self, Z):
        return 2.0 * self.parts.weights[:, None, None] * Z


def minimise(
    parts: Parts,
    shared: Shared,
    theta_mm: Float[np.ndarray, "parts adapted"],
    amplitude: Float[np.ndarray, "groups own"],
    finished: Callable[[float, Float[np.ndarray, "parts adapted"]], bool],
    most_steps: int,
    start_deg: Float[np.ndarray, "6 rows"] | None = None,
) -> End:
    """Step until ``finished`` says so of the last decrease and the slope in theta; each group has its own damping."""
    objective, (lower, upper) = _Objective(parts, shared), parts.bounds_mm
    theta, a = np.clip(theta_mm, lower, upper), np.array(amplitude)
    damping = np.full(len(a), _FIRST_DAMPING)
    at = objective.at(theta, a, start_deg)
    rest = np.zeros((len(theta), _N + a.shape[1], _N + a.shape[1]))  # of the curvature, beside Gauss-Newton's
    moved = before = np.zeros(rest.shape[:2])  # by the last step; and its gradient
    taken = np.zeros(len(theta), bool)
    settled, gain, step_number, slope = False, np.inf, 0, np.zeros_like(theta)
    for step_number in range(most_steps + 1):
        Z, gradient = objective.slopes(at)
        held = ((theta <= lower) & (gradient[:, :_N] > 0)) | ((theta >= upper) & (gradient[:, :_N] < 0))
        slope = np.where(held, 0.0, gradient[:, :_N])
        settled = finished(gain, slope) and bool((damping < _STUCK).all())
        if settled or step_number == most_steps:
            break
        matrix = objective.matrix(at, Z)
        rest = np.where(taken[:, None, None], secant(rest, matrix, moved, gradient - before), 0.0)
        step, before = objective.step(gradient, matrix + rest, theta, a, damping), gradient
        tried = objective.at(theta + step.theta, a + step.amplitude, at.near.angles_deg.T)
        better = tried.total <= at.total + _SAME * np.abs(at.total)
        damping = np.where(better, damping * _LESS, np.maximum(damping * _MORE, _LEAST_AFTER_FAILURE))
        gain = float(np.where(better, at.total - tried.total, np.inf).max())
        taken, moved = better[parts.group], np.concatenate([step.theta, step.amplitude[parts.group]], axis=1)
        theta = np.where(taken[:, None], theta + step.theta, theta)
        a = np.where(better[:, None], a + step.amplitude, a)
        at = _chosen(parts, better, at, tried)
    return End(theta, a, at.E, at.near, slope, step_number, settled)


def _chosen(parts: Parts, better, old: _Point, new: _Point) -> _Point:
    """The new point in the groups where it is better."""
    part = better[parts.group]
    return _Point(
        old.near.where(part[parts.part], new.near),
        np.where(part, new.E, old.E),
        np.where(better, new.total, old.total),
        ThoraxPart(
            old.thorax.D,  # is part of E
            np.where(part[:, None], new.thorax.gradient, old.thorax.gradient),
            np.where(part[:, None, None], new.thorax.matrix, old.thorax.matrix),
        ),
    )
