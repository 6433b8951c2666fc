"""Posture fits of the rows of motions: with given girdles, or as the optima of adaptations have them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import DTypeLike

from adapt.engine.batching import put_problems, take_problems
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.continuation import follow_motions, mark_jumps
from adapt.solvers.objective import angle_weights, mean_square_deg2
from adapt.solvers.padded_batch import Batch
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problem_batch import ProblemBatch
from adapt.solvers.solution import PostureSolution
from models.effects import ActiveEffects
from models.effects.amplitudes import Amplitudes, active_effects
from models.girdle import Girdle
from motions.rotations import DEG
from motions.table import Motions


@dataclass(frozen=True)
class MotionRows:
    """The rows of the motions for each model in turn, a problem each."""

    angles: Float[np.ndarray, "6 problems"]
    """Measured, rad; NaN where not measured."""
    measured: Bool[np.ndarray, "6 problems"]
    previous: Int[np.ndarray, " problems"]
    """The problem of the posture before in its motion, -1 for the first."""
    active_effects: ActiveEffects

    @staticmethod
    def of_models(motions: Motions, models: int, effects: Amplitudes, dtype: DTypeLike) -> "MotionRows":
        """Lay out the rows for so many models."""
        angles = np.tile(motions.angles_deg.T / DEG, models).astype(dtype, copy=False)
        before, rows = motions.previous_rows(), len(motions.posture)
        previous = np.concatenate([np.where(before < 0, -1, before + k * rows) for k in range(models)])
        known = active_effects(effects, motions).at(np.tile(np.arange(rows), models))
        return MotionRows(angles, np.isfinite(angles), previous, known)


def fit_rows(rows: MotionRows, girdle: Girdle) -> PostureSolution:
    """Fit every row with its girdle, on one branch along each motion where there is one."""
    chain = rows.active_effects.on(girdle)
    fitted = fit_batch(chain, rows.angles, rows.measured)
    return follow_motions(fitted, chain, rows.angles, rows.measured, rows.previous)


def rows_of_optima(rows: MotionRows, batch: Batch, data: ProblemBatch, adapted: Adapted) -> PostureSolution:
    """Give the postures that the optima consist of, so that E = D + w mean(J) is of these, with their jumps marked.

    Where there is no optimum, or one that does not hold the postures (w = 0), they are fitted with the girdle as it
    ended, to say which of them is the trouble.
    """
    subjects = len(batch.subjects)
    problem, posture = (
        np.concatenate([batch.unpack(part) for part in np.split(places, places.shape[1] // subjects, axis=1)])
        for places in np.indices(data.counted.shape)[::-1]
    )
    chain = data.girdles_at(adapted.theta_mm, posture, problem)
    fitted = _at_optimum(rows, adapted, posture, problem)
    without = ~((adapted.status[problem] == status.OK) & np.isfinite(fitted.multipliers).all(axis=0))
    fitted = mark_jumps(fitted, chain, rows.angles, rows.measured, np.where(without, -1, rows.previous))
    if without.any():
        part = take_problems(chain, without), rows.angles[:, without], rows.measured[:, without]
        number = np.cumsum(without) - 1
        previous = np.where(rows.previous < 0, -1, number[rows.previous])[without]
        put_problems(fitted, without, follow_motions(fit_batch(*part, fitted.angles[:, without]), *part, previous))
    return fitted


def _at_optimum(rows: MotionRows, adapted: Adapted, posture, problem) -> PostureSolution:
    def at(values: np.ndarray) -> np.ndarray:
        return np.array(values[..., posture, problem])

    angles, target = at(adapted.angles), np.where(rows.measured, rows.angles, 0.0).astype(float)
    return PostureSolution(
        angles=angles,
        multipliers=at(adapted.multipliers),
        residual_mm=at(adapted.residual_mm),
        stationarity=at(adapted.stationarity),
        j_deg2=mean_square_deg2(angles, target, angle_weights(rows.measured)),
        iterations=adapted.iterations[problem],
        code=np.full(len(problem), status.CONVERGED),
        jump=np.zeros(len(problem), bool),
    )
