"""Uncertainty of the adapted parameters: their covariance, and the share of each source.

**Noise model.** Every measured angle is the angle of the closed chain plus an independent Gaussian error of SD s. The
thorax points are those of another person, whose ellipsoid theta_0 (min D) differs from this person's theta by a
Gaussian of covariance Sigma (``PERSON_SD_MM``, or less where the set has points of the person; the conoid has no part
in it, as D does not depend on it). E = D + w mean(J) is then, up to a factor, the negative logarithm of a likelihood
(J) times a prior (D): with n points, P postures and all angles measured, -2 log p = 6 P E / (w s^2). The weight w
therefore states how precisely the points are assumed to be known, each to s sqrt(n w / (6 P)) (1.5 deg, 24 points, 14
postures, w = 10: 2.5 mm). As nobody chose w for this purpose, the optimum is instead judged as an estimator, for any w
(sandwich estimator): with I_D, I_J and B of ``adapt.evaluation.curvature``

    theta^ - theta = -I^-1 (B e + I_D (theta - theta_0)),      e the errors of the angles
    cov = s^2 I^-1 B B' I^-1  +  I^-1 I_D Sigma I_D I^-1       (noise; person)

The information I = I_D + I_J is the expected Hessian of E. The rest of the Hessian H comes from the residuals, whose
mean in this model is 0. In a single subject they are not 0, and where the motion hardly determines the ellipsoid H is
a third off, or even has no inverse. On simulated subjects the information gives more accurate intervals.

The noise follows from the gap, s^2 = sum of squared gaps / (measured angles - 3 P - tr(I^-1 I_J)): three angles of each
posture and tr(I^-1 I_J) of the parameters follow the errors. Errors of the model count as noise, as if they were
independent from posture to posture.

Person and optimum both lie within the bounds, W apart: two points drawn there at random differ by W^2 / 6 in the mean
square. This knowledge is combined with cov, and limits directions that nothing else determines:

    (cov^-1 + diag(6 / W^2))^-1 = cov - cov (cov + diag(W^2 / 6))^-1 cov.

A parameter at its bound carries no information: it may be anywhere between its two bounds (mean square W^2 / 3 away,
for bounds W apart), and the other parameters, held back by it, follow with -I_ff^-1 I_fk. This is the third part of the
covariance.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from adapt.evaluation.curvature import Curvature, curvature
from adapt.own_bones.own_adaptation import HERE, OwnBones
from adapt.solvers.adaptation import Adapted
from adapt.solvers.problems import Problems
from models.adapted_parameters import ADAPTED
from motions.rotations import DEG

_NARROWEST_MM = 1e-6
"""Least width of bounds in the computation. A fixed parameter has bounds 0 apart; it has no spread, whatever the
width."""

NORMAL_95 = 1.959964
"""Half width of a 95 % interval in SDs."""


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of adapted parameters, in the order of ``ADAPTED``, mm; NaN where neither motion nor points determine
    one."""

    noise_mm2: Float[np.ndarray, "adapted adapted problems"]
    """Covariance from the errors of the angles, without regard to bounds."""
    person_mm2: Float[np.ndarray, "adapted adapted problems"]
    """Covariance due to thorax points of another person, without regard to bounds."""
    bound_mm2: Float[np.ndarray, "adapted adapted problems"]
    """Covariance from parameters that ended at a bound; 0 where there is none."""
    covariance_mm2: Float[np.ndarray, "adapted adapted problems"]
    """Covariance of theta^ - theta: noise and person, reduced to the width of the bounds, plus ``bound_mm2``."""
    points_share: Float[np.ndarray, "adapted problems"]
    """Share of the thorax points in the information on a parameter, 0 to 1, while the other parameters follow it; the
    rest is the motion's. NaN at a bound."""
    noise_deg: Float[np.ndarray, " problems"]
    """Noise s, degrees."""
    curvature: Curvature
    free: Bool[np.ndarray, "adapted problems"]
    bounded: bool | Bool[np.ndarray, " problems"] = True
    """True where the parameters had bounds."""

    @property
    def sd_mm(self) -> Float[np.ndarray, "adapted problems"]:
        """Standard deviations: the square roots of the diagonal of ``covariance_mm2``."""
        return sd(self.covariance_mm2)


def with_posterior(found: Uncertainty, own: OwnBones) -> Uncertainty:
    """Replace the sandwich by the posterior of own bones, where these were adapted: one covariance, of noise and people
    together."""
    count, here = len(ADAPTED), own.code == HERE
    covariance = np.where(here, own.covariance[:count, :count], found.covariance_mm2)
    return replace(
        found,
        noise_mm2=np.where(here, covariance, found.noise_mm2),
        person_mm2=np.where(here, 0.0, found.person_mm2),
        bound_mm2=np.where(here, 0.0, found.bound_mm2),
        covariance_mm2=covariance,
        noise_deg=np.where(here, own.scales[-1], found.noise_deg),
        free=found.free | here,
        bounded=~here,
    )


def sd(covariance: Float[np.ndarray, "n n problems"]) -> Float[np.ndarray, "n problems"]:
    """Compute standard deviations, the square roots of the diagonals of covariances: (n, problems)."""
    return np.sqrt(np.einsum("kkl->kl", covariance))


def uncertainty(
    data: Problems, adapted: Adapted, person_sd_mm: Float[np.ndarray, " adapted"] | None = None
) -> Uncertainty:
    """Compute the uncertainty of each adaptation of ``data`` by its E = D + W mean(J), mm^2 and deg^2.

    ``person_sd_mm``: square roots of the diagonal of Sigma; by default those that the set of each subject states.
    """
    curved = curvature(data, adapted)
    free = ~adapted.at_bound
    of_points, of_motion = curved.points_information, curved.motion_information
    inverse = reduced_inverse(of_points + of_motion, free)
    noise = _noise_rad(data, adapted, np.einsum("ijl,jil->l", inverse, of_motion))
    by_noise = np.einsum("iapl,japl->ijl", curved.by_angle, curved.by_angle) * noise**2
    sd_mm = np.asarray(data.person_sd_mm) if person_sd_mm is None else person_sd_mm[:, None]
    by_person = np.einsum("ijl,jl,kjl->ikl", of_points, np.broadcast_to(sd_mm, adapted.theta_mm.shape) ** 2, of_points)
    noise_mm2, person_mm2 = _sandwich(inverse, by_noise), _sandwich(inverse, by_person)
    width_mm = np.subtract(*np.asarray(data.bounds_mm)[::-1])
    bound_mm2 = _from_bounds(inverse, of_points + of_motion, free, width_mm)
    return Uncertainty(
        noise_mm2=noise_mm2,
        person_mm2=person_mm2,
        bound_mm2=bound_mm2,
        covariance_mm2=within_bounds(noise_mm2 + person_mm2, width_mm) + bound_mm2,
        points_share=_points_share(inverse, of_points, free),
        noise_deg=noise * DEG,
        curvature=curved,
        free=free,
    )


def _points_share(inverse, of_points, free) -> Float[np.ndarray, "adapted problems"]:
    """Compute u' I_D u / u' I u along u = I^-1 e_k, the direction in which the other parameters follow parameter k."""
    along = np.einsum("ikl,ijl,jkl->kl", inverse, of_points, inverse)
    return along / np.where(free, np.einsum("kkl->kl", inverse), np.nan)


def within_bounds(covariance, width_mm) -> Float[np.ndarray, "adapted adapted problems"]:
    """Reduce a covariance to the width W of the bounds: cov - cov (cov + diag(W^2 / 6))^-1 cov.

    The covariance of parameters without a spread stays 0.
    """
    C = np.moveaxis(covariance, -1, 0)
    room = np.eye(len(width_mm)) * np.maximum(width_mm.T[:, None], _NARROWEST_MM) ** 2 / 6.0
    return np.moveaxis(C - C @ np.linalg.solve(C + room, C), 0, -1)


def _from_bounds(inverse, information, free, width_mm) -> Float[np.ndarray, "adapted adapted problems"]:
    """Compute M diag(W^2 / 3) M' over the parameters k at a bound; column k of M: 1 at k, -I_ff^-1 I_fk at free
    parameters."""
    held = np.where(free, 0.0, width_mm**2 / 3.0)
    follow = np.eye(len(free))[..., None] - np.einsum("ijl,jkl->ikl", inverse, information)
    return np.einsum("ikl,kl,jkl->ijl", follow, held, follow)


def _sandwich(inverse, middle) -> Float[np.ndarray, "adapted adapted problems"]:
    return np.einsum("ijl,jkl,kml->iml", inverse, middle, inverse)


def reduced_inverse(
    matrix: Float[np.ndarray, "adapted adapted problems"], free: Bool[np.ndarray, "adapted problems"]
) -> Float[np.ndarray, "adapted adapted problems"]:
    """Invert a matrix over the free parameters, with 0 for the others; NaN where it is not positive definite."""
    both = free[:, None] & free[None]
    unit = np.eye(len(free))[..., None]
    reduced = np.where(both, matrix, np.where(free[:, None], 0.0, unit))
    parts = np.moveaxis(reduced, -1, 0)
    finite = np.asarray(np.isfinite(parts).all(axis=(1, 2)))
    parts = np.where(finite[:, None, None], parts, np.eye(len(free)))
    definite = np.asarray(finite & (np.linalg.eigvalsh(parts) > 0.0).all(axis=1))
    inverse = np.moveaxis(np.linalg.inv(np.where(definite[:, None, None], parts, np.eye(len(free)))), 0, -1)
    return np.where(both, np.where(definite, inverse, np.nan), 0.0)


def _noise_rad(
    data: Problems, adapted: Adapted, followed: Float[np.ndarray, " problems"]
) -> Float[np.ndarray, " problems"]:
    """Estimate s, rad; ``followed`` = tr(I^-1 I_J) parameters follow the errors. NaN without degrees of freedom."""
    counts = np.asarray(data.measured) & np.asarray(data.counted)[None]
    squares = np.where(counts, (adapted.angles - np.asarray(data.angles)) ** 2, 0.0).sum(axis=(0, 1))
    left = counts.sum(axis=(0, 1)) - 3 * np.asarray(data.counted).sum(axis=0) - followed
    return np.sqrt(np.where(left > 0.0, squares / np.where(left > 0.0, left, 1.0), np.nan))
