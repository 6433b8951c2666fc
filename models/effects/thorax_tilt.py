"""The thorax ellipsoid's axes are not those of the thorax frame.

They turn about its centre. Had they turned about another point of its long axis, the centre would also lie further
forward or back (and aside, which the sagittal plane forbids): the diagnosis allows for that.
"""

from dataclasses import replace

import jax.numpy as jnp

from models.effects.effect import Effect, Points, Rotations, turned
from models.girdle import Girdle
from motions.rotations import DEG, compose, rotate, rotation_from_vector


def _adjust(girdle: Girdle, rotations: Rotations, deg) -> tuple[Girdle, Rotations]:
    """Everything else turned back about the ellipsoid's centre: the same chain, seen along the ellipsoid's axes."""
    R_ellipsoid_thorax = jnp.swapaxes(rotation_from_vector(deg / DEG), 0, 1)
    sc = girdle.centre_mm + rotate(R_ellipsoid_thorax, girdle.sc_mm - girdle.centre_mm)
    R_clavicle, R_scapula = (compose(R_ellipsoid_thorax, R) for R in rotations)
    return replace(girdle, sc_mm=sc), (R_clavicle, R_scapula)


def _show(points: Points, girdle: Girdle, rotations: Rotations, deg) -> Points:
    """Back into the thorax frame."""
    centre = girdle.centre_mm[:, None]
    return centre + turned(rotation_from_vector(deg / DEG), points - centre)


_SCALE_DEG = 7.0

_PIVOT_APART_MM = 50.0
"""How far from the centre the axes may well have turned, assumed: it lies some 150 mm below IJ, and the middle of
the scapula 100 mm."""

EFFECT = Effect(
    name="thorax_tilt",
    what="ellipsoid axes rotated from the thorax frame",
    unit="deg",
    channels=("about x", "about y", "about z"),
    scale=(_SCALE_DEG,) * 3,
    over_elevation=False,
    source="assumed: 5-10 deg, no figure found",
    adjust=_adjust,
    show=_show,
    takes_along_mm=(("M_z", _PIVOT_APART_MM * _SCALE_DEG / float(DEG)),),
)
