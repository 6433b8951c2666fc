"""The girdle adapted to a subject as a differentiable function: the optimum of E over theta and all closed postures.

E = D + w mean(J_p) within bounds (thesis Eq. 6.3-6.5) with theta the adapted parameters, or
E_own = w / m (S + sigma^2 |z|^2) with z the sizes of the person's own bones in SDs (``docs/method.md``) and S the sum
of the squared gaps of the m measured angles.
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Bool, Float

from adapt.differentiable.closest_posture import (
    PostureFit,
    Postures,
    check_shape,
    distances_mm,
    fit_from,
    say_compiling,
    target,
)
from adapt.differentiable.constrained_optimum import NEAR, SOFTLY, following, reached, sum_of_squares
from models.adapted_parameters import ADAPTED, STARTS_MM
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.person.own_bones import NO_SDS, SIZES, OwnSDs, spread_about
from motions.arrays import Array
from motions.errors import InputError

WEIGHT = 10.0
"""w of Eq. 6.5 (thesis 6.2.6)."""

ENDLESS = np.array([[-np.inf], [np.inf]])
"""Bounds of parameters that have none."""


class OwnPrior(NamedTuple):
    """Prior of own bones about a girdle, and the noise of the angles."""

    columns_mm: Float[Array, "numbers sizes"]
    """Change of ``Girdle.numbers_mm`` per SD of each size."""
    noise_deg: Float[Array, ""]
    """SD sigma of the noise of every measured angle, degrees."""

    @classmethod
    def about(
        cls, model: ParameterSet, noise_deg: float, scales: Mapping[str, float] | None = None, sds: OwnSDs = NO_SDS
    ) -> "OwnPrior":
        """Build the prior about a parameter set from ``models.person.own_bones.SIZES``; ``sds`` replace SDs by name.

        ``scales`` are factors of the SDs by group (adapted, bones, frames): ``adapted_scale`` and so on of
        ``parameters.csv``, which has ``noise_deg`` too.
        """
        factors = np.array([(scales or {}).get(one.group, 1.0) for one in SIZES])
        return cls(jnp.asarray(spread_about(model, sds).columns_mm * factors), jnp.asarray(noise_deg))


class AdaptedSubject(NamedTuple):
    """Optimum of E within the bounds; every number is NaN where the search did not converge."""

    theta_mm: Float[Array, " adapted"]
    """Adapted parameters in the order of ``models.adapted_parameters.ADAPTED``, mm."""
    free: Bool[Array, " adapted"]
    """False at a bound. The derivative of such a parameter is that of its bound, and 0 in every other number."""
    E: Float[Array, ""]
    """D + w mean(J), mm^2, or E_own."""
    D_mm2: Float[Array, ""]
    mean_j_deg2: Float[Array, ""]
    postures: PostureFit
    converged: Bool[Array, ""]
    girdle: Girdle
    """Adapted girdle."""
    sizes: Float[Array, " sizes"]
    """Sizes of own bones, in SDs; empty without own bones."""


def objective(
    theta_mm: Float[Array, " adapted"],
    girdle: Girdle,
    points_mm: Float[Array, " 3 points"],
    angles: Float[Array, " 6 postures"],
    measured: Bool[Array, " 6 postures"] | None = None,
    weight: float | Float[Array, ""] = WEIGHT,
    start: Float[Array, " 6 postures"] | None = None,
) -> Float[Array, ""]:
    """Compute E(theta) = D + w mean(J_p), mm^2 (Eq. 6.3-6.5), as a function that any optimiser can minimise.

    D is the mean squared distance of the thorax points. Angles, ``measured``, ``start``, derivatives, compilation and
    errors are as in :func:`fit_posture`.
    """
    s, R = target(girdle, angles, measured, axes=2)
    check_shape("theta_mm", theta_mm, (len(ADAPTED),))
    _check_points(points_mm)
    say_compiling()
    moved = girdle.with_adapted(jnp.asarray(theta_mm))
    J = fit_from(jax.tree.map(jnp.asarray, moved), s, R, start).j_deg2
    D = jnp.mean(distances_mm(moved, jnp.asarray(points_mm)) ** 2)
    return D + weight * jnp.sum(J) / jnp.sum(jnp.any(R != 0.0, axis=0))  # J of padding is 0


def adapt_subject(
    girdle: Girdle,
    points_mm: Float[Array, " 3 points"],
    bounds_mm: Float[Array, " 2 adapted"],
    angles: Float[Array, " 6 postures"],
    measured: Bool[Array, " 6 postures"] | None = None,
    weight: float | Float[Array, ""] = WEIGHT,
    own_bones: OwnPrior | None = None,
    start: Float[Array, " thetas"] | None = None,
) -> AdaptedSubject:
    """Minimise E(theta) (:func:`objective`) within lower and upper bounds, mm, as :func:`adapt.adapt_subjects` does.

    The result is differentiable in every number given but the girdle's own adapted parameters, which are only a start.
    ``jax.vmap`` takes subjects with unequal numbers of postures: pad them with postures whose ``measured`` is False.
    Starts are places around the girdle (thesis 6.2.6; ``models.adapted_parameters.STARTS_MM``).

    ``own_bones``: minimise E_own = w / m (S + sigma^2 |z|^2) over the sizes of the person's own bones, without bounds,
    as ``adapt_subjects(..., own_bones=True)`` does with the same noise and scales (``docs/method.md``). The result is
    differentiable in every number given, ``own_bones`` included; bounds, points and w do not change the optimum. The
    compiled fits give an unmeasured angle a millionth of the weight of a measured one, this function none. E_own has
    local minima, and each search may end in another one.

    ``start``: theta (mm), or sizes (SDs), as the only start. A start at the result of a compiled adaptation ends in the
    same minimum and saves the search.

    The first call compiles for 15 s, a derivative for 6 s more. 14 postures then take 0.1 s, 56 some 0.7 s, 280
    some 4 s. Errors are as in :func:`fit_posture`.
    """
    s, R = target(girdle, angles, measured, axes=2)
    _check_points(points_mm)
    check_shape("bounds_mm", bounds_mm, (2, len(ADAPTED)))
    if not isinstance(bounds_mm, Tracer) and not (np.asarray(bounds_mm[0]) <= np.asarray(bounds_mm[1])).all():
        cause = "a lower bound is above its upper one, or is no number"
        raise InputError("bounds_mm", None, cause, "Give (lower, upper), as model.bounds_mm")
    if start is not None:
        check_shape("start", start, (len(ADAPTED),) if own_bones is None else own_bones.columns_mm.shape[1:])
    say_compiling()
    given = girdle, points_mm, bounds_mm, s, R, weight, own_bones, start
    problem, starts = _problem(*jax.tree.map(jnp.asarray, given))
    # compiled apart: a derivative would compile the search again, which takes three quarters of the time
    x, beyond = _search(*jax.lax.stop_gradient((problem, *starts)))
    found = _at_optimum(problem, beyond, x, jnp.asarray(points_mm))
    return found._replace(sizes=found.sizes[:0]) if own_bones is None else found


def _check_points(points_mm) -> None:
    if np.ndim(points_mm) != 2 or np.shape(points_mm)[0] != 3:
        raise InputError(
            "points_mm", None, f"its shape is {np.shape(points_mm)}", "Give (3, points), as model.points_mm"
        )


@jax.jit
def _problem(girdle, points_mm, bounds_mm, s, R, weight, prior: OwnPrior | None, start):
    """Build the problem and its starts."""
    counts = jnp.sum(R != 0.0, axis=0)  # measured angles
    if prior is None:
        counts, zeros = jnp.minimum(counts, 1), jnp.zeros(len(ADAPTED))
        base, starts, points, pull = girdle.with_adapted(zeros), girdle.adapted_mm + STARTS_MM, points_mm, 0.0
        columns = jax.jacobian(lambda theta: girdle.with_adapted(theta).numbers_mm)(zeros)
    else:
        columns, zeros = prior.columns_mm, jnp.zeros(prior.columns_mm.shape[1])
        base, starts, points, pull = girdle, zeros[None], points_mm[:, :0], prior.noise_deg
        bounds_mm = ENDLESS * jnp.ones_like(zeros)
    root = jnp.sqrt(weight / jnp.sum(counts))
    problem = Postures(s, R, root * jnp.sqrt(counts), base, columns, bounds_mm, points, root * pull)
    return problem, (starts, starts[0]) if start is None else (starts[:0], start)


@jax.jit
def _at_optimum(problem: Postures, beyond, x, points_mm) -> AdaptedSubject:
    """Describe the optimum, with the derivatives in the numbers of the problem."""
    x = following(problem, beyond, x)
    theta, fits, adapted = x[0], problem.fits(x[1]), problem.girdle_at(x[0])
    return AdaptedSubject(
        theta_mm=adapted.adapted_mm,
        free=beyond[: len(ADAPTED)] == 0.0,  # sizes have no bounds
        E=sum_of_squares(problem, x),
        D_mm2=jnp.mean(distances_mm(adapted, points_mm) ** 2),
        mean_j_deg2=jnp.sum(fits.j_deg2) / jnp.sum(jnp.any(problem.R != 0.0, axis=0)),
        postures=fits,
        converged=jnp.all(jnp.isfinite(theta)),
        girdle=adapted,
        sizes=theta,
    )


@jax.jit
@jax.custom_batching.sequential_vmap
def _search(problem: Postures, starts: Array, theta: Array) -> tuple[tuple[Array, Array], Array]:
    """Find the lowest optimum: from the starts with the measured postures, then from the best of these optima with its
    lowest postures, or from ``theta`` where the starts lead to no optimum or there are none. Subjects are solved one by
    one, so that none waits for another."""

    def further(best, given):
        start, soft = given
        theta = jnp.where(soft, start, best[0][0])
        q = jax.lax.cond(soft, lambda: problem.s, lambda: fit_from(problem.girdle_at(theta), problem.s, problem.R)[0])
        found = reached(problem, (theta, q), jnp.where(soft, SOFTLY, NEAR))
        return jax.tree.map(lambda new, old: jnp.where(found[2] < best[2], new, old), found, best), None

    nothing = (theta, jnp.concatenate([problem.s, jnp.zeros_like(problem.s[:3])])), jnp.zeros_like(theta), jnp.inf
    rounds = jnp.concatenate([starts, theta[None]]), jnp.arange(len(starts) + 1) < len(starts)
    x, beyond, E = jax.lax.scan(further, nothing, rounds)[0]
    return jax.tree.map(lambda of: jnp.where(jnp.isfinite(E), of, jnp.nan), x), beyond
