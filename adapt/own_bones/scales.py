"""How much the persons of a run differ: a scale of the SDs of each group of sizes, and the noise, by their likelihood.

About the most probable girdles the distances y of the chain are linear in the sizes, y = T (c z - x + x_0) + y_0, and
the sizes of each person integrate out. With B the columns times the scales of their groups, A = T'T and sigma^2 the
noise,

    M = B' A B / sigma^2,   v = B' T' b / sigma^2,   H = 1 + M,   z = H^-1 v
    -2 log p = sum over persons of  m log sigma^2 + log det H + |b|^2 / sigma^2 - v' z
    d/d(log scale of g) = 2 sum_{i in g} (1 - (H^-1)_ii - z_i^2)

of m informative numbers, of a posture the angles that were measured less three. The scales have a prior about 1, so
that a few persons stay near it, and persons who do not differ lead to 0.
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
"""Of a scale about 1, and of the logarithm of the noise: twice the SDs of ``SIZES``, and persons who do not differ, are
1.7 SDs off; half or twice the noise is 1."""

TYPICAL_NOISE_DEG = 0.8
"""Between bone pins, 0.4, and palpation, 1.5: of an angle, with what the chain cannot do."""

_LEAST_SCALE, MOST_SCALE = 0.02, 2.0
"""Nobody differs; and people are at most twice as different as ``SIZES`` say: what is beyond is no bone, but what the
chain cannot do, and noise."""

_NOISES_DEG = (0.05, 10.0)

_LARGEST = 1e13
"""Of an element of M, below which M + 1 is positive definite to rounding."""

_FLAT = 1e-3
"""Slope of -2 log p in a logarithm at the end: it is then 1e-4 SDs off at most."""

_MOST_STEPS, _SHORTER, _SHORTEST = 100, 0.3, 1e-6
"""Most take 4 to 10; factor on a step that leads up, and the share of a step below which it is rounding that ends."""

_ROUNDING = 1e-13
"""Relative, of -2 log p."""


class Scales(NamedTuple):
    """Of the SDs of each group, and the noise."""

    adapted: float = 1.0
    bones: float = 1.0
    frames: float = 1.0
    noise_deg: float = TYPICAL_NOISE_DEG

    @property
    def of_sizes(self) -> Float[np.ndarray, " sizes"]:
        """The scale of each of ``SIZES``."""
        return np.array(self)[GROUP_OF_SIZE]


PRIOR = Scales()

GROUP_OF_SIZE = np.array([GROUPS.index(one.group) for one in SIZES])

IN_GROUP = (GROUP_OF_SIZE[:, None] == np.arange(len(GROUPS))).astype(float)

_LEAST, _MOST = np.log(
    np.array([(_LEAST_SCALE, MOST_SCALE)] * len(GROUPS) + [_NOISES_DEG]) / np.array(PRIOR)[:, None]
).T[..., None]


class Moments(NamedTuple):
    """What the likelihood of each person needs."""

    A: Float[np.ndarray, "sizes sizes problems"]
    """C' T'T C, C the columns at scale 1."""
    c: Float[np.ndarray, "sizes problems"]
    """C' T' b."""
    square: Float[np.ndarray, " problems"]
    """|b|^2, deg^2."""
    informative: Int[np.ndarray, " problems"]
    """m."""


def informative(
    measured: Bool[np.ndarray, "6 rows"], part: Int[np.ndarray, " rows"], problems: int
) -> Int[np.ndarray, " problems"]:
    """Count the numbers of each problem that say something of its girdle."""
    return np.bincount(part, np.maximum(measured.sum(axis=0) - FEWEST_ANGLES, 0), problems).astype(int)


def moments(
    columns: Float[np.ndarray, "numbers sizes problems"],
    prior: Prior,
    found: Posterior,
    rows: Rows,
    part: Int[np.ndarray, " rows"],
) -> Moments:
    """Collect them at the most probable girdles."""
    y, slopes = found.nearest.y, found.nearest.by_theta
    x = prior.numbers_at(found.u) - prior.numbers_mm
    b = np.einsum("ikr,kr->ir", slopes, x[:, part]) - y
    along = np.einsum("ikr,ksr->isr", slopes, columns[..., part])
    people = range(x.shape[1])
    A, c = [], []
    for p in people:
        mine = np.concatenate(along[..., part == p], axis=1)
        A.append(mine @ mine.T)
        c.append(mine @ np.concatenate(b[:, part == p]))
    A, c = np.stack(A, axis=-1), np.stack(c, axis=-1)
    return Moments(A, c, np.bincount(part, (b**2).sum(axis=0)), informative(rows.measured, part, x.shape[1]))


def are_known(of: Moments) -> Bool[np.ndarray, " problems"]:
    """Tell whose likelihood can be computed with all scales and noises within the limits.

    A chain that hardly closes has slopes without end.
    """
    finite = np.isfinite(of.square) & np.isfinite(of.A).all(axis=(0, 1)) & np.isfinite(of.c).all(axis=0)
    largest = np.abs(of.A).max(axis=(0, 1)) * (MOST_SCALE / _NOISES_DEG[0]) ** 2
    return finite & (largest < _LARGEST) & (of.informative > 0)


def learnt(of: Moments, runs: Bool[np.ndarray, "runs problems"], start: Sequence[Scales]) -> list[Scales]:
    """Find the most probable scales of the problems of each run, from those of ``start``.

    Newton's method within the limits, each run on its own.
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


def relative_variances(
    of: Moments, runs: Bool[np.ndarray, "runs problems"], found: Sequence[Scales]
) -> Float[np.ndarray, "runs groups"]:
    """Compute the variance of each group's scale at its most probable value, relative to the square of that.

    By the curvature in the scales themselves: the logarithm of one that is nearly 0 has none.
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
    """The step of those that are free, by the expected curvature where the other one is not positive definite."""
    both, unit = free[:, None] & free, np.eye(len(slope))[..., None]
    matrices = _convex(*(np.where(both, one, unit) for one in (curvature, expected)))
    return np.linalg.solve(matrices, (slope * free).T[..., None])[..., 0].T


def _convex(curvature, expected) -> Float[np.ndarray, "runs scales scales"]:
    """The curvature of each run, where it is not positive definite the one expected."""
    own, other = (np.moveaxis(one, -1, 0) for one in (curvature, expected))
    convex = np.linalg.eigvalsh(own)[:, 0] > 0.0
    return np.where(convex[:, None, None], own, other)


def minus_two_log_likelihood(logarithms: Float[np.ndarray, "scales runs"], of: Moments, run: Int[np.ndarray, " pairs"]):
    """Compute it with the prior of the logarithms for each run, its slopes, its curvature and the one expected.

    ``of``: of each pair of a run and one of its problems, ``run`` ascending. With K = 1 - H^-1 the second derivatives
    are 4 (H^-1_ij K_ij - z_i z_j (2 H^-1_ij - delta_ij)), summed over i in g and j in h, for two scales, 4 (2 z_i (H^-1
    z)_i - (H^-1 K)_ii) for one and the noise; those expected 4 K_ij^2 and 4 (H^-1 K)_ii.
    """
    s, variance = np.exp(logarithms)[GROUP_OF_SIZE][:, run], (PRIOR.noise_deg * np.exp(logarithms[-1, run])) ** 2
    M, v = persons_first(of.A * s[:, None] * s / variance), persons_first(of.c * s / variance)
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


def _of_prior(logarithms: Float[np.ndarray, "scales runs"]):
    """-2 log of it, with its slopes and curvatures: normal in the scales, and in the logarithm of the noise."""
    scale, noise = np.exp(logarithms[:-1]), logarithms[-1:]
    off, off_noise = (scale - 1.0) / SCALE_SD, noise / LOG_NOISE_SD
    value = (off**2).sum(axis=0) + (off_noise**2)[0]
    slope = np.append(2.0 * off * scale / SCALE_SD, 2.0 * off_noise / LOG_NOISE_SD, axis=0)
    of_noise = np.full(noise.shape, 2.0 / LOG_NOISE_SD**2)
    curved = np.append(2.0 * scale * (2.0 * scale - 1.0) / SCALE_SD**2, of_noise, axis=0)
    expected = np.append(2.0 * scale**2 / SCALE_SD**2, of_noise, axis=0)
    return value, slope, *(np.eye(len(slope))[..., None] * one for one in (curved, expected))


def _by_group(of_sizes: Float[np.ndarray, "pairs sizes"]) -> Float[np.ndarray, "pairs groups"]:
    """Add up each pair by itself, so that sums are the same to the last digit whoever else is there."""
    return (of_sizes[:, None] @ IN_GROUP)[:, 0]


def _bordered(of_sizes, with_noise, of_noise) -> Float[np.ndarray, "pairs scales scales"]:
    """4 times the sums over the sizes of each group, bordered by those with the noise."""
    border = _by_group(with_noise)
    of_groups = IN_GROUP.T @ of_sizes @ IN_GROUP
    upper = np.append(of_groups, border[:, :, None], axis=2)
    lower = np.append(border, of_noise[:, None], axis=1)
    return 4.0 * np.append(upper, lower[:, None], axis=1)
