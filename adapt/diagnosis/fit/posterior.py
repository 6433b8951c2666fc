"""Posterior modes of sets of causes, found by damped Gauss-Newton steps within the bounds.

The mode of theta, h, b and a (``fit.evidence``) has amplitudes that all shoulders share. The model is linearised there
(Laplace approximation), and in the linear model each shoulder has subject-level amplitudes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.evidence import Evidence
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.engine.batching import where_problems
from adapt.solvers.projection.bounded_step import lowest
from adapt.solvers.projection.damped_steps import STUCK, Damping, Steps, until_ended
from adapt.solvers.projection.gauss_newton import Objective, cost_of_open_chains, newly_open
from adapt.solvers.projection.nearest_posture import Nearest
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_MOST_STEPS = 300
"""Maximum number of steps: most modes take 20 to 60, more in long, curved ridges."""

_ENOUGH = 0.02
"""Convergence tolerance: decrease of -2 log p in a step, a hundredth of a nat. At a tolerance of 0.5, searches ended up
to one nat away from the mode, and rounding errors decided which cause was named."""

_DAMPING = Damping(less=0.25, more=8.0, least=1e-3, least_after_failure=0.01, hopeless=1e3)

_NEAR = 1e-4
"""Convergence tolerance of nearest postures: movement by a projection, in SDs. A coarse tolerance is enough,
because ``|y|^2`` is stationary at the nearest posture."""


@dataclass(frozen=True)
class Posterior:
    """Posterior mode of one hypothesis, with the linear model there."""

    hypothesis: Hypothesis
    theta_mm: Float[np.ndarray, "subjects adapted"]
    amplitude: Float[np.ndarray, " own"]
    y: Float[np.ndarray, "rows 3"]
    Z: Float[np.ndarray, "rows 3 n"]
    """Derivatives of y with respect to the adapted parameters and the amplitudes of all candidates."""
    evidence: Evidence
    by_belief: tuple[Evidence, ...] = ()
    """Evidence with each belief about the unexplained part, in the same linear model."""


def modes(
    joint: JointFit,
    likelihood: Likelihood,
    hypotheses: Sequence[Hypothesis],
    thetas_mm: Sequence[Float[np.ndarray, "subjects adapted"]],
    amplitudes: Sequence[Float[np.ndarray, " own"]],
    beliefs: Sequence[Likelihood] = (),
) -> list[Posterior]:
    """Find the modes of a batch of hypotheses, each from its own starting point; ``joint`` has all subjects in one
    group."""
    objective = joint.objective(hypotheses)
    a = np.zeros((max(map(len, amplitudes)), len(hypotheses)))
    for group, own in enumerate(amplitudes):
        a[: len(own), group] = own
    by_positions = _by_positions(joint, likelihood, hypotheses), _added(joint, likelihood, hypotheses)
    first = _begin(likelihood, objective, np.concatenate(thetas_mm).T, a, *by_positions)
    near, theta, mode = until_ended(objective, first, partial(_stepped, likelihood), _MOST_STEPS)
    near = objective.with_whole_slopes(theta, mode.a, near)
    every = np.arange(len(joint.candidates.scale))
    distinct = {id(one): one for one in (likelihood, *beliefs)}.values()  # likelihood is mostly one of the beliefs
    in_order, thetas = np.argsort(joint.rows), _by_group(theta, mode)
    found = []
    for group, hypothesis in enumerate(hypotheses):
        y, by_theta, by_channel = (
            _rows_first(one, mode)[group, in_order] for one in (near.y[:, None], near.by_theta, near.by_channel)
        )
        Z = np.concatenate([by_theta, joint.candidates.by_amplitude(by_channel)], axis=2)
        own = mode.a[: len(amplitudes[group]), group]
        here = joint.candidates.among_all(hypothesis, own)
        by_likelihood = {id(one): one.evidence(thetas[group], y[..., 0], Z, every, here) for one in distinct}
        evidence, *others = (by_likelihood[id(one)] for one in (likelihood, *beliefs))
        found.append(Posterior(hypothesis, thetas[group], own, y[..., 0], Z, evidence, tuple(others)))
    return found


def _by_positions(
    joint: JointFit, likelihood: Likelihood, hypotheses: Sequence[Hypothesis]
) -> Float[np.ndarray, "own+1 own+1 groups"]:
    """Compute Q of each hypothesis from the positions (``Evidence.of_amplitudes``); 0 without positions."""
    places = [joint.candidates.where(one) for one in hypotheses]
    most = max(map(len, places))
    found = np.zeros((most + 1, most + 1, len(places)))
    if likelihood.positions is None:
        return found
    for group, where in enumerate(places):
        own = np.append(np.arange(len(where)), most)
        mean, scale = joint.candidates.mean[where], joint.candidates.scale[where]
        found[own[:, None], own, group] = likelihood.positions.only(where).of_amplitudes(mean, scale)
    return found


def _added(
    joint: JointFit, likelihood: Likelihood, hypotheses: Sequence[Hypothesis]
) -> Float[np.ndarray, "rows 3 own+1 groups"]:
    """Lay out the terms that positions add to y (``ShownNoise.added``) per hypothesis; else one row of 0."""
    places = [joint.candidates.where(one) for one in hypotheses]
    most = max(map(len, places))
    if likelihood.shown is None:
        return np.zeros((1, 3, most + 1, len(places)))
    found = np.zeros((len(joint.rows), 3, most + 1, len(places)))
    for group, where in enumerate(places):
        found[:, :, np.append(np.arange(len(where)), most), group] = likelihood.shown.of(where)[joint.rows]
    return found


class _OfGroups(NamedTuple):
    """State of the iteration of each hypothesis, beside the adapted parameters of its problems."""

    a: Float[np.ndarray, "own groups"]
    f: Float[np.ndarray, "factors groups"]
    """Shared factors h and b."""
    by_positions: Float[np.ndarray, "own+1 own+1 groups"]
    """Quadratic form Q of a given the positions."""
    added: Float[np.ndarray, "rows 3 own+1 groups"]
    """Terms that positions add to y: one per amplitude, and a constant."""
    total: Float[np.ndarray, " groups"]
    """-2 log p."""
    damping: Float[np.ndarray, " groups"]
    going: Bool[np.ndarray, " groups"]


def _begin(likelihood: Likelihood, objective: Objective, theta, a, by_positions, added) -> Steps:
    """Evaluate the starting point, clipped to the bounds."""
    theta, groups = np.clip(theta, *objective.problems.bounds_mm), a.shape[1]
    nowhere, f = np.full(groups, np.inf), np.zeros((likelihood.shared, groups))
    first = _OfGroups(a, f, by_positions, added, nowhere, np.zeros(groups), np.ones(groups, bool))
    near, total = _at(likelihood, objective, theta, first, None)
    return (near, theta, first._replace(total=total))


def _stepped(likelihood: Likelihood, objective: Objective, steps: Steps) -> Steps:
    """Take a step in every unfinished group if -2 log p does not rise and no chain opens; increase the damping of the
    other groups."""
    problems, shared, (near, theta, now) = objective.problems, objective.shared, steps
    gradient, undamped = _quadratic(likelihood, objective, steps)
    matrix = undamped.copy()
    np.einsum("iip->ip", matrix)[:] *= 1.0 + now.damping[problems.group]
    (lower, upper), factors = problems.bounds_mm, len(now.f)
    precision = np.concatenate([np.ones(now.f.shape), 1.0 / shared.scale**2])
    prior_gradient = precision * np.concatenate([now.f, now.a - shared.mean])
    prior_matrix = np.eye(len(precision))[..., None] * precision
    prior_matrix[factors:, factors:] += now.by_positions[:-1, :-1]
    prior_gradient[factors:] += np.einsum("ijg,jg->ig", now.by_positions[:-1], _and_1(now.a))
    dtheta, d = lowest(gradient, matrix, problems.group, prior_gradient, prior_matrix, (lower - theta, upper - theta))
    every = np.concatenate([dtheta, d[:, problems.group]])
    expected = np.bincount(problems.group, _decrease(gradient, undamped, every), len(now.total))
    expected += _decrease(prior_gradient, prior_matrix, d)
    tried = now._replace(f=now.f + d[:factors], a=now.a + d[factors:])
    there, total = _at(likelihood, objective, theta + dtheta, tried, near.angles)
    opened = np.bincount(problems.group[problems.problem], newly_open(near, there), len(total)) > 0
    better = now.going & (total <= now.total) & ~opened
    share = np.where(better, now.total - total, 0.0) / np.where(expected > 0.0, expected, 1.0)
    damping = _DAMPING.after(now.damping, better, share)
    ended = better & (now.total - total < _ENOUGH) & (now.damping < STUCK)
    taken = better[problems.group]
    return (
        where_problems(taken[problems.problem], there, near),
        np.where(taken, theta + dtheta, theta),
        where_problems(better, tried._replace(total=total), now)._replace(
            damping=damping, going=now.going & ~ended & (damping < _DAMPING.hopeless)
        ),
    )


def _at(
    likelihood: Likelihood, objective: Objective, theta, at: _OfGroups, start
) -> tuple[Nearest, Float[np.ndarray, " groups"]]:
    """Compute the nearest postures, and -2 log p of every group."""
    near, problems, shared = objective.nearest(theta, at.a, start, _NEAR), objective.problems, objective.shared
    total = (((at.a - shared.mean) / shared.scale) ** 2).sum(axis=0) + (at.f**2).sum(axis=0)
    total += np.bincount(problems.group[problems.problem], cost_of_open_chains(near), len(total))
    total += np.einsum("ig,ijg,jg->g", _and_1(at.a), at.by_positions, _and_1(at.a))
    white = likelihood.values(_y_beside_positions(near, at), _by_group(theta, at), at.f.T)
    total += sum((one**2).reshape(len(total), -1).sum(axis=1) for one in white)
    return near, np.where(np.isfinite(total), total, np.inf)


def _y_beside_positions(near: Nearest, at: _OfGroups) -> Float[np.ndarray, "groups rows 3"]:
    return _rows_first(near.y[:, None], at)[..., 0] + np.einsum("rckg,kg->grc", at.added, _and_1(at.a))


def _and_1(a: Float[np.ndarray, "own groups"]) -> Float[np.ndarray, "own+1 groups"]:
    return np.concatenate([a, np.ones((1, a.shape[1]))])


def _quadratic(likelihood: Likelihood, objective: Objective, steps: Steps) -> tuple[np.ndarray, np.ndarray]:
    """Compute gradient and Gauss-Newton matrix of -log p of every problem in theta, f and a, without the priors of f
    and a and the quadratic form of a given the positions."""
    near, theta, at = steps
    near = objective.with_whole_slopes(theta, at.a, near)
    slopes = np.concatenate([near.by_theta, objective.by_amplitude(near)], axis=1)
    slopes = _rows_first(slopes, at)
    slopes[..., _N:] += np.moveaxis(at.added[:, :, :-1], 3, 0)
    M = likelihood.quadratic(_y_beside_positions(near, at), slopes, _by_group(theta, at), at.f.T)
    every = np.moveaxis(M.reshape(-1, *M.shape[2:]), 0, -1)
    return every[:-1, -1], every[:-1, :-1]


def _decrease(
    gradient: Float[np.ndarray, "n every"], matrix: Float[np.ndarray, "n n every"], d: Float[np.ndarray, "n every"]
) -> Float[np.ndarray, " every"]:
    """Compute the decrease of -2 log p along d from the gradient and matrix of -log p."""
    return -(d * (2.0 * gradient + np.einsum("ijp,jp->ip", matrix, d))).sum(axis=0)


def _rows_first(x: Float[np.ndarray, "3 n every"], at: _OfGroups) -> Float[np.ndarray, "groups rows 3 n"]:
    """Split the rows by group, and move them before the components."""
    return np.moveaxis(x.reshape(*x.shape[:2], len(at.total), -1), (0, 1), (2, 3))


def _by_group(
    theta: Float[np.ndarray, "adapted problems"], at: _OfGroups
) -> Float[np.ndarray, "groups subjects adapted"]:
    """Split the parameters by group."""
    return theta.T.reshape(len(at.total), -1, _N)
