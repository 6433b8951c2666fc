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

from adapt.diagnosis.fit.linear_evidence import (
    AmplitudePrior,
    LinearisedFit,
    Spread,
    common_shift,
    independent_prior,
    inner_products,
    log_evidence,
    log_sum,
    shared_prior,
)
from adapt.diagnosis.fit.measurement_noise import NoiseEstimate
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.priors import SHIFT
from models.effects.effect import FULL_ELEVATION_DEG
from models.girdle import CONSTRAINTS
from motions.rotations import DEG

Columns = Float[np.ndarray, "subjects residuals more"]
"""Derivatives of y by some numbers each."""

SMOOTH, FINE = 3, 6
"""Terms over elevation in each motion: a constant, a slope and a bend; or nearly any course of seven postures."""

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
"""Shares of an estimated noise that may be all of it."""

_SCATTER_SHARE = 0.01
"""Prior probability of scatter: the noise of six angles is not quite alike, which is not to pass for it."""


def discrepancy_columns(fitted: LinearisedFit, data: Observed, terms: int) -> Columns:
    """Derivatives of y by the terms (Legendre polynomials of elevation), for each constraint and motion."""
    return _over_elevation(fitted.root[..., : len(CONSTRAINTS)], data, terms)


def landmark_columns(fitted: LinearisedFit, data: Observed) -> list[tuple[Columns, tuple[float, ...]]]:
    """The same, smooth over elevation, for a degree of each angle of either bone, and a mm of each coordinate of every
    landmark, with their scales; of data without landmarks, none."""
    by_coordinate = fitted.root[..., len(CONSTRAINTS) :]
    if not by_coordinate.shape[-1]:
        return []
    units = [(angle, _SCALES_DEG) for angle in _by_three(fitted.by_angle / DEG)]
    units += [(landmark, _SCALES_LANDMARK_MM) for landmark in _by_three(by_coordinate)]
    return [(_over_elevation(unit, data, SMOOTH), scales) for unit, scales in units]


def _by_three(units: Float[np.ndarray, "subjects postures m units"]) -> list[np.ndarray]:
    return np.split(units, units.shape[-1] // _XYZ, axis=-1)


def _over_elevation(unit: Float[np.ndarray, "subjects postures m units"], data: Observed, terms: int) -> Columns:
    x = np.clip(2.0 * data.elevation_deg / FULL_ELEVATION_DEG - 1.0, -1.0, 1.3).T
    over = np.polynomial.legendre.legvander(x, terms - 1)
    in_motion = data.motion.T[..., None] == np.arange(len(data.motions))
    columns = unit[..., None, None] * (over[..., None] * in_motion[..., None, :])[:, :, None, None]
    return columns.reshape(len(unit), unit.shape[1] * unit.shape[2], -1)


def scatter_columns(fitted: LinearisedFit, held_by: Sequence[float]) -> Columns:
    """Derivatives of y by a number of mm for each posture, added to A1-A3 in the shares of ``held_by``."""
    subjects, postures, m, _ = fitted.root.shape
    at_posture = fitted.root[..., : len(CONSTRAINTS)] @ np.asarray(held_by)
    columns = at_posture[..., None] * np.eye(postures)[:, None]
    return columns.reshape(subjects, postures * m, postures)


def discrepancy_gain(fitted: LinearisedFit, data: Observed, prior: AmplitudePrior, noise: NoiseEstimate) -> float:
    """log evidence of the hypothesis with a discrepancy beside it, less that without: the most over its kinds.

    A course over elevation: smooth or fine, of either size, common to the subjects or each subject's own; with landmark
    positions, of a bone's angles or a landmark too. Or scatter from posture to posture in what holds the scapula or the
    clavicle; it passes for noise, so the noise may then be less than it was estimated to be.
    """
    course = _gain(fitted, prior, _courses(fitted, data), noise.likely_factors)
    scatter = _gain(fitted, prior, _scatters(fitted), _less_or_likely(noise))
    return max(course, scatter + math.log(_SCATTER_SHARE))


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
    """``_NOISES``, and the shares above them that an estimate from few degrees of freedom leaves likely: without them a
    noise estimated too low would pass for scatter."""
    if noise.known:
        return noise.likely_factors
    shares = [*_NOISES, *(share for share, _ in noise.likely_factors if share > max(_NOISES))]
    return [(share, 1.0 / len(shares)) for share in shares]


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
