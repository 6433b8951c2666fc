"""Whole-subject problems with effects at work as rows of postures: each problem a part and a group of its own."""

import jax
import numpy as np
from jaxtyping import Float

from adapt.solvers.batched.subject import Fixed
from adapt.solvers.extended.joint_parts import Parts
from adapt.solvers.extended.nearest_posture import UNMEASURED_SD
from adapt.solvers.extended.thorax_term import Thorax
from models.effects import ActiveEffects
from motions.rotations import DEG


def rows_of(fixed: Fixed) -> tuple[np.ndarray, np.ndarray]:
    """Find problem and posture of every row that counts, problem by problem."""
    problem, posture = np.nonzero(np.asarray(fixed.problem.counted).T)
    return problem, posture


def row_weights(fixed: Fixed) -> Float[np.ndarray, " rows"]:
    """Give the weights of |y|^2 in E, deg^2: those of the angles that were measured."""
    problem, posture = rows_of(fixed)
    return np.asarray(fixed.problem.weights)[:, posture, problem].max(axis=0) / (2.0 * float(DEG) ** 2)


def parts_of(fixed: Fixed, active_effects: ActiveEffects) -> Parts:
    """Lay the postures that count out as rows, each problem a part and a group of its own."""
    problem, posture = rows_of(fixed)
    count = fixed.problem.measured.shape[-1]
    measured = np.asarray(fixed.problem.weights)[:, posture, problem] > 0.0
    girdle = jax.tree.map(np.asarray, fixed.girdle)
    return Parts(
        girdle=girdle,
        thorax=Thorax(girdle, fixed.points_mm, fixed.point_weights, fixed.levels_mm),
        bounds_mm=(np.asarray(fixed.problem.lower).T, np.asarray(fixed.problem.upper).T),
        effects=active_effects.effects,
        strengths=np.concatenate([np.asarray(one)[:, posture, problem] for one in active_effects.strengths]),
        measured_deg=np.asarray(fixed.problem.measured)[:, posture, problem] * float(DEG),
        sd=np.where(measured, 1.0, UNMEASURED_SD),
        weights=row_weights(fixed),
        part=problem,
        group=np.arange(count),
        strengths_are_known=not active_effects.own,
    )
