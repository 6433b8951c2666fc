"""The most probable parameters of every subject under every hypothesis, and the linear model there.

Each subject under each hypothesis is a problem; all descend side by side (Gauss-Newton with damping). A subject alone
can end in a worse valley, so there are several rounds: each subject by itself under a wide prior; then under the prior
that its fellows suggest, both from where it is and from where they are; then, where another hypothesis has found a much
lower place for the subject, with the girdle of that one; then all subjects of a hypothesis together, under the
hierarchical prior, so that the linearisation is where the pooled answer is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.linear_evidence import posterior
from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS, Hypothesis, LinearisedFit, shared_prior
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.misfit import Misfit, columns_of, free_columns, misfit, prior_sd_of, prior_z
from adapt.diagnosis.fit.observations import Observed
from models.adapted_parameters import ADAPTED, PRIOR_SD_MM
from models.effects import Effect
from models.girdle import Girdle

_STEPS = 6
"""Most Gauss-Newton steps in each of the first two rounds, and of all subjects together."""

_SMALL_STEP = 1e-2
"""In prior standard deviations: all problems below it have come to rest."""

_SETTLED = 0.02
"""Change of -2 log posterior below which a step changes no answer."""

_BEHIND = 20.0
"""Difference of -2 log posterior between a subject's hypotheses from which one is perhaps in another valley: most lie
behind because they are wrong, but a descent more costs little."""

_FIRST_DAMPING = 1e-3

_OPEN_MM = 0.2
"""A chain that is open by this costs as much as one standard deviation; two projections leave a tenth of it."""

_THETA = np.arange(len(ADAPTED))

Evaluate = Callable[[np.ndarray, np.ndarray | None, int, np.ndarray], Misfit]
"""The misfit at z, from the nearest postures so far, after some projections, of some of the problems."""


@dataclass(frozen=True)
class _Prior:
    """Independent Gaussians of the parameters that each problem frees; a column of -1 is padding."""

    columns: Int[np.ndarray, "free problems"]
    mean: Float[np.ndarray, "parameters problems"]
    sd: Float[np.ndarray, "free problems"]

    def select(self, problems: Int[np.ndarray, " chosen"]) -> "_Prior":
        """Those of some problems."""
        return _Prior(*(values[:, problems] for values in vars(self).values()))

    def away(self, z: Float[np.ndarray, "parameters problems"]) -> Float[np.ndarray, "free problems"]:
        """z less its mean, in standard deviations."""
        problems = np.arange(z.shape[1])
        return np.where(self.columns >= 0, (z - self.mean)[self.columns, problems] / self.sd, 0.0)

    def moved(self, z, step: Float[np.ndarray, "free problems"]) -> Float[np.ndarray, "parameters problems"]:
        """z after a step in standard deviations."""
        z, problems = z.copy(), np.arange(z.shape[1])
        for column, move in zip(self.columns, np.where(self.columns >= 0, self.sd * step, 0.0), strict=True):
            z[np.maximum(column, 0), problems] += move
        return z


@dataclass(frozen=True)
class _Estimate:
    """The parameters of each problem so far."""

    z: Float[np.ndarray, "parameters problems"]
    nearest: Float[np.ndarray, "quantities postures problems"]
    cost: Float[np.ndarray, " problems"]
    """-2 log posterior but for a constant."""

    def with_lower(self, other: "_Estimate", problems: Int[np.ndarray, " chosen"], by: float = 0.0) -> "_Estimate":
        """These problems as ``other`` has them, where that is more probable, its cost lower by so much."""
        gains = other.cost < self.cost[problems] - by
        z, nearest, cost = self.z.copy(), self.nearest.copy(), self.cost.copy()
        taken = problems[gains]
        z[:, taken], nearest[..., taken], cost[taken] = other.z[:, gains], other.nearest[..., gains], other.cost[gains]
        return _Estimate(z, nearest, cost)


def fit_hypotheses(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    hypotheses: Sequence[Hypothesis],
    data: Observed,
    noise: Noise,
) -> list[LinearisedFit]:
    """Fit every hypothesis to all subjects, in the given order."""
    subjects = data.counted.shape[1]
    subject = np.tile(np.arange(subjects), len(hypotheses))
    columns, scales = (np.repeat(x, subjects, axis=1) for x in _layout(effects, hypotheses))
    start = np.repeat(prior_z(girdle, effects)[:, None], columns.shape[1], axis=1)

    def evaluate(z, nearest, projections, problems):
        chosen = data.select_subjects(subject[problems])
        return misfit(girdle, effects, chosen, noise, z, columns[:, problems], nearest, projections)

    is_amplitude = np.arange(len(columns))[:, None] >= len(ADAPTED)
    wide = _Prior(columns, start, np.where(is_amplitude, np.hypot(1.0, BETWEEN_SUBJECTS), 1.0) * scales)
    alone = _descend(evaluate, wide, start, None)
    typical = np.repeat(np.median(alone.z.reshape(len(start), -1, subjects), axis=2), subjects, axis=1)
    fellows = start.copy()
    fellows[len(ADAPTED) :] = typical[len(ADAPTED) :]
    narrow = _Prior(columns, fellows, np.where(is_amplitude, BETWEEN_SUBJECTS, 1.0) * scales)
    everywhere = np.arange(start.shape[1])
    found = _descend(evaluate, narrow, alone.z, alone.nearest).with_lower(
        _descend(evaluate, narrow, typical, None), everywhere
    )
    return _fit_jointly(girdle, effects, hypotheses, evaluate, _from_lower_valleys(evaluate, narrow, found, subjects))


def _from_lower_valleys(evaluate: Evaluate, prior: _Prior, found: _Estimate, subjects: int) -> _Estimate:
    """Descend once more, from its girdle, where another hypothesis of the same subject is far more probable."""
    cost = found.cost.reshape(-1, subjects)
    behind = np.flatnonzero(cost - cost.min(axis=0) > _BEHIND)
    if not len(behind):
        return found
    lowest = (cost.argmin(axis=0) * subjects + np.arange(subjects))[behind % subjects]
    start = prior.mean[:, behind].copy()
    start[_THETA] = found.z[_THETA[:, None], lowest]
    again = _descend(
        lambda z, nearest, count, problems: evaluate(z, nearest, count, behind[problems]),
        prior.select(behind),
        start,
        None,
    )
    return found.with_lower(again, behind, _SETTLED)


def _layout(effects, hypotheses) -> tuple[Int[np.ndarray, "free hypotheses"], Float[np.ndarray, "free hypotheses"]]:
    """The columns of z that each hypothesis frees, padded with -1, and their prior scales."""
    columns = free_columns(effects, hypotheses)
    scale = np.concatenate([PRIOR_SD_MM, prior_sd_of(effects)])
    return columns, np.where(columns >= 0, scale[columns], 1.0)


def _descend(evaluate: Evaluate, prior: _Prior, z, nearest) -> _Estimate:
    """Each problem by itself to its most probable z; one that has come to rest costs nothing more."""

    def estimate(z, nearest, projections, problems) -> tuple[_Estimate, Misfit]:
        at, own = evaluate(z, nearest, projections, problems), prior.select(problems)
        cost = (at.y**2).sum(axis=(1, 2)) + (own.away(z) ** 2).sum(axis=0) + _penalty(at).sum(axis=1)
        return _Estimate(z, at.nearest, np.where(np.isfinite(cost), cost, np.inf)), at

    best, at = estimate(z.copy(), nearest, 4 if nearest is None else 2, np.arange(z.shape[1]))
    y, slopes = at.y, at.slopes
    damping = np.full(z.shape[1], _FIRST_DAMPING)
    for _ in range(_STEPS):
        step = _newton_step(y, slopes, prior, best.z, damping)
        moving = np.flatnonzero(np.abs(step).max(axis=0) >= _SMALL_STEP)
        if not len(moving):
            break
        tried, at = estimate(prior.moved(best.z, step)[:, moving], best.nearest[..., moving], 2, moving)
        better = tried.cost <= best.cost[moving]
        damping[moving] = np.where(better, damping[moving] * 0.1, np.maximum(damping[moving] * 100.0, 1e-2))
        taken = moving[better]
        best.z[:, taken], best.nearest[..., taken] = tried.z[:, better], tried.nearest[..., better]
        best.cost[taken], y[taken], slopes[taken] = tried.cost[better], at.y[better], at.slopes[better]
    return best


def _penalty(at: Misfit) -> Float[np.ndarray, "problems postures"]:
    """Cost of a chain that does not close: where no posture does, y means nothing."""
    return (at.open_mm / _OPEN_MM) ** 2


def _newton_step(y, slopes, prior: _Prior, z, damping) -> Float[np.ndarray, "free problems"]:
    """Damped Gauss-Newton step of each problem, in prior standard deviations."""
    J = slopes.reshape(len(y), -1, slopes.shape[-1]) * prior.sd.T[:, None]
    curvature = np.swapaxes(J, 1, 2) @ J + (1.0 + damping)[:, None, None] * np.eye(J.shape[2])
    slope = np.einsum("lrk,lr->lk", J, y.reshape(len(y), -1)) + prior.away(z).T
    return -np.linalg.solve(curvature, slope[..., None])[..., 0].T


def _fit_jointly(girdle, effects, hypotheses, evaluate: Evaluate, found: _Estimate) -> list[LinearisedFit]:
    """All subjects of each hypothesis, from what was found for each: whole steps, or shorter ones where they fail."""
    prior, subjects = prior_z(girdle, effects), found.z.shape[1] // len(hypotheses)

    def linear(chosen: Sequence[int], z, nearest) -> tuple[list[LinearisedFit], list[float]]:
        """Of some of the hypotheses."""
        problems = (np.array(chosen)[:, None] * subjects + np.arange(subjects)).ravel()
        at = evaluate(z, nearest, 2, problems)
        spans = [slice(k * subjects, (k + 1) * subjects) for k in range(len(chosen))]
        fitted = [_linear(effects, hypotheses[h], at, z, prior, s) for h, s in zip(chosen, spans, strict=True)]
        return fitted, [_cost(one) + _penalty(at)[s].sum() for one, s in zip(fitted, spans, strict=True)]

    moving = list(range(len(hypotheses)))
    best, cost = linear(moving, found.z, found.nearest)
    fraction = np.ones(len(hypotheses))
    for _ in range(_STEPS):
        now = [best[h] for h in moving]
        directions = [fraction[h] * (_pooled_z(effects, best[h], prior) - best[h].z) for h in moving]
        trial = np.concatenate([one.z + direction for one, direction in zip(now, directions, strict=True)], axis=1)
        tried = linear(moving, trial, np.concatenate([one.nearest for one in now], axis=2))
        settled = []
        for h, fitted, cost_tried in zip(moving, *tried, strict=True):
            if abs(cost[h] - cost_tried) < _SETTLED:
                settled.append(h)
            if cost_tried < cost[h]:
                best[h], cost[h], fraction[h] = fitted, cost_tried, min(1.0, 2.0 * fraction[h])
            else:
                fraction[h] *= 0.25
        moving = [h for h in moving if h not in settled]
        if not moving:
            break
    return best


def _pooled_z(effects, fitted: LinearisedFit, prior) -> Float[np.ndarray, "parameters subjects"]:
    """Where the linear model puts the most probable parameters of all subjects together."""
    mean = posterior(fitted, shared_prior(fitted.scale))
    z = np.repeat(prior[:, None], fitted.z.shape[1], axis=1)
    z[_THETA] += (mean.u * PRIOR_SD_MM).T
    z[columns_of(effects, fitted.hypothesis)] = mean.a.T
    return z


def _cost(fitted: LinearisedFit) -> float:
    """-2 log of the joint posterior at z, but for a constant: misfit, adapted parameters, amplitudes."""
    a = fitted.a / fitted.scale
    prior = shared_prior(np.ones(a.shape[1]))
    spread, common = prior.between**2, prior.common**2
    mu = common * a.sum(axis=0) / (spread + len(a) * common)
    cost = (fitted.y**2).sum() + (fitted.u**2).sum() + ((a - mu) ** 2 / spread).sum() + (mu**2 / common).sum()
    return float(np.where(np.isfinite(cost), cost, np.inf))


def _linear(effects, hypothesis: Hypothesis, at: Misfit, z, prior, span: slice) -> LinearisedFit:
    chosen = columns_of(effects, hypothesis)
    scale = prior_sd_of(e for e in effects if e.name in hypothesis)
    y = at.y[span].reshape(at.y[span].shape[0], -1)
    slopes = at.slopes[span].reshape(*y.shape, -1)
    X, A = slopes[..., _THETA] * PRIOR_SD_MM, slopes[..., len(ADAPTED) : len(ADAPTED) + len(chosen)]
    u = (z[_THETA, span].T - prior[_THETA]) / PRIOR_SD_MM
    a = z[chosen][:, span].T
    return LinearisedFit(
        hypothesis=hypothesis,
        z=z[:, span].copy(),
        nearest=at.nearest[..., span],
        y=y,
        X=X,
        A=A,
        scale=scale,
        u=u,
        a=a,
        linear=np.einsum("srk,sk->sr", X, u) + np.einsum("srk,sk->sr", A, a) - y,
        root=at.root[span],
        by_angle=at.by_angle[span],
    )
