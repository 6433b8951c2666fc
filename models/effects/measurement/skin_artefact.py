"""A marker on the skin lags behind the scapula, by a share of the lag between bone pins and skin markers of one man.

The man had markers all over the scapula (Cereatti et al. 2017, doi 10.1016/j.jbiomech.2017.02.004, one computation from
the published trials). The lag grows with the elevation of the arm and does not accelerate above 90 degrees. The
direction of the lag is the subject's own: the skin lags along the rotation of the scapula from the lowest to the
highest postures.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from models.effects.basis import Varying
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotation_from_cardan, rotation_from_vector, vector_from_rotation
from motions.table import BONES, Motions

_ABDUCTION_DEG = np.array([[0, 20, 40, 60, 80, 100], [0, 2.8, 5.3, 7.9, 10.7, 13.8]])
_FLEXION_DEG = np.array([[0, 20, 40, 60, 80, 100, 120, 140], [0, 6, 10, 12, 14, 16, 17, 20]])
"""Elevations of the arm, and the lag at each, in degrees."""

_SIDEWAYS = ("frontal", "abduction")
"""Words in the names of motions that raise the arm sideways; all other motions count as flexion."""

_HIGH = 0.8
"""Share of a subject's highest elevation above which postures determine the direction of the lag."""

SIZE_DEG = 4.5
"""Size of the lag, the same for every basis and direction: root mean square beyond a constant."""

MEAN_IN_SDS = 2.5
"""Prior mean of the lag in SDs: the SD is 0.4 of the mean, as some people have a third of the lag of others."""

SOURCE = (
    "Cereatti 2017 (one man): RMS 4.6 deg over 0-100 deg of abduction, 6.0 over 0-140 of flexion; Meskers 2007, van "
    "Andel 2009, Warner 2012: 6-13 deg at most, / 3.5 = 1.7-3.7; root of the mean square of 5.3 and 2.8 = 4.2"
)

_ROUNDS = 15
"""Number of fixed-point iterations for the direction; each halves the error."""

_LATERAL = np.array([0.0, 0.0, 1.0])
"""Axis of lateral rotation, scapula frame: direction of the lag if no rotation of the scapula was measured."""


def measured_lag_deg(motions: Motions) -> Float[np.ndarray, " postures"]:
    """Interpolate the size of the lag at the elevation of every posture, degrees."""
    elevation = np.nan_to_num(motions.humerus_elevation_deg)
    sideways = np.array([any(word in name.lower() for word in _SIDEWAYS) for name in motions.motion.tolist()])
    return np.where(sideways, np.interp(elevation, *_ABDUCTION_DEG), np.interp(elevation, *_FLEXION_DEG))


def own_way(motions: Motions, lag_deg: Float[np.ndarray, " postures"]) -> Float[np.ndarray, "3 postures"]:
    """Find the direction u of the lag of each posture's subject, a unit vector in the scapula frame.

    u is parallel to the mean over the high postures of log(R_0' R), where R = R_measured exp(lag u) is the rotation of
    the bone and R_0 is R in the lowest posture. The sign of u is that of lateral rotation.
    """
    scapula, subject = motions.angles_deg[:, BONES["scapula"]].T, motions.subject_number
    R_measured = rotation_from_cardan(np.nan_to_num(scapula) / DEG)
    return _ways(R_measured, lag_deg / DEG, subject, *lowest_and_high(motions))[:, subject]


def lowest_and_high(motions: Motions) -> tuple[Int[np.ndarray, " subjects"], Float[np.ndarray, " postures"]]:
    """Find each subject's lowest posture with a measured scapula, and the weights of the high postures in their mean
    (0 for all other postures)."""
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
    """Compute the fixed point u of every subject; the axis of lateral rotation where the scapula did not turn."""
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
    """Basis with one amplitude, the share of the measured lag; three channels, the rotation vector (scapula frame)."""

    word: str = "elevation of the arm, as measured"
    least_rms: float = 2.5
    """Lower limit of ``rms``: that of the lag in degrees up to 60 degrees of elevation."""

    def channels(self, directions: int) -> int:
        """Return 3, the components of the rotation vector."""
        return 3

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Compute the whole measured lag along each subject's direction."""
        lag = measured_lag_deg(motions)
        return (own_way(motions, lag) * lag)[None]


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Compute R_true = R_measured exp(lag): the bone has turned further, about its own axes, than the skin."""
    R_thorax_clavicle, R_thorax_measured = rotations
    return girdle, (R_thorax_clavicle, compose(R_thorax_measured, rotation_from_vector(deg / DEG)))


EFFECT = Effect(
    name="skin_artefact",
    plain_name="skin marker lags the scapula",
    what="a skin marker lags the scapula as pins beside skin markers showed",
    unit="of the measured lag",
    strength_unit="deg",
    directions=("share",),
    basis=MeasuredLag(),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(SIZE_DEG,),
        mean=MEAN_IN_SDS,
        sign=(1,),
        source=SOURCE,
    ),
)
