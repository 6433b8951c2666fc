"""Variation between the persons of a run: scales of the SDs of each group of sizes, and the noise, by their likelihood.

Near the most probable girdles the distances y of the chain are linear in the sizes, y = T (c z - x + x_0) + y_0, and
the sizes of each person integrate out. With B the columns times the scales of their groups, A = T'T and the noise
variance sigma^2,

    M = B' A B / sigma^2,   v = B' T' b / sigma^2,   H = 1 + M,   z = H^-1 v
    -2 log p = sum over persons of  m log sigma^2 + log det H + |b|^2 / sigma^2 - v' z
    d/d(log scale of g) = 2 sum_{i in g} (1 - (H^-1)_ii - z_i^2)

with m informative numbers: per posture the number of measured angles less three. The scales have a prior about 1: with
few persons they stay near 1, and for persons who do not differ they go to 0.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import put_problems, take_problems
from adapt.own_bones.most_probable import Posterior, Prior, Rows
from adapt.own_bones.posture_steps import persons_first
from models.person.own_bones import GROUPS, SIZES
from motions.table import FEWEST_ANGLES

SCALE_SD, LOG_NOISE_SD = 0.6, 0.7
"""Prior SDs of a scale about 1 and of the logarithm of the noise. Scales of 2 (twice the SDs of ``SIZES``) and 0
(persons who do not differ) are 1.7 SDs off; half or twice the typical noise is 1 SD off."""

TYPICAL_NOISE_DEG = 0.8
"""Typical noise of an angle, including what the chain cannot follow: between bone pins (0.4) and palpation (1.5)."""

_LEAST_SCALE, MOST_SCALE = 0.02, 2.0
"""Limits of a scale: at the lower limit nobody differs; at the upper limit people differ twice as much as ``SIZES``
say. Larger differences are not bones, but noise and what the chain cannot follow."""

_NOISES_DEG = (0.05, 10.0)

_LARGEST = 1e13
"""Largest element of M; below it M + 1 is positive definite in spite of rounding."""

_FLAT = 1e-3
"""Tolerance of the gradient of -2 log p in the logarithms, which are then at most 1e-4 SDs from the optimum."""

_MOST_STEPS, _SHORTER, _SHORTEST = 100, 0.3, 1e-6
"""Largest number of steps (most runs take 4 to 10), factor on a step that increases -2 log p, and the fraction of a
step below which only rounding prevents a decrease."""

_ROUNDING = 1e-13
"""Relative rounding error of -2 log p."""


class Scales(NamedTuple):
    """Scales of the SDs of each group of sizes, and the noise."""

    adapted: float = 1.0
    bones: float = 1.0
    frames: float = 1.0
    noise_deg: float = TYPICAL_NOISE_DEG

    @property
    def of_sizes(self) -> Float[np.ndarray, " sizes"]:
        """Scale of each of ``SIZES``."""
        return np.array(self)[GROUP_OF_SIZE]


PRIOR = Scales()

GROUP_OF_SIZE = np.array([GROUPS.index(one.group) for one in SIZES])

IN_GROUP = (GROUP_OF_SIZE[:, None] == np.arange(len(GROUPS))).astype(float)

_LEAST, _MOST = np.log(
    np.array([(_LEAST_SCALE, MOST_SCALE)] * len(GROUPS) + [_NOISES_DEG]) / np.array(PRIOR)[:, None]
).T[..., None]


class Moments(NamedTuple):
    """Quantities that determine the likelihood of each person."""

    A: Float[np.ndarray, "sizes sizes problems"]
    """C' T'T C, with C the columns at scale 1."""
    c: Float[np.ndarray, "sizes problems"]
    """C' T' b."""
    square: Float[np.ndarray, " problems"]
    """|b|^2, deg^2."""
    informative: Int[np.ndarray, " problems"]
    """Number m of informative values."""


def informative(
    measured: Bool[np.ndarray, "6 rows"], problem: Int[np.ndarray, " rows"], problems: int
) -> Int[np.ndarray, " problems"]:
    """Count the numbers of each problem that inform about its girdle: measured angles less three per posture."""
    return np.bincount(problem, np.maximum(measured.sum(axis=0) - FEWEST_ANGLES, 0), problems).astype(int)


def moments(
    columns: Float[np.ndarray, "numbers sizes problems"],
    prior: Prior,
    found: Posterior,
    rows: Rows,
    problem: Int[np.ndarray, " rows"],
) -> Moments:
    """Compute the moments of the likelihood at the most probable girdles."""
    y, slopes = found.nearest.y, found.nearest.by_theta
    x = prior.numbers_at(found.u) - prior.numbers_mm
    b = np.einsum("ikr,kr->ir", slopes, x[:, problem]) - y
    along = np.einsum("ikr,ksr->isr", slopes, columns[..., problem])
    people = range(x.shape[1])
    A, c = [], []
    for p in people:
        mine = np.concatenate(along[..., problem == p], axis=1)
        A.append(mine @ mine.T)
        c.append(mine @ np.concatenate(b[:, problem == p]))
    A, c = np.stack(A, axis=-1), np.stack(c, axis=-1)
    return Moments(A, c, np.bincount(problem, (b**2).sum(axis=0)), informative(rows.measured, problem, x.shape[1]))


def are_known(of: Moments) -> Bool[np.ndarray, " problems"]:
    """Check for which problems the likelihood can be computed with all scales and noises within the limits.

    The Jacobian of a chain that hardly closes has no bound.
    """
    finite = np.isfinite(of.square) & np.isfinite(of.A).all(axis=(0, 1)) & np.isfinite(of.c).all(axis=0)
    largest = np.abs(of.A).max(axis=(0, 1)) * (MOST_SCALE / _NOISES_DEG[0]) ** 2
    return finite & (largest < _LARGEST) & (of.informative > 0)


def learnt(of: Moments, runs: Bool[np.ndarray, "runs problems"], start: Sequence[Scales]) -> list[Scales]:
    """Find the most probable scales for the problems of each run, starting from ``start``.

    Newton's method within the limits; runs are independent.
    """
    if not len(runs):
        return []
    run, problem = np.nonzero(runs)
    pairs = Moments(*(one[..., problem] for one in of))
    x = np.log(np.array(start) / np.array(PRIOR)).T
    here, length = minus_two_log_likelihood(x, pairs, run), np.ones(len(start))
    for _ in range(_MOST_STEPS):
        value, slope, curvature, expected = here
        free = ~((x <= _LEAST) & (slope > 0.0) | (x >= _MOST) & (slope < 0.0))
        going = (np.abs(slope * free).max(axis=0) > _FLAT) & (length > _SHORTEST)
        if not going.any():
            break
        some, mine = np.flatnonzero(going), going[run]
        tried = np.clip(x - length * _newton(slope, curvature, expected, free), _LEAST, _MOST)[:, some]
        there = minus_two_log_likelihood(tried, take_problems(pairs, mine), np.searchsorted(some, run[mine]))
        better = there[0] <= value[some] + _ROUNDING * np.abs(value[some])
        put_problems((x, here), some[better], take_problems((tried, there), better))
        length[some] = np.where(better, 1.0, _SHORTER * length[some])
    return [Scales(*one) for one in (np.exp(x).T * np.array(PRIOR)).tolist()]


def log_likelihoods(of: Moments, found: Sequence[Scales]) -> Float[np.ndarray, " problems"]:
    """Compute the log likelihood of each problem with its scales."""
    if not len(found):
        return np.zeros(0)
    x = np.log(np.array(found) / np.array(PRIOR)).T
    return -0.5 * (minus_two_log_likelihood(x, of, np.arange(x.shape[1]))[0] - _of_prior(x)[0])


def misfits(of: Moments, found: Sequence[Scales]) -> Float[np.ndarray, " problems"]:
    """Compute the misfit of each problem, min over z of |T (c z - x + x_0) + y_0|^2 / sigma^2 + |z|^2.

    It is chi-square distributed with m degrees of freedom, if persons and noise vary as the scales say.
    """
    variance = np.array([one.noise_deg for one in found]) ** 2
    M, v = _in_sds(of, np.stack([one.of_sizes for one in found], axis=-1), variance)
    z = np.linalg.solve(M + np.eye(len(SIZES)), v[..., None])[..., 0]
    return of.square / variance - (v * z).sum(axis=1)


def relative_variances(
    of: Moments, runs: Bool[np.ndarray, "runs problems"], found: Sequence[Scales]
) -> Float[np.ndarray, "runs groups"]:
    """Compute the variance of each group's scale at its most probable value, relative to the square of this value.

    The curvature is taken in the scales themselves, because it vanishes in the logarithm of a scale near 0.
    """
    if not len(runs):
        return np.zeros((0, len(GROUPS)))
    run, problem = np.nonzero(runs)
    x = np.log(np.array(found) / np.array(PRIOR)).T
    _, slope, curvature, expected = minus_two_log_likelihood(x, Moments(*(one[..., problem] for one in of)), run)
    in_scales = curvature - np.eye(len(slope))[..., None] * slope
    matrices = _convex(in_scales, expected)
    return 2.0 * np.einsum("rgg->rg", np.linalg.inv(matrices))[:, : len(GROUPS)]


def _newton(slope, curvature, expected, free) -> Float[np.ndarray, "scales runs"]:
    """Compute the Newton step of the scales that are not held at a limit (``free``)."""
    both, unit = free[:, None] & free, np.eye(len(slope))[..., None]
    matrices = _convex(*(np.where(both, one, unit) for one in (curvature, expected)))
    return np.linalg.solve(matrices, (slope * free).T[..., None])[..., 0].T


def _convex(curvature, expected) -> Float[np.ndarray, "runs scales scales"]:
    """Return the Hessian of each run, or the expected Hessian where the Hessian is not positive definite."""
    own, other = (np.moveaxis(one, -1, 0) for one in (curvature, expected))
    convex = np.linalg.eigvalsh(own)[:, 0] > 0.0
    return np.where(convex[:, None, None], own, other)


def minus_two_log_likelihood(logarithms: Float[np.ndarray, "scales runs"], of: Moments, run: Int[np.ndarray, " pairs"]):
    """Compute -2 log p with the prior for each run, its gradient, Hessian and expected Hessian in the logarithms.

    ``of``: moments per pair of a run and one of its problems; ``run``: run of each pair, ascending. With K = 1 - H^-1
    the second derivatives are 4 (H^-1_ij K_ij - z_i z_j (2 H^-1_ij - delta_ij)), summed over i in g and j in h, for two
    scales, and 4 (2 z_i (H^-1 z)_i - (H^-1 K)_ii) for a scale and the noise; their expectations 4 K_ij^2 and
    4 (H^-1 K)_ii.
    """
    s, variance = np.exp(logarithms)[GROUP_OF_SIZE][:, run], (PRIOR.noise_deg * np.exp(logarithms[-1, run])) ** 2
    M, v = _in_sds(of, s, variance)
    n, m, square = len(s), of.informative, of.square / variance
    inverse = np.linalg.inv(M + np.eye(n))
    K = np.eye(n) - inverse
    z, followed, shared = (inverse @ v[..., None])[..., 0], np.einsum("pii->pi", K), (inverse * K).sum(axis=2)
    back, vz, zz = (inverse @ z[..., None])[..., 0], (v * z).sum(axis=1), (z * z).sum(axis=1)
    log_det = 2.0 * np.log(np.einsum("pii->pi", np.linalg.cholesky(M + np.eye(n)))).sum(axis=1)
    values = m * np.log(variance) + log_det + square - vz
    by_noise = 2.0 * (m - followed.sum(axis=1) - square + vz + zz)
    slopes = np.append(_by_group(2.0 * (followed - z**2)), by_noise[:, None], axis=1)
    of_scales = inverse * K - z[:, :, None] * z[:, None] * (2.0 * inverse - np.eye(n))
    noise_alone = shared.sum(axis=1) + square - vz - zz - 2.0 * (z * back).sum(axis=1)
    curvatures = _bordered(of_scales, 2.0 * z * back - shared, noise_alone)
    expected = _bordered(K * K, shared, m - followed.sum(axis=1) - shared.sum(axis=1))
    starts = np.searchsorted(run, np.arange(logarithms.shape[1]))
    sums = (np.add.reduceat(one, starts, axis=0).T for one in (values, slopes, curvatures, expected))
    return tuple(one + more for one, more in zip(sums, _of_prior(logarithms), strict=True))


def _in_sds(of: Moments, s: Float[np.ndarray, "sizes problems"], variance: Float[np.ndarray, " problems"]):
    """Return M and v, in SDs of the sizes (``s`` times those of ``SIZES``) and of the noise."""
    return persons_first(of.A * s[:, None] * s / variance), persons_first(of.c * s / variance)


def _of_prior(logarithms: Float[np.ndarray, "scales runs"]):
    """Compute -2 log prior with its derivatives: normal in the scales and in the logarithm of the noise."""
    scale, noise = np.exp(logarithms[:-1]), logarithms[-1:]
    off, off_noise = (scale - 1.0) / SCALE_SD, noise / LOG_NOISE_SD
    value = (off**2).sum(axis=0) + (off_noise**2)[0]
    slope = np.append(2.0 * off * scale / SCALE_SD, 2.0 * off_noise / LOG_NOISE_SD, axis=0)
    of_noise = np.full(noise.shape, 2.0 / LOG_NOISE_SD**2)
    curved = np.append(2.0 * scale * (2.0 * scale - 1.0) / SCALE_SD**2, of_noise, axis=0)
    expected = np.append(2.0 * scale**2 / SCALE_SD**2, of_noise, axis=0)
    return value, slope, *(np.eye(len(slope))[..., None] * one for one in (curved, expected))


def _by_group(of_sizes: Float[np.ndarray, "pairs sizes"]) -> Float[np.ndarray, "pairs groups"]:
    """Sum the sizes of each group, pair by pair, so that rounding does not depend on the other pairs in the batch."""
    return (of_sizes[:, None] @ IN_GROUP)[:, 0]


def _bordered(of_sizes, with_noise, of_noise) -> Float[np.ndarray, "pairs scales scales"]:
    """Compute 4 times the sums over the sizes of each group, bordered by the entries of the noise."""
    border = _by_group(with_noise)
    of_groups = IN_GROUP.T @ of_sizes @ IN_GROUP
    upper = np.append(of_groups, border[:, :, None], axis=2)
    lower = np.append(border, of_noise[:, None], axis=1)
    return 4.0 * np.append(upper, lower[:, None], axis=1)
