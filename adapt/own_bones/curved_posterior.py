"""Correction of the linearised posterior covariance, which overstates the information of motions about bones.

The posterior of the chain's u (``own_bones.most_probable``) has curved ridges. The covariance H^-1 from the Jacobian at
the optimum assumes straight ridges and is too small where people differ much. Random draws show by how much: with noise
e on the measured angles and a shift eta ~ N(0, 1) of the prior mean, the optimum moves by d. With straight ridges it
would move by

    d' = H^-1 (eta - T'B e / sigma^2),

where T and B are the Jacobians of the distances y in u and in the angles. The d' have the covariance H^-1 (randomise,
then optimise: Bardsley et al. 2014, SIAM J Sci Comput 36:A1895). With sizes z = S u of prior variance 1,

    beta = (sum z(d)^2 - sum z(d')^2) / sum (1 - var z),    covariance C + r (1 - C) r,   r = sqrt(beta) of each group

with C the linearised covariance of z, and sums over the persons, one draw of each and its mirror image, and the sizes
of a group. beta is the fraction of the linearised information that the motions do not contain. In this form no
posterior variance exceeds the prior variance, which a factor on C would allow. d and d' use the same draws, so their
difference has hardly any sampling noise.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.random import PCG64, Generator

from adapt.engine.batching import take_problems
from adapt.own_bones.most_probable import (
    Posterior,
    Prior,
    Rows,
    most_probable,
    of_problems,
    take_found,
)
from adapt.own_bones.posture_steps import persons_first
from motions.rotations import DEG

_SEED = 0

_MOST_STEPS = 60
"""Largest number of steps for a draw; its end counts where the chain is closed. For people who differ twice as much as
the prior says, 75 % have settled after 30 steps and 98 % after 150; the coverage of the intervals is within 0.3 % of
the coverage after 60 steps."""


def covariance_of_u(
    found: Posterior, prior: Prior, problem: Int[np.ndarray, " rows"]
) -> Float[np.ndarray, "problems n n"]:
    """Compute the covariance H^-1 = (1 + T'T / sigma^2)^-1 of each problem."""
    slopes = _slopes(found, prior, problem)
    matrix = np.add.reduceat(np.swapaxes(slopes, 1, 2) @ slopes, _starts(prior, problem), axis=0)
    return np.linalg.inv(matrix / prior.noise_deg[:, None, None] ** 2 + np.eye(len(found.u)))  # prior variance 1


def overstated(
    rows: Rows,
    problem: Int[np.ndarray, " rows"],
    prior: Prior,
    shares: Float[np.ndarray, "sizes n problems"],
    found: Posterior,
    known: Bool[np.ndarray, " problems"],
    models: int,
) -> tuple[Float[np.ndarray, "sizes problems"], Float[np.ndarray, "sizes problems"]]:
    """Sum z(d)^2 - z(d')^2 and 1 - var z of each problem over the draws whose chain closes; 0 without an optimum.

    ``shares``: S. ``models``: number of models, which share the persons and the draws.
    """
    more, every = np.zeros((2, len(shares), len(prior.noise_deg)))
    left = np.flatnonzero(found.settled & known)
    if not len(left):
        return more, every
    eta, noise = _draws(found, models)
    eta, noise = eta[:, left], noise[:, np.isin(problem, left)]
    found = take_found(found, problem, np.flatnonzero(found.settled & known))
    (rows, problem), prior, S = (
        of_problems(rows, problem, left),
        take_problems(prior, left),
        persons_first(shares[..., left]),
    )
    moves_deg = noise * prior.noise_deg[problem]
    told, straight = _if_straight(found, prior, problem, S, eta, moves_deg)
    for end, d in _if_moved(rows, problem, prior, found, eta, moves_deg):
        more[:, left] += np.where(end, _squares(S, d) - straight, 0.0)
        every[:, left] += np.where(end, told, 0.0)
    return more, every


def _draws(found: Posterior, models: int) -> Sequence[Float[np.ndarray, "k all"]]:
    """Draw the shifts of the prior mean and of each angle, in SDs."""
    generator, sizes = Generator(PCG64(_SEED)), (found.u.shape, found.nearest.angles.shape)
    return [np.tile(generator.standard_normal((n, count // models)), models) for n, count in sizes]


def _if_moved(rows: Rows, problem, prior: Prior, found: Posterior, eta, moves_deg):
    """Compute where the chain closes, and d, for each draw and its mirror image, in one batch."""
    count = len(prior.noise_deg)
    eta, moves = (np.append(one, -one, axis=1) for one in (eta, moves_deg / DEG))
    again = np.tile(np.arange(count), 2)
    twice, several = of_problems(rows, problem, again)
    prior, start = take_problems(prior, again), np.tile(found.nearest.angles, 2)
    twice, prior = twice._replace(angles=twice.angles + moves), prior._replace(numbers_mm=prior.numbers_at(eta))
    end = most_probable(twice, several, prior, found.u[:, again] - eta, start, _MOST_STEPS)
    d = end.u + eta - found.u[:, again]
    return zip(np.split(end.closed, 2), np.split(d, 2, axis=1), strict=True)


def _if_straight(found: Posterior, prior: Prior, problem, S, eta, moves_deg):
    """Compute 1 - var z, and z(d')^2, which a draw and its mirror image share."""
    covariance = covariance_of_u(found, prior, problem)
    of_angles = persons_first(found.nearest.B) @ persons_first(moves_deg / DEG)[..., None]
    slope = (np.swapaxes(_slopes(found, prior, problem), 1, 2) @ of_angles)[..., 0]
    back = np.add.reduceat(slope, _starts(prior, problem), axis=0) / prior.noise_deg[:, None] ** 2
    d = (covariance @ (persons_first(eta) - back)[..., None])[..., 0].T
    return np.maximum(((S - S @ covariance) * S).sum(axis=2).T, 0.0), _squares(S, d)


def _squares(S: Float[np.ndarray, "problems sizes n"], d: Float[np.ndarray, "n problems"]):
    """Compute z(d)^2."""
    return (S @ persons_first(d)[..., None])[..., 0].T ** 2


def _slopes(found: Posterior, prior: Prior, problem: Int[np.ndarray, " rows"]) -> Float[np.ndarray, "rows 3 n"]:
    """Compute the Jacobian T of each row."""
    return persons_first(found.nearest.by_theta) @ persons_first(prior.root_mm)[problem]


def _starts(prior: Prior, problem: Int[np.ndarray, " rows"]) -> Int[np.ndarray, " problems"]:
    return np.searchsorted(problem, np.arange(len(prior.noise_deg)))
