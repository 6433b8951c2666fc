"""Parametric bootstrap: what the adaptation makes of simulated repetitions of a subject's measurement."""

import numpy as np
from jaxtyping import Float

from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapted_from
from adapt.solvers.problem_batch import ProblemBatch, select_problems
from motions.rotations import DEG


def bootstrap_mm(
    data: ProblemBatch,
    adapted: Adapted,
    noise_deg: Float[np.ndarray, " problems"],
    replicates: int,
    seed: int,
) -> Float[np.ndarray, "adapted replicates problems"]:
    """Compute the adapted parameters (ADAPTED, mm) of simulated repetitions; NaN where one did not converge.

    Each repetition has the fitted, closed postures as truth, with independent Gaussian errors of SD ``noise_deg`` on
    every angle, and is adapted anew from the subject's own optimum, with the same thorax points and bounds.
    """
    count = adapted.theta_mm.shape[-1]
    problem = np.tile(np.arange(count), replicates)
    generator = np.random.Generator(np.random.PCG64(seed))
    postures = adapted.angles.shape[1]
    errors = generator.standard_normal((replicates, count, 6, postures)) * (noise_deg / DEG)[:, None, None]
    measured = adapted.angles[..., problem] + np.moveaxis(errors.reshape(-1, 6, postures), 0, -1)
    again = adapted_from(
        select_problems(data, problem, angles=measured), adapted.theta_mm[:, problem], adapted.weight[problem]
    )
    theta = np.where(again.status == status.OK, again.theta_mm, np.nan)
    return theta.reshape(len(theta), replicates, count)
