"""Posterior mode of the girdle of each person, given measured postures and the variation between people.

With noise of SD sigma in every measured angle and a person's sizes z ~ N(0, 1) (``models.person.own_bones``)

    -2 log p(z | angles) = sum over measured angles of (q - s)^2 / sigma^2 + |z|^2 + constant,

where q are the closed postures nearest to the measured postures s. The search minimises sigma^2 times this,

    F(u) = sum (q - s)^2 + sigma^2 |u|^2,     g(q, x) = 0,   chain's numbers x = x_0 + R u,   R R' = sum c c',

over as many u as the chain can distinguish: sizes that move the same numbers are fitted together. There are no bounds:
the prior limits the directions that the angles do not determine.

F has long curved ridges: with a conoid that hardly turns with the bones, 0.1 mm of A3 is worth degrees. So the
constraints first have a slack, as ligaments and soft tissue do. The slack decreases in stages of damped Gauss-Newton
steps at the nearest postures (``projection.nearest_posture``). At last the chain is rigid: Newton steps in u and all
postures at once, with each posture eliminated (``own_bones.posture_steps``) and backtracking on the augmented
Lagrangian as in ``adapt.solvers.newton.subject``.
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
"""SDs (mm) of the constraints' slack in the stages of each start; the angles have an SD of one degree. For six bone-pin
shoulders with five sets F has two or three local minima; each start leads to the lowest in 22 to 25 of the 30 cases."""

_STEPS_A_STAGE, _STAGE_GAIN = 8, 1e-2
"""Largest number of steps in a stage, and the relative decrease of F below which the stage ends."""

_STAGE_NEAR = 1e-6
"""Tolerance of the nearest postures in a stage: the last projection moves them by less than this number of SDs."""

_MOST_STEPS = 320
"""Largest number of steps with the rigid chain. Most searches take 4 to 20 steps; the longest search that reached the
lowest minimum took 319."""

_FLAT = 1e-6
"""Tolerance of |dF/du| at convergence, relative to sigma^2. The prior alone gives F a curvature of the order of
sigma^2, so u is at most 1e-6 SDs from the optimum and F is 1e-12 sigma^2 above its minimum."""

_CLOSED_MM, _STILL_DEG = 1e-7, 1e-6
"""Tolerances at convergence: constraint violation, and stationarity of the postures. The postures are then refitted."""

_SHORTER, _HARDLY = 0.3, 0.02
"""Factor on the length of a rejected step, and the length below which a step is accepted in any case."""

_ROUNDING = 1e-12
"""Relative rounding error of the merit function."""

_FIRST_DAMPING, _LESS, _MORE, _LEAST, _MOST = 10.0, 0.3, 10.0, 1e-3, 1e3
"""Damping of a step in u, relative to the prior's curvature: first value, factors after a full and after a shortened
step, lower and upper limit. Damping below the lower limit becomes 0. Damping above the upper limit would stop u while
the postures are still far from their optimum."""


_ENTRIES = np.tril_indices(COUNT_OF_NUMBERS)
"""Rows and columns of the entries in ``Eliminated.matrix``."""


class Rows(NamedTuple):
    """Measured postures of all persons, ordered by person."""

    angles: Float[np.ndarray, "6 rows"]
    """Measured angles, rad."""
    measured: Bool[np.ndarray, "6 rows"]
    active_effects: ActiveEffects

    @property
    def weights(self) -> Float[np.ndarray, "6 rows"]:
        """Weights W of the squared differences (rad^2), so that F / 2 is in deg^2."""
        return sd_rad(self.measured, UNMEASURED_SD) ** -2.0


class ProblemOfRows(NamedTuple):
    """Problem of each row. A problem is one person, and a group of its own in the damped steps."""

    problem: Int[np.ndarray, " rows"]
    group: Int[np.ndarray, " problems"]


class Prior(NamedTuple):
    """Prior of each person's girdle."""

    numbers_mm: Float[np.ndarray, "numbers problems"]
    """Prior mean x_0, with SC at 0 (``of_chain``)."""
    root_mm: Float[np.ndarray, "numbers n problems"]
    """Root R of the prior covariance."""
    noise_deg: Float[np.ndarray, " problems"]
    """SD sigma of the noise in a measured angle."""

    def numbers_at(self, u: Float[np.ndarray, "n problems"]) -> Float[np.ndarray, "numbers problems"]:
        """Return the chain's numbers x at u."""
        return self.numbers_mm + self.moved_mm(u)

    def moved_mm(self, u: Float[np.ndarray, "n problems"]) -> Float[np.ndarray, "numbers problems"]:
        """Return R u, the change of the chain's numbers."""
        return (persons_first(self.root_mm) @ persons_first(u)[..., None])[..., 0].T

    def u_of(self, numbers_mm: Float[np.ndarray, "numbers problems"]) -> Float[np.ndarray, "n problems"]:
        """Find the u whose numbers are nearest to those given. The columns of R are orthogonal, and some are 0."""
        squares = (self.root_mm**2).sum(axis=0)
        along = np.einsum("kup,kp->up", self.root_mm, numbers_mm - self.numbers_mm)
        return along / np.where(squares > 0.0, squares, np.inf)


class Posterior(NamedTuple):
    """Posterior mode of each problem, or the last point of its search."""

    u: Float[np.ndarray, "n problems"]
    F: Float[np.ndarray, " problems"]
    """Objective, deg^2."""
    nearest: Nearest
    """Nearest postures, with slopes in the numbers of the girdle."""
    steps: Int[np.ndarray, " problems"]
    closed: Bool[np.ndarray, " problems"]
    """True where the chain is closed in every posture with more than three measured angles."""
    settled: Bool[np.ndarray, " problems"]
    """True where the chain is closed and F is stationary."""


def of_problems(rows: Rows, problem: Int[np.ndarray, " rows"], problems) -> tuple[Rows, Int[np.ndarray, " some"]]:
    """Select the rows of ``problems``, which may repeat; also return the position in ``problems`` of each row."""
    at, number = _places(problem, problems)
    return Rows(rows.angles[:, at], rows.measured[:, at], rows.active_effects.at(at)), number


def take_found(found: Posterior, problem: Int[np.ndarray, " rows"], problems: Int[np.ndarray, " some"]) -> Posterior:
    """Select the posterior modes of ``problems``."""
    nearest = take_problems(found.nearest, _places(problem, problems)[0])
    return take_problems(found._replace(nearest=()), problems)._replace(nearest=nearest)


def _places(problem: Int[np.ndarray, " rows"], problems: Int[np.ndarray, " some"]):
    """Find the row indices of ``problems``, problem by problem, and the position in ``problems`` of each row."""
    first = np.searchsorted(problem, problems)
    counts = np.searchsorted(problem, problems, side="right") - first
    number = np.repeat(np.arange(len(problems)), counts)
    return np.arange(len(number)) + (first - (np.cumsum(counts) - counts))[number], number


class _OfRows(NamedTuple):
    """Last accepted point of each posture, and the step from there."""

    angles: Float[np.ndarray, "6 rows"]
    multipliers: Float[np.ndarray, "3 rows"]
    dq: Float[np.ndarray, "6 rows"]
    change: Float[np.ndarray, "3 rows"]
    target: Float[np.ndarray, "3 rows"]
    """Multipliers at the end of the full step; the merit function uses them."""
    stiffness: Float[np.ndarray, "3 rows"]


class _OfGroups(NamedTuple):
    u: Float[np.ndarray, "n problems"]
    du: Float[np.ndarray, "n problems"]
    length: Float[np.ndarray, " problems"]
    """Fraction of the step that is tried."""
    merit: Float[np.ndarray, " problems"]
    damping: Float[np.ndarray, " problems"]
    steps: Int[np.ndarray, " problems"]
    settled: Bool[np.ndarray, " problems"]
    going: Bool[np.ndarray, " problems"]


@dataclass(frozen=True)
class _Objective:
    rows: Rows
    prior: Prior
    problems: ProblemOfRows

    def of(self, groups: Bool[np.ndarray, " problems"]) -> "_Objective":
        """Select some persons."""
        rows = groups[self.problems.problem]
        measured = Rows(self.rows.angles[:, rows], self.rows.measured[:, rows], self.rows.active_effects.at(rows))
        problems = ProblemOfRows(np.cumsum(groups)[self.problems.problem[rows]] - 1, np.arange(groups.sum()))
        return replace(self, rows=measured, prior=take_problems(self.prior, groups), problems=problems)

    @cached_property
    def first_rows(self) -> Int[np.ndarray, " problems"]:
        """Index of the first row of each person."""
        return np.searchsorted(self.problems.problem, self.problems.group)

    @cached_property
    def alike(self) -> list[tuple[Int[np.ndarray, " some"], Int[np.ndarray, "some postures"]]]:
        """Groups of persons with equal numbers of postures, and the row indices of each person."""
        counts = np.bincount(self.problems.problem, minlength=len(self.problems.group))
        starts = np.cumsum(counts) - counts
        every = [(np.flatnonzero(counts == count), count) for count in np.unique(counts).tolist()]
        return [(some, starts[some, None] + np.arange(count)) for some, count in every]

    def sums(self, values: Float[np.ndarray, "... rows"]) -> Float[np.ndarray, "... problems"]:
        """Sum the rows of each person."""
        return np.add.reduceat(values, self.first_rows, axis=-1)

    def largest(self, values: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " problems"]:
        """Return the maximum over the rows of each person."""
        return np.maximum.reduceat(values, self.first_rows)

    def postures(self, u, angles, multipliers) -> Postures:
        """Assemble the arguments of the kernels."""
        numbers, rows = self.prior.numbers_at(u)[:, self.problems.problem], self.rows
        strengths = strengths_rows(rows.active_effects, len(self.problems.problem))
        return Postures(numbers, strengths, angles, multipliers, rows.angles, rows.weights)

    def half_F(self, u, angles) -> Float[np.ndarray, " problems"]:
        """Compute F / 2 (deg^2) at u and ``angles``."""
        apart = (self.rows.weights * (angles - self.rows.angles) ** 2).sum(axis=0)
        return 0.5 * (self.sums(apart) + self.of_prior(u))

    def of_prior(self, u) -> Float[np.ndarray, " problems"]:
        """Compute the prior's share of F, sigma^2 |u|^2."""
        return self.prior.noise_deg**2 * (persons_first(u) ** 2).sum(axis=1)

    def in_u(self, at: Eliminated):
        """Sum the rows of each person in terms of u: matrix, gradient, and gradient at stationary postures."""
        row, column = _ENTRIES
        whole = np.empty((COUNT_OF_NUMBERS, COUNT_OF_NUMBERS, len(self.problems.group)))
        whole[row, column] = whole[column, row] = self.sums(at.matrix)
        root = persons_first(self.prior.root_mm)
        across = np.swapaxes(root, 1, 2)
        slopes = ((across @ persons_first(self.sums(one))[..., None])[..., 0].T for one in (at.slope, at.x_slope))
        return across @ persons_first(whole) @ root, *slopes


def most_probable(
    rows: Rows,
    problem: Int[np.ndarray, " rows"],
    prior: Prior,
    u: Float[np.ndarray, "n problems"],
    angles: Float[np.ndarray, "6 rows"],
    most_steps: int = _MOST_STEPS,
) -> Posterior:
    """Find the posterior mode of each person from the starting point u and ``angles`` (rad)."""
    objective = _Objective(rows, prior, ProblemOfRows(problem, np.arange(len(prior.noise_deg))))
    of_rows, _, end = until_ended(objective, _first(objective, u, angles), _stepped, most_steps)
    numbers = prior.numbers_at(end.u)[:, problem]
    near = nearest_by_numbers(numbers, rows.active_effects, rows.angles, rows.measured, of_rows.angles)
    tells = rows.measured.sum(axis=0) > FEWEST_ANGLES  # three angles or fewer leave no residual: the chain may be open
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
    """Objective F of chains whose constraints have a slack."""

    of_rigid: _Objective
    slack_mm: float

    @property
    def problems(self) -> ProblemOfRows:
        """Problem of each row."""
        return self.of_rigid.problems

    def of(self, groups: Bool[np.ndarray, " problems"]) -> "_Slack":
        """Select some persons."""
        return _Slack(self.of_rigid.of(groups), self.slack_mm)

    def at(self, u, start) -> tuple[Nearest, Float[np.ndarray, " problems"]]:
        """Find the nearest postures and compute F, infinite where undefined."""
        rows, prior = self.of_rigid.rows, self.of_rigid.prior
        numbers = prior.numbers_at(u)[:, self.problems.problem]
        measured = rows.active_effects, rows.angles, rows.measured
        near = nearest_by_numbers(numbers, *measured, start, _STAGE_NEAR, self.slack_mm)
        F = self.of_rigid.sums((near.y**2).sum(axis=0)) + self.of_rigid.of_prior(u)
        return near, np.where(np.isfinite(F), F, np.inf)

    def normal_equations(self, near: Nearest):
        """Compute sum y' y and sum y' y'^T over the rows of each person, y' the Jacobian in u; persons first."""
        every = persons_first(np.concatenate([near.by_theta, near.y[:, None]], axis=1))
        root = persons_first(self.of_rigid.prior.root_mm)
        count, n = len(root), root.shape[2]
        gradient, matrix = np.empty((count, n)), np.empty((count, n, n))
        for some, rows in self.of_rigid.alike:  # no padding: it would change the order in which BLAS sums
            own = every[rows].reshape(len(some), rows.shape[1] * every.shape[1], -1)
            slopes = own[:, :, :-1] @ root[some]
            across = np.swapaxes(slopes, 1, 2)
            gradient[some], matrix[some] = (across @ own[:, :, -1:])[..., 0], across @ slopes
        return gradient, matrix


def staged(
    rows: Rows, problem: Int[np.ndarray, " rows"], prior: Prior, slacks_mm: Sequence[float]
) -> tuple[Float[np.ndarray, "n problems"], Float[np.ndarray, "6 rows"]]:
    """Find a starting point u and angles (rad), from the set and the measured angles, by stages of decreasing slack."""
    count = len(prior.noise_deg)
    objective = _Objective(rows, prior, ProblemOfRows(problem, np.arange(count)))
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
    return where_problems(better[soft.problems.problem], tried, near), (), state


def _first(objective: _Objective, u, angles) -> Steps:
    """Create the state of the starting point, which is always accepted because its merit is infinite."""
    (n, count), rows = u.shape, angles.shape[1]
    no_angles, none, never = np.zeros((6, rows)), np.zeros((3, rows)), np.zeros(count, bool)
    of_rows = _OfRows(angles, none, no_angles, none, none, none)
    ones = np.ones(count)
    groups = _OfGroups(
        u, np.zeros((n, count)), ones, np.inf * ones, _FIRST_DAMPING * ones, np.zeros(count, int), never, ~never
    )
    return of_rows, (), groups


def _stepped(objective: _Objective, steps: Steps) -> Steps:
    """Try the step of every person: accept it and compute the next step from its end, or shorten it."""
    (of_rows, _, own), problem, effects = steps, objective.problems.problem, objective.rows.active_effects.effects
    u = own.u + own.length * own.du
    angles, multipliers = (
        of_rows.angles + own.length[problem] * of_rows.dq,
        of_rows.multipliers + own.length[problem] * of_rows.change,
    )
    at = objective.postures(u, angles, multipliers)
    half_F = objective.half_F(u, angles)
    merit = half_F + objective.sums(_augmented(of_rows.target, of_rows.stiffness, violations_mm(effects, at)))
    good = (merit <= own.merit + _ROUNDING * (1.0 + np.abs(own.merit))) | (own.length < _HARDLY) & np.isfinite(merit)
    good &= own.going
    refused = own._replace(length=np.where(own.going, _SHORTER * own.length, own.length), steps=own.steps + own.going)
    if not good.any():
        return of_rows, (), refused
    some, mine = objective.of(good), good[problem]
    rows_there, groups_there = _accepted(
        some, take_problems((u, own.length, own.damping, own.steps, half_F), good), take_problems(at, mine)
    )
    return with_problems(of_rows, mine, rows_there), (), with_problems(refused, good, groups_there)


def _accepted(objective: _Objective, groups, at: Postures) -> tuple[_OfRows, _OfGroups]:
    """Compute the next step from accepted points."""
    u, length, damping, steps, half_F = groups
    effects, problem, variance = (
        objective.rows.active_effects.effects,
        objective.problems.problem,
        objective.prior.noise_deg**2,
    )
    found = eliminate(effects, at)
    matrix, slope, slope_there = objective.in_u(found)
    # a posture that cannot be eliminated ends the search of its own person only
    finite = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(slope).all(axis=0)
    matrix, slope = np.where(np.reshape(finite, (-1, 1, 1)), matrix, 0.0), np.where(finite, slope, 0.0)
    more, less = np.clip(_MORE * damping, _LEAST, _MOST), _LESS * damping * (damping > _LEAST)
    damping = np.where(length < 1.0, more, less)
    du = _lowest(matrix, slope + variance * u, variance, damping)
    dq, target = found.at(objective.prior.moved_mm(du)[:, problem])
    new = _OfRows(at.angles, at.multipliers, dq, target - at.multipliers, target, found.stiffness)
    longest = objective.largest(np.abs(dq).max(axis=0))
    merit = half_F + objective.sums(_augmented(target, found.stiffness, found.g_mm))
    settled = np.abs(slope_there + variance * u).max(axis=0) <= _FLAT * variance
    worst = np.maximum(np.abs(found.g_mm).max(axis=0) / _CLOSED_MM, found.unstationary / (float(DEG) * _STILL_DEG))
    settled &= objective.largest(worst) <= 1.0
    shortened = np.minimum(1.0, STEP_LIMIT_RAD / np.maximum(longest, 1e-9))
    return new, _OfGroups(u, du, shortened, merit, damping, steps + 1, settled, ~settled & finite)


def _lowest(matrix, slope, variance, damping) -> Float[np.ndarray, "n problems"]:
    """Compute the step to the minimum of the damped model; negative curvature counts by its absolute value."""
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
    """Solve each system; a numerically singular system gets the solution with the least |x|."""
    try:
        return np.linalg.solve(matrices, b[..., None])[..., 0]
    except np.linalg.LinAlgError:
        if len(matrices) > 1:  # one by one, so that the other solutions do not depend on the singular one
            return np.concatenate([_solved(matrices[k : k + 1], b[k : k + 1]) for k in range(len(matrices))])
        return (np.linalg.pinv(matrices, hermitian=True) @ b[..., None])[..., 0]


def _definite(matrices: Float[np.ndarray, "problems n n"]) -> Bool[np.ndarray, " problems"]:
    """Test which matrices are positive definite."""
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        return np.linalg.eigvalsh(matrices)[:, 0] > 0.0
    return np.ones(len(matrices), bool)


def _augmented(target, stiffness, g_mm) -> Float[np.ndarray, " rows"]:
    """Compute lambda'g + 1/2 g' s g per posture."""
    return ((target + 0.5 * stiffness * g_mm) * g_mm).sum(axis=0)
