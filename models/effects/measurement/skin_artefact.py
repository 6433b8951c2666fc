"""A marker on the skin lags behind the scapula, by so much of what pins beside skin markers showed.

Measured in one man with markers all over the scapula (Cereatti et al. 2017, doi 10.1016/j.jbiomech.2017.02.004, one
computation from the published trials): the lag grows with the elevation of the arm and does not accelerate above 90
degrees. Its direction is the subject's own: the skin stays behind on the way that the scapula turns from the lowest to
the highest postures.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from models.effects.course import Varying
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotation_from_cardan, rotation_from_vector, vector_from_rotation
from motions.table import BONES, Motions

_ABDUCTION_DEG = np.array([[0, 20, 40, 60, 80, 100], [0, 2.8, 5.3, 7.9, 10.7, 13.8]])
_FLEXION_DEG = np.array([[0, 20, 40, 60, 80, 100, 120, 140], [0, 6, 10, 12, 14, 16, 17, 20]])
"""Elevation of the arm, and the lag there."""

_SIDEWAYS = ("frontal", "abduction")
"""Words in the name of a motion that raises the arm sideways; all others are taken for flexion."""

_HIGH = 0.8
"""Postures above this share of a subject's highest elevation show where its scapula turns."""

SIZE_DEG = 4.5
"""Of the lag, whatever its course and direction; root mean square beyond a constant."""

MEAN_IN_SDS = 2.5
"""Its SD is 0.4 of its mean: some have a third of what others have."""

SOURCE = (
    "Cereatti 2017 (one man): RMS 4.6 deg over 0-100 deg of abduction, 6.0 over 0-140 of flexion; Meskers 2007, van "
    "Andel 2009, Warner 2012: 6-13 deg at most, / 3.5 = 1.7-3.7; root of the mean square of 5.3 and 2.8 = 4.2"
)

_ROUNDS = 15
"""Of the fixed point of the direction, which halves what is left of its error in each."""

_LATERAL = np.array([0.0, 0.0, 1.0])
"""Rotation of the scapula with a raised arm, scapula frame: the direction where no way was measured."""


def measured_lag_deg(motions: Motions) -> Float[np.ndarray, " postures"]:
    """Look up the size of the lag at the elevation of every posture, degrees."""
    elevation = np.nan_to_num(motions.humerus_elevation_deg)
    sideways = np.array([any(word in name.lower() for word in _SIDEWAYS) for name in motions.motion.tolist()])
    return np.where(sideways, np.interp(elevation, *_ABDUCTION_DEG), np.interp(elevation, *_FLEXION_DEG))


def own_way(motions: Motions, lag_deg: Float[np.ndarray, " postures"]) -> Float[np.ndarray, "3 postures"]:
    """Find the direction of the lag of every posture's subject, a unit vector in the scapula frame.

    u is parallel to the mean over the high postures of log(R_0' R exp(lag u)), R_0 the lowest posture: the way that the
    bone turned, of which the measured way is what the lag has left. It points to lateral rotation.
    """
    scapula, subject = motions.angles_deg[:, BONES["scapula"]].T, motions.subject_number
    R_measured = rotation_from_cardan(np.nan_to_num(scapula) / DEG)
    return _ways(R_measured, lag_deg / DEG, subject, *lowest_and_high(motions))[:, subject]


def lowest_and_high(motions: Motions) -> tuple[Int[np.ndarray, " subjects"], Float[np.ndarray, " postures"]]:
    """Find the lowest posture of every subject of those with a measured scapula, and the weights of the high ones in
    their mean, 0 for all others."""
    known = np.asarray(np.isfinite(motions.angles_deg[:, BONES["scapula"]]).all(axis=1))
    elevation, every = np.nan_to_num(motions.humerus_elevation_deg), motions.rows_by_subject()
    lowest, high = np.zeros(len(every), int), np.zeros(len(elevation))
    for k, own in enumerate(every):
        rows = own[known[own]]
        if len(rows):
            lowest[k] = rows[np.argmin(elevation[rows])]
            up = rows[elevation[rows] >= _HIGH * elevation[rows].max()]
            high[up] = 1.0 / len(up)
    return lowest, high


def _ways(R_measured, lag, subject, lowest, high) -> Float[np.ndarray, "3 subjects"]:
    """The fixed point u of every subject; lateral rotation where there is no way."""
    u = np.zeros((3, len(lowest)))
    for _ in range(_ROUNDS):
        R = compose(R_measured, rotation_from_vector(u[:, subject] * lag))
        relative = compose(np.swapaxes(R[..., lowest[subject]], 0, 1), R)
        way = np.stack([np.bincount(subject, high * x, len(lowest)) for x in vector_from_rotation(relative)])
        length = np.sqrt(np.sum(way * way, axis=0))
        unit = way / np.where(length > 0.0, length, 1.0) * np.where(way[2] > 0, 1.0, -1.0)
        u = np.where(length > 0.0, unit, _LATERAL[:, None])
    return u


@dataclass(frozen=True)
class MeasuredLag(Varying):
    """One amplitude, the share of the measured lag; three channels, its rotation vector in the scapula frame."""

    word: str = "elevation of the arm, as measured"
    least_rms: float = 2.5
    """Of the lag in degrees up to 60 degrees of elevation."""

    def channels(self, directions: int) -> int:
        """Count the components of the rotation vector."""
        return 3

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Give the whole measured lag along each subject's own way."""
        lag = measured_lag_deg(motions)
        return (own_way(motions, lag) * lag)[None]


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """R_true = R_measured exp(lag): the bone has turned further, about its own axes, than the skin shows."""
    R_thorax_clavicle, R_thorax_measured = rotations
    return girdle, (R_thorax_clavicle, compose(R_thorax_measured, rotation_from_vector(deg / DEG)))


EFFECT = Effect(
    name="skin_artefact",
    plain_name="skin marker lags the scapula",
    what="a skin marker lags the scapula as pins beside skin markers showed",
    unit="of the measured lag",
    strength_unit="deg",
    directions=("share",),
    course=MeasuredLag(),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(SIZE_DEG,),
        mean=MEAN_IN_SDS,
        sign=(1,),
        source=SOURCE,
    ),
)
