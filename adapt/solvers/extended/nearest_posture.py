"""The chain near measured postures: the closed posture nearest to each, and how it moves with parameters and effects.

One compiled function for all candidate effects at once, each with strength zero where it is not at work, so that no
hypothesis needs a compilation of its own.
"""

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.engine.jax_program import per_problem
from adapt.engine.kernel import Kernel
from adapt.solvers.batched.posture_kernels import GIRDLE
from models.adapted_parameters import ADAPTED
from models.effects import ActiveEffects, Effect
from models.effects.own_effects import is_user_defined
from models.girdle import Girdle
from motions.arrays import Array
from motions.rotations import DEG

_MOST_STEPS = 150
"""Projections onto the constraints. Each takes the distance to the nearest posture down by the curvature of the
constraints times the gap, some tenth; of a chain that does not close they go on for ever."""

THERE_DEG = 1e-11
"""A projection that moves no angle farther ends them. |y|^2 is stationary there: its error goes with the square."""

_SHORTEST, _LONGEST = 1.0 / 16.0, 16.0
"""Of the part of a projection along the constraints that is taken: 1 where they are straight, less where they bend
away from the measured posture, more where they bend round it."""

_LONGEST_STEP_DEG = 25.0
"""A projection moves no angle farther: beyond it the constraints are no longer nearly straight."""

_FAR_DEG = 1e6

UNMEASURED_SD = 1000.0
"""SD of an angle that was not measured beside 1 of one that was: it is whatever closes the chain."""

NO_CHANNELS = 1
"""Of strengths where there are no effects: machine code has no empty arguments."""

_CHUNK = 256
"""Rows that XLA works on at a time."""


@dataclass(frozen=True)
class Nearest:
    """The closed postures x nearest to measured ones s.

    y = V^-1/2 (g + G (s - x)) with V = G S^2 G', all at x: |y|^2 is the squared distance in units of the SDs S, and
    x = s - S^2 B' y with B = V^-1/2 G.
    """

    angles_deg: Float[np.ndarray, "6 rows"]
    y: Float[np.ndarray, "3 rows"]
    by_theta: Float[np.ndarray, "3 adapted rows"]
    """dy a mm of each adapted parameter."""
    by_channel: Float[np.ndarray, "3 channels rows"]
    """dy a unit of strength in each channel of each effect; no channels where their strengths are known."""
    B: Float[np.ndarray, "3 6 rows"]
    g_mm: Float[np.ndarray, "3 rows"]
    """A1-A3 at x: not 0 where no closed posture was found."""
    h: Float[np.ndarray, "3 rows"]
    """V^-1/2' y: what one millimetre of each constraint costs of |y|^2 / 2."""

    @property
    def open_mm(self) -> Float[np.ndarray, " rows"]:
        """How far the chain is open at most."""
        return np.abs(self.g_mm).max(axis=0)

    def of(self, rows: np.ndarray) -> "Nearest":
        """Take some rows."""
        return Nearest(*(one[..., rows] for one in vars(self).values()))

    def with_rows(self, rows: np.ndarray, some: "Nearest") -> "Nearest":
        """Replace some rows."""
        found = Nearest(*(one.copy() for one in vars(self).values()))
        for mine, theirs in zip(vars(found).values(), vars(some).values(), strict=True):
            mine[..., rows] = theirs
        return found

    def where(self, chosen: np.ndarray, other: "Nearest") -> "Nearest":
        """Take the chosen rows of the other."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Nearest(*(np.where(chosen, theirs, mine) for mine, theirs in pairs))


def nearest_postures(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    strengths: Float[np.ndarray, "channels rows"],
    measured_deg: Float[np.ndarray, "6 rows"],
    sd: Float[np.ndarray, "6 rows"],
    start_deg: Float[np.ndarray, "6 rows"] | None = None,
    strengths_are_known: bool = False,
    there_deg: float | Float[np.ndarray, " rows"] = THERE_DEG,
) -> Nearest:
    """Find the nearest closed posture of every row, by projections from ``start_deg``, else from the measured angles.

    ``girdle``: (component, rows), adapted. ``sd`` is 1 where an angle was measured. Strengths that are known need no
    slopes. ``there_deg``: a projection that moves no angle farther is the last.
    """
    start = measured_deg if start_deg is None else start_deg
    there = np.broadcast_to(there_deg, measured_deg.shape[1:])
    found = _kernel(effects, strengths_are_known)(girdle, girdle.adapted_mm, strengths, measured_deg, sd, start, there)
    x, y, B, g, h, by_theta, *by_channel = found
    count = x.shape[1]
    B, T, *C = (one.reshape(3, -1, count) for one in (B, by_theta, *by_channel))
    return Nearest(x, y, T, C[0] if C else np.zeros((3, 0, count)), B, g, h)


@functools.cache
def _kernel(effects: tuple[Effect, ...], strengths_are_known: bool) -> Kernel:
    """The compiled function of these effects; last of its results, if wanted, the slopes in their strengths."""
    channels = [one.course.channels(len(one.directions)) for one in effects]
    splits, count = np.cumsum(channels).tolist(), sum(channels) or NO_CHANNELS

    def nearest(girdle: Girdle, theta_mm, strengths, s, sd, start, there):
        def g(x, theta, strengths=strengths):
            active = ActiveEffects(tuple(jnp.split(strengths, splits)[: len(effects)]), effects)
            return active.on(girdle.with_adapted(theta)).residuals_mm(x / DEG)

        at = (theta_mm,) if strengths_are_known else (theta_mm, strengths)
        return _nearest(g, at, s, sd, start, there)

    inputs = GIRDLE, str(len(ADAPTED)), str(count), "6", "6", "6", ""
    name = f"nearest_{'known_' * strengths_are_known}{_digest(effects, nearest, count)}"
    outputs = "6", "3", "18", "3", "3", str(3 * len(ADAPTED)), *([] if strengths_are_known else [str(3 * count)])
    return Kernel(name, per_problem(nearest), inputs, outputs, _CHUNK)


def _digest(effects: tuple[Effect, ...], nearest, count: int) -> str:
    """One word for the compiled function of these effects: by their names, and for effects from elsewhere, whose
    source the cache of machine code does not know, by all that JAX traces."""
    words = " ".join(one.name for one in effects)
    if any(map(is_user_defined, effects)):
        girdle = jax.tree.map(lambda words: np.zeros(3 if words else ()), GIRDLE)
        words += str(jax.make_jaxpr(nearest)(girdle, *(np.zeros(k) for k in (len(ADAPTED), count, 6, 6, 6, ()))))
    return hashlib.sha256(words.encode()).hexdigest()[:12]


def _nearest(g, at, s, sd, start, there):
    """Project until g(x, *at) is 0 and nothing moves, then all slopes; of one row."""

    slopes_at = jax.jit(functools.partial(_with_slopes, g))  # is traced once; the compiler drops what nobody reads

    def project(state):
        number, x, step_before, along_before, _ = state
        value, G, *_ = slopes_at(x, *at)
        GS = G * sd
        root = _inverse_root(GS @ GS.T)

        def across(constraints):
            return sd * (GS.T @ (root.T @ (root @ constraints)))

        along = (s - x) - across(G @ (s - x))
        step = _part_of(along, step_before, along_before, sd) * along - across(value)
        step = step * jnp.minimum(1.0, _LONGEST_STEP_DEG / jnp.maximum(jnp.max(jnp.abs(step)), 1e-9))
        return number + 1.0, x + step, step, along, jnp.max(jnp.abs(step) / sd)

    def moving(state):
        return (state[0] < _MOST_STEPS) & (state[4] > there)

    one, nothing = jnp.ones(()), 0.0 * start
    _, x, *_ = jax.lax.while_loop(moving, project, (0.0 * one, start, nothing, nothing, _FAR_DEG * one))
    value, G, *slopes = slopes_at(x, *at)
    GS = G * sd
    root = _inverse_root(GS @ GS.T)
    y = root @ (value + G @ (s - x))
    B, *slopes = ((root @ one).ravel() for one in (G, *slopes))
    return x, y, B, value, root.T @ y, *slopes


def _part_of(along, step_before, along_before, sd):
    """The part of the way along the constraints to take: that of Barzilai and Borwein (IMA J Numer Anal 8, 1988)."""
    turned = (along_before - along) / sd
    part = jnp.sum(step_before / sd * turned) / jnp.maximum(jnp.sum(turned**2), 1e-300)
    return jnp.where(part > 0.0, jnp.clip(part, _SHORTEST, _LONGEST), 1.0)


def _with_slopes(g, *at):
    """g and its slopes (3, inputs) in each argument."""
    value, pull = jax.vjp(g, *at)
    return value, *jax.vmap(pull)(jnp.eye(3))


def _inverse_root(V: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    """Inverse of the lower Cholesky factor, written out."""
    a = jnp.sqrt(V[0, 0])
    b, d = V[1, 0] / a, V[2, 0] / a
    c = jnp.sqrt(V[1, 1] - b * b)
    e = (V[2, 1] - d * b) / c
    f = jnp.sqrt(V[2, 2] - d * d - e * e)
    zero = jnp.zeros(())
    p, q, r = 1.0 / a, 1.0 / c, 1.0 / f
    s, u = -b * p * q, -e * q * r
    return jnp.stack([jnp.stack([p, zero, zero]), jnp.stack([s, q, zero]), jnp.stack([-(d * p + e * s) * r, u, r])])


def strengths_of(columns: Sequence[Float[np.ndarray, "amplitudes channels rows"]]) -> Float[np.ndarray, "k c rows"]:
    """Lay the columns of several effects out side by side: amplitudes by channels of all, zero elsewhere."""
    amplitudes, channels = (sum(one.shape[axis] for one in columns) for axis in (0, 1))
    every = np.zeros((amplitudes, channels, columns[0].shape[2]))
    a = c = 0
    for one in columns:
        every[a : a + one.shape[0], c : c + one.shape[1]] = one
        a, c = a + one.shape[0], c + one.shape[1]
    return every
