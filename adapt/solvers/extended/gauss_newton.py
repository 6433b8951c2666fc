"""Adaptations of several subjects with effects at work, with amplitudes that are given or that subjects share.

    a* = argmin_a sum_i min_theta E_i(theta, a) + sum ((a - mean) / scale)^2,   E_i = D + w mean(J_p) within bounds

J_p is the squared distance to the nearest closed posture, so its slope in theta and a needs no derivative of that
posture (envelope theorem), and damped Gauss-Newton steps with y of ``extended.nearest_posture`` follow; the rest of
the curvature is learnt on the way (``extended.secant``). Part i is one subject with the postures that it is adapted to;
the parts of a group share a.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.extended.arrow_step import Quadratic, Step, lowest
from adapt.solvers.extended.joint_parts import Parts, Shared
from adapt.solvers.extended.nearest_posture import THERE_DEG, Nearest
from adapt.solvers.extended.secant import secant
from adapt.solvers.extended.thorax_term import ThoraxPart
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_OPEN_MM = 0.05
_OPEN_COST = 100.0
"""A posture whose chain stays open by more than this costs the square of it, mm^2, times this: a wall, not a slope."""

_FIRST_DAMPING, _LESS, _MORE, _LEAST_AFTER_FAILURE = 1e-3, 0.1, 30.0, 1e-2

_STUCK = 0.1
"""A step with more damping than this is short because it must be, not because it is the last."""

_HOPELESS = 1e8
"""A group that needs more damping than this stands at a wall: it ends there, not settled."""

_SAME = 1e-12
"""Relative rounding of E: a step that changes it by less is no step up."""

_ENOUGH_DEG, _ROUGHEST_DEG = 1e-5, 1e-4
"""A posture is near enough where a projection moves it by less than so many degrees a unit of slope (mm^2 a mm) that
its part had before the step, and by less than the roughest: 3000 adaptations took the same steps as with none."""

FEW = 0.75
"""Share of the groups below which those that are going on do so without the others: leaving them costs a copy."""


class End(NamedTuple):
    """Where the steps ended."""

    theta_mm: Float[np.ndarray, "parts adapted"]
    amplitude: Float[np.ndarray, "groups own"]
    E: Float[np.ndarray, " parts"]
    nearest: Nearest
    slope: Float[np.ndarray, "parts adapted"]
    """dE/dtheta, 0 where a bound holds it."""
    steps: Int[np.ndarray, " groups"]
    settled: Bool[np.ndarray, " groups"]


Finished = Callable[[Float[np.ndarray, " groups"], Float[np.ndarray, "parts adapted"]], Bool[np.ndarray, " groups"]]
"""Which groups are, by the last decrease of each and the slopes in theta of their parts."""


def cost_of_open_chains(near: Nearest) -> Float[np.ndarray, " rows"]:
    """Compute what each posture costs whose chain does not close."""
    return np.where(near.open_mm > _OPEN_MM, _OPEN_COST * np.minimum(near.open_mm, 1.0) ** 2, 0.0)


class _Point(NamedTuple):
    near: Nearest
    E: Float[np.ndarray, " parts"]
    total: Float[np.ndarray, " groups"]
    thorax: ThoraxPart


class _State(NamedTuple):
    """Where the steps are, and what they have learnt."""

    at: _Point
    theta: Float[np.ndarray, "parts adapted"]
    a: Float[np.ndarray, "groups own"]
    damping: Float[np.ndarray, " groups"]
    gain: Float[np.ndarray, " groups"]
    """By the last step."""
    rest: Float[np.ndarray, "parts n n"]
    """Of the curvature, beside Gauss-Newton's."""
    moved: Float[np.ndarray, "parts n"]
    """By the last step; and the gradient before it."""
    before: Float[np.ndarray, "parts n"]
    taken: Bool[np.ndarray, " parts"]
    """Whether the last step was."""
    steps: Int[np.ndarray, " groups"]

    def of(self, groups: Bool[np.ndarray, " groups"], whole: Parts) -> "_State":
        """Take some groups."""
        parts = groups[whole.group]
        near, E, total, thorax = self.at
        at = _Point(near.of(parts[whole.part]), E[parts], total[groups], ThoraxPart(*(one[parts] for one in thorax)))
        of_groups = {name: getattr(self, name)[groups] for name in ("a", "damping", "gain", "steps")}
        of_parts = {name: getattr(self, name)[parts] for name in ("theta", "rest", "moved", "before", "taken")}
        return _State(at=at, **of_groups, **of_parts)


@dataclass(frozen=True)
class Objective:
    """E of every part with the prior of the shared amplitudes, as a function of theta and the amplitudes a."""

    parts: Parts
    shared: Shared

    @cached_property
    def used(self) -> Int[np.ndarray, " used"]:
        """The channels that the amplitudes act in."""
        return np.flatnonzero(self.shared.columns.any(axis=(0, 2)))

    @cached_property
    def columns(self) -> Float[np.ndarray, "own used rows"]:
        """Strength in these channels of an amplitude of 1."""
        return self.shared.columns[:, self.used]

    def of(self, groups: Bool[np.ndarray, " groups"]) -> "Objective":
        """Take some groups."""
        rows = groups[self.parts.group][self.parts.part]
        return Objective(self.parts.of(groups), self.shared.of(groups, rows))

    def nearest(self, theta, a, start_deg, there_deg=THERE_DEG) -> Nearest:
        """Find the nearest postures of all rows."""
        parts, strengths = self.parts, self.parts.strengths
        if len(self.used):
            strengths = strengths.copy()
            strengths[self.used] += np.einsum("rk,kcr->cr", a[parts.group][parts.part], self.columns)
        return parts.nearest(theta, strengths, start_deg, there_deg)

    def at(self, theta, a, start_deg, there_deg=THERE_DEG) -> _Point:
        """Evaluate it."""
        parts, near = self.parts, self.nearest(theta, a, start_deg, there_deg)
        thorax = parts.thorax(theta)
        E = thorax.D + parts.sums(parts.weights * (near.y**2).sum(axis=0) + cost_of_open_chains(near))
        E = np.where(np.isfinite(E), E, np.inf)
        prior = (((a - self.shared.mean) / self.shared.scale) ** 2).sum(axis=1)
        total = np.bincount(parts.group, E, len(a)) + prior
        return _Point(near, E, total, thorax)

    def normal_equations(self, at: _Point) -> tuple[Float[np.ndarray, "parts n"], Float[np.ndarray, "parts n n"]]:
        """Compute the gradient of E of every part in theta and the amplitudes, and its Gauss-Newton matrix."""
        every = np.concatenate([at.near.by_theta, self.by_amplitude(at.near), at.near.y[:, None]], axis=1)
        products = self.parts.products(np.sqrt(2.0 * self.parts.weights) * every)
        gradient, matrix = products[:, :-1, -1], products[:, :-1, :-1]
        gradient[:, :_N] += at.thorax.gradient
        matrix[:, :_N, :_N] += at.thorax.matrix
        return gradient, matrix

    def by_amplitude(self, near: Nearest) -> Float[np.ndarray, "3 own rows"]:
        """Give dy in the amplitudes."""
        return np.einsum("icr,kcr->ikr", near.by_channel[:, self.used], self.columns)

    def step(self, gradient, matrix, theta, a, damping: Float[np.ndarray, " groups"]) -> Step:
        """Find the lowest point of the damped quadratic model within the bounds; the matrix is changed."""
        parts, shared = self.parts, self.shared
        trace = np.einsum("pii->p", matrix[:, :_N, :_N])
        matrix[:, range(_N), range(_N)] += (damping[parts.group] * trace)[:, None]
        lower, upper = parts.bounds_mm
        return lowest(
            Quadratic(gradient, matrix, parts.group),
            len(a),
            2.0 * (a - shared.mean) / shared.scale**2,
            np.eye(a.shape[1]) * (2.0 / shared.scale**2 * (1.0 + damping[:, None]))[:, None, :],
            (lower - theta, upper - theta),
        )


def minimise(
    parts: Parts,
    shared: Shared,
    theta_mm: Float[np.ndarray, "parts adapted"],
    amplitude: Float[np.ndarray, "groups own"],
    finished: Finished,
    most_steps: int,
    start_deg: Float[np.ndarray, "6 rows"] | None = None,
) -> End:
    """Step until every group is ``finished``; each has its own damping, and stays where it is then."""
    objective = Objective(parts, shared)
    theta, a = np.clip(theta_mm, *parts.bounds_mm), np.array(amplitude)
    (count, _), (groups, own) = theta.shape, a.shape
    nothing = np.zeros((count, _N + own))
    begin = _State(
        at=objective.at(theta, a, start_deg),
        theta=theta,
        a=a,
        damping=np.full(groups, _FIRST_DAMPING),
        gain=np.full(groups, np.inf),
        rest=np.zeros((count, _N + own, _N + own)),
        moved=nothing,
        before=nothing,
        taken=np.zeros(count, bool),
        steps=np.zeros(groups, int),
    )
    return _steps(objective, begin, finished, most_steps)


def _steps(objective: Objective, state: _State, finished: Finished, most_steps: int) -> End:
    """Take at most so many steps; once enough groups have ended the others go on without them."""
    parts, (lower, upper) = objective.parts, objective.parts.bounds_mm
    left = most_steps
    while True:
        gradient, matrix = objective.normal_equations(state.at)
        own = gradient[:, :_N]
        held = ((state.theta <= lower) & (own > 0)) | ((state.theta >= upper) & (own < 0))
        slope = np.where(held, 0.0, own)
        settled = finished(state.gain, slope) & (state.damping < _STUCK)
        end = End(state.theta, state.a, state.at.E, state.at.near, slope, state.steps, settled)
        going = ~settled & (state.damping < _HOPELESS)
        if not going.any() or not left:
            return end
        if going.mean() <= FEW:
            others = _steps(objective.of(going), state.of(going, parts), finished, left)
            return _joined(end, going, others, parts)
        state = _stepped(objective, state, gradient, matrix, slope, going)
        left -= 1


def _stepped(
    objective: Objective, state: _State, gradient, matrix, slope, going: Bool[np.ndarray, " groups"]
) -> _State:
    """Take a step in every group that is going on, if it leads down; else damp it more."""
    parts, at, damping = objective.parts, state.at, state.damping
    learnt = secant(state.rest, matrix, state.moved, gradient - state.before)
    rest = np.where(state.taken[:, None, None], learnt, 0.0)
    step = objective.step(gradient, matrix + rest, state.theta, state.a, damping)
    there_deg = np.clip(_ENOUGH_DEG * np.abs(slope).max(axis=1), THERE_DEG, _ROUGHEST_DEG)[parts.part]
    tried = objective.at(state.theta + step.theta, state.a + step.amplitude, at.near.angles_deg, there_deg)
    better = (tried.total <= at.total + _SAME * np.abs(at.total)) & going
    changed = np.where(better, damping * _LESS, np.maximum(damping * _MORE, _LEAST_AFTER_FAILURE))
    taken = better[parts.group]
    return _State(
        at=_chosen(parts, better, at, tried),
        theta=np.where(taken[:, None], state.theta + step.theta, state.theta),
        a=np.where(better[:, None], state.a + step.amplitude, state.a),
        damping=np.where(going, changed, damping),
        gain=np.where(better, at.total - tried.total, np.where(going, np.inf, state.gain)),
        rest=rest,
        moved=np.concatenate([step.theta, step.amplitude[parts.group]], axis=1),
        before=gradient,
        taken=taken,
        steps=state.steps + going,
    )


def _joined(every: End, groups: Bool[np.ndarray, " groups"], others: End, parts: Parts) -> End:
    """Put the ends of some groups in the places that they have among all."""
    of_parts = groups[parts.group]
    places = {
        **dict.fromkeys(("theta_mm", "E", "slope"), of_parts),
        **dict.fromkeys(("amplitude", "steps", "settled"), groups),
    }
    joined = {name: put(getattr(every, name), where, getattr(others, name)) for name, where in places.items()}
    rows = of_parts[parts.part]
    return End(nearest=every.nearest.with_rows(rows, others.nearest), **joined)


def put(whole: np.ndarray, places: Bool[np.ndarray, " some"], values: np.ndarray) -> np.ndarray:
    """Replace the values at some places."""
    found = np.array(whole)
    found[places] = values
    return found


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
