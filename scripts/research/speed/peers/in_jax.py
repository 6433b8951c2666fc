"""The whole-subject problem of one subject as functions of x = (angles of the postures in degrees, theta in mm), traced
by JAX: our girdle, with derivatives by JAX."""

import jax
import jax.numpy as jnp

from adapt.solvers.objective import WEIGHT
from models import load_model
from models.ellipsoid import signed_distance_mm
from models.girdle import constraint_residuals_mm
from models.person.thorax_ellipsoid import jitted_geometric_fit
from motions.rotations import DEG


class InJax:
    """E and the constraints with the numbers of one parameter set."""

    def __init__(self, model: str):
        chosen = load_model(model)
        self.points_mm = jnp.asarray(chosen.points_mm)
        self.girdle = jitted_geometric_fit(chosen.girdle, self.points_mm)

    def D(self, theta):
        """Compute the mean squared distance of the thorax points."""
        adapted = self.girdle.with_adapted(theta)
        distance = signed_distance_mm(self.points_mm, adapted.centre_mm[:, None], adapted.semi_axes_mm[:, None])
        return jnp.mean(distance**2)

    def chain(self, angles_deg, theta):
        """Compute A1-A3 of one posture, mm."""
        return constraint_residuals_mm(self.girdle.with_adapted(theta), angles_deg / DEG)

    def E(self, x, target):
        """Compute E relative to the measured angles ``target``, one posture after another, as in x."""
        return self.D(x[-6:]) + WEIGHT * jnp.mean((x[:-6] - target) ** 2)

    def chains(self, x):
        """Compute A1-A3 of every posture."""
        return jax.vmap(self.chain, (0, None))(x[:-6].reshape(-1, 6), x[-6:]).reshape(-1)
