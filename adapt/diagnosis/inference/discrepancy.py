"""A gap that no effect of the list explains, as columns of the linear model: what A1-A3 would have to be off by.

Whatever acts, acts on the constraints: their targets are off by some function of elevation, another one in each motion.
Where landmark positions are given too, the angles of a bone may be off against them, or one landmark against the rest:
neither need touch A1-A3. A hypothesis that leaves something systematic becomes more probable when this is added to it;
a true one does not. So does one that leaves more scatter between postures than the noise of the angles makes: a
breathing thorax.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.discrepancy_columns import FINE, SMOOTH, Columns, discrepancy_columns, over_elevation
from adapt.diagnosis.fit.linear_evidence import inner_products, log_evidence, log_sum
from adapt.diagnosis.fit.linear_model import (
    AmplitudePrior,
    LinearisedFit,
    Spread,
    common_shift,
    independent_prior,
    shared_prior,
)
from adapt.diagnosis.fit.measurement_noise import NoiseEstimate
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.priors import SHIFT
from models.girdle import CONSTRAINTS
from motions.rotations import DEG

_SCALES_MM = (1.0, 3.0)
"""Prior SD of each term: bone pins left 3-5 mm of TS and AI, 2-4 mm of the conoid; a third of that for a small one."""

_SCALES_DEG = (2.0, 6.0)
"""The same of a measured angle: the effects of the list are of 4 to 10 degrees."""

_SCALES_LANDMARK_MM = (2.0, 6.0)
"""The same of a landmark: about the noise of one, and what surely is not."""

_XYZ = 3
"""Angles of a bone, coordinates of a landmark."""

_HELD_BY = ((1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""What may scatter: the thorax under TS and AI, or the conoid."""

_NOISES = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1)
"""Factors that may take an estimated noise to all of it."""

_SCATTER_PROBABILITY = 0.01
"""Prior probability of scatter: the noise of six angles is not quite equal, which is not to pass for it."""


def landmark_columns(fitted: LinearisedFit, data: Observed) -> list[tuple[Columns, tuple[float, ...]]]:
    """Differentiate y by terms smooth over elevation, for a degree of each angle of either bone, and a mm of each
    coordinate of every landmark, with their scales; of data without landmarks, none."""
    by_coordinate = fitted.root[..., len(CONSTRAINTS) :]
    if not by_coordinate.shape[-1]:
        return []
    units = [(angle, _SCALES_DEG) for angle in _by_three(fitted.by_angle / DEG)]
    units += [(landmark, _SCALES_LANDMARK_MM) for landmark in _by_three(by_coordinate)]
    return [(over_elevation(unit, data, SMOOTH), scales) for unit, scales in units]


def _by_three(units: Float[np.ndarray, "subjects postures m units"]) -> list[np.ndarray]:
    return np.split(units, units.shape[-1] // _XYZ, axis=-1)


def scatter_columns(fitted: LinearisedFit, held_by: Sequence[float]) -> Columns:
    """Differentiate y by a number of mm for each posture, added to A1-A3 in the shares of ``held_by``."""
    subjects, postures, m, _ = fitted.root.shape
    at_posture = fitted.root[..., : len(CONSTRAINTS)] @ np.asarray(held_by)
    columns = at_posture[..., None] * np.eye(postures)[:, None]
    return columns.reshape(subjects, postures * m, postures)


def discrepancy_gain(fitted: LinearisedFit, data: Observed, prior: AmplitudePrior, noise: NoiseEstimate) -> float:
    """Compute the log evidence of the hypothesis with a discrepancy beside it, less that without: the most over kinds.

    A course over elevation: smooth or fine, of either size, common to the subjects or each subject's own; with landmark
    positions, of a bone's angles or a landmark too. Or scatter from posture to posture in what holds the scapula or the
    clavicle; it passes for noise, so the noise may then be less than it was estimated to be.
    """
    course = _gain(fitted, prior, _courses(fitted, data), noise.likely_factors)
    scatter = _gain(fitted, prior, _scatters(fitted), _less_or_likely(noise))
    return max(course, scatter + math.log(_SCATTER_PROBABILITY))


Kind = tuple[Columns, Spread, tuple[float, ...]]
"""Columns of a discrepancy, how it varies between subjects, and the scales that it may have."""


def _courses(fitted: LinearisedFit, data: Observed) -> list[Kind]:
    smooth, fine = (discrepancy_columns(fitted, data, terms) for terms in (SMOOTH, FINE))
    return [
        (smooth, shared_prior, _SCALES_MM),
        (smooth, independent_prior, _SCALES_MM),
        (fine, shared_prior, _SCALES_MM),
        *(
            (columns, spread, sds)
            for columns, sds in landmark_columns(fitted, data)
            for spread in (shared_prior, independent_prior)
        ),
    ]


def _scatters(fitted: LinearisedFit) -> list[Kind]:
    return [(scatter_columns(fitted, held_by), independent_prior, _SCALES_MM) for held_by in _HELD_BY]


def _less_or_likely(noise: NoiseEstimate) -> list[tuple[float, float]]:
    """Give ``_NOISES``, and the factors above them that an estimate from few degrees of freedom leaves likely: without
    them a noise estimated too low would pass for scatter."""
    if noise.known:
        return noise.likely_factors
    factors = [*_NOISES, *(factor for factor, _ in noise.likely_factors if factor > max(_NOISES))]
    return [(factor, 1.0 / len(factors)) for factor in factors]


def _gain(
    fitted: LinearisedFit, prior: AmplitudePrior, kinds: Sequence[Kind], noises: Sequence[tuple[float, float]]
) -> float:
    """The most of any kind and size; the noise is integrated out, with and without. A shift of the adapted parameters
    that subjects have in common is no discrepancy: it may be there in both."""
    shift = common_shift(SHIFT)
    without = log_sum(log_evidence(inner_products(fitted).with_shift().over(noises), prior + shift))
    gains = []
    for columns, spread, scales in kinds:
        with_more, one = inner_products(fitted, columns).with_shift().over(noises), np.ones(columns.shape[2])
        priors = [prior + spread(one * scale) + shift for scale in scales]
        gains += [log_sum(log_evidence(with_more, wider)) for wider in priors]
    return max(gains) - without
