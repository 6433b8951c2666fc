"""How much the persons of a run differ: a scale of the SDs of bones and of frames, and the noise, by their likelihood.

About the most probable girdles the distances y of the chain are linear in the sizes, y = T (c z - x + x_0) + y_0, and
the sizes of each person integrate out. With B the columns times the scales of their groups, A = T'T and sigma^2 the
noise,

    M = B' A B / sigma^2,   v = B' T' b / sigma^2,   H = 1 + M,   z = H^-1 v
    -2 log p = sum over persons of  m log sigma^2 + log det H + |b|^2 / sigma^2 - v' z
    d/d(log scale of g) = 2 sum_{i in g} (1 - (H^-1)_ii - z_i^2)

of m informative numbers, of a posture the angles that were measured less three. The scales have a prior about 1, so
that a few persons stay near it, and persons who do not differ lead to 0. The adapted parameters keep the SDs of people.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.own_bones.most_probable import Posterior, Prior, Rows
from models.person.own_bones import GROUPS, SIZES
from motions.table import FEWEST_ANGLES

SCALED = GROUPS[1:]
"""The groups whose scale is learnt."""

LOG_SCALE_SD, LOG_NOISE_SD = 0.4, 0.7
"""Of the logarithms' normal priors: half or twice the SDs of ``SIZES`` is 1.7 SDs off, half or twice the noise 1."""

TYPICAL_NOISE_DEG = 0.8
"""Between bone pins, 0.4, and palpation, 1.5: of an angle, with what the chain cannot do."""

FEWEST_PERSONS = 10
"""Six bone-pin shoulders of three cadavers would make bones twice as different as people's are."""

_FARTHEST = 4.0
"""Of a logarithm from the prior's, ten or six SDs: a line search that goes on to e^28 finds rounding and ends there."""


class Scales(NamedTuple):
    """Of the SDs of each group, and the noise."""

    bones: float = 1.0
    frames: float = 1.0
    noise_deg: float = TYPICAL_NOISE_DEG

    @property
    def of_sizes(self) -> Float[np.ndarray, " sizes"]:
        """The scale of each of ``SIZES``."""
        by_group = {"adapted": 1.0, "bones": self.bones, "frames": self.frames}
        return np.array([by_group[one.group] for one in SIZES])


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


def learnt(of: Moments, chosen: Bool[np.ndarray, " problems"]) -> Scales:
    """Find the most probable scales of the chosen problems; of few, those of the prior."""
    if chosen.sum() < FEWEST_PERSONS:
        return Scales()
    from scipy.optimize import minimize  # 0.4 s to load: not for every command

    some = Moments(*(one[..., chosen] for one in of))
    within = [(-_FARTHEST, _FARTHEST)] * 3
    end = minimize(_minus_two_log_likelihood, np.zeros(3), (some,), jac=True, method="L-BFGS-B", bounds=within)
    return _scales(end.x)


def _scales(logarithms) -> Scales:
    bones, frames, noise = np.exp(logarithms).tolist()
    return Scales(bones, frames, TYPICAL_NOISE_DEG * noise)


def _minus_two_log_likelihood(logarithms, of: Moments):
    """With the prior of the logarithms, and its slopes in them."""
    scales = _scales(logarithms)
    s, variance = scales.of_sizes, scales.noise_deg**2
    M = np.moveaxis(of.A * s[:, None, None] * s[None, :, None] / variance, -1, 0)
    v = (of.c * s[:, None] / variance).T
    H = M + np.eye(len(s))
    inverse = np.linalg.inv(H)
    z = (inverse @ v[..., None])[..., 0]
    fits = of.square.sum() / variance - (v * z).sum()
    value = of.informative.sum() * np.log(variance) + np.linalg.slogdet(H)[1].sum() + fits
    each = 2.0 * (1.0 - np.einsum("pii->pi", inverse) - z**2).sum(axis=0)
    Mz = (M @ z[..., None])[..., 0]
    by_noise = 2.0 * of.informative.sum() - 2.0 * (len(s) * len(H) - np.einsum("pii->", inverse))
    by_noise += -2.0 * of.square.sum() / variance + 4.0 * (v * z).sum() - 2.0 * (z * Mz).sum()
    slopes = [sum(each[k] for k, one in enumerate(SIZES) if one.group == group) for group in SCALED] + [by_noise]
    sd = np.array([LOG_SCALE_SD, LOG_SCALE_SD, LOG_NOISE_SD])
    return value + ((logarithms / sd) ** 2).sum(), np.array(slopes) + 2.0 * logarithms / sd**2
