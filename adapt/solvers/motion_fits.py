"""Posture fits of the rows of motions: with given girdles, or as the optima of adaptations have them."""

import numpy as np

from adapt.engine.batching import refit
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.continuation import follow_motions
from adapt.solvers.objective import mean_square_deg2
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems
from adapt.solvers.rows import PostureRows
from adapt.solvers.solution import PostureSolution
from adapt.solvers.unmeasured import angle_weights
from models.girdle import Girdle


def fit_rows(rows: PostureRows, girdle: Girdle) -> PostureSolution:
    """Fit every row with its girdle, on one branch along each motion where there is one."""
    chain = rows.active_effects.on(girdle)
    fitted = fit_batch(chain, rows.angles, rows.measured)
    return follow_motions(fitted, chain, rows.angles, rows.measured, rows.previous)


def rows_of_optima(rows: PostureRows, data: Problems, adapted: Adapted) -> PostureSolution:
    """Give the postures that the optima consist of, so that E = D + w mean(J) is of these, with their jumps marked.

    Where there is no optimum, or one that does not hold the postures (w = 0), they are fitted with the girdle as it
    ended, to say which of them is the trouble.
    """
    subjects, models = len(rows.subjects), data.counted.shape[1] // len(rows.subjects)
    one = rows.unpacked(np.indices(rows.counted.shape))
    posture, problem = np.tile(one[0], models), np.concatenate([one[1] + k * subjects for k in range(models)])
    rows = rows.repeated(models, data.angles.dtype)
    chain = data.girdles_at(adapted.theta_mm, posture, problem)
    fitted = _at_optimum(rows, adapted, posture, problem)
    without = ~((adapted.code[problem] == status.CONVERGED) & np.isfinite(fitted.multipliers).all(axis=0))
    refit(fitted, without, fit_batch, chain, rows.angles, rows.measured, fitted.angles)
    return follow_motions(fitted, chain, rows.angles, rows.measured, rows.previous, may_move=without)


def _at_optimum(rows: PostureRows, adapted: Adapted, posture, problem) -> PostureSolution:
    def at(values: np.ndarray) -> np.ndarray:
        return np.array(values[..., posture, problem])

    angles = at(adapted.angles)
    return PostureSolution(
        angles=angles,
        multipliers=at(adapted.multipliers),
        residual_mm=at(adapted.residual_mm),
        stationarity=at(adapted.stationarity),
        j_deg2=mean_square_deg2(angles, rows.angles, angle_weights(rows.measured)),
        iterations=adapted.iterations[problem],
        code=np.full(len(problem), status.CONVERGED),
        jump=np.zeros(len(problem), bool),
    )
