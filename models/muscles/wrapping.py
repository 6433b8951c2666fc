"""Shortest path between two points outside an ellipsoid: straight, geodesic, straight; exact to rounding.

All vectors are relative to the centre, along the axes a = (a_x, a_y, a_z). A hat means division by the axes: the
ellipsoid becomes the unit sphere |y| = 1, and the tangent lines through a point p touch this sphere on the circle

    y(phi) = p^/rho^2 + k e(phi),   direction  e(phi) - k p^,   rho = |p^|,  k = sqrt(1 - 1/rho^2),

with e(phi) a unit vector normal to p^. If p is on the surface, k is 0 and phi the direction in which the path leaves.
From y the path follows the geodesic for a length s (v: unit tangent, N = x_i / a_i^2),

    x' = v,   v' = -(v . D v) / |N|^2 N,   D = diag(1 / a_i^2),

and leaves along its tangent. The length of the straight part to a point with rho_q is (rho_q^2 - 1)^(1/2) / |v^|,
independent of the direction. So phi and s give an end point with the same rho as q, and two equations for its position
on that sphere remain. Their solution is regular with and without contact and on the surface (a form of the natural
geodesic variations of Scholz et al., Multibody Syst. Dyn. 36:195-219, 2016, that needs two unknowns). On a sphere the
solution is a great circle, phi = 0; from there a continuation leads the axes to their values, with Newton steps.

There is contact where the straight line from p to q would enter the ellipsoid. At lift-off, the length, its derivative
and the directions are continuous. A point inside is replaced by the closest point of the surface.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

from models.ellipsoid import closest_point
from motions.arrays import Array

Points = Float[Array, " 3 *batch"]

_STEPS = 128
"""Runge-Kutta steps along a geodesic: a quarter of a great circle of radius 100 mm is then exact to 3e-8 mm."""

_FEW_STEPS = 24
"""Runge-Kutta steps during the continuation of the axes: enough to stay near the solution."""

_STAGES = 8
"""Stages of the continuation of the axes, on a logarithmic scale: sufficient for axes up to 50 times as long as
others."""

_NEWTON = 3
"""Newton steps per stage: the solution moves little from stage to stage."""

_MOST_NEWTON = 12
"""Limit of Newton steps with the final axes; two or three are needed, more near points opposite each other."""

_LANES = 256
"""Paths per batch: as many as fit into the processor's cache, four times as fast as batches of thousands."""

_LARGEST_TURN = 0.5
"""Largest Newton step: in rad for phi, as a share of the mean axis for s."""

_CHORDS = 32

_LONGER = 1.002
"""Largest length of a solution over the length of a known path: a longer solution winds round and is not the shortest.
The known length is measured by chords and 1e-3 too short."""

_ON_SURFACE = 1e-12
"""Excess of |y| over 1 up to which a point counts as on the surface: rounding errors are 1e-15, and the path gets 1e-17
longer."""

TOLERANCE = 1e-10
"""Tolerance of the end point, divided by the axes: about 1e-8 mm."""


class Path(NamedTuple):
    """Path from p to q; lengths in mm, directions as unit vectors."""

    length_mm: Float[Array, " *batch"]
    from_p: Points
    """Direction of the path at p."""
    from_q: Points
    """Direction of the path at q."""
    contact_mm: Float[Array, " *batch"]
    """Length of the geodesic; 0 where there is no contact."""
    by_axes: Points
    """dL / da_i: the integral of the curvature times n_i x_i / a_i along the geodesic."""
    found: Bool[Array, " *batch"]


def outside(p_mm: Points, axes_mm: Points) -> Points:
    """Replace points inside the ellipsoid by the closest point of the surface; differentiable."""
    p, a = jnp.broadcast_arrays(p_mm, axes_mm)
    inside = jnp.sum((p / a) ** 2, axis=0) < 1.0
    return jnp.where(inside[None], closest_point(p, a), p)


@jax.custom_jvp
def path_length_mm(p_mm: Points, q_mm: Points, axes_mm: Points) -> Float[Array, " *batch"]:
    """Compute the length of the shortest path between two points that are not inside; NaN where no path was found.

    First and second derivatives are exact: the first, because changes of the shortest path do not change its length to
    first order; the second, by the implicit function theorem on the equations of the path. Use ``jax.grad``,
    ``jax.hessian`` or ``jax.jacrev(jax.jacfwd(...))``; reverse over reverse is an error of JAX. The second derivatives
    have a step at lift-off. At a point on the surface they hold for moves along the surface, which :func:`outside`
    makes; for moves off the surface the second derivative is unbounded.
    """
    path = shortest_path(p_mm, q_mm, axes_mm)
    return jnp.where(path.found, path.length_mm, jnp.nan)


@path_length_mm.defjvp
def _path_length_jvp(primals, tangents):
    """Compute dL = -u_p . dp - u_q . dq + sum dL/da_i da_i, with the directions u_p and u_q of the path at its ends."""
    path = shortest_path(*primals)
    (dp, dq, da) = tangents
    moved = -jnp.sum(path.from_p * dp, axis=0) - jnp.sum(path.from_q * dq, axis=0) + jnp.sum(path.by_axes * da, axis=0)
    return jnp.where(path.found, path.length_mm, jnp.nan), moved


@jax.jit
def shortest_path(p_mm: Points, q_mm: Points, axes_mm: Points) -> Path:
    """Find the shortest path between two points that are not inside, elementwise over the batch.

    The path found is the continuation of a great circle; with nearly opposite points, another path may be as short.
    """
    given = jnp.broadcast_arrays(p_mm, q_mm, axes_mm)
    batch = given[0].shape[1:]
    count = math.prod(batch)
    chunks = max(-(-count // _LANES), 1)
    lanes = min(count, _LANES)
    flat = [jnp.pad(x.reshape(3, count), ((0, 0), (0, chunks * lanes - count)), mode="edge") for x in given]
    found = jax.lax.map(lambda x: _side_by_side(*x), [jnp.moveaxis(x.reshape(3, chunks, lanes), 1, 0) for x in flat])
    return Path(
        *(
            jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1)[..., :count].reshape(*x.shape[1:-1], *batch)
            for x in found
        )
    )


def _side_by_side(p, q, a) -> Path:
    straight = q - p
    distance = _norm(straight)
    along = straight / jnp.where(distance > 0.0, distance, 1.0)[None]
    start, touches = _start(p / a, q / a), _enters(p / a, q / a)
    phi, s, error = _solve(start, a, touches)
    x, leaving, before = _leave(start, phi, a)
    _, arriving, by_axes = _geodesic(x, leaving, s, a, _STEPS)
    after = start.beyond_q / _norm(arriving / a)
    length = before + s + after
    solved = (error < TOLERANCE) & (s > -TOLERANCE * jnp.max(a, axis=0)) & (length < _LONGER * _known_length(start, a))
    return Path(
        jnp.where(touches, length, distance),
        jnp.where(touches[None], leaving, along),
        jnp.where(touches[None], -arriving, -along),
        jnp.where(touches, s, 0.0),
        jnp.where(touches[None], by_axes, 0.0),
        (solved | ~touches) & jnp.isfinite(distance),
    )


def path_points_mm(p_mm: Points, q_mm: Points, axes_mm: Points, count: int) -> Float[Array, " points 3 *batch"]:
    """Return points along the shortest path: p, ``count`` points of the geodesic or of the straight line, and q."""
    p, q, a = jnp.broadcast_arrays(p_mm, q_mm, axes_mm)
    start = _start(p / a, q / a)
    touches = _enters(p / a, q / a)
    phi, s, _ = _solve(start, a, touches)
    x, v, _ = _leave(start, phi, a)
    shares = jnp.linspace(0.0, 1.0, count)
    curved = jax.lax.map(lambda share: _geodesic(x, v, share * s, a, _STEPS)[0], shares)
    line = jax.lax.map(lambda share: p + share * (q - p), shares)
    return jnp.concatenate([p[None], jnp.where(touches[None, None], curved, line), q[None]])


class _Start(NamedTuple):
    """Problem with all vectors divided by the axes, on the unit sphere."""

    p: Points
    inverse_rho2: Array
    k: Array
    """k of p."""
    e1: Points
    """Unit vector toward q, normal to p."""
    e2: Points
    q: Points
    beyond_q: Array
    """Tangent length (rho_q^2 - 1)^(1/2) of q."""
    f1: Points
    """Unit vector normal to q, away from p."""
    f2: Points
    arc: Array
    """Angle of the great circle between the two circles of contact, rad."""


def _start(p, q) -> _Start:
    rho_p, rho_q = (_off_surface(_norm(x)) for x in (p, q))
    tangent_p, tangent_q = (_tangent(rho) for rho in (rho_p, rho_q))
    normal = jnp.cross(p, q, axis=0)
    length = _norm(normal)
    e2 = normal / jnp.where(length > 0.0, length, 1.0)[None]
    e1 = jnp.cross(e2, p / _norm(p)[None], axis=0)
    f1 = jnp.cross(e2, q / _norm(q)[None], axis=0)
    angle = jnp.arctan2(length, jnp.sum(p * q, axis=0))
    arc = angle - jnp.arctan(tangent_p) - jnp.arctan(tangent_q)
    return _Start(p, 1.0 / rho_p**2, tangent_p / rho_p, e1, e2, q, tangent_q, f1, e2, arc)


def _off_surface(rho) -> Array:
    """Set rho to exactly 1, with derivative 0, on the surface (and inside)."""
    return jnp.where(rho > 1.0 + _ON_SURFACE, rho, 1.0)


def _tangent(rho) -> Array:
    """Compute (rho^2 - 1)^(1/2), with derivative 0 at 1."""
    off = rho > 1.0
    return jnp.where(off, jnp.sqrt(jnp.where(off, rho**2 - 1.0, 1.0)), 0.0)


def _known_length(start: _Start, a) -> Array:
    """Compute the length of a path in a plane through the centre, not the shortest one; by chords, 1e-3 too short."""
    x, _, before = _leave(start, jnp.zeros_like(start.k), a)
    outward = start.p / _norm(start.p)[None]
    touching = jnp.arctan2(jnp.sum(x / a * start.e1, axis=0), jnp.sum(x / a * outward, axis=0))

    def at(number):
        angle = touching + number / _CHORDS * start.arc
        return a * (jnp.cos(angle)[None] * outward + jnp.sin(angle)[None] * start.e1)

    along = jax.lax.fori_loop(0, _CHORDS, lambda k, total: total + _norm(at(k + 1) - at(k)), jnp.zeros_like(start.k))
    return before + along + _norm(a * start.q - at(_CHORDS))


def _enters(p, q) -> Bool[Array, " *batch"]:
    """Check whether the straight line between two points that are not inside the unit sphere enters it."""
    d = q - p
    squared = jnp.sum(d * d, axis=0)
    share = -jnp.sum(p * d, axis=0) / jnp.where(squared > 0.0, squared, 1.0)
    nearest = jnp.sum((p + share[None] * d) ** 2, axis=0)
    return (share > 0.0) & (share < 1.0) & (nearest < 1.0)


def _leave(start: _Start, phi, a) -> tuple[Points, Points, Array]:
    """Compute the point where the path meets the surface, the unit tangent there, and the length of the straight part
    before."""
    e = jnp.cos(phi)[None] * start.e1 + jnp.sin(phi)[None] * start.e2
    y = start.p * start.inverse_rho2[None] + start.k[None] * e
    direction = a * (e - start.k[None] * start.p)
    size = _norm(direction)
    return a * y, direction / size[None], start.k * size


def _geodesic(x, v, s, a, steps: int | Array) -> tuple[Points, Points, Points]:
    """Integrate the geodesic over a length s: end point, unit tangent, integral of curvature times n_i x_i / a_i."""
    h = s / steps

    def slope(state):
        x, v, _ = state
        N = x / a**2
        squared, bend = jnp.sum(N * N, axis=0), jnp.sum((v / a) ** 2, axis=0)
        pressing = (bend / squared)[None]
        return v, -pressing * N, pressing * N * x / a

    def moved(state, slopes, share):
        return tuple(one + share * h * d for one, d in zip(state, slopes, strict=True))

    def step(_, state):
        k1 = slope(state)
        k2 = slope(moved(state, k1, 0.5))
        k3 = slope(moved(state, k2, 0.5))
        k4 = slope(moved(state, k3, 1.0))
        mean = tuple((b + 2.0 * c + 2.0 * d + e) / 6.0 for b, c, d, e in zip(k1, k2, k3, k4, strict=True))
        return moved(state, mean, 1.0)

    x, v, integral = jax.lax.fori_loop(0, steps, step, (x, v, jnp.zeros_like(x)))
    return x, v / _norm(v)[None], integral


def _miss(start: _Start, phi, s, a, steps: int | Array) -> tuple[Array, Array]:
    """Compute the error of the end point against q on its sphere, in two directions."""
    x, v, _ = _geodesic(*_leave(start, phi, a)[:2], s, a, steps)
    tangent = v / a
    end = x / a + tangent * (start.beyond_q / _norm(tangent))[None]
    return jnp.sum(start.f1 * (end - start.q), axis=0), jnp.sum(start.f2 * (end - start.q), axis=0)


@jax.custom_jvp
def _solve(start: _Start, a, touches) -> tuple[Array, Array, Array]:
    """Continue the axes from a sphere to ``a``; return phi, s and the error of the end point. Only paths with contact
    have to converge."""
    mean = jnp.exp(jnp.mean(jnp.log(a), axis=0))

    def part(number, state):
        arrived = number == 1
        steps, most = (jnp.where(arrived, *two) for two in ((_STEPS, _FEW_STEPS), (_MOST_NEWTON, _STAGES * _NEWTON)))

        def unfinished(state):
            done, _, _, error = state
            return (done < most) & jnp.any(touches & ~(error < TOLERANCE) | ~arrived)

        def step(state):
            done, phi, s, _ = state
            share = (done // _NEWTON + 1.0) / _STAGES
            axes = jnp.where(arrived, a, mean[None] ** (1.0 - share) * a**share)
            return (done + 1, *_newton(start, phi, s, axes, mean, steps))

        _, phi, s, _ = state
        return jax.lax.while_loop(unfinished, step, (0, phi, s, jnp.full_like(s, jnp.inf)))

    great_circle = (0, jnp.zeros_like(mean), mean * start.arc, jnp.full_like(mean, jnp.inf))
    _, phi, s, error = jax.lax.fori_loop(0, 2, part, great_circle)
    return phi, s, error


@_solve.defjvp
def _solve_jvp(primals, tangents):
    """Apply the implicit function theorem: changes of phi and s cancel the error that start and axes add."""
    start, a, _ = primals
    phi, s, error = _solve(*primals)
    _, moved = jax.jvp(lambda start, a: _miss(start, phi, s, a, _STEPS), (start, a), tangents[:2])
    _, correction = _correction(start, phi, s, a, _STEPS)
    return (phi, s, error), (*correction(*moved), jnp.zeros_like(error))


def _correction(start: _Start, phi, s, a, steps: int | Array):
    """Compute the error of the end point, and the function from a small error to the change of phi and s that cancels
    it."""

    def miss(phi, s):
        return _miss(start, phi, s, a, steps)

    along = jnp.eye(2).reshape(2, 2, *[1] * phi.ndim) * jnp.ones_like(phi)
    missed, slopes = jax.vmap(lambda d: jax.jvp(miss, (phi, s), (d[0], d[1])), out_axes=(None, 0))(along)
    (a11, a12), (a21, a22) = slopes
    determinant = a11 * a22 - a12 * a21
    regular = jnp.where(determinant == 0.0, 1.0, determinant)
    return missed, lambda r1, r2: ((a12 * r2 - a22 * r1) / regular, (a21 * r1 - a11 * r2) / regular)


def _newton(start: _Start, phi, s, a, mean, steps: int | Array) -> tuple[Array, Array, Array]:
    """Compute phi and s after one Newton step, and the error of the end point before it."""
    (r1, r2), correction = _correction(start, phi, s, a, steps)
    turn, onward = correction(r1, r2)
    largest = jnp.maximum(abs(turn), abs(onward) / mean) / _LARGEST_TURN
    shorter = 1.0 / jnp.maximum(largest, 1.0)
    return phi + shorter * turn, s + shorter * onward, jnp.maximum(abs(r1), abs(r2))


def _norm(v) -> Array:
    return jnp.sqrt(jnp.sum(v * v, axis=0))
