"""Predictions of postures that are held out of an adaptation, and their gaps."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems, select_problems
from motions.rotations import DEG

Adapt = Callable[[Problems, Int[np.ndarray, " folds"]], tuple[Problems, Adapted]]
"""Function that adapts folds of problems, given the problem of each fold. It returns the problems of the folds, with
the effects and bones that were found, and the adaptations."""

Places = Bool[np.ndarray, "postures folds"]
"""Mask of some postures of each fold."""


HeldOutAngles = Float[np.ndarray, "6 postures folds"]
"""Angles (rad) or gaps (degrees) at the tested postures; NaN elsewhere, and where a fit failed."""


def predicted(
    data: Problems, problem: Int[np.ndarray, " folds"], fitted: Places, tested: Places, adapt: Adapt
) -> tuple[Problems, Adapted, HeldOutAngles]:
    """Adapt folds of problems to some of their postures, and predict others; return the problems of the folds, the
    adaptations and the angles in rad."""
    of_folds, without = adapt(select_problems(data, problem, counted=fitted), problem)
    return of_folds, without, held_out_angles(of_folds, without, tested)


def held_out_angles(data: Problems, adapted: Adapted, tested: Places) -> HeldOutAngles:
    """Simulate the tested postures of adapted folds, rad."""
    posture, problem = np.nonzero(tested & (adapted.status == status.OK))
    result = np.full((6, *tested.shape), np.nan)
    if not len(problem):  # every adaptation failed
        return result
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    found = fit_batch(data.girdles_at(adapted.theta_mm, posture, problem), angles, measured)
    result[:, posture, problem] = np.where(found.status == status.OK, found.angles, np.nan)
    return result


def gaps_of(data: Problems, angles: HeldOutAngles) -> HeldOutAngles:
    """Compute |simulated - measured|, degrees; NaN where not measured."""
    return np.where(data.measured, np.abs(angles - data.angles) * DEG, np.nan)
