"""The thorax ellipsoid's axes are not those of the thorax frame.

They turn about its centre, which may lie further forward or back with it: had they turned about another point of the
long axis, it would (and aside, which the sagittal plane forbids).
"""

from dataclasses import replace

import jax.numpy as jnp

from models.effects.effect import Effect, Points, Rotations, rotate_points
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotate, rotation_from_vector


def _centre_mm(girdle: Girdle, tilt):
    """The centre, moved back by the last channel."""
    M_x, M_y, M_z = girdle.centre_mm
    return jnp.stack(jnp.broadcast_arrays(M_x, M_y, M_z + tilt[3]))


def _adjust(girdle: Girdle, rotations: Rotations, tilt) -> tuple[Girdle, Rotations]:
    """Everything else turned back about the ellipsoid's centre: the same chain, seen along the ellipsoid's axes."""
    R_ellipsoid_thorax = jnp.swapaxes(rotation_from_vector(tilt[:3] / DEG), 0, 1)
    centre = _centre_mm(girdle, tilt)
    sc = centre + rotate(R_ellipsoid_thorax, girdle.sc_mm - centre)
    R_clavicle, R_scapula = (compose(R_ellipsoid_thorax, R) for R in rotations)
    return replace(girdle, sc_mm=sc, centre_mm=centre), (R_clavicle, R_scapula)


def _show(points: Points, girdle: Girdle, rotations: Rotations, tilt) -> Points:
    """Back into the thorax frame."""
    centre = _centre_mm(girdle, tilt)[:, None]
    return centre + rotate_points(rotation_from_vector(tilt[:3] / DEG), points - centre)


_SCALE_DEG = (6.0, 3.5, 3.5)

_PIVOT_APART_MM = 50.0
"""How far from the centre the axes may well have turned, assumed: it lies some 150 mm below IJ, and the middle of
the scapula 100 mm."""

EFFECT = Effect(
    name="thorax_tilt",
    what="ellipsoid axes rotated from the thorax frame",
    unit="deg",
    channels=("about x", "about y", "about z", "centre back, mm"),
    details=1,
    over_elevation=False,
    adjust=_adjust,
    show=_show,
    prior=EffectPrior(
        scale=(*_SCALE_DEG, _PIVOT_APART_MM * _SCALE_DEG[0] / float(DEG)),
        source="assumed: 5-10 deg, no figure found",
    ),
)
