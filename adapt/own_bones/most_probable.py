"""The most probable girdle of each person, given measured postures and how people differ.

With noise of SD sigma in every measured angle and a person's sizes z ~ N(0, 1) (``models.person.own_bones``)

    -2 log p(z | angles) = sum over measured angles of (q - s)^2 / sigma^2 + |z|^2 + constant,

q the closed postures nearest to the measured ones. What is minimised is sigma^2 times that,

    F(u) = sum (q - s)^2 + sigma^2 |u|^2,     g(q, x) = 0,   chain's numbers x = x_0 + R u,   R R' = sum c c',

over as many u as the chain can tell apart: no pair of sizes that move the same numbers is fitted twice. There are no
bounds: the prior holds what the angles do not.

F has long curved ridges: with conoids that hardly turn with the bones a tenth of a millimetre of A3 is worth degrees.
So the constraints first have a slack, as ligaments and soft tissue do, which becomes smaller in stages; damped
Gauss-Newton steps with the postures of each stage (``projection.nearest_posture``). At last the chain is rigid: Newton
steps in u and all postures at once, each posture eliminated (``own_bones.posture_steps``), with backtracking on the
augmented Lagrangian as in ``adapt.solvers.newton.subject``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import take_problems, where_problems, with_problems
from adapt.own_bones.posture_steps import Eliminated, Postures, eliminate, persons_first, violations_mm
from adapt.solvers.newton.elimination import STEP_LIMIT_RAD
from adapt.solvers.projection.damped_steps import Steps, until_ended
from adapt.solvers.projection.nearest_posture import Nearest, nearest_by_numbers, strengths_rows
from adapt.solvers.unmeasured import UNMEASURED_SD, sd_rad
from models.effects import ActiveEffects
from models.girdle import COUNT_OF_NUMBERS
from motions.rotations import DEG
from motions.table import FEWEST_ANGLES

STARTS_MM = ((1.0, 0.3, 0.1, 0.03, 0.01), (0.1, 0.03, 0.01), ())
"""SDs of the constraints in the stages of each start, beside a degree in the angles. Of six bone-pin shoulders with
five sets F has two or three local minima; each start leads to the lowest of them in 22 to 25 of 30."""

_STEPS_A_STAGE, _STAGE_GAIN = 8, 1e-2
"""Most steps of a stage, and the relative decrease of F at which it ends."""

_STAGE_NEAR = 1e-6
"""A posture of a stage is near enough where a projection moves it by less than so many SDs."""

_MOST_STEPS = 320
"""With the rigid chain most take 4 to 20, the hardest of those that lead to the lowest end 319."""

_FLAT = 1e-6
"""|dF/du| of an end, relative to sigma^2: u is 1e-6 SDs from the optimum at most, for the prior alone curves F by as
much; F is 1e-12 sigma^2 above its minimum."""

_CLOSED_MM, _STILL_DEG = 1e-7, 1e-6
"""Of the chains and the postures of such an end, which are fitted anew then."""

_SHORTER, _HARDLY = 0.3, 0.02
"""Factor on a step whose end was refused; the share that is taken in any case."""

_ROUNDING = 1e-12
"""Relative, of the merit."""

_FIRST_DAMPING, _LESS, _MORE, _LEAST, _MOST = 10.0, 0.3, 10.0, 1e-3, 1e3
"""Of a step in u, beside the prior's 1: less after a full step, more after a shortened one; below the least none. More
than the most would hold u where the postures have not found their way yet."""


_ENTRIES = np.tril_indices(COUNT_OF_NUMBERS)
"""Of ``Eliminated.matrix``."""


class Rows(NamedTuple):
    """The postures of all persons, person by person."""

    angles: Float[np.ndarray, "6 rows"]
    """Measured, rad."""
    measured: Bool[np.ndarray, "6 rows"]
    active_effects: ActiveEffects

    @property
    def weights(self) -> Float[np.ndarray, "6 rows"]:
        """W: F / 2 in deg^2."""
        return sd_rad(self.measured, UNMEASURED_SD) ** -2.0


class Parts(NamedTuple):
    """Which person (group and part at once) each row is of."""

    part: Int[np.ndarray, " rows"]
    group: Int[np.ndarray, " problems"]


class Prior(NamedTuple):
    """What is believed of each person's girdle."""

    numbers_mm: Float[np.ndarray, "numbers problems"]
    """x_0, with SC at 0 (``of_chain``)."""
    root_mm: Float[np.ndarray, "numbers n problems"]
    """R."""
    noise_deg: Float[np.ndarray, " problems"]
    """sigma."""

    def numbers_at(self, u: Float[np.ndarray, "n problems"]) -> Float[np.ndarray, "numbers problems"]:
        """Give the chain's numbers at u."""
        return self.numbers_mm + self.moved_mm(u)

    def moved_mm(self, u: Float[np.ndarray, "n problems"]) -> Float[np.ndarray, "numbers problems"]:
        """Give R u."""
        return (persons_first(self.root_mm) @ persons_first(u)[..., None])[..., 0].T

    def u_of(self, numbers_mm: Float[np.ndarray, "numbers problems"]) -> Float[np.ndarray, "n problems"]:
        """Find u of the nearest numbers: the columns of R are orthogonal, some of them 0."""
        squares = (self.root_mm**2).sum(axis=0)
        along = np.einsum("kup,kp->up", self.root_mm, numbers_mm - self.numbers_mm)
        return along / np.where(squares > 0.0, squares, np.inf)


class Posterior(NamedTuple):
    """Where the steps ended."""

    u: Float[np.ndarray, "n problems"]
    F: Float[np.ndarray, " problems"]
    """deg^2."""
    nearest: Nearest
    """With slopes in the numbers of the girdle."""
    steps: Int[np.ndarray, " problems"]
    closed: Bool[np.ndarray, " problems"]
    """The chain is, in every posture."""
    settled: Bool[np.ndarray, " problems"]
    """And F stationary."""


def of_problems(rows: Rows, part: Int[np.ndarray, " rows"], problems) -> tuple[Rows, Int[np.ndarray, " some"]]:
    """Take the rows of some problems, any as often as wanted, and say which of them each is of."""
    at, number = _places(part, problems)
    return Rows(rows.angles[:, at], rows.measured[:, at], rows.active_effects.at(at)), number


def take_found(found: Posterior, part: Int[np.ndarray, " rows"], problems: Int[np.ndarray, " some"]) -> Posterior:
    """Take the ends of some problems."""
    nearest = take_problems(found.nearest, _places(part, problems)[0])
    return take_problems(found._replace(nearest=()), problems)._replace(nearest=nearest)


def _places(part: Int[np.ndarray, " rows"], problems: Int[np.ndarray, " some"]):
    """Find the rows of some problems, one problem's after the other, and which of them each is of."""
    first = np.searchsorted(part, problems)
    counts = np.searchsorted(part, problems, side="right") - first
    number = np.repeat(np.arange(len(problems)), counts)
    return np.arange(len(number)) + (first - (np.cumsum(counts) - counts))[number], number


class _OfRows(NamedTuple):
    """The last accepted point of each posture, and the step from it."""

    angles: Float[np.ndarray, "6 rows"]
    multipliers: Float[np.ndarray, "3 rows"]
    dq: Float[np.ndarray, "6 rows"]
    change: Float[np.ndarray, "3 rows"]
    target: Float[np.ndarray, "3 rows"]
    """Multipliers at the end of the full step: those of the merit."""
    stiffness: Float[np.ndarray, "3 rows"]


class _OfGroups(NamedTuple):
    u: Float[np.ndarray, "n problems"]
    du: Float[np.ndarray, "n problems"]
    length: Float[np.ndarray, " problems"]
    """The share of the step that is tried."""
    merit: Float[np.ndarray, " problems"]
    damping: Float[np.ndarray, " problems"]
    steps: Int[np.ndarray, " problems"]
    settled: Bool[np.ndarray, " problems"]
    going: Bool[np.ndarray, " problems"]


@dataclass(frozen=True)
class _Objective:
    rows: Rows
    prior: Prior
    parts: Parts

    def of(self, groups: Bool[np.ndarray, " problems"]) -> "_Objective":
        """Take some persons."""
        rows = groups[self.parts.part]
        measured = Rows(self.rows.angles[:, rows], self.rows.measured[:, rows], self.rows.active_effects.at(rows))
        parts = Parts(np.cumsum(groups)[self.parts.part[rows]] - 1, np.arange(groups.sum()))
        return replace(self, rows=measured, prior=take_problems(self.prior, groups), parts=parts)

    @cached_property
    def first_rows(self) -> Int[np.ndarray, " problems"]:
        """The first row of each person."""
        return np.searchsorted(self.parts.part, self.parts.group)

    @cached_property
    def alike(self) -> list[tuple[Int[np.ndarray, " some"], Int[np.ndarray, "some postures"]]]:
        """Persons with equally many postures, and the rows of each."""
        counts = np.bincount(self.parts.part, minlength=len(self.parts.group))
        starts = np.cumsum(counts) - counts
        every = [(np.flatnonzero(counts == count), count) for count in np.unique(counts).tolist()]
        return [(some, starts[some, None] + np.arange(count)) for some, count in every]

    def sums(self, values: Float[np.ndarray, "... rows"]) -> Float[np.ndarray, "... problems"]:
        """Add up the rows of each person."""
        return np.add.reduceat(values, self.first_rows, axis=-1)

    def largest(self, values: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " problems"]:
        """Find the largest of the rows of each person."""
        return np.maximum.reduceat(values, self.first_rows)

    def postures(self, u, angles, multipliers) -> Postures:
        """Lay out what the kernels take."""
        numbers, rows = self.prior.numbers_at(u)[:, self.parts.part], self.rows
        strengths = strengths_rows(rows.active_effects, len(self.parts.part))
        return Postures(numbers, strengths, angles, multipliers, rows.angles, rows.weights)

    def half_F(self, u, angles) -> Float[np.ndarray, " problems"]:
        """Compute F / 2 of angles, deg^2."""
        apart = (self.rows.weights * (angles - self.rows.angles) ** 2).sum(axis=0)
        return 0.5 * (self.sums(apart) + self.of_prior(u))

    def of_prior(self, u) -> Float[np.ndarray, " problems"]:
        """Compute sigma^2 |u|^2."""
        return self.prior.noise_deg**2 * (persons_first(u) ** 2).sum(axis=1)

    def in_u(self, at: Eliminated):
        """Turn what the rows add up to from numbers into u: slope, matrix and the slope at stationary postures."""
        row, column = _ENTRIES
        whole = np.empty((COUNT_OF_NUMBERS, COUNT_OF_NUMBERS, len(self.parts.group)))
        whole[row, column] = whole[column, row] = self.sums(at.matrix)
        root = persons_first(self.prior.root_mm)
        across = np.swapaxes(root, 1, 2)
        slopes = ((across @ persons_first(self.sums(one))[..., None])[..., 0].T for one in (at.slope, at.x_slope))
        return across @ persons_first(whole) @ root, *slopes


def most_probable(
    rows: Rows,
    part: Int[np.ndarray, " rows"],
    prior: Prior,
    u: Float[np.ndarray, "n problems"],
    angles: Float[np.ndarray, "6 rows"],
    most_steps: int = _MOST_STEPS,
) -> Posterior:
    """Find it of each person from u and ``angles`` (rad), in at most so many steps."""
    objective = _Objective(rows, prior, Parts(part, np.arange(len(prior.noise_deg))))
    of_rows, _, end = until_ended(objective, _first(objective, u, angles), _stepped, most_steps)
    numbers = prior.numbers_at(end.u)[:, part]
    near = nearest_by_numbers(numbers, rows.active_effects, rows.angles, rows.measured, of_rows.angles)
    tells = rows.measured.sum(axis=0) > FEWEST_ANGLES  # of others nothing is compared, wherever their search ends
    closed = objective.sums(np.abs(near.g_mm).max(axis=0) * tells) <= _CLOSED_MM
    F = objective.sums((near.y**2).sum(axis=0)) + objective.of_prior(end.u)
    closed &= np.isfinite(F)
    return Posterior(end.u, F, near, end.steps, closed, end.settled & closed)


class _Stage(NamedTuple):
    u: Float[np.ndarray, "n problems"]
    F: Float[np.ndarray, " problems"]
    damping: Float[np.ndarray, " problems"]
    going: Bool[np.ndarray, " problems"]


@dataclass(frozen=True)
class _Slack:
    """F of chains with a slack."""

    of_rigid: _Objective
    slack_mm: float

    @property
    def parts(self) -> Parts:
        """Whose the rows are."""
        return self.of_rigid.parts

    def of(self, groups: Bool[np.ndarray, " problems"]) -> "_Slack":
        """Take some persons."""
        return _Slack(self.of_rigid.of(groups), self.slack_mm)

    def at(self, u, start) -> tuple[Nearest, Float[np.ndarray, " problems"]]:
        """Find the nearest postures, and F."""
        rows, prior = self.of_rigid.rows, self.of_rigid.prior
        numbers = prior.numbers_at(u)[:, self.parts.part]
        measured = rows.active_effects, rows.angles, rows.measured
        near = nearest_by_numbers(numbers, *measured, start, _STAGE_NEAR, self.slack_mm)
        F = self.of_rigid.sums((near.y**2).sum(axis=0)) + self.of_rigid.of_prior(u)
        return near, np.where(np.isfinite(F), F, np.inf)

    def normal_equations(self, near: Nearest):
        """Compute sum y' y and sum y' y'^T over the rows of each person, slopes in u; persons first."""
        every = persons_first(np.concatenate([near.by_theta, near.y[:, None]], axis=1))
        root = persons_first(self.of_rigid.prior.root_mm)
        count, n = len(root), root.shape[2]
        gradient, matrix = np.empty((count, n)), np.empty((count, n, n))
        for some, rows in self.of_rigid.alike:  # not padded: with other numbers of rows BLAS adds up in another order
            own = every[rows].reshape(len(some), rows.shape[1] * every.shape[1], -1)
            slopes = own[:, :, :-1] @ root[some]
            across = np.swapaxes(slopes, 1, 2)
            gradient[some], matrix[some] = (across @ own[:, :, -1:])[..., 0], across @ slopes
        return gradient, matrix


def staged(
    rows: Rows, part: Int[np.ndarray, " rows"], prior: Prior, slacks_mm: Sequence[float]
) -> tuple[Float[np.ndarray, "n problems"], Float[np.ndarray, "6 rows"]]:
    """Go where chains with less and less slack lead to from the set and the measured angles: u and angles (rad)."""
    count = len(prior.noise_deg)
    objective = _Objective(rows, prior, Parts(part, np.arange(count)))
    u = np.zeros((prior.root_mm.shape[1], count))
    start = np.concatenate([rows.angles, np.zeros((3, rows.angles.shape[1]))])
    for slack_mm in slacks_mm:
        soft = _Slack(objective, slack_mm)
        near, F = soft.at(u, start)
        state = _Stage(u, F, np.full(count, _FIRST_DAMPING), np.isfinite(F))
        near, _, state = until_ended(soft, (near, (), state), _stage_step, _STEPS_A_STAGE)
        u, start = state.u, near.angles
    return u, start[:6]


def _stage_step(soft: _Slack, steps: Steps) -> Steps:
    near, _, own = steps
    variance = soft.of_rigid.prior.noise_deg**2
    gradient, matrix = soft.normal_equations(near)
    curvature = matrix + (variance * (1.0 + own.damping))[:, None, None] * np.eye(len(own.u))
    slope = gradient + (variance * own.u).T
    u = own.u - np.linalg.solve(curvature, slope[..., None])[..., 0].T
    tried, F = soft.at(u, near.angles)
    better = (F <= own.F) & own.going
    ended = better & (own.F - F <= _STAGE_GAIN * own.F)
    damping = np.where(better, _LESS * own.damping, np.clip(_MORE * own.damping, 1.0, _MOST))
    state = _Stage(np.where(better, u, own.u), np.where(better, F, own.F), damping, own.going & ~ended)
    return where_problems(better[soft.parts.part], tried, near), (), state


def _first(objective: _Objective, u, angles) -> Steps:
    """A point to be accepted, whatever it is like."""
    (n, count), rows = u.shape, angles.shape[1]
    no_angles, none, never = np.zeros((6, rows)), np.zeros((3, rows)), np.zeros(count, bool)
    of_rows = _OfRows(angles, none, no_angles, none, none, none)
    ones = np.ones(count)
    groups = _OfGroups(
        u, np.zeros((n, count)), ones, np.inf * ones, _FIRST_DAMPING * ones, np.zeros(count, int), never, ~never
    )
    return of_rows, (), groups


def _stepped(objective: _Objective, steps: Steps) -> Steps:
    """Try the step of every person: accept its end and find the next step there, or come back part of the way."""
    (of_rows, _, own), part, effects = steps, objective.parts.part, objective.rows.active_effects.effects
    u = own.u + own.length * own.du
    angles, multipliers = (
        of_rows.angles + own.length[part] * of_rows.dq,
        of_rows.multipliers + own.length[part] * of_rows.change,
    )
    at = objective.postures(u, angles, multipliers)
    half_F = objective.half_F(u, angles)
    merit = half_F + objective.sums(_augmented(of_rows.target, of_rows.stiffness, violations_mm(effects, at)))
    good = (merit <= own.merit + _ROUNDING * (1.0 + np.abs(own.merit))) | (own.length < _HARDLY) & np.isfinite(merit)
    good &= own.going
    refused = own._replace(length=np.where(own.going, _SHORTER * own.length, own.length), steps=own.steps + own.going)
    if not good.any():
        return of_rows, (), refused
    some, mine = objective.of(good), good[part]
    rows_there, groups_there = _accepted(
        some, take_problems((u, own.length, own.damping, own.steps, half_F), good), take_problems(at, mine)
    )
    return with_problems(of_rows, mine, rows_there), (), with_problems(refused, good, groups_there)


def _accepted(objective: _Objective, groups, at: Postures) -> tuple[_OfRows, _OfGroups]:
    """The step from these points."""
    u, length, damping, steps, half_F = groups
    effects, part, variance = objective.rows.active_effects.effects, objective.parts.part, objective.prior.noise_deg**2
    found = eliminate(effects, at)
    matrix, slope, slope_there = objective.in_u(found)
    # where a posture cannot be eliminated: the end of this person, and of nobody else
    finite = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(slope).all(axis=0)
    matrix, slope = np.where(np.reshape(finite, (-1, 1, 1)), matrix, 0.0), np.where(finite, slope, 0.0)
    more, less = np.clip(_MORE * damping, _LEAST, _MOST), _LESS * damping * (damping > _LEAST)
    damping = np.where(length < 1.0, more, less)
    du = _lowest(matrix, slope + variance * u, variance, damping)
    dq, target = found.at(objective.prior.moved_mm(du)[:, part])
    new = _OfRows(at.angles, at.multipliers, dq, target - at.multipliers, target, found.stiffness)
    longest = objective.largest(np.abs(dq).max(axis=0))
    merit = half_F + objective.sums(_augmented(target, found.stiffness, found.g_mm))
    settled = np.abs(slope_there + variance * u).max(axis=0) <= _FLAT * variance
    worst = np.maximum(np.abs(found.g_mm).max(axis=0) / _CLOSED_MM, found.unstationary / (float(DEG) * _STILL_DEG))
    settled &= objective.largest(worst) <= 1.0
    shortened = np.minimum(1.0, STEP_LIMIT_RAD / np.maximum(longest, 1e-9))
    return new, _OfGroups(u, du, shortened, merit, damping, steps + 1, settled, ~settled & finite)


def _lowest(matrix, slope, variance, damping) -> Float[np.ndarray, "n problems"]:
    """The lowest point of the damped model; where it is concave along a direction, as far down as if it were convex."""
    n = matrix.shape[1]
    curvature = matrix + (variance * (1.0 + damping))[:, None, None] * np.eye(n)
    du = -_solved(curvature, slope.T)
    concave = np.flatnonzero(~_definite(curvature))
    if len(concave):
        values, vectors = np.linalg.eigh(curvature[concave])
        steepness = np.maximum(np.abs(values), variance[concave, None])
        along = np.einsum("pij,ip->pj", vectors, slope[:, concave]) / steepness
        du[concave] = -np.einsum("pij,pj->pi", vectors, along)
    return du.T


def _solved(matrices: Float[np.ndarray, "problems n n"], b: Float[np.ndarray, "problems n"]):
    """Solve each system; one that is singular to rounding, with the least |x|."""
    try:
        return np.linalg.solve(matrices, b[..., None])[..., 0]
    except np.linalg.LinAlgError:
        if len(matrices) > 1:  # the others as they would be without it
            return np.concatenate([_solved(matrices[k : k + 1], b[k : k + 1]) for k in range(len(matrices))])
        return (np.linalg.pinv(matrices, hermitian=True) @ b[..., None])[..., 0]


def _definite(matrices: Float[np.ndarray, "problems n n"]) -> Bool[np.ndarray, " problems"]:
    """Which are positive definite."""
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        return np.linalg.eigvalsh(matrices)[:, 0] > 0.0
    return np.ones(len(matrices), bool)


def _augmented(target, stiffness, g_mm) -> Float[np.ndarray, " rows"]:
    """lambda'g + 1/2 g' s g."""
    return ((target + 0.5 * stiffness * g_mm) * g_mm).sum(axis=0)
