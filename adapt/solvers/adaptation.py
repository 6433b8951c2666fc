"""Adaptation of the girdle to subjects: min E = D + w mean(J_p) over ellipsoid and conoid (thesis Eq. 6.5).

Lanes: every subject with every model is one element of a flat batch.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt.engine.batching import as_type, compiled, in_chunks, in_rounds, take_problems, with_problems
from adapt.engine.kernel import Kernel
from adapt.solvers import status
from adapt.solvers.batched.kernels import GIRDLE
from adapt.solvers.batched.subject import Fixed, Start, Swept, sweep
from adapt.solvers.linalg import Factor, diagonal, matmul, trace, transpose
from adapt.solvers.objective import DEFAULT_READING, READINGS, WEIGHT, ThoraxPoints, fitted_girdle, thorax_distance_mm2
from adapt.solvers.padded_batch import Batch
from adapt.solvers.posture_fits import FEWEST_ANGLES, AnyGirdle, fit_batch
from adapt.solvers.reference.constraints import ByHand, Constraints, Differentiated
from adapt.solvers.reference.posture import mean_square_deg2, objective_weights
from adapt.solvers.reference.subject import Problem, Subject, joint, solve_subjects
from models.effects import NO_ACTIVE_EFFECTS, ActiveEffects
from models.girdle import ADAPTED, Girdle
from models.parameter_sets import ParameterSet
from motions.arrays import Array, ByType, xp

STARTS_MM = np.array([[0.0] * 6, [60.0, 0.0, 0.0, 60.0, 0.0, 0.0], [-60.0, 0.0, 0.0, -60.0, 0.0, 0.0]])
"""Offsets of the starts from the geometric fit, in the order of ADAPTED. E has many local minima (thesis 6.2.6). Those
that lay lower than where the geometric fit leads were found from thoraxes whose centre is higher and which are longer,
or lower and shorter. 12 random starts of each found lower ones than these in none of 8 measured shoulders with five
sets and in 11 of 900 simulated adaptations, by up to 3 %; starts with M_y against A_y, or deeper, added nothing."""

_ROUNDS = 4
"""A lane that did not converge, or has a posture in the higher of two valleys, goes on from fresh posture fits."""

_LOWER_DEG2 = ByType(1e-6, 1e-3)
"""A fresh posture fit lower by less than this is the same one."""

_ROOT_ROUNDS = 100
"""Most fixed-point iterations of the weight of a reading with roots."""

_ROOT_SETTLED = 1e-4
"""Relative change of that weight at which it has settled."""

_LEAST_WEIGHT = 1e-6
"""The weight goes to 0 where the root of D has its kink, at the geometric fit; below this nothing moves any more."""

_AT_BOUND_MM = 1e-9


@dataclass(frozen=True)
class Adapted:
    """Adaptations of L lanes (subject x model), numpy."""

    theta_mm: Float[np.ndarray, "6 lanes"]
    """ADAPTED, mm."""
    sd_mm: Float[np.ndarray, "6 lanes"]
    """Standard deviation from the curvature of E: see :func:`standard_deviations`; NaN at a bound."""
    at_bound: Bool[np.ndarray, "6 lanes"]
    angles: Float[np.ndarray, "6 postures lanes"]
    """Fitted postures at theta, rad."""
    D_mm2: Float[np.ndarray, " lanes"]
    mean_j_deg2: Float[np.ndarray, " lanes"]
    E: Float[np.ndarray, " lanes"]
    """In the units of the reading."""
    iterations: Int[np.ndarray, " lanes"]
    status: Shaped[np.ndarray, " lanes"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ProblemBatch:
    """The data and models of L lanes, padding included. All numbers float64; or float32, for adaptations in that."""

    girdle: Girdle
    """Each model's girdle after its geometric fit, (component, lanes)."""
    points_mm: Float[Array, " 3 points lanes"]
    shares: Float[Array, "points lanes"]
    bounds_mm: Float[Array, " 2 6 lanes"]
    angles: Float[Array, " 6 postures lanes"]
    measured: Bool[Array, " 6 postures lanes"]
    counted: Bool[Array, "postures lanes"]
    active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
    """Strengths (channels, postures, lanes). They act in the chain; D is that of the ellipsoid without them."""

    def chain(self, theta_mm: Float[Array, " 6 lanes"], posture, lane) -> AnyGirdle:
        """The girdles at theta, with what is at work, of some postures: a lane each."""
        return self.active_effects.at(posture, lane).on(take_problems(self.girdle.with_adapted(theta_mm), lane))


def lanes(batch: Batch, models: list[ParameterSet], active_effects: ActiveEffects = NO_ACTIVE_EFFECTS) -> ProblemBatch:
    """Every subject of the batch with every model: lane = model * subjects + subject. Strengths of what is
    ``active_effects`` are (channels, postures, subjects)."""
    subjects = batch.angles.shape[-1]
    points = max(model.points_mm.shape[1] for model in models)

    def each_subject(values):
        return np.repeat(np.stack(values, axis=-1), subjects, axis=-1)

    def each_model(values):
        return np.tile(values, [1] * (values.ndim - 1) + [len(models)])

    def padded(model: ParameterSet):
        return np.pad(model.points_mm, ((0, 0), (0, points - model.points_mm.shape[1])), mode="edge")

    def shares(model: ParameterSet):
        count = model.points_mm.shape[1]
        return np.where(np.arange(points) < count, 1.0 / count, 0.0)

    girdles = [fitted_girdle(model.girdle, model.points_mm) for model in models]
    return ProblemBatch(
        girdle=jax.tree.map(lambda *x: each_subject(x), *girdles),
        points_mm=each_subject([padded(model) for model in models]),
        shares=each_subject([shares(model) for model in models]),
        bounds_mm=each_subject([model.bounds_mm for model in models]),
        angles=each_model(batch.angles),
        measured=each_model(batch.measured),
        counted=each_model(batch.counted),
        active_effects=jax.tree.map(each_model, active_effects),
    )


def select_problems(data: ProblemBatch, index: Int[np.ndarray, " chosen"], **changed: np.ndarray) -> ProblemBatch:
    """The given lanes, any of them as often as wanted, with some of their arrays replaced."""
    return replace(ProblemBatch(**{k: take_problems(v, index) for k, v in vars(data).items()}), **changed)


def adapt_batch(
    data: ProblemBatch,
    weight: float = WEIGHT,
    reading: str = DEFAULT_READING,
    progress: Callable[[str], None] = lambda _: None,
) -> Adapted:
    """The lowest E found for each lane from several starts, with exact derivatives and the bounds of the model.

    A lane is ``ok`` when the optimality conditions of the whole-subject problem hold to tolerance.
    """
    chosen = READINGS[reading]
    lanes_shape = data.counted.shape[1:]
    if not chosen.root:
        factor = np.broadcast_to(chosen.weight(weight, np.nan, np.nan), lanes_shape)
        return _lowest(data, weight, chosen, factor, progress)
    factor = np.full(lanes_shape, WEIGHT)
    adapted = _lowest(data, weight, chosen, factor, progress)
    moving = np.ones(lanes_shape, bool)
    for number in range(_ROOT_ROUNDS):
        progress(f"weight of the roots, round {number + 1}")
        before, factor = factor, np.maximum(chosen.weight(weight, adapted.D_mm2, adapted.mean_j_deg2), _LEAST_WEIGHT)
        adapted = _from_theta(data, weight, chosen, factor, adapted.theta_mm, lambda _: None)
        moving = np.abs(np.log(factor / before)) > _ROOT_SETTLED
        if not moving.any():
            return adapted
    return replace(adapted, status=np.where(moving, status.NOT_CONVERGED, adapted.status))


def _lowest(data: ProblemBatch, weight, reading, factor, progress) -> Adapted:
    """All starts of all lanes side by side, then the best of each lane."""
    starts, count = len(STARTS_MM), len(factor)
    lower, upper = data.bounds_mm
    theta = [np.clip(data.girdle.adapted_mm + offset[:, None], lower, upper) for offset in STARTS_MM]
    every = np.tile(np.arange(count), starts)
    found = _from_theta(
        take_problems(data, every), weight, reading, factor[every], np.concatenate(theta, axis=-1), progress
    )
    best, *others = (_take(found, slice(k * count, (k + 1) * count)) for k in range(starts))
    for other in others:
        best = _better(best, other)
    return best


def _take(adapted: Adapted, chosen) -> Adapted:
    return Adapted(**{name: value[..., chosen] for name, value in vars(adapted).items()})


def _better(one: Adapted, other: Adapted) -> Adapted:
    """Lane by lane the converged one, then the one with the lower E."""
    gains = (other.status == status.OK) & ((one.status != status.OK) | (other.E < one.E))
    return Adapted(
        **{k: np.where(gains, value, getattr(one, k)) for k, value in vars(other).items()}  # lanes are last
    )


def solved_from_geometric_fit(data: ProblemBatch) -> Subject:
    """One start alone, the geometric fit and the measured angles, with the default weight: what benchmarks compare."""
    problem = problem_of(data, np.full(data.counted.shape[1:], WEIGHT))
    theta = np.clip(data.girdle.adapted_mm, *data.bounds_mm)
    return solved_from((data.girdle, data.points_mm, data.shares, problem), theta, data.angles)


def adapted_from(data: ProblemBatch, theta: Float[np.ndarray, "6 lanes"], weight: float = WEIGHT) -> Adapted:
    """The optimum of E [mm^2, deg^2] reached from one start alone, theta in mm and within the bounds."""
    reading = READINGS[DEFAULT_READING]
    return _from_theta(data, weight, reading, np.full(data.counted.shape[1:], weight), theta, lambda _: None)


def _from_theta(data: ProblemBatch, weight, reading, factor, theta: Float[np.ndarray, "6 lanes"], progress) -> Adapted:
    weights = _weights(data, factor)
    fixed = data.girdle, data.points_mm, data.shares, _problem(data, weights)
    progress("round 1")
    result = _solved(fixed, data.active_effects, theta, fitted_angles(data, theta))
    left = np.arange(theta.shape[-1])
    for number in range(2, _ROUNDS + 1):
        angles, lower = _lower_postures(take_problems(data, left), take_problems(result, left))
        again = ~result.converged[left] | lower
        left = left[again]
        if not len(left):
            break
        progress(f"round {number}")
        further = _solved(*take_problems((fixed, data.active_effects), left), result.theta[:, left], angles[..., again])
        gains = further.converged | ~result.converged[left]
        left = left[gains]  # another would go the same way again
        result = with_problems(result, left, take_problems(further, gains))
    return _as_adapted(as_type(data, float), weight, reading, weights, result)


def _solved(fixed: tuple[Girdle, Array, Array, Problem], active_effects: ActiveEffects, theta, angles) -> Subject:
    """The optima reached from here; with effects at work, which have no fast path, by the careful one."""
    if not active_effects.effects:
        return solved_from(fixed, theta, angles)
    return in_chunks(_solve, _SMALL_CHUNK, *fixed, theta, angles, active_effects)


def solved_from(fixed: tuple[Girdle, Array, Array, Problem], theta, angles) -> Subject:
    """The optima reached from here: the fast path, then the careful one for the lanes that need it; after a fast path
    in float32 (where the measured angles are) first the one in float64.

    All judge the end of every lane by the conditions of ``adapt.solvers.reference.subject``, with g and its feet
    computed anew.
    """
    result = swept_from(fixed, theta, angles)
    left = np.flatnonzero(~result.converged)
    if len(left):
        again = take_problems((fixed, theta, angles), left)
        if fixed[3].measured.dtype == np.float32:
            further = solved_from(*as_type(again, float))
        else:
            further = in_chunks(_solve, _SMALL_CHUNK, *again[0], *again[1:], at_once=_SMALL_AT_ONCE)
        result = with_problems(result, left, further)
    return result


def swept_from(fixed: tuple[Girdle, Array, Array, Problem], theta, angles) -> Subject:
    """The fast path alone, done in the type of the measured angles."""
    lanes, postures = theta.shape[-1], angles.shape[1]
    start = Start(theta, angles, np.zeros((3, postures, lanes)), np.zeros(lanes, bool))
    measured = fixed[3].measured
    given = as_type(((Fixed(*fixed),), start), measured.dtype)
    swept = as_type(in_rounds(subjects_kernel, _SWEEPS.for_dtype_of(measured), *given), float)
    nothing = np.zeros((postures, lanes))
    return Subject(penalty=nothing, radius_mm=nothing[0], **swept._asdict())


def _lower_postures(data: ProblemBatch, solved: Subject) -> tuple[np.ndarray, np.ndarray]:
    """The postures fitted anew at the solution, where that lowers their J, and the lanes where it does.

    A posture can be carried along in a valley that has become the higher one; E is the sum of the lowest.
    """
    fresh = fitted_angles(data, solved.theta)
    weights = objective_weights(data.measured)
    before, after = (mean_square_deg2(angles, data.angles, weights) for angles in (solved.angles, fresh))
    lower = (after < before - _LOWER_DEG2.for_dtype_of(data.angles)) & data.counted
    return np.where(lower[None], fresh, solved.angles), np.any(lower, axis=0)


def fitted_angles(data: ProblemBatch, theta: Float[Array, " 6 lanes"]) -> Float[Array, " 6 postures lanes"]:
    """The posture fits of every lane with its own girdle at theta."""
    postures, count = data.counted.shape
    posture, lane = (places.ravel() for places in np.indices((postures, count)))
    fitted = fit_batch(
        data.chain(theta, posture, lane),
        np.asarray(data.angles).reshape(6, -1),
        np.asarray(data.measured).reshape(6, -1),
        around=True,
    )
    return fitted.angles.reshape(6, postures, count)


def _weights(data: ProblemBatch, factor) -> Float[Array, " 6 postures lanes"]:
    """W of each angle in E: w / postures times that in J."""
    count = xp.sum(data.counted, axis=0)
    return objective_weights(data.measured) * (factor / count)[None, None]


def problem_of(data: ProblemBatch, factor: Float[np.ndarray, " lanes"]) -> Problem:
    """The whole-subject problems of the lanes with E = D [mm^2] + factor mean(J) [deg^2]."""
    return _problem(data, _weights(data, factor))


def _problem(data: ProblemBatch, weights) -> Problem:
    return Problem(data.angles, weights, data.counted, *data.bounds_mm)


def _conditions(girdle: Girdle, points_mm, shares, active_effects: ActiveEffects) -> tuple[Constraints, ThoraxPoints]:
    """The constraints of z = (q, theta) and the thorax term of theta."""
    of_postures = girdle.over_postures()

    def with_effects(z):
        return active_effects.on(of_postures.with_adapted(z[6:])).residuals_mm(z[:6])

    constraints = Differentiated(with_effects) if active_effects.effects else ByHand(of_postures)
    return constraints, ThoraxPoints(girdle, points_mm, shares)


_LANES = 256
"""Subjects in a chunk of a compiled program: 14 postures of each are 30 kB an array."""

_AT_ONCE = 128
"""Subjects up to which numpy is done before a compiled program is loaded."""

_SMALL_CHUNK = 16
"""Subjects in a chunk of the careful path, which is long to compile."""

_SMALL_AT_ONCE = 256
"""Subjects up to which numpy does the careful path; it takes a minute to compile."""

_SWEEPS = ByType((10, 10, 20, 20, 400), (10, 10, 20))
"""Most iterations of the fast path in each round: measured on simulated subjects, 8 of 10 lanes need one round, 199 of
200 four; the others, one of whose postures is at no strict minimum, converge linearly, which is left to float64."""

subjects_kernel = Kernel(
    "subjects",
    sweep,
    (
        Fixed(GIRDLE, "3 points", "points", Problem("6 postures", "6 postures", "postures bool", "6", "6")),
        Start("6", "6 postures", "3 postures", "bool"),
        "",
    ),
    Swept("6", "6 postures", "3 postures", "3 postures", "postures", "6", "int", "bool"),
    _LANES,
)


@jax.jit
def _solve(
    girdle: Girdle,
    points_mm,
    shares,
    problem: Problem,
    theta,
    angles,
    active_effects: ActiveEffects = NO_ACTIVE_EFFECTS,
) -> Subject:
    return solve_subjects(*_conditions(girdle, points_mm, shares, active_effects), problem, theta, angles)


@compiled
def standard_deviations(
    girdle: Girdle, points_mm, shares, problem: Problem, solved: Subject, active_effects: ActiveEffects
) -> Float[Array, " 6 lanes"]:
    """SD of each free parameter, mm, from the curvature of E (Gauss-Newton sandwich).

    cov = H^-1 V H^-1 over the free parameters. With R_p = (G W^-1 G')^-1 the stiffness that posture p has left against
    moving its constraints by T dtheta, and d_i the distance of thorax point i,

        H = sum_p T' R_p T + 2 sum_i share_i d'_i d'_i'      (curvature of E)
        V = W s2 sum_p T' R_p T + 4 d2 sum_i share_i^2 d'_i d'_i'   (covariance of dE/dtheta)

    for angles with variance s2 = sum of squared gaps / (3 P - free) and distances with variance d2 = n D / (n - 5).
    The gaps stand for the noise: what the model cannot do counts as if it were independent from posture to posture.
    """
    constraints, thorax = _conditions(girdle, points_mm, shares, active_effects)
    slopes = constraints.slopes(joint(solved.angles, solved.theta))
    G, T = slopes[:, :6], slopes[:, 6:]
    weight = xp.max(problem.weights, axis=(0, 1))
    softness = xp.where(problem.weights > 0.0, 1.0 / problem.weights, 1e6 / weight)
    range_space_penalty = matmul(G * softness[None], transpose(G))
    factor = Factor(range_space_penalty, 1e-12 * trace(range_space_penalty))
    from_angles = problem.total(matmul(transpose(T), factor.solve(T)))

    at, by_parameter = thorax.distances(solved.theta)
    d, slope = at.d, xp.stack(by_parameter, axis=1)
    from_points = 2.0 * xp.einsum("nil,nl,njl->ijl", slope, shares, slope)
    scatter = 4.0 * xp.einsum("nil,nl,njl->ijl", slope, shares**2, slope)

    free = (solved.theta > problem.lower + _AT_BOUND_MM) & (solved.theta < problem.upper - _AT_BOUND_MM)
    squares = problem.total(xp.sum(problem.weights * (solved.angles - problem.measured) ** 2, axis=0))
    freedom = 3.0 * xp.sum(problem.counted, axis=0) - xp.sum(free, axis=0)
    points = xp.sum(shares > 0.0, axis=0)
    point_variance = xp.sum(shares * d**2, axis=0) * points / xp.maximum(points - 5, 1)
    # W s2 = (sum of W gap^2) / freedom.
    V = xp.where(freedom > 0, squares / freedom, xp.nan) * from_angles + point_variance * scatter

    both = free[:, None] & free[None]
    curvature = from_angles + from_points
    size = xp.max(xp.abs(curvature), axis=(0, 1))
    reduced = xp.where(both, curvature, 0.0) + diagonal(xp.where(free, 0.0, size[None]))
    curved = Factor(reduced, 1e-12 * size)
    covariance = curved.solve(transpose(curved.solve(xp.where(both, V, 0.0))))
    variance = xp.stack([covariance[k, k] for k in range(len(ADAPTED))])
    return xp.where(free & curved.positive[None], xp.sqrt(variance), xp.nan)


def _as_adapted(data: ProblemBatch, weight, reading, weights, solved: Subject) -> Adapted:
    problem = _problem(data, weights)
    fixed = data.girdle, data.points_mm, data.shares, problem
    at_once = 0 if data.active_effects.effects else _AT_ONCE
    sd = in_chunks(standard_deviations, _LANES, *fixed, solved, data.active_effects, at_once=at_once)
    D = thorax_distance_mm2(data.girdle.with_adapted(solved.theta), data.points_mm, data.shares)
    j = mean_square_deg2(solved.angles, data.angles, objective_weights(data.measured))
    mean_j = problem.total(j) / np.sum(data.counted, axis=0)
    lower, upper = (np.asarray(bound) for bound in data.bounds_mm)
    theta = np.asarray(solved.theta)
    determined = np.all(np.sum(data.measured, axis=0) >= FEWEST_ANGLES, axis=0)
    converged = np.asarray(solved.converged) & np.isfinite(D) & np.isfinite(mean_j)
    words = np.where(converged, status.OK, status.NOT_CONVERGED)
    return Adapted(
        theta_mm=theta,
        sd_mm=np.asarray(sd),
        at_bound=(theta <= lower + _AT_BOUND_MM) | (theta >= upper - _AT_BOUND_MM),
        angles=np.asarray(solved.angles),
        D_mm2=D,
        mean_j_deg2=mean_j,
        E=reading.value(weight, D, mean_j),
        iterations=np.asarray(solved.iterations),
        status=np.where(determined, words, status.INVALID).astype("U16"),
    )
