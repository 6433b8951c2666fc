"""The girdle driven by its three free coordinates: y and z of AC and x of TS (thesis 3.2.2 and 6.2.3).

SC is fixed, so the six angles follow in four steps with one unknown each:

1. Direction of the clavicle, in closed form. AC lies on the sphere of radius L about SC:
   AC_x = SC_x + sqrt(L^2 - (AC_y - SC_y)^2 - (AC_z - SC_z)^2). The second root, with AC medial of SC, is ignored.
2. TS lies on the circle at distance |ts| from AC in the plane x = TS_x; some points of this circle fulfil A1.
3. AI lies on a circle about the line AC-TS; some points of this circle fulfil A2. AC, TS and AI determine the scapula.
4. Axial rotation c of the clavicle, in closed form. With p = R_yz' (P - SC), P the conoid's attachment on the scapula
   and k the attachment on the clavicle, A3 reads

       (p_y k_y + p_z k_z) cos c + (p_z k_y - p_y k_z) sin c = (|p|^2 + |k|^2 - L_conoid^2) / 2 - p_x k_x.

Steps 2-4 have several solutions: the branches of the chain. Each step takes the solution nearest to a start posture.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from models.ellipsoid import distance_and_normal
from models.girdle import Girdle, constraint_residuals_mm, landmarks, refuse_degrees
from models.nearest_root import nearest_root
from motions.arrays import Array
from motions.rhythm import REST_DEG
from motions.rotations import (
    DEG,
    cardan_from_rotation,
    compose,
    rotate,
    rotation_about,
    rotation_between,
    rotation_from_cardan,
)

DRIVEN = ("ok", "unreachable_AC", "unreachable_TS", "unreachable_AI", "unreachable_conoid", "not_converged", "invalid")
"""Status words of a posture. ``unreachable_AC``: AC_y, AC_z are farther from SC than the clavicle is long.
``unreachable_TS``, ``unreachable_AI``: the point has its required distance nowhere within ``WINDOW_DEG`` of the start.
``unreachable_conoid``: too short or too long at every axial rotation. ``invalid``: a number is missing."""

WINDOW_DEG = 60.0
"""Largest turn of TS and AI from the start posture. From rest, the window reaches every posture of the shipped
simulated subjects, up to 150 degrees of elevation. Other branches have the scapula on the front of the thorax or upside
down."""

_SAMPLES = 49
"""Number of samples of a distance in the window, 2.5 degrees apart."""

TOLERANCE_MM = 1e-9
"""Tolerance for |g| and for the coordinates of a driven posture, as in a posture fit; rounding leaves 1e-12."""


class Driven(NamedTuple):
    """Postures with given free coordinates."""

    angles: Float[Array, " 6 *batch"]
    """Angles in rad; NaN where the status is not ``ok``."""
    status: Int[Array, " *batch"]
    """Index in ``DRIVEN``."""

    @property
    def words(self) -> np.ndarray:
        """Status words, one per posture."""
        return np.array(DRIVEN)[np.asarray(self.status)]


def free_coordinates_mm(girdle: Girdle, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
    """Compute AC_y, AC_z and TS_x, mm, thorax frame, from six angles in radians: the inverse of :func:`drive`.

    Raises ValueError if an angle exceeds a full turn, as angles in degrees do.
    """
    refuse_degrees(angles)
    angles = jnp.asarray(angles)
    at = landmarks(_over_batch(girdle, angles.ndim - 1), angles)
    return jnp.stack([at.AC[1], at.AC[2], at.TS[0]])


def drive(
    girdle: Girdle,
    coordinates_mm: Float[Array, " 3 *batch"],
    start: Float[Array, " 6 *#batch"] | None = None,
) -> Driven:
    """Compute the closed posture with these AC_y, AC_z, TS_x, on the branch nearest to ``start`` (rad; default: rest).

    The function works elementwise over postures; the girdle has the same batch or none. It is differentiable with
    respect to coordinates and girdle, forward and reverse, any number of times; the derivative of a posture that is not
    ``ok`` is 0. (Thesis 6.2.3; Eq. 6.2 for A1-A3.) Raises ValueError if an angle of ``start`` exceeds a full turn, as
    angles in degrees do.
    """
    if start is not None:
        refuse_degrees(start)
    coordinates = jnp.asarray(coordinates_mm)
    batch = coordinates.shape[1:]
    start = jnp.broadcast_to(_rest(len(batch)) if start is None else jnp.asarray(start), (6, *batch))
    return _drive(_over_batch(girdle, len(batch)), coordinates, start)


def _rest(axes: int) -> Float[Array, " 6 *batch"]:
    return jnp.asarray(REST_DEG / DEG).reshape(6, *[1] * axes)


def _over_batch(girdle: Girdle, axes: int) -> Girdle:
    girdle = jax.tree.map(jnp.asarray, girdle)
    return girdle.over_axes(axes - girdle.conoid_length_mm.ndim)


@jax.custom_jvp
def _drive(girdle: Girdle, coordinates, start) -> Driven:
    return _search(girdle, coordinates, start)


@_drive.defjvp
def _drive_jvp(primals, tangents):
    """Apply the implicit function theorem to the six equations; 0 where there is no posture, so that NaN cannot spread
    to the derivatives of other postures."""
    driven = _drive(*primals)
    good = (driven.status == 0)[None]
    q = jnp.where(good, driven.angles, primals[2])
    step = _newton_step(primals[:2], tangents[:2], q, good)
    return driven, Driven(jnp.where(good, step, 0.0), np.zeros(good.shape[1:], jax.dtypes.float0))


@jax.jit
def _newton_step(inputs, moved_inputs, q, good) -> Float[Array, " 6 *batch"]:
    """Compute the tangent of q for given tangents of girdle and coordinates."""
    _, move = jax.linearize(equations_mm, *inputs, q)
    nothing = jax.tree.map(jnp.zeros_like, inputs)
    identity = jnp.eye(6).reshape(6, 6, *[1] * (q.ndim - 1))
    by_angle = jax.vmap(lambda unit: move(*nothing, unit), out_axes=1)(jnp.broadcast_to(identity, (6, *q.shape)))
    slopes = jnp.where(good[None], by_angle, identity)
    moved = move(*moved_inputs, jnp.zeros_like(q))
    step = jnp.linalg.solve(jnp.moveaxis(slopes, (0, 1), (-2, -1)), -jnp.moveaxis(moved, 0, -1)[..., None])
    return jnp.moveaxis(step[..., 0], -1, 0)


def equations_mm(girdle: Girdle, coordinates, angles) -> Float[Array, " 6 *batch"]:
    """Compute the residuals of the six equations: free coordinates minus required ones, then A1-A3."""
    return jnp.concatenate([free_coordinates_mm(girdle, angles) - coordinates, constraint_residuals_mm(girdle, angles)])


@jax.jit
def _search(girdle: Girdle, coordinates, start) -> Driven:
    whole = jnp.isfinite(sum(x if x.ndim == start.ndim - 1 else x.sum(axis=0) for x in jax.tree.leaves(girdle)))
    finite = jnp.isfinite(coordinates).all(axis=0) & jnp.isfinite(start).all(axis=0) & whole
    start = jnp.where(finite, start, _rest(finite.ndim))
    coordinates = jnp.where(finite, coordinates, 0.0)
    AC_y, AC_z, TS_x = coordinates
    R_start = rotation_from_cardan(start[3:])
    clavicle, to_ac, ac_reached = _clavicle_direction(girdle, AC_y, AC_z)
    AC = girdle.sc_mm + to_ac
    to_ts, ts_reached = _to_ts(girdle, AC, TS_x, rotate(R_start, girdle.ts_mm))
    R_scapula, ai_reached = _scapula(girdle, AC, to_ts, R_start)
    to_attachment = to_ac + rotate(R_scapula, girdle.scapula_conoid_mm)
    axial, conoid_reached = _axial_rotation(girdle, clavicle, to_attachment, start[2])
    angles = jnp.concatenate([clavicle, axial[None], cardan_from_rotation(R_scapula)])
    closed = (abs(equations_mm(girdle, coordinates, angles)) <= TOLERANCE_MM).all(axis=0)
    failed = [~finite, ~ac_reached, ~ts_reached, ~ai_reached, ~conoid_reached, ~closed]
    status = jnp.select(failed, [DRIVEN.index(word) for word in _IN_ORDER], DRIVEN.index("ok"))
    return Driven(jnp.where(status == 0, angles, jnp.nan), status)


_IN_ORDER = ("invalid", "unreachable_AC", "unreachable_TS", "unreachable_AI", "unreachable_conoid", "not_converged")
"""Failures in order of precedence: the first that applies is the status."""


def _clavicle_direction(girdle: Girdle, AC_y, AC_z) -> tuple[Array, Array, Bool[Array, " *batch"]]:
    """Compute step 1: protraction and elevation of the clavicle, SC to AC in mm, and a mask of reachable AC."""
    dy, dz = AC_y - girdle.sc_mm[1], AC_z - girdle.sc_mm[2]
    dx, reached = _side_of_triangle(girdle.ac_mm[0], jnp.stack([dy, dz]))
    return jnp.stack([jnp.arctan2(-dz, dx), jnp.arctan2(dy, jnp.hypot(dx, dz))]), jnp.stack([dx, dy, dz]), reached


def _side_of_triangle(longest, others: Float[Array, " sides *batch"]) -> tuple[Array, Bool[Array, " *batch"]]:
    """Compute sqrt(longest^2 - sum of others^2), or 1 where the radicand is not positive, and the mask of positive
    radicands."""
    squared = longest**2 - jnp.sum(others**2, axis=0)
    return jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0)), squared > 0.0


def _to_ts(girdle: Girdle, AC, TS_x, arm_at_start) -> tuple[Array, Bool[Array, " *batch"]]:
    """Compute step 2: AC to TS in mm, and a mask of postures in which TS has its distance. The search along the circle
    begins at the direction of TS in the start posture."""
    along = TS_x - AC[0]
    radius, crosses = _side_of_triangle(jnp.sqrt(jnp.sum(girdle.ts_mm**2, axis=0)), along[None])
    origin = jnp.arctan2(arm_at_start[2], arm_at_start[1])

    def arm(turn):
        return jnp.stack([along, radius * jnp.cos(origin + turn), radius * jnp.sin(origin + turn)])

    def distance(turn):
        to_ts = arm(turn)
        d, n = distance_and_normal(AC + to_ts, girdle.centre_mm, girdle.semi_axes_mm)
        return d - girdle.ts_distance_mm, n[2] * to_ts[1] - n[1] * to_ts[2]

    turn, found = nearest_root(distance, TS_x.shape, WINDOW_DEG / DEG, _SAMPLES)
    return arm(turn), crosses & found


def _scapula(girdle: Girdle, AC, to_ts, R_start) -> tuple[Array, Bool[Array, " *batch"]]:
    """Compute step 3: R_thorax_scapula, and a mask of postures in which AI has its distance. The smallest rotation that
    brings the scapula of the start posture to TS comes first."""
    axis = to_ts / jnp.sqrt(jnp.sum(to_ts**2, axis=0))[None]
    from_axis = rotate(R_start, girdle.ts_mm)
    from_axis = from_axis / jnp.sqrt(jnp.sum(from_axis**2, axis=0))[None]
    R_brought = compose(rotation_between(from_axis, axis), R_start)
    arm = rotate(R_brought, girdle.ai_mm)

    def distance(turn):
        to_ai = rotate(rotation_about(axis, turn), arm)
        d, n = distance_and_normal(AC + to_ai, girdle.centre_mm, girdle.semi_axes_mm)
        return d - girdle.ai_distance_mm, jnp.sum(n * jnp.cross(axis, to_ai, axis=0), axis=0)

    turn, found = nearest_root(distance, AC.shape[1:], WINDOW_DEG / DEG, _SAMPLES)
    return compose(rotation_about(axis, turn), R_brought), found


def _axial_rotation(girdle: Girdle, clavicle, to_attachment, axial_at_start) -> tuple[Array, Bool[Array, " *batch"]]:
    """Compute step 4: c in (-pi, pi], and a mask of postures in which the conoid can have its length. ``to_attachment``
    is the vector from SC to the attachment on the scapula."""
    R_yz = rotation_from_cardan(jnp.concatenate([clavicle, jnp.zeros_like(clavicle[:1])]))
    p, k = rotate(jnp.swapaxes(R_yz, 0, 1), to_attachment), girdle.clavicle_conoid_mm
    C = 0.5 * (jnp.sum(p**2, axis=0) + jnp.sum(k**2, axis=0) - girdle.conoid_length_mm**2) - p[0] * k[0]
    by_cos, by_sin = p[1] * k[1] + p[2] * k[2], p[2] * k[1] - p[1] * k[2]
    other, reached = _side_of_triangle(jnp.sqrt(by_cos**2 + by_sin**2), C[None])
    middle, half = jnp.arctan2(by_sin, by_cos), jnp.arctan2(other, C)
    branches = jnp.stack([_wrapped(middle - half), _wrapped(middle + half)])
    nearer = jnp.argmin(abs(_wrapped(branches - axial_at_start[None])), axis=0)
    return jnp.where(nearer == 0, *branches), reached


def _wrapped(angle):
    return angle - 2.0 * jnp.pi * jnp.round(angle / (2.0 * jnp.pi))
