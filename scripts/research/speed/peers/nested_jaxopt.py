"""SciPy's L-BFGS-B through jaxopt on E(theta), with every posture fitted anew in each step: compiled, subject by
subject. First derivatives only: the approach of a general optimiser to the problem."""

import warnings

import jax
import jax.numpy as jnp

from adapt.differentiable import objective
from models import load_model
from models.person.thorax_ellipsoid import jitted_geometric_fit
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG
from scripts.reporting import timed
from scripts.research.speed.peers.cases import SEED


def seconds_a_subject(model: str, subjects: int) -> float:
    """Measure the seconds per subject, starting from the geometric fit."""
    warnings.simplefilter("ignore", DeprecationWarning)
    import jaxopt

    chosen = load_model(model)
    points = jnp.asarray(chosen.points_mm)
    girdle = jitted_geometric_fit(chosen.girdle, points)

    def nested(theta, angles):
        return objective(theta, girdle, points, angles)

    both = jax.jit(jax.value_and_grad(nested))
    motions = simulate_subjects(subjects, seed=SEED)
    every = [jnp.asarray(motions.angles_deg[motions.subject == name].T / DEG) for name in motions.subjects]
    both(girdle.adapted_mm, every[0])
    bounds = tuple(jnp.asarray(b) for b in chosen.bounds_mm)

    def run():
        for angles in every:
            solver = jaxopt.ScipyBoundedMinimize(
                method="L-BFGS-B", fun=lambda theta, angles=angles: both(theta, angles), value_and_grad=True, jit=False
            )
            solver.run(girdle.adapted_mm, bounds=bounds)

    return timed(run) / subjects
