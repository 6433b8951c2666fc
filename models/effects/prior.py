"""What is believed about an effect before any data: one rule for all, whatever the course.

The scale of a direction is the SD of a size: of the root mean square over the measured postures of what the effect
does beyond a constant of each subject, in mm at the joint or degrees of the bone; of a constant effect, of the
constant. With strengths sum_k a_k f_k(p) along the terms of its course, each less its mean over the postures of the
subject,

    E[mean_p |sum_k a_k f_k(p)|^2] = scale^2,   a_k ~ N(mean SD_k, SD_k^2),   SD_k = c r_k

r_k are the SDs of the course's terms beside each other, and only the first has a mean. That fixes c: a course of many
terms is no larger than one of one. A monotone course of range R has a root mean square of about R / 3.5.

The diagnosis reads it; a model with a known effect does not.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class EffectPrior:
    """Normal prior of an effect's amplitudes; a tuple has one value for each direction."""

    scale: tuple[float, ...]
    """Prior SD of the size: as a vector, as long as the effect typically is."""
    source: str
    """Where the scale comes from, and how a range or a largest value was turned into it."""
    sign: tuple[int, ...] = ()
    """Where the effect's nature gives one: +1, -1, or 0 for either; empty for all 0."""
    mean: float = 0.0
    """Prior mean of the first amplitude of each direction, in its SDs, where what is measured of it has one."""


class AmplitudePrior(NamedTuple):
    """Normal prior of the amplitudes of an effect at given postures."""

    mean: Float[np.ndarray, " amplitudes"]
    sd: Float[np.ndarray, " amplitudes"]


def amplitude_prior(
    prior: EffectPrior, terms_sd: tuple[float, ...], rms: Float[np.ndarray, " amplitudes"]
) -> AmplitudePrior:
    """Compute the prior of amplitudes from that of sizes. ``rms``: of an amplitude of 1, at the postures."""
    relative = np.tile(terms_sd, len(prior.scale))
    in_sds = np.tile(np.eye(len(terms_sd))[0] * prior.mean, len(prior.scale))
    squares = ((1.0 + in_sds**2) * (relative * rms) ** 2).reshape(len(prior.scale), -1)
    sd = relative * np.repeat(prior.scale / np.sqrt(squares.sum(axis=1)), len(terms_sd))
    return AmplitudePrior(in_sds * sd, sd)
