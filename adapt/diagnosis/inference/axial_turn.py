"""How far the clavicle turns about its own axis: published, so known a little beforehand.

The fits see how far measured postures are from those that the chain can take, three numbers of six. They do not see
where among these the bones are; but hypotheses differ in that. A clavicle whose measured axial rotation is an estimate
that lags turns farther than was measured, one with a strained conoid does not. With rho the slope of the axial rotation
over elevation, mean over the subjects and their motions, and a the amplitudes of a hypothesis,

    rho(a) = rho_measured + R a ~ N(published, between studies^2 + between people^2 / subjects),

which is one more residual: that of a mean subject without adapted parameters.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_evidence import InnerProducts
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.departures import departures_of, departures_per_channel
from models.adapted_parameters import ADAPTED
from models.effects import Effect
from models.effects.effect import FULL_ELEVATION_DEG
from motions.rotations import DEG
from motions.table import ANGLES

_AXIAL = ANGLES.index("clavicle_x")

_PUBLISHED_DEG, _STUDIES_DEG, _PEOPLE_DEG = 33.0, 12.0, 11.0
"""By 150 degrees of elevation; SD between studies and between people. Bone pins and open MRI: 17-35 deg by 120 to 140
(Ludewig, Matsuki, Sahara); six shoulders with bone pins 9-31 by 120 (Moissenet 2023); the closed chain turns it
farther, by about 45. So wide that it decides only what is open otherwise."""

_LEAST_RANGE = 0.04
"""Sum of squares of the elevations of a subject about the means of its motions, as shares of ``FULL_ELEVATION_DEG``,
from which they have a slope: two postures 42 degrees apart."""


class MeanSubject(NamedTuple):
    """The one residual, R a - measured, in standard deviations."""

    columns: Float[np.ndarray, " amplitudes"]
    measured: float


def mean_subject(effects: Sequence[Effect], data: Observed) -> MeanSubject | None:
    """Compute the residual of the mean subject under a hypothesis of these effects: its columns are the amplitudes,
    followed by their departures (see ``departures``). None where no elevations have a slope."""
    weight = _slope_weights(data)
    subjects = int(weight.any(axis=0).sum())
    if not subjects:
        return None
    sd = np.hypot(_STUDIES_DEG, _PEOPLE_DEG / np.sqrt(subjects))
    own, beside = [np.zeros(0)], [np.zeros(0)]
    for effect in effects:
        by_term, by_departure = np.zeros(effect.terms), np.zeros(departures_per_channel(data))
        if effect.prior.axial:
            course = effect.course(data.elevation_deg)
            by_term = (course * weight).sum(axis=(1, 2)) / subjects
            by_departure = np.einsum("ps,spd->d", course[0] * weight, departures_of(data, effect)) / subjects
        axial = effect.prior.axial or np.zeros(len(effect.channels))
        own.append(np.outer(axial, by_term).ravel())
        if effect.over_elevation:
            beside.append(np.outer(axial, by_departure).ravel())
    return MeanSubject(
        np.concatenate([*own, *beside]) / sd,
        (_PUBLISHED_DEG - float(_turns_deg(data, weight).sum()) / subjects) / sd,
    )


def turns_deg(data: Observed) -> Float[np.ndarray, " subjects"]:
    """Compute how far each subject's clavicle turned as measured, deg by full elevation: 0 where no elevations have a
    slope."""
    return _turns_deg(data, _slope_weights(data))


def _turns_deg(data: Observed, weight: Float[np.ndarray, "postures subjects"]) -> Float[np.ndarray, " subjects"]:
    return (data.values[_AXIAL] * weight).sum(axis=0) * float(DEG)


def with_mean_subject(products: InnerProducts, one: MeanSubject | None) -> InnerProducts:
    """Add the inner products of one more subject, the mean one; without it, change nothing."""
    if one is None:
        return products
    row = np.concatenate([np.zeros(len(ADAPTED)), one.columns])
    return replace(
        products,
        columns=np.concatenate([products.columns, np.outer(row, row)[None]]),
        with_data=np.concatenate([products.with_data, (row * one.measured)[None]]),
        square=products.square + one.measured**2,
    )


def _slope_weights(data: Observed) -> Float[np.ndarray, "postures subjects"]:
    """What each posture adds to its subject's slope over elevation, its motions each about their own mean."""
    f = data.elevation_deg / FULL_ELEVATION_DEG
    measured = data.counted & data.measured[_AXIAL]
    apart = np.zeros_like(f)
    for motion in range(len(data.motions)):
        in_motion = measured & (data.motion == motion)
        mean = (f * in_motion).sum(axis=0) / np.maximum(in_motion.sum(axis=0), 1)
        apart += np.where(in_motion, f - mean, 0.0)
    square = (apart**2).sum(axis=0)
    return np.where(square >= _LEAST_RANGE, apart / np.maximum(square, _LEAST_RANGE), 0.0)
