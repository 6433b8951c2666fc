"""How well each effect explains the gap of all subjects together: evidence with everything else integrated out.

Model of one subject s with effects k (whitened residuals y, linear around the most probable z):

    y = X (theta - theta0) + A alpha_s + noise
    theta - theta0 ~ N(0, Sigma_theta),   alpha_s ~ N(mu, Delta),   mu ~ N(0, M)

The adapted parameters are each subject's own; amplitudes vary between subjects about a common one (hierarchical
prior). All integrals are Gaussian, so the evidence is closed form; per subject only two sufficient statistics of the
amplitude are left, and subjects combine by adding them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from adapt.sampson import Observed, Whitened, whitened
from models.effects import Effect
from models.girdle import ADAPTED, Girdle

THETA_SD_MM = np.array([30.0, 8.0, 6.0, 30.0, 12.0, 3.0])
"""Prior SD of a subject's adapted parameters about the model's own, in the order of ADAPTED: the spread between
subjects of Table 6.5 (R2: 31, 6, 3, 24, 17, 2 mm), rounded."""

BETWEEN_SUBJECTS = 0.3
"""Prior SD of a subject's amplitude about the common one, as a share of the effect's scale."""

_ITERATIONS = 12
"""Most Gauss-Newton steps to the most probable z; 3-5 are usual."""

_SETTLED = 1e-3
"""A step shorter than this, in prior standard deviations, changes the evidence by less than 1e-6."""


@dataclass(frozen=True)
class Evidence:
    """What the data say about one set of effects."""

    log_evidence: float
    chi_square: float
    """Of the whitened residuals at the most probable parameters."""
    freedom: float
    """Residuals less the parameters that the data determined."""
    amplitude: Float[np.ndarray, " amplitudes"]
    """Posterior mean of the common amplitudes of the active effects."""
    amplitude_covariance: Float[np.ndarray, "amplitudes amplitudes"]
    z: Float[np.ndarray, "parameters subjects"]
    """Most probable parameters: adapted ones in mm, then amplitudes of every effect (0 where not active)."""


def columns_of(effects: Sequence[Effect], active: Sequence[str]) -> np.ndarray:
    """Columns of z that hold the amplitudes of the active effects."""
    start, found = len(ADAPTED), []
    for effect in effects:
        if effect.name in active:
            found.extend(range(start, start + effect.amplitudes))
        start += effect.amplitudes
    return np.array(found, int)


def evidence(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    active: Sequence[str],
    data: Observed,
    noise_deg: float,
    start: Float[np.ndarray, "parameters subjects"] | None = None,
) -> Evidence:
    """Log evidence of the active effects (none for the base model), with fit and amplitudes.

    ``start``: parameters to start from, for instance the base model's most probable ones.
    """
    columns = columns_of(effects, active)
    scales = np.concatenate([np.asarray(effect.prior_sd) for effect in effects if effect.name in active] or [[]])
    z, at = _most_probable(girdle, effects, columns, scales, data, noise_deg, start)
    theta, used = np.arange(len(ADAPTED)), np.concatenate([np.arange(len(ADAPTED)), columns])
    prior = np.asarray(girdle.adapted_mm)
    deviation = z[used].T - np.concatenate([prior, np.zeros(len(columns))])
    linear = np.einsum("snm,sm->sn", at.slopes[:, :, used], deviation) - at.y
    X, A = at.slopes[:, :, theta] * THETA_SD_MM, at.slopes[:, :, columns] * scales
    log, common, covariance = _hierarchical(X, A, linear)
    sd = np.concatenate([THETA_SD_MM, np.sqrt(1.0 + BETWEEN_SUBJECTS**2) * scales])
    return Evidence(
        log_evidence=log,
        chi_square=float((at.y**2).sum()),
        freedom=3.0 * data.counted.sum() - _determined(at.slopes[:, :, used] * sd),
        amplitude=common * scales,
        amplitude_covariance=covariance * np.outer(scales, scales),
        z=z,
    )


def _most_probable(
    girdle: Girdle, effects, columns, scales, data: Observed, noise_deg: float, start
) -> tuple[Float[np.ndarray, "parameters subjects"], Whitened]:
    """Each subject's z of largest posterior, by Gauss-Newton with step halving."""
    prior = np.zeros(len(ADAPTED) + sum(effect.amplitudes for effect in effects))
    prior[: len(ADAPTED)] = np.asarray(girdle.adapted_mm)
    used = np.concatenate([np.arange(len(ADAPTED)), columns])
    sd = np.concatenate([THETA_SD_MM, np.sqrt(1.0 + BETWEEN_SUBJECTS**2) * scales])
    z = np.repeat(prior[:, None], data.counted.shape[1], axis=1) if start is None else start.copy()

    def look(z):
        at = whitened(girdle, effects, data, noise_deg, z)
        away = (z[used] - prior[used][:, None]) / sd[:, None]
        cost = (at.y**2).sum(axis=1) + (away**2).sum(axis=0)
        return at, away, np.where(np.isfinite(cost), cost, np.inf)

    at, away, cost = look(z)
    damping = np.full(len(cost), 1e-6)
    for _ in range(_ITERATIONS):
        J = at.slopes[:, :, used] * sd
        curvature = np.einsum("snm,snk->smk", J, J) + (1.0 + damping)[:, None, None] * np.eye(len(used))
        slope = np.einsum("snm,sn->sm", J, at.y) + away.T
        step = -np.linalg.solve(curvature, slope[..., None])[..., 0].T
        trial = z.copy()
        trial[used] += sd[:, None] * step
        at_trial, away_trial, cost_trial = look(trial)
        better = cost_trial <= cost
        damping = np.where(better, damping * 0.1, np.maximum(damping * 100.0, 1e-2))
        z = np.where(better, trial, z)
        cost = np.where(better, cost_trial, cost)
        away = np.where(better, away_trial, away)
        at = Whitened(
            np.where(better[:, None], at_trial.y, at.y),
            np.where(better[:, None, None], at_trial.slopes, at.slopes),
        )
        if (np.abs(step).max(axis=0) < _SETTLED)[better].all() and better.all():
            break
    return z, at


def _hierarchical(X, A, linear) -> tuple[float, np.ndarray, np.ndarray]:
    """Log evidence, and mean and covariance of the common amplitude, in prior standard deviations.

    ``linear`` = X theta + A alpha + noise with standard normal priors of theta and of the common amplitude.
    """
    residuals, amplitudes = A.shape[1:]
    marginal = np.eye(residuals) + np.einsum("snm,skm->snk", X, X)
    root = np.linalg.cholesky(marginal)
    b = np.linalg.solve(root, linear[..., None])[..., 0]
    B = np.linalg.solve(root, A)
    log = -0.5 * (b**2).sum() - np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
    if not amplitudes:
        return float(log), np.zeros(0), np.zeros((0, 0))
    between = BETWEEN_SUBJECTS**2
    information = np.einsum("sni,snj->sij", B, B)
    pull = np.einsum("sni,sn->si", B, b)
    shrink = np.linalg.inv(np.eye(amplitudes) + between * information)
    log += 0.5 * between * np.einsum("si,sij,sj->", pull, shrink, pull)
    log += 0.5 * np.linalg.slogdet(shrink)[1].sum()
    total = np.eye(amplitudes) + np.einsum("sij,sjk->ik", shrink, information)
    summed = np.einsum("sij,sj->i", shrink, pull)
    covariance = np.linalg.inv(total)
    common = covariance @ summed
    log += 0.5 * summed @ common - 0.5 * np.linalg.slogdet(total)[1]
    return float(log), common, covariance


def _determined(J) -> float:
    """How many parameters the data determined: trace of the hat matrix, parameters in prior standard deviations."""
    information = np.einsum("snm,snk->smk", J, J)
    eye = np.eye(J.shape[2])
    return float(np.trace(np.linalg.solve(eye + information, information), axis1=1, axis2=2).sum())
