"""The posterior mode of sets of causes, by damped Gauss-Newton steps within the bounds; and of the discrepancy.

At the mode of theta, h, b and a (``fit.evidence``) with amplitudes that all shoulders share the model is taken for
linear (Laplace), and there each shoulder has its own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.discrepancy import LOG_SD, TYPICAL, Discrepancy
from adapt.diagnosis.fit.evidence import Evidence, Likelihood
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.solvers.extended.arrow_step import Quadratic, lowest, times
from adapt.solvers.extended.gauss_newton import FEW, Objective, cost_of_open_chains, put
from adapt.solvers.extended.nearest_posture import Nearest
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_MOST_STEPS = 60

_ENOUGH = 0.5
"""Decrease of -2 log p in a step at which a mode is found: a quarter of a nat."""

_LESS, _MORE, _NONE, _LEAST_AFTER_FAILURE, _HOPELESS = 0.25, 8.0, 1e-3, 0.01, 1e3
"""Damping after a step down and up, what is taken for 0, the least after a step up, and that without a way down."""

_STUCK = 0.1
"""A step with more damping than this is short because it must be, not because it is the last."""

_NEAR_DEG = 1e-4
"""A posture is near enough where a projection moves it by less: |y|^2 is stationary there."""

_WITHIN = 2.5
"""Discrepancies are looked for within so many SDs of their prior."""

_SEARCH = {"eps": 1e-2, "ftol": 1e-3, "maxiter": 25, "maxls": 6}
"""For slopes, differences of a hundredth of an SD: the evidence is smooth but for curves that come and go. At those a
longer line search ends in vain, and steps that gain less than a thousandth are not worth their evaluations."""


@dataclass(frozen=True)
class Posterior:
    """The mode of one hypothesis."""

    hypothesis: Hypothesis
    theta_mm: Float[np.ndarray, "subjects adapted"]
    amplitude: Float[np.ndarray, " own"]
    y: Float[np.ndarray, "rows 3"]
    Z: Float[np.ndarray, "rows 3 n"]
    """dy in the adapted parameters and in the amplitudes of all candidates."""
    evidence: Evidence


def modes(
    joint: JointFit,
    likelihood: Likelihood,
    hypotheses: Sequence[Hypothesis],
    thetas_mm: Sequence[Float[np.ndarray, "subjects adapted"]],
    amplitudes: Sequence[Float[np.ndarray, " own"]],
) -> list[Posterior]:
    """Find the modes of hypotheses side by side, each from a start of its own; ``joint`` has everybody in one group."""
    steps = _Steps(likelihood, joint.objective(hypotheses))
    a = np.zeros((len(hypotheses), max(map(len, amplitudes))))
    for group, own in enumerate(amplitudes):
        a[group, : len(own)] = own
    mode = steps.to_the_mode(steps.start(np.stack(thetas_mm), a))
    near, in_order = mode.near, np.argsort(joint.rows)
    found = []
    for group, hypothesis in enumerate(hypotheses):
        y, by_theta, by_channel = (
            steps.rows_first(one)[group, in_order] for one in (near.y[:, None], near.by_theta, near.by_channel)
        )
        Z = np.concatenate([by_theta, joint.candidates.by_amplitude(by_channel)], axis=2)
        evidence = likelihood.evidence(mode.theta[group], y[..., 0], Z)
        own = mode.a[group, : len(amplitudes[group])]
        found.append(Posterior(hypothesis, mode.theta[group], own, y[..., 0], Z, evidence))
    return found


def likeliest(joint: JointFit, at: Posterior, start: Discrepancy) -> Discrepancy:
    """Find the discrepancy of the highest evidence times prior, in the linear model around a mode."""
    from scipy.optimize import minimize  # 0.4 s to load: not for every command

    where = joint.candidates.where(at.hypothesis)
    mean, scale = joint.candidates.mean[where], joint.candidates.scale[where]
    Z, own = at.Z[..., np.concatenate([np.arange(_N), _N + where])], np.arange(len(where))

    def of(z: Float[np.ndarray, " numbers"]) -> Discrepancy:
        """In SDs of the logarithms about their medians."""
        return Discrepancy(*np.exp(np.log(TYPICAL) + LOG_SD * z).tolist())

    def cost(z: Float[np.ndarray, " numbers"]) -> float:
        evidence = Likelihood.of(joint.model, joint.shoulders, of(z)).evidence(at.theta_mm, at.y, Z)
        return 0.5 * float((z**2).sum()) - evidence.given(own, at.amplitude, mean, scale).log_evidence

    first, bounds = np.log(np.divide(start, TYPICAL)) / LOG_SD, [(-_WITHIN, _WITHIN)] * len(LOG_SD)
    found = minimize(cost, first, method="L-BFGS-B", bounds=bounds, options=_SEARCH)
    return of(found.x)


@dataclass(frozen=True)
class _State:
    """Where the steps are."""

    theta: Float[np.ndarray, "groups subjects adapted"]
    a: Float[np.ndarray, "groups own"]
    f: Float[np.ndarray, "groups factors"]
    """h and b."""
    total: Float[np.ndarray, " groups"]
    """-2 log p."""
    damping: Float[np.ndarray, " groups"]
    going: Bool[np.ndarray, " groups"]
    near: Nearest

    def of_groups(self) -> Iterator[tuple[str, np.ndarray]]:
        """Give what there is one of in every group, by name."""
        return ((name, one) for name, one in vars(self).items() if name != "near")

    def going_on(self, rows: Bool[np.ndarray, " rows"]) -> "_State":
        """Take the groups that are going on, whose rows these are."""
        return _State(**{name: one[self.going] for name, one in self.of_groups()}, near=self.near.of(rows))

    def joined(self, rows: Bool[np.ndarray, " rows"], others: "_State") -> "_State":
        """Put the groups that went on in the places that they have among all."""
        new = dict(others.of_groups())
        return _State(
            **{name: put(one, self.going, new[name]) for name, one in self.of_groups()},
            near=self.near.with_rows(rows, others.near),
        )


@dataclass(frozen=True)
class _Steps:
    """Gauss-Newton steps of several hypotheses side by side, one group each."""

    likelihood: Likelihood
    objective: Objective

    @cached_property
    def groups(self) -> int:
        return len(self.objective.shared.scale)

    @cached_property
    def places(self) -> list[slice]:
        """Where the rows of each shoulder are within a group."""
        rows = self.likelihood.whitening.rows
        ends = np.cumsum([len(own) for own in rows])
        return [slice(end - len(own), end) for end, own in zip(ends, rows, strict=True)]

    def rows_first(self, x: Float[np.ndarray, "3 n every"]) -> Float[np.ndarray, "groups rows 3 n"]:
        """Part the rows by group."""
        return np.moveaxis(x.reshape(*x.shape[:2], self.groups, -1), (0, 1), (2, 3))

    def start(self, theta, a) -> _State:
        """Evaluate where the steps begin."""
        theta, f = self.within_bounds(theta), np.zeros((self.groups, self.likelihood.shared))
        near, total = self.at(theta, a, f, None)
        return _State(theta, a, f, total, np.zeros(self.groups), np.ones(self.groups, bool), near)

    def within_bounds(self, theta) -> Float[np.ndarray, "groups subjects adapted"]:
        """Move to the nearest bounds what is beyond them."""
        return np.clip(theta.reshape(-1, _N), *self.objective.parts.bounds_mm).reshape(theta.shape)

    def to_the_mode(self, state: _State, left: int = _MOST_STEPS) -> _State:
        """Step until no group goes down any more; once enough have ended the others go on without them."""
        while left and state.going.any():
            if state.going.mean() <= FEW:
                parts = self.objective.parts
                rows = state.going[parts.group][parts.part]
                others = _Steps(self.likelihood, self.objective.of(state.going))
                return state.joined(rows, others.to_the_mode(state.going_on(rows), left))
            state, left = self.stepped(state), left - 1
        return state

    def stepped(self, state: _State) -> _State:
        """Take a step in every group that is going on, if it leads down; else damp it more."""
        parts, shared, damping = self.objective.parts, self.objective.shared, state.damping
        gradient, matrix = self.quadratic(state)
        diagonal = np.einsum("pii->pi", matrix)
        diagonal[:] *= 1.0 + damping[parts.group][:, None]
        (lower, upper), theta = parts.bounds_mm, state.theta.reshape(-1, _N)
        precision = np.concatenate([np.ones(state.f.shape), 1.0 / shared.scale**2], axis=1)
        step = lowest(
            Quadratic(gradient, matrix, parts.group),
            self.groups,
            precision * np.concatenate([state.f, state.a - shared.mean], axis=1),
            np.eye(precision.shape[1]) * precision[:, None, :],
            (lower - theta, upper - theta),
        )
        by_f, by_a = np.split(step.amplitude, [state.f.shape[1]], axis=1)
        theta, a, f = state.theta + step.theta.reshape(state.theta.shape), state.a + by_a, state.f + by_f
        near, total = self.at(theta, a, f, state.near.angles_deg)
        better = state.going & (total <= state.total)
        damping = np.where(
            better, damping * _LESS * (damping > _NONE), np.maximum(damping * _MORE, _LEAST_AFTER_FAILURE)
        )
        there = better & (state.total - total < _ENOUGH) & (state.damping < _STUCK)
        return _State(
            theta=np.where(better[:, None, None], theta, state.theta),
            a=np.where(better[:, None], a, state.a),
            f=np.where(better[:, None], f, state.f),
            total=np.where(better, total, state.total),
            damping=damping,
            going=state.going & ~there & (damping < _HOPELESS),
            near=state.near.where(better[parts.group][parts.part], near),
        )

    def at(self, theta, a, f, start_deg) -> tuple[Nearest, Float[np.ndarray, " groups"]]:
        """Compute -2 log p of every group."""
        near = self.objective.nearest(theta.reshape(-1, _N), a, start_deg, _NEAR_DEG)
        parts, shared = self.objective.parts, self.objective.shared
        total = (((a - shared.mean) / shared.scale) ** 2).sum(axis=1) + (f**2).sum(axis=1)
        total += np.bincount(parts.group[parts.part], cost_of_open_chains(near), self.groups)
        y = self.rows_first(near.y[:, None])[..., 0]
        for subject, rows in enumerate(self.places):
            total += (self.likelihood.values(subject, y[:, rows], theta[:, subject], f) ** 2).sum(axis=1)
        return near, np.where(np.isfinite(total), total, np.inf)

    def quadratic(self, state: _State) -> tuple[np.ndarray, np.ndarray]:
        """Give gradient and matrix of half of -2 log p of every part in theta, f and a, but for the priors of these."""
        gradients, matrices = [], []
        slopes = np.concatenate([state.near.by_theta, self.objective.by_amplitude(state.near)], axis=1)
        Z, y = self.rows_first(slopes), self.rows_first(state.near.y[:, None])[..., 0]
        for subject, rows in enumerate(self.places):
            columns = self.likelihood.columns(subject, Z[:, rows])
            values = self.likelihood.values(subject, y[:, rows], state.theta[:, subject], state.f)
            across = np.swapaxes(columns, 1, 2)
            gradients.append(times(across, values))
            matrices.append(across @ columns)
        n = gradients[0].shape[1]
        return np.stack(gradients, axis=1).reshape(-1, n), np.stack(matrices, axis=1).reshape(-1, n, n)
