"""The chain near measured postures: the closed posture nearest to each, and its slopes in parameters and effects.

One compiled function serves all candidate effects at once, with strength zero where an effect is not active, so that no
hypothesis needs its own compilation.
"""

import functools
import hashlib
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from adapt.engine.jax_program import per_problem
from adapt.engine.kernel import Kernel
from adapt.solvers.newton.postures import GIRDLE
from adapt.solvers.projection.small_matrices import inverse_root, null_basis, symmetric_solve
from adapt.solvers.unmeasured import UNMEASURED_SD, sd_rad
from models.adapted_parameters import ADAPTED
from models.effects import ActiveEffects, AnyGirdle, Effect
from models.effects.own_effects import is_user_defined
from models.girdle import COUNT_OF_NUMBERS, Girdle
from motions.arrays import Array
from motions.rotations import DEG

_MOST_STEPS = 150
"""Largest number of projections onto the constraints. Each multiplies the distance to the nearest posture by the
curvature of the constraints times the gap, some tenth; where the chain does not close, only this limit ends them."""

THERE = 1e-11
"""Tolerance, in SDs of each angle, of the step of the last projection. |y|^2 is stationary there: its error is
quadratic in this tolerance."""

_SHORTEST, _LONGEST = 1.0 / 16.0, 16.0
"""Bounds of the step length of a projection along the constraints: 1 where the constraints are straight, less where
they bend away from the measured posture, more where they bend round it."""

_LONGEST_STEP_RAD = 25.0 / float(DEG)
"""Largest step of an angle in a projection: beyond it the constraints are no longer nearly straight."""

_FAR = 1e6

_MOST_CLOSING_STEPS, _FIRST_DAMPING = 120, 1e-3

_FOLD = 1.0 / 30.0
"""Smallest curvature of the distance along the constraints, relative to straight constraints, for which the slopes
include the movement of the nearest posture. Below it, near a fold, that posture moves more than thirty times as far as
with straight constraints and ceases to exist close by: its slopes do not predict a step."""

_STEEPEST = 1e4
"""Largest slope of y, SDs per millimetre or per unit of strength; any fold has at most a thirtieth of it. Only frames
whose middle angle is 90 degrees exceed it, where a basis over their angles has no derivative."""

_AT_REST_RAD, _CLOSED_MM = 1e-10, 1e-12
"""Tolerances of closing a chain: the step at which it has come to rest, and the constraint violation that is only
rounding."""

NO_CHANNELS = 1
"""Number of channels where there are no effects: machine code has no empty arguments."""

_CHUNK = 256
"""Number of rows per chunk of an XLA program."""


class Nearest(NamedTuple):
    """Closed postures x nearest to measured ones s.

    y = V^-1/2 (g + G (s - x)) with V = G S^2 G', all at x: |y|^2 is the squared distance in units of the SDs S, and
    x = s - S^2 B' y with B = V^-1/2 G. S of a measured angle is a degree.
    """

    angles: Float[np.ndarray, "6 rows"]
    """Angles x, rad."""
    y: Float[np.ndarray, "3 rows"]
    by_theta: Float[np.ndarray, "3 adapted rows"]
    """Slopes of y per mm of each adapted parameter."""
    by_channel: Float[np.ndarray, "3 channels rows"]
    """Slopes of y per unit of strength in each channel of each effect; no channels where their strengths are known."""
    B: Float[np.ndarray, "3 6 rows"]
    """B, per rad."""
    g_mm: Float[np.ndarray, "3 rows"]
    """Constraints A1-A3 at x: not 0 where no closed posture was found."""
    h: Float[np.ndarray, "3 rows"]
    """V^-1/2' y: cost of one millimetre of each constraint in |y|^2 / 2."""

    @property
    def open_mm(self) -> Float[np.ndarray, " rows"]:
        """Largest constraint violation."""
        return np.abs(self.g_mm).max(axis=0)


def nearest_postures(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    strengths: Float[np.ndarray, "channels rows"],
    angles: Float[np.ndarray, "6 rows"],
    measured: Bool[np.ndarray, "6 rows"],
    start: Float[np.ndarray, "6 rows"] | None = None,
    strengths_are_known: bool = False,
    there: float | Float[np.ndarray, " rows"] = THERE,
    unmeasured_sd: float = UNMEASURED_SD,
) -> Nearest:
    """Find the nearest closed posture of every row, by projections from ``start``, or else from the angles, rad.

    ``girdle``: (component, rows), adapted. Known strengths get no slopes. ``there``: tolerance of the last projection,
    in SDs of each angle. ``unmeasured_sd``: SD that holds an unmeasured angle to its value in ``angles``, relative to a
    measured angle.
    """
    sd, last = sd_rad(measured, unmeasured_sd), np.broadcast_to(there, angles.shape[1:])
    kernel = _nearest_kernel(effects, strengths_are_known)
    found = kernel(
        girdle, girdle.adapted_mm, strengths, angles, sd, np.asarray(angles if start is None else start), last
    )
    x, y, B, g, h, by_theta, *by_channel = found
    count = x.shape[1]
    B, T, *C = (one.reshape(3, -1, count) for one in (B, by_theta, *by_channel))
    return Nearest(x, y, T, C[0] if C else np.zeros((3, 0, count)), B, g, h)


def nearest_by_numbers(
    numbers_mm: Float[np.ndarray, "numbers rows"],
    active_effects: ActiveEffects,
    angles: Float[np.ndarray, "6 rows"],
    measured: Bool[np.ndarray, "6 rows"],
    start: Float[np.ndarray, "n rows"],
    there: float | Float[np.ndarray, " rows"] = THERE,
    slack_mm: float = 0.0,
) -> Nearest:
    """Find the nearest closed postures with slopes in every number of the girdle (``Girdle.numbers_mm``) in place of
    the adapted parameters.

    With ``slack_mm`` each constraint has a slack of this SD, beside the degree of the angles. ``start`` and ``angles``
    of the result then have three more rows, mm, and |y|^2 is the squared distance to the nearest posture that closes up
    to the slacks.
    """
    sd = sd_rad(measured, UNMEASURED_SD)
    rows, strengths = angles.shape[1], strengths_rows(active_effects, angles.shape[1])
    if slack_mm:
        angles = np.concatenate([angles, np.zeros((3, rows))])
        sd = np.concatenate([sd, np.full((3, rows), slack_mm)])
    kernel = _numbers_kernel(active_effects.effects, len(sd))
    x, y, B, g, h, T = kernel(numbers_mm, strengths, angles, sd, np.asarray(start), np.broadcast_to(there, (rows,)))
    B, T = (one.reshape(3, -1, rows) for one in (B, T))
    return Nearest(x, y, T, np.zeros((3, 0, rows)), B, g, h)


def strengths_rows(active_effects: ActiveEffects, rows: int) -> Float[np.ndarray, "channels rows"]:
    """Concatenate the strengths of all effects."""
    return np.concatenate(active_effects.strengths) if active_effects.effects else np.zeros((NO_CHANNELS, rows))


def with_whole_slopes(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    strengths: Float[np.ndarray, "channels rows"],
    angles: Float[np.ndarray, "6 rows"],
    measured: Bool[np.ndarray, "6 rows"],
    near: Nearest,
    unmeasured_sd: float = UNMEASURED_SD,
) -> Nearest:
    """Compute slopes of y that include the movement of the nearest postures; ``nearest_postures`` gives slopes at fixed
    postures.

    The two agree for |y|^2 (envelope theorem), but not for a square of y weighted by a covariance between rows. Near a
    fold (``_FOLD``) the slopes are those at a fixed posture, at a gimbal lock (``_STEEPEST``) they are 0.
    """
    sd = sd_rad(measured, unmeasured_sd)
    at, rows = (girdle, girdle.adapted_mm, strengths, angles, sd, near.angles), angles.shape[1]
    kernel = _slopes_kernel(effects)  # one component per call: machine code of all three compiles thrice as long
    each = zip(*(kernel(*at, np.repeat(one[:, None], rows, axis=1)) for one in np.eye(3)), strict=True)
    slopes = [np.stack(one) for one in each]
    told = np.all([(np.abs(one) < _STEEPEST).all(axis=(0, 1)) for one in slopes], axis=0)
    by_theta, by_channel = (np.where(told, one, 0.0) for one in slopes)
    return near._replace(by_theta=by_theta, by_channel=by_channel)


def closed(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    strengths: Float[np.ndarray, "channels rows"],
    start: Float[np.ndarray, "6 rows"],
) -> tuple[Float[np.ndarray, "6 rows"], Float[np.ndarray, "3 rows"]]:
    """Find angles (rad) near ``start`` where the chain closes or, if it cannot, is least open (a local minimum of
    |g|^2), and g there, mm.

    The method is Levenberg-Marquardt with steps in the range of G'.
    """
    return _closing_kernel(effects)(girdle, girdle.adapted_mm, strengths, start)


@functools.cache
def _nearest_kernel(effects: tuple[Effect, ...], strengths_are_known: bool) -> Kernel:
    """Return the compiled function of these effects; its last result, if wanted, is the slopes in their strengths."""
    count = channels(effects)[-1] or NO_CHANNELS

    def nearest(girdle: Girdle, theta_mm, strengths, s, sd, start, there):
        at = (theta_mm,) if strengths_are_known else (theta_mm, strengths)
        return _nearest(_constraints(effects, girdle, strengths), at, s, sd, start, there)

    inputs = GIRDLE, str(len(ADAPTED)), str(count), "6", "6", "6", ""
    name = f"nearest_{'known_' * strengths_are_known}{digest(effects, nearest, (len(ADAPTED), count, 6, 6, 6, ()))}"
    outputs = "6", "3", "18", "3", "3", str(3 * len(ADAPTED)), *([] if strengths_are_known else [str(3 * count)])
    return Kernel(name, per_problem(nearest), inputs, outputs, _CHUNK)


@functools.cache
def _slopes_kernel(effects: tuple[Effect, ...]) -> Kernel:
    count = channels(effects)[-1] or NO_CHANNELS

    def slopes(girdle: Girdle, theta_mm, strengths, s, sd, x, weights):
        return _whole_slopes(_constraints(effects, girdle, strengths), (theta_mm, strengths), s, sd, x, weights)

    name = f"slopes_{digest(effects, slopes, (len(ADAPTED), count, 6, 6, 6, 3))}"
    inputs = GIRDLE, str(len(ADAPTED)), str(count), "6", "6", "6", "3"
    return Kernel(name, per_problem(slopes), inputs, (str(len(ADAPTED)), str(count)), _CHUNK)


@functools.cache
def _numbers_kernel(effects: tuple[Effect, ...], coordinates: int) -> Kernel:
    """Return the compiled function of these effects, at known strengths, with slopes in the numbers of the girdle.
    Coordinates beyond the six angles are slacks of A1-A3."""
    count, n = channels(effects)[-1] or NO_CHANNELS, coordinates

    def nearest(numbers_mm, strengths, s, sd, start, there):
        def g(x, numbers):
            residuals = with_effects(effects, Girdle.of_numbers(numbers), strengths).residuals_mm(x[:6])
            return residuals - x[6:] if n > 6 else residuals

        return _nearest(g, (numbers_mm,), s, sd, start, there)

    name = f"numbers_{n}_{digest(effects, nearest, (COUNT_OF_NUMBERS, count, n, n, n, ()), of_girdle=False)}"
    inputs = str(COUNT_OF_NUMBERS), str(count), *[str(n)] * 3, ""
    outputs = str(n), "3", str(3 * n), "3", "3", str(3 * COUNT_OF_NUMBERS)
    return Kernel(name, per_problem(nearest), inputs, outputs, _CHUNK)


@functools.cache
def _closing_kernel(effects: tuple[Effect, ...]) -> Kernel:
    count = channels(effects)[-1] or NO_CHANNELS

    def close(girdle: Girdle, theta_mm, strengths, start):
        return _closed(functools.partial(_constraints(effects, girdle, strengths), theta=theta_mm), start)

    name = f"closed_{digest(effects, close, (len(ADAPTED), count, 6))}"
    return Kernel(name, per_problem(close), (GIRDLE, str(len(ADAPTED)), str(count), "6"), ("6", "3"), _CHUNK)


def channels(effects: tuple[Effect, ...]) -> list[int]:
    """List the bounds between the strengths of successive effects: 0, then the end of each effect."""
    return [0, *np.cumsum([one.basis.channels(len(one.directions)) for one in effects], dtype=int).tolist()]


def _constraints(effects: tuple[Effect, ...], girdle: Girdle, known_strengths) -> Callable[..., Array]:
    """Return A1-A3 of one row, mm, as a function of its angles (rad), the adapted parameters and the strengths."""

    def g(x, theta, strengths=known_strengths):
        return with_effects(effects, girdle.with_adapted(theta), strengths).residuals_mm(x)

    return g


def with_effects(effects: tuple[Effect, ...], girdle: Girdle, strengths) -> AnyGirdle:
    """Apply effects with concatenated strengths to the girdle."""
    every = jnp.split(strengths, channels(effects)[1:])[: len(effects)]
    return ActiveEffects(tuple(every), effects).on(girdle)


def digest(
    effects: tuple[Effect, ...], function, shapes: Sequence[int | tuple[int, ...]], of_girdle: bool = True
) -> str:
    """Compute a hash that names the compiled function of these effects. The hash covers the names of the effects and,
    for user-defined effects, whose source the cache of machine code does not know, all that JAX traces."""
    words = " ".join(one.name for one in effects)
    if any(map(is_user_defined, effects)):
        girdle = [jax.tree.map(lambda words: np.zeros(3 if words else ()), GIRDLE)] * of_girdle
        words += str(jax.make_jaxpr(function)(*girdle, *(np.zeros(shape) for shape in shapes)))
    return hashlib.sha256(words.encode()).hexdigest()[:12]


def _nearest(g, at, s, sd, start, there):
    """Project until g(x, *at) is 0 and x does not move, then compute all slopes, for one row."""

    slopes_at = jax.jit(functools.partial(_with_slopes, g))  # traced once; the compiler drops unused results

    def project(state):
        number, x, step_before, along_before, _ = state
        value, G, *_ = slopes_at(x, *at)
        GS = G * sd
        root = inverse_root(GS @ GS.T)

        def across(constraints):
            return sd * (GS.T @ (root.T @ (root @ constraints)))

        along = (s - x) - across(G @ (s - x))
        step = _part_of(along, step_before, along_before, sd) * along - across(value)
        step = _limited(step)
        return number + 1.0, x + step, step, along, jnp.max(jnp.abs(step) / sd)

    def moving(state):
        return (state[0] < _MOST_STEPS) & (state[4] > there)

    one, nothing = jnp.ones(()), 0.0 * start
    _, x, *_ = jax.lax.while_loop(moving, project, (0.0 * one, start, nothing, nothing, _FAR * one))
    value, G, *slopes = slopes_at(x, *at)
    GS = G * sd
    root = inverse_root(GS @ GS.T)
    y = root @ (value + G @ (s - x))
    B, *slopes = ((root @ one).ravel() for one in (G, *slopes))
    return x, y, B, value, root.T @ y, *slopes


def _whole_slopes(g, at, s, sd, x, weights):
    """Compute slopes of weights' y (inputs) in each of ``at`` as the nearest posture follows, for one row.

    x satisfies S^-2 (x - s) + G' h = 0 and g = 0. With K the derivative of the first condition in x, and (a, b) the
    solution of K a + G' b = y_x' weights, G a = 0, the slopes are those of weights' y - h' G a - b' g at a fixed x. a
    lies in the span of Z, the directions along the constraints. Near a fold (``_FOLD``) a and b are 0.
    """

    def along_weights(x, *at):
        value, pull = jax.vjp(lambda x: g(x, *at), x)
        G = jax.vmap(lambda one: pull(one)[0])(jnp.eye(3))
        GS = G * sd
        root = inverse_root(GS @ GS.T)
        y = root @ (value + G @ (s - x))
        return weights @ y, (G, root.T @ y)

    _, pull, (G, h) = jax.vjp(along_weights, x, *at, has_aux=True)
    of_x, *of_at = pull(jnp.ones(()))
    bend = jax.grad(lambda x: h @ g(x, *at))
    Z = null_basis(G)
    straight = Z / (sd * sd)[:, None]
    KZ = jax.vmap(lambda z: jax.jvp(bend, (x,), (z,))[1], in_axes=1, out_axes=1)(Z) + straight
    along, _ = symmetric_solve(Z.T @ KZ, (Z.T @ of_x)[:, None])
    across, _ = symmetric_solve(G @ G.T, G @ (of_x[:, None] - KZ @ along))
    _, pivot = symmetric_solve(Z.T @ (KZ - _FOLD * straight), jnp.zeros((3, 0)))
    a, b = (jnp.where(pivot > 0.0, one[:, 0], 0.0) for one in (Z @ along, across))

    def slopes(x, h):
        return jax.grad(lambda at: h @ g(x, *at))(at)

    _, follows = jax.jvp(slopes, (x, h), (a, b))
    return tuple(one - jnp.where(pivot > 0.0, two, 0.0) for one, two in zip(of_at, follows, strict=True))


def _part_of(along, step_before, along_before, sd):
    """Compute the step length along the constraints by Barzilai and Borwein (IMA J Numer Anal 8, 1988)."""
    turned = (along_before - along) / sd
    part = jnp.sum(step_before / sd * turned) / jnp.maximum(jnp.sum(turned**2), 1e-300)
    return jnp.where(part > 0.0, jnp.clip(part, _SHORTEST, _LONGEST), 1.0)


def _limited(step):
    """Shorten a step so that no angle moves by more than ``_LONGEST_STEP_RAD``."""
    return step * jnp.minimum(1.0, _LONGEST_STEP_RAD / jnp.maximum(jnp.max(jnp.abs(step)), 1e-9))


def _closed(g, start):
    """Close the chain of one row."""
    slopes_at = jax.jit(functools.partial(_with_slopes, g))

    def close(state):
        number, x, damping, _ = state
        value, G = slopes_at(x)
        V = G @ G.T
        root = inverse_root(V + damping * jnp.trace(V) * jnp.eye(3))
        step = _limited(-(G.T @ (root.T @ (root @ value))))
        trial, _ = slopes_at(x + step)
        better = jnp.sum(trial**2) < jnp.sum(value**2)  # False where V was singular and the step is NaN
        far = ~(jnp.max(jnp.abs(step)) <= _AT_REST_RAD)
        is_open = jnp.max(jnp.abs(jnp.where(better, trial, value))) > _CLOSED_MM
        return number + 1.0, jnp.where(better, x + step, x), damping * jnp.where(better, 0.1, 10.0), far & is_open

    def moving(state):
        return (state[0] < _MOST_CLOSING_STEPS) & state[3]

    zero = 0.0 * start[0]
    _, x, *_ = jax.lax.while_loop(moving, close, (zero, start, zero + _FIRST_DAMPING, zero < 1.0))
    return x, slopes_at(x)[0]


def _with_slopes(g, *at):
    """Compute g and its slopes (3, inputs) in each argument."""
    value, pull = jax.vjp(g, *at)
    return value, *jax.vmap(pull)(jnp.eye(3))


def strengths_of(columns: Sequence[Float[np.ndarray, "amplitudes channels rows"]]) -> Float[np.ndarray, "k c rows"]:
    """Arrange the columns of several effects side by side: amplitudes by channels of all effects, zero elsewhere."""
    amplitudes, channels = (sum(one.shape[axis] for one in columns) for axis in (0, 1))
    every = np.zeros((amplitudes, channels, columns[0].shape[2]))
    a = c = 0
    for one in columns:
        every[a : a + one.shape[0], c : c + one.shape[1]] = one
        a, c = a + one.shape[0], c + one.shape[1]
    return every
