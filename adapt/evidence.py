"""How well each hypothesis explains the gap of all subjects together: evidence with everything else integrated out.

A hypothesis is a set of effects at work. In subject s, linear around the most probable parameters,

    y_s = X_s u_s + A_s a_s + noise,   u_s ~ N(0, 1),   a_s = c mu + b delta_s,   mu, delta_s ~ N(0, 1)

with u the adapted parameters and a the amplitudes, both in prior standard deviations about the model's own: every
subject has parameters of its own, and amplitudes that vary (b) about a common one (c). All integrals are Gaussian, so
the evidence is closed form; per subject only two sufficient statistics of the amplitudes are left, and subjects combine
by adding them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from adapt.misfit import columns_of, misfit, prior_z
from adapt.observed import Noise, Observed
from models.effects import Effect
from models.girdle import ADAPTED, Girdle

Hypothesis = tuple[str, ...]
"""Names of the effects at work; empty for none."""

THETA_SD_MM = np.array([30.0, 8.0, 6.0, 30.0, 12.0, 3.0])
"""Prior SD of a subject's adapted parameters about the model's own, in the order of ADAPTED: the spread between
subjects of Table 6.5 (R2: 31, 6, 3, 24, 17, 2 mm), rounded."""

BETWEEN_SUBJECTS = 0.3
"""Prior SD of a subject's amplitude about the common one, as a share of the effect's scale."""

_ALONE_STEPS, _TOGETHER_STEPS = 6, 8
"""Most Gauss-Newton steps of each subject alone, then of all together."""

_SETTLED = 0.02
"""Change of -2 log posterior below which a step changes no answer."""


@dataclass(frozen=True)
class Block:
    """Prior of some amplitudes: SD of the common part and of each subject's deviation from it."""

    common: Float[np.ndarray, " amplitudes"]
    between: Float[np.ndarray, " amplitudes"]

    def __add__(self, other: "Block") -> "Block":
        return Block(np.concatenate([self.common, other.common]), np.concatenate([self.between, other.between]))

    def __mul__(self, factor: float) -> "Block":
        return Block(factor * self.common, factor * self.between)


def alike(scale: Float[np.ndarray, " amplitudes"]) -> Block:
    """Amplitudes that vary little between subjects."""
    return Block(scale, BETWEEN_SUBJECTS * scale)


def unlike(scale: Float[np.ndarray, " amplitudes"]) -> Block:
    """Amplitudes that every subject has for itself, of either sign."""
    return Block(0.0 * scale, np.sqrt(1.0 + BETWEEN_SUBJECTS**2) * scale)


@dataclass(frozen=True)
class Linear:
    """A hypothesis fitted to all subjects, linear around its most probable parameters."""

    hypothesis: Hypothesis
    z: Float[np.ndarray, "parameters subjects"]
    nearest: Float[np.ndarray, "quantities postures subjects"]
    y: Float[np.ndarray, "subjects residuals"]
    """Whitened residuals at z."""
    X: Float[np.ndarray, "subjects residuals 6"]
    """Their derivatives by the adapted parameters, in prior standard deviations."""
    A: Float[np.ndarray, "subjects residuals amplitudes"]
    """Their derivatives by the amplitudes, in units of the effect."""
    scale: Float[np.ndarray, " amplitudes"]
    u: Float[np.ndarray, "subjects 6"]
    a: Float[np.ndarray, "subjects amplitudes"]
    """The adapted parameters at z in prior standard deviations, and the amplitudes."""
    linear: Float[np.ndarray, "subjects residuals"]
    """X u + A a - y at z: y of other u and a is X u + A a - linear."""
    root: Float[np.ndarray, "subjects postures m m"]


@dataclass(frozen=True)
class Posterior:
    """What follows from the linear model with one prior of the amplitudes."""

    log_evidence: float
    common: Float[np.ndarray, " amplitudes"]
    """Mean of the common amplitude."""
    covariance: Float[np.ndarray, "amplitudes amplitudes"]
    """Of the common amplitude."""
    u: Float[np.ndarray, "subjects 6"]
    """Means of the adapted parameters, in prior standard deviations."""
    a: Float[np.ndarray, "subjects amplitudes"]
    """Means of each subject's amplitudes."""


def fit_hypotheses(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    hypotheses: Sequence[Hypothesis],
    data: Observed,
    noise: Noise,
) -> list[Linear]:
    """The most probable parameters of every subject under every hypothesis, and the linear model there.

    Gauss-Newton: first each subject alone with step halving by damping, then all subjects of a hypothesis together
    under the hierarchical prior, so that the linearisation is where the pooled answer is.
    """
    subjects = data.counted.shape[1]
    lanes = data.of_subjects(np.tile(np.arange(subjects), len(hypotheses)))
    columns, scales = _layout(effects, hypotheses)
    lane_columns, lane_scales = (np.repeat(x, subjects, axis=1) for x in (columns, scales))
    prior = prior_z(girdle, effects)
    z = np.repeat(prior[:, None], lane_columns.shape[1], axis=1)

    def look(z, nearest, projections):
        return misfit(girdle, effects, lanes, noise, z, lane_columns, nearest, projections)

    start, nearest = _alone(look, z, prior, lane_columns, np.hypot(1.0, _between(columns))[:, :1] * lane_scales)

    def together(z, nearest) -> tuple[list[Linear], np.ndarray]:
        at = look(z, nearest, 2)
        fitted = [_linear(effects, hypothesis, h, at, z, prior, subjects) for h, hypothesis in enumerate(hypotheses)]
        return fitted, np.array([_cost(found) for found in fitted])

    best, cost = together(start, nearest)
    share = np.ones(len(hypotheses))
    for _ in range(_TOGETHER_STEPS):
        trial = np.concatenate(
            [found.z + t * (_pooled_z(effects, found, prior) - found.z) for found, t in zip(best, share, strict=True)],
            axis=1,
        )
        tried, cost_tried = together(trial, np.concatenate([found.nearest for found in best], axis=2))
        better = cost_tried < cost
        settled = np.abs(cost - cost_tried) < _SETTLED
        best = [new if good else old for new, old, good in zip(tried, best, better, strict=True)]
        cost, share = np.where(better, cost_tried, cost), np.where(better, np.minimum(1.0, 2.0 * share), 0.25 * share)
        if settled.all():
            break
    return best


def _pooled_z(effects, found: Linear, prior) -> Float[np.ndarray, "parameters subjects"]:
    """Where the linear model puts the most probable parameters of all subjects together."""
    mean = posterior(found, alike(found.scale))
    z = np.repeat(prior[:, None], found.z.shape[1], axis=1)
    z[: len(ADAPTED)] += (mean.u * THETA_SD_MM).T
    z[columns_of(effects, found.hypothesis)] = mean.a.T
    return z


def _cost(found: Linear) -> float:
    """-2 log of the joint posterior at z, but for a constant: misfit, adapted parameters, amplitudes."""
    u, a = found.u, found.a / found.scale
    block = alike(np.ones(a.shape[1]))
    spread, common = block.between**2, block.common**2
    mu = common * a.sum(axis=0) / (spread + len(a) * common)
    cost = (found.y**2).sum() + (u**2).sum() + ((a - mu) ** 2 / spread).sum() + (mu**2 / common).sum()
    return float(np.where(np.isfinite(cost), cost, np.inf))


def _layout(
    effects, hypotheses
) -> tuple[Int[np.ndarray, "columns hypotheses"], Float[np.ndarray, "columns hypotheses"]]:
    """The columns of z that each hypothesis frees, padded with -1, and their prior SD."""
    theta = np.arange(len(ADAPTED))
    free = [np.concatenate([theta, columns_of(effects, hypothesis)]) for hypothesis in hypotheses]
    sd = np.concatenate([THETA_SD_MM, *(np.asarray(effect.prior_sd) for effect in effects)])
    width = max(map(len, free))
    columns = np.stack([np.pad(f, (0, width - len(f)), constant_values=-1) for f in free], axis=1)
    return columns, np.where(columns >= 0, sd[columns], 1.0)


def _between(columns):
    """Share of the between-subject variation in a subject's own prior: none for the adapted parameters."""
    return np.where(np.arange(len(columns))[:, None] < len(ADAPTED), 0.0, BETWEEN_SUBJECTS) + 0.0 * columns


def _alone(look, z, prior, columns, sd):
    """The most probable z of each lane by itself, and its nearest postures."""
    lanes = np.arange(z.shape[1])

    def weighed(at, z):
        away = np.where(columns >= 0, (z[columns, lanes] - prior[columns]) / sd, 0.0)
        cost = (at.y**2).sum(axis=(1, 2)) + (away**2).sum(axis=0)
        return away, np.where(np.isfinite(cost), cost, np.inf)

    at = look(z, None, 4)
    away, cost = weighed(at, z)
    damping = np.full(len(cost), 1e-3)
    y, slopes, nearest = at.y, at.slopes, at.nearest
    for _ in range(_ALONE_STEPS):
        J = slopes.reshape(len(lanes), -1, len(columns)) * sd.T[:, None]
        curvature = np.swapaxes(J, 1, 2) @ J + (1.0 + damping)[:, None, None] * np.eye(len(columns))
        slope = np.einsum("lrk,lr->lk", J, y.reshape(len(lanes), -1)) + away.T
        step = -np.linalg.solve(curvature, slope[..., None])[..., 0].T
        trial = z.copy()
        for column, move in zip(columns, np.where(columns >= 0, sd * step, 0.0), strict=True):
            trial[np.maximum(column, 0), lanes] += move
        at = look(trial, nearest, 2)
        away_trial, cost_trial = weighed(at, trial)
        better = cost_trial <= cost
        damping = np.where(better, damping * 0.1, np.maximum(damping * 100.0, 1e-2))
        z, cost, away = (
            np.where(better, trial, z),
            np.where(better, cost_trial, cost),
            np.where(better, away_trial, away),
        )
        nearest = np.where(better, at.nearest, nearest)
        y = np.where(better[:, None, None], at.y, y)
        slopes = np.where(better[:, None, None, None], at.slopes, slopes)
        if better.all() and np.abs(step).max() < 1e-2:
            break
    return z, nearest


def _linear(effects, hypothesis: Hypothesis, h: int, at, z, prior, subjects: int) -> Linear:
    span = slice(h * subjects, (h + 1) * subjects)
    chosen = columns_of(effects, hypothesis)
    scale = np.concatenate([np.zeros(0), *(np.asarray(e.prior_sd) for e in effects if e.name in hypothesis)])
    y = at.y[span].reshape(subjects, -1)
    slopes = at.slopes[span].reshape(*y.shape, -1)
    X, A = slopes[..., : len(ADAPTED)] * THETA_SD_MM, slopes[..., len(ADAPTED) : len(ADAPTED) + len(chosen)]
    u = (z[: len(ADAPTED), span].T - prior[: len(ADAPTED)]) / THETA_SD_MM
    a = z[chosen][:, span].T
    return Linear(
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
    )


@dataclass(frozen=True)
class Statistics:
    """What is left of the subjects once their adapted parameters are integrated out."""

    log: float
    """Log evidence with all amplitudes 0."""
    information: Float[np.ndarray, "subjects amplitudes amplitudes"]
    pull: Float[np.ndarray, "subjects amplitudes"]


def statistics(fitted: Linear, extra: Float[np.ndarray, "subjects residuals more"] | None = None) -> Statistics:
    """Sufficient statistics of the amplitudes; ``extra`` are further columns beside those of the hypothesis."""
    columns = fitted.A if extra is None else np.concatenate([fitted.A, extra], axis=2)
    marginal = np.eye(fitted.y.shape[1]) + fitted.X @ np.swapaxes(fitted.X, 1, 2)
    root = np.linalg.cholesky(marginal)
    both = np.linalg.solve(root, np.concatenate([fitted.linear[..., None], columns], axis=2))
    b, B = both[..., 0], both[..., 1:]
    log = -0.5 * (b**2).sum() - np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
    return Statistics(float(log), np.swapaxes(B, 1, 2) @ B, np.einsum("srk,sr->sk", B, b))


def log_evidence(of: Statistics, prior: Block) -> float:
    """log p(y | hypothesis) but for a constant that all hypotheses on the same data share."""
    return _combined(of, prior)[0]


def _combined(of: Statistics, prior: Block):
    """Log evidence; mean and covariance of mu in units of c; the shrinkage b S b of each subject."""
    b, c = prior.between, prior.common
    information, pull = of.information, of.pull
    eye = np.eye(len(c))
    S = np.linalg.inv(eye + b[:, None] * information * b)
    own = b[:, None] * S * b
    log = of.log + 0.5 * np.einsum("si,sij,sj->", pull, own, pull) + 0.5 * np.linalg.slogdet(S)[1].sum()
    common_information = (information - information @ own @ information).sum(axis=0)
    common_pull = (pull - np.einsum("sij,sjk,sk->si", information, own, pull)).sum(axis=0)
    covariance = np.linalg.inv(eye + c[:, None] * common_information * c)
    mu = covariance @ (c * common_pull)
    log += 0.5 * (c * common_pull) @ mu + 0.5 * np.linalg.slogdet(covariance)[1]
    return float(log), c * mu, c[:, None] * covariance * c, own


def posterior(fitted: Linear, prior: Block) -> Posterior:
    """Evidence and means of everything under one prior of the amplitudes."""
    of = statistics(fitted)
    log, common, covariance, own = _combined(of, prior)
    left = of.pull - np.einsum("sij,j->si", of.information, common)
    a = common + np.einsum("sij,sj->si", own, left)
    rest = fitted.linear - np.einsum("srk,sk->sr", fitted.A, a)
    XX = np.swapaxes(fitted.X, 1, 2) @ fitted.X + np.eye(fitted.X.shape[2])
    u = np.linalg.solve(XX, np.einsum("srk,sr->sk", fitted.X, rest)[..., None])[..., 0]
    return Posterior(log, common, covariance, u, a)
