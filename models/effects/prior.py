"""Prior of an effect's amplitudes, by one rule for every basis.

The scale of a direction is the SD of the effect's size, in mm at the joint or degrees of the bone. The size is the root
mean square, over the measured postures, of the effect's strength beyond a constant of each subject; for a constant
effect it is the constant. With strengths sum_k a_k f_k(p) over the terms f_k of the basis, each minus its mean over the
postures of the subject,

    E[mean_p |sum_k a_k f_k(p)|^2] = scale^2,   a_k ~ N(mean SD_k, SD_k^2),   SD_k = c r_k

where r_k are the relative SDs of the terms, and only the first term has a mean. These equations determine c, so that a
basis of many terms has the same size as a basis of one. A monotone basis of range R has a root mean square of about
R / 3.5.

The diagnosis uses this prior; a model with a known effect does not.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class EffectPrior:
    """Normal prior of an effect's amplitudes; tuples have one value per direction."""

    scale: tuple[float, ...]
    """Prior SD of the size. The norm of this vector is the typical size of the effect."""
    source: str
    """Source of the scale, and its derivation where the source has a range or a largest value."""
    sign: tuple[int, ...] = ()
    """Sign that the nature of the effect implies: +1, -1, or 0 for either; empty for all 0."""
    mean: float = 0.0
    """Prior mean of the first amplitude of each direction, in its SDs, where measurements give one."""


class AmplitudePrior(NamedTuple):
    """Normal prior of the amplitudes of an effect at given postures."""

    mean: Float[np.ndarray, " amplitudes"]
    sd: Float[np.ndarray, " amplitudes"]


def amplitude_prior(
    prior: EffectPrior, terms_sd: tuple[float, ...], rms: Float[np.ndarray, " amplitudes"]
) -> AmplitudePrior:
    """Compute the prior of amplitudes from the prior of sizes. ``rms``: size of each amplitude of 1 at the postures."""
    relative = np.tile(terms_sd, len(prior.scale))
    in_sds = np.tile(np.eye(len(terms_sd))[0] * prior.mean, len(prior.scale))
    squares = ((1.0 + in_sds**2) * (relative * rms) ** 2).reshape(len(prior.scale), -1)
    sd = relative * np.repeat(prior.scale / np.sqrt(squares.sum(axis=1)), len(terms_sd))
    return AmplitudePrior(in_sds * sd, sd)
