"""Adaptations of several subjects of any chain, with amplitudes that are given or that subjects share.

    a* = argmin_a sum_i min_theta E_i(theta, a) + sum ((a - mean) / scale)^2,   E_i = D + w mean(J_p) within bounds

J_p is the squared distance to the nearest closed posture, so its slope in theta and a needs no derivative of that
posture (envelope theorem). Damped Gauss-Newton steps with y of ``projection.nearest_posture`` minimise E; secant
updates estimate the rest of the Hessian (``projection.secant``). Problem i is one subject with the postures to which it
is adapted; the problems of a group share a.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import where_problems
from adapt.solvers.projection.bounded_step import lowest
from adapt.solvers.projection.damped_steps import STUCK, Damping, Steps, until_ended
from adapt.solvers.projection.grouped_problems import GroupedProblems, Shared
from adapt.solvers.projection.nearest_posture import THERE, Nearest
from adapt.solvers.projection.secant import secant
from adapt.solvers.projection.thorax_term import ThoraxTerms
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_OPEN_MM = 0.05
_OPEN_COST = 100.0
"""Constraint violation, mm, above which a posture has an extra cost in E, and the cost per squared violation, mm^2: a
wall that has no gradient."""

_FIRST_DAMPING = 1e-3

_DAMPING = Damping(less=0.1, more=30.0, least=0.0, least_after_failure=1e-2, hopeless=1e8)

_SAME = 1e-12
"""Relative rounding of E: a smaller rise does not reject a step."""

_ENOUGH, _ROUGHEST = 1e-5, 1e-4
"""Tolerance of the projections of a posture, in SDs: the first number per unit of the slope (mm^2 per mm) that its
problem had before the step, at most the second. 3000 adaptations took the same steps as without this relaxation."""


class End(NamedTuple):
    """End of the steps."""

    theta_mm: Float[np.ndarray, "adapted problems"]
    amplitude: Float[np.ndarray, "own groups"]
    E: Float[np.ndarray, " problems"]
    nearest: Nearest
    """Nearest postures, with slopes in the amplitudes in place of the channels."""
    slope: Float[np.ndarray, "adapted problems"]
    """dE/dtheta, 0 where a bound holds the parameter."""
    steps: Int[np.ndarray, " groups"]
    settled: Bool[np.ndarray, " groups"]


Finished = Callable[[Float[np.ndarray, " groups"], Float[np.ndarray, "adapted problems"]], Bool[np.ndarray, " groups"]]
"""Function that returns which groups have converged, from the last gain of each and the slopes in theta of its
problems."""


def cost_of_open_chains(near: Nearest) -> Float[np.ndarray, " rows"]:
    """Compute the extra cost of each posture whose chain does not close."""
    return np.where(near.open_mm > _OPEN_MM, _OPEN_COST * np.minimum(near.open_mm, 1.0) ** 2, 0.0)


def newly_open(before: Nearest, after: Nearest) -> Bool[np.ndarray, " rows"]:
    """Return the postures whose chain a step leaves open, although it was closed before. A projection that cannot close
    the chain ends anywhere, depending on rounding of its starting point: with such steps the same data have other
    minima on other machines."""
    return (before.open_mm <= _OPEN_MM) & (after.open_mm > _OPEN_MM)


class _OfProblems(NamedTuple):
    """State of every problem."""

    theta: Float[np.ndarray, "adapted problems"]
    E: Float[np.ndarray, " problems"]
    thorax: ThoraxTerms
    gradient: Float[np.ndarray, "n problems"]
    matrix: Float[np.ndarray, "n n problems"]
    """Gauss-Newton matrix."""
    slope: Float[np.ndarray, "adapted problems"]
    rest: Float[np.ndarray, "n n problems"]
    """Rest of the Hessian, beyond the Gauss-Newton matrix."""
    moved: Float[np.ndarray, "n problems"]
    """Change of theta and the amplitudes in the last step; ``before`` is the gradient before that step."""
    before: Float[np.ndarray, "n problems"]
    taken: Bool[np.ndarray, " problems"]
    """True where the last step was accepted."""


class _OfGroups(NamedTuple):
    """State of every group."""

    a: Float[np.ndarray, "own groups"]
    total: Float[np.ndarray, " groups"]
    damping: Float[np.ndarray, " groups"]
    gain: Float[np.ndarray, " groups"]
    """Decrease of E in the last step, as the quadratic model predicts it: near the optimum the rounding of E is
    larger."""
    steps: Int[np.ndarray, " groups"]
    settled: Bool[np.ndarray, " groups"]
    going: Bool[np.ndarray, " groups"]


@dataclass(frozen=True)
class Objective:
    """E of every problem with the prior of the shared amplitudes, as a function of theta and the amplitudes a."""

    problems: GroupedProblems
    shared: Shared

    @cached_property
    def _group(self) -> Int[np.ndarray, " rows"]:
        return self.problems.group[self.problems.problem]

    @cached_property
    def _places(self) -> Int[np.ndarray, "some own rows"]:
        """Indices of the channels of the amplitudes among the strengths of all rows, channel by channel."""
        rows = len(self._group)
        return rows * self.shared.channels[..., self._group] + np.arange(rows)

    def of(self, groups: Bool[np.ndarray, " groups"]) -> "Objective":
        """Select some groups."""
        rows = groups[self.problems.group][self.problems.problem]
        return Objective(self.problems.of(groups), self.shared.of(groups, rows))

    def _strengths(self, a: Float[np.ndarray, "own groups"]) -> Float[np.ndarray, "channels rows"]:
        """Compute the strengths of the effects in all rows."""
        strengths = self.problems.strengths
        if not self._places.size:
            return strengths
        own = (a[:, self._group] * self.shared.columns).ravel()
        return strengths + np.bincount(self._places.ravel(), own, strengths.size).reshape(strengths.shape)

    def nearest(self, theta, a, start, there=THERE) -> Nearest:
        """Find the nearest postures of all rows."""
        return self.problems.nearest(theta, self._strengths(a), start, there)

    def with_whole_slopes(self, theta, a, near: Nearest) -> Nearest:
        """Replace the slopes of y by those that include the movement of the nearest postures."""
        return self.problems.with_whole_slopes(theta, self._strengths(a), near)

    def at(self, theta, a, start, there=THERE) -> tuple[Nearest, Float[np.ndarray, " problems"], ThoraxTerms]:
        """Evaluate E: return the nearest postures, with slopes in the amplitudes in place of the channels, E of every
        problem, and D with its slopes."""
        problems, near = self.problems, self.nearest(theta, a, start, there)
        near = near._replace(by_channel=self.by_amplitude(near))  # fewer numbers, because every step copies them
        thorax = problems.thorax(theta)
        E = thorax[0] + problems.sums(problems.weights * (near.y**2).sum(axis=0) + cost_of_open_chains(near))
        return near, np.where(np.isfinite(E), E, np.inf), thorax

    def total(
        self, E: Float[np.ndarray, " problems"], a: Float[np.ndarray, "own groups"]
    ) -> Float[np.ndarray, " groups"]:
        """Sum E over the problems of every group, and add the prior of its amplitudes."""
        prior = (((a - self.shared.mean) / self.shared.scale) ** 2).sum(axis=0)
        return np.bincount(self.problems.group, E, a.shape[1]) + prior

    def normal_equations(
        self, near: Nearest, thorax: ThoraxTerms
    ) -> tuple[Float[np.ndarray, "n problems"], Float[np.ndarray, "n n problems"]]:
        """Compute the gradient of E of every problem in theta and the amplitudes, and its Gauss-Newton matrix."""
        every = np.concatenate([near.by_theta, near.by_channel, near.y[:, None]], axis=1)
        products = self.problems.products(np.sqrt(2.0 * self.problems.weights) * every)
        gradient, matrix = products[:-1, -1], products[:-1, :-1]
        _, of_points, curvature = thorax
        gradient[:_N] += of_points
        matrix[:_N, :_N] += curvature
        return gradient, matrix

    def by_amplitude(self, near: Nearest) -> Float[np.ndarray, "3 own rows"]:
        """Return the derivatives of y with respect to the amplitudes."""
        return (near.by_channel.reshape(3, -1).take(self._places, axis=1) * self.shared.columns).sum(axis=1)

    def step(
        self, gradient, matrix, theta, a, damping: Float[np.ndarray, " groups"]
    ) -> tuple[Float[np.ndarray, "adapted problems"], Float[np.ndarray, "own groups"], Float[np.ndarray, " groups"]]:
        """Find the minimum of the damped quadratic model within the bounds, and the predicted decrease (half of
        -gradient' step); the matrix is changed in place."""
        problems, shared = self.problems, self.shared
        trace = np.einsum("iip->p", matrix[:_N, :_N])
        matrix[range(_N), range(_N)] += damping[problems.group] * trace
        lower, upper = problems.bounds_mm
        precision = 2.0 / shared.scale**2
        prior_matrix = np.eye(len(a))[..., None] * (precision * (1.0 + damping))
        prior_gradient = precision * (a - shared.mean)
        room = lower - theta, upper - theta
        dtheta, da = lowest(gradient, matrix, problems.group, prior_gradient, prior_matrix, room)
        of_problems = (gradient * np.concatenate([dtheta, da[:, problems.group]])).sum(axis=0)
        fall = -np.bincount(problems.group, of_problems, len(damping)) - (prior_gradient * da).sum(axis=0)
        return dtheta, da, 0.5 * fall


def minimise(
    problems: GroupedProblems,
    shared: Shared,
    theta_mm: Float[np.ndarray, "adapted problems"],
    amplitude: Float[np.ndarray, "own groups"],
    finished: Finished,
    most_steps: int,
    start: Float[np.ndarray, "6 rows"] | None = None,
) -> End:
    """Take steps until every group is ``finished``; each group has its own damping and stays unchanged once
    finished."""
    objective = Objective(problems, shared)
    first = _begin(objective, np.clip(theta_mm, *problems.bounds_mm), np.array(amplitude), start, finished)
    near, of_problems, of_groups = until_ended(objective, first, partial(_stepped, finished), most_steps)
    return End(
        of_problems.theta, of_groups.a, of_problems.E, near, of_problems.slope, of_groups.steps, of_groups.settled
    )


def _begin(objective: Objective, theta, a, start, finished: Finished) -> Steps:
    near, E, thorax = objective.at(theta, a, start)
    gradient, matrix = objective.normal_equations(near, thorax)
    (n, problems), groups = gradient.shape, a.shape[1]
    nothing, never = np.zeros((n, problems)), np.zeros(groups, bool)
    slope, rest = _unheld(objective.problems, theta, gradient), np.zeros((n, n, problems))
    of_problems = _OfProblems(
        theta, E, thorax, gradient, matrix, slope, rest, nothing, nothing, np.zeros(problems, bool)
    )
    damping, gain = np.full(groups, _FIRST_DAMPING), np.full(groups, np.inf)
    of_groups = _OfGroups(a, objective.total(E, a), damping, gain, np.zeros(groups, int), never, never)
    return (near, of_problems, _judged(of_groups, slope, finished))


def _unheld(problems: GroupedProblems, theta, gradient) -> Float[np.ndarray, "adapted problems"]:
    """Return the slope in theta, 0 where a bound holds the parameter."""
    (lower, upper), own = problems.bounds_mm, gradient[:_N]
    return np.where(((theta <= lower) & (own > 0)) | ((theta >= upper) & (own < 0)), 0.0, own)


def _judged(groups: _OfGroups, slope, finished: Finished) -> _OfGroups:
    settled = finished(groups.gain, slope) & (groups.damping < STUCK)
    return groups._replace(settled=settled, going=~settled & (groups.damping < _DAMPING.hopeless))


def _stepped(finished: Finished, objective: Objective, steps: Steps) -> Steps:
    """Take a step in every unfinished group if it descends; else increase the damping."""
    problems, (near, own, groups) = objective.problems, steps
    learnt = secant(own.rest, own.matrix, own.moved, own.gradient - own.before)
    rest = np.where(own.taken, learnt, 0.0)
    dtheta, da, gain = objective.step(own.gradient, own.matrix + rest, own.theta, groups.a, groups.damping)
    there = np.clip(_ENOUGH * np.abs(own.slope).max(axis=0), THERE, _ROUGHEST)[problems.problem]
    theta, a = own.theta + dtheta, groups.a + da
    tried, E, thorax = objective.at(theta, a, near.angles, there)
    total = objective.total(E, a)
    better = (total <= groups.total + _SAME * np.abs(groups.total)) & groups.going
    taken = better[problems.group]
    near = where_problems(taken[problems.problem], tried, near)
    theta, E, thorax = where_problems(taken, (theta, E, thorax), (own.theta, own.E, own.thorax))
    gradient, matrix = objective.normal_equations(near, thorax)
    slope, moved = _unheld(problems, theta, gradient), np.concatenate([dtheta, da[:, problems.group]])
    gain = np.where(better, gain, np.where(groups.going, np.inf, groups.gain))
    new = _OfGroups(
        a=np.where(better, a, groups.a),
        total=np.where(better, total, groups.total),
        damping=np.where(groups.going, _DAMPING.after(groups.damping, better), groups.damping),
        gain=gain,
        steps=groups.steps + groups.going,
        settled=groups.settled,
        going=groups.going,
    )
    of_problems = _OfProblems(theta, E, thorax, gradient, matrix, slope, rest, moved, own.gradient, taken)
    return (near, of_problems, _judged(new, slope, finished))
