"""What A1-A3 would have to be off by over elevation, as columns of the linear model."""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_model import LinearisedFit
from adapt.diagnosis.fit.observations import Observed
from models.effects.effect import FULL_ELEVATION_DEG
from models.girdle import CONSTRAINTS

Columns = Float[np.ndarray, "subjects residuals more"]
"""Derivatives of y by some numbers each."""

SMOOTH, FINE = 3, 6
"""Terms over elevation in each motion: a constant, a slope and a bend; or nearly any course of seven postures."""


def discrepancy_columns(fitted: LinearisedFit, data: Observed, terms: int) -> Columns:
    """Differentiate y by the terms (Legendre polynomials of elevation), for each constraint and motion."""
    return over_elevation(fitted.root[..., : len(CONSTRAINTS)], data, terms)


def over_elevation(unit: Float[np.ndarray, "subjects postures m units"], data: Observed, terms: int) -> Columns:
    """Let each unit follow a Legendre polynomial of elevation, of so many terms, in each motion."""
    x = np.clip(2.0 * data.elevation_deg / FULL_ELEVATION_DEG - 1.0, -1.0, 1.3).T
    over = np.polynomial.legendre.legvander(x, terms - 1)
    in_motion = data.motion.T[..., None] == np.arange(len(data.motions))
    columns = unit[..., None, None] * (over[..., None] * in_motion[..., None, :])[:, :, None, None]
    return columns.reshape(len(unit), unit.shape[1] * unit.shape[2], -1)
