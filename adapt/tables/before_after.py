# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# pyright: reportReturnType=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Postures of a model as it is and adapted, side by side: the changes by an adaptation beyond the angles."""

from dataclasses import dataclass

import jax
import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt.solvers import status
from adapt.tables.results import girdles_after
from models.girdle import Girdle
from models.person.family import AnyModel, girdles_of
from motions.rotations import DEG
from motions.table import ANGLES

KEYS = ["subject", "motion", "posture", "humerus_elevation_deg"]

STATES = ("before", "after")


@dataclass(frozen=True)
class State:
    """Postures, each with its own girdle."""

    girdle: Girdle
    angles: Float[np.ndarray, "6 postures"]
    """Simulated angles, rad."""


@dataclass(frozen=True)
class BeforeAfter:
    """Postures of all subjects that could be fitted in both states, in the order of the motions."""

    rows: pd.DataFrame
    """Columns KEYS of each posture."""
    before: State
    after: State


def before_and_after(model: AnyModel, fits: pd.DataFrame, parameters: pd.DataFrame) -> BeforeAfter:
    """Pair the fits of one model before and after adaptation, each with the girdle of its subject in that state."""
    mine = fits[fits["model"] == model.name]
    one, other = (mine[mine["adapted"] == state].reset_index(drop=True) for state in (0, 1))
    good = (one["status"] == status.OK) & (other["status"] == status.OK)
    girdles = girdles_of(model, one["subject"].tolist())
    one, other = one[good], other[good]
    rows = one[KEYS].reset_index(drop=True)
    own = jax.tree.map(lambda x: x[..., good.to_numpy()], girdles)
    adapted = girdles_after(model, other["subject"].tolist(), parameters) if len(rows) else own
    return BeforeAfter(rows, State(own, _angles(one)), State(adapted, _angles(other)))


def _angles(fits: pd.DataFrame) -> Float[np.ndarray, "6 postures"]:
    return fits[[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy(float).T / DEG


def subject_means(rows: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Compute the means of the columns over the postures of each motion, then over the motions of each subject."""
    by_motion = rows.groupby(["model", "subject", "motion"], sort=False)[columns].mean()
    return by_motion.groupby(level=["model", "subject"], sort=False).mean().reset_index()
