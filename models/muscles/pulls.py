"""Lengths and moment arms of muscle lines in postures of the girdle.

A line of length L pulls its moving bone with unit force f = -dL/dX, X its attachment there. Its arms are

- about SC, of clavicle and scapula together: (X - SC) x f, and about AC, of the scapula: (X - AC) x f. These are
  -dL/dtheta for small rotations theta about the thorax axes, mm;
- in the six angles q of the bones: -dL/dq = f . dX/dq, mm a rad;
- in the chain's three free coordinates c (``models.drive``): -dL/dc = T' (-dL/dq), with T = dq/dc along which A1-A3
  stay closed,  [dc/dq; dA/dq] T = [1; 0]; no unit (mm a mm).

The thesis's measure of a muscle (3.3.1): mean of the vectors over its lines, length of the mean vector, mean over the
motion.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from models.drive import equations_mm
from models.girdle import Girdle, bone_rotations, chain_landmarks
from models.muscles.muscle_lines import MuscleLines
from models.muscles.wrapping import outside, path_length_mm, path_points_mm, shortest_path
from motions.arrays import Array
from motions.rotations import rotate


@dataclass(frozen=True)
class Pulls:
    """What the lines do in each posture, thorax frame."""

    length_mm: Float[np.ndarray, " lines *batch"]
    """NaN where no path was found."""
    contact_mm: Float[np.ndarray, " lines *batch"]
    """Of the length, how much lies on the ellipsoid."""
    depth_mm: Float[np.ndarray, " lines *batch"]
    """How deep the deeper attachment of a line that wraps lies in the ellipsoid, 0 outside (by the shortest axis)."""
    attachment_mm: Float[np.ndarray, " 3 lines *batch"]
    """Where the line pulls at the moving bone."""
    pull: Float[np.ndarray, " 3 lines *batch"]
    """Force on the moving bone of a line with tension 1: a unit vector but for an attachment inside the ellipsoid."""
    about_sc_mm: Float[np.ndarray, " 3 lines *batch"]
    about_ac_mm: Float[np.ndarray, " 3 lines *batch"]
    """0 of lines that end at the clavicle."""


def pulls(lines: MuscleLines, girdle: Girdle, angles: Float[np.ndarray, " 6 postures"]) -> Pulls:
    """Compute paths and arms in postures (rad); ``girdle`` has one element a posture or no batch."""
    which, given = _arguments(lines, girdle, angles)
    length, contact, X, f, about_sc, about_ac = _in_blocks(partial(_lines, which), given)
    return Pulls(
        length,
        contact,
        _depth_mm(lines, girdle, X),
        X,
        f,
        about_sc,
        np.where(lines.on_scapula[None, :, None], about_ac, 0.0),
    )


def lengths_mm(
    lines: MuscleLines, girdle: Girdle, angles: Float[Array, " 6 postures"]
) -> Float[Array, " lines postures"]:
    """Measure the lines in postures (rad), mm; differentiable twice in angles and girdle.

    ``-jax.jacfwd`` gives the arms by angle, ``-jax.hessian`` their slopes: see :func:`path_length_mm`.
    """
    which, (thorax, bone, batched, q) = _arguments(lines, girdle, angles)
    return _length(thorax, _attachments(bone, which, batched, q), which, batched)


def line_points_mm(
    lines: MuscleLines, girdle: Girdle, angles: Float[np.ndarray, " 6 postures"], curved: int
) -> Float[np.ndarray, " points 3 lines postures"]:
    """Return points along the lines in postures (rad), thorax frame, from the thorax to the bone.

    The two ends and ``curved`` points between them, evenly along what lies on the ellipsoid, or along a straight line.
    NaN where an angle is.
    """
    which, given = _arguments(lines, girdle, angles)
    return _in_blocks(partial(_points, which, curved=curved), given)


def arms_by_angle_mm(
    lines: MuscleLines, found: Pulls, girdle: Girdle, angles: Float[np.ndarray, " 6 postures"]
) -> Float[np.ndarray, " 6 lines postures"]:
    """Compute -dL/dq of the six angles, mm a rad."""
    which, (_, *moving) = _arguments(lines, girdle, angles)
    return np.einsum("xlp,xqlp->qlp", found.pull, _in_blocks(partial(_attachment_slopes, which), moving))


@partial(jax.jit, static_argnums=0)
def _attachment_slopes(which: "_Which", bone, girdle: Girdle, q) -> Float[Array, " 3 6 lines postures"]:
    return _by_angle(lambda q: _attachments(bone, which, girdle, q), q)


def free_directions(girdle: Girdle, angles: Float[np.ndarray, " 6 postures"]) -> Float[np.ndarray, " 6 3 postures"]:
    """Compute T = dq/dc of the free coordinates AC_y, AC_z, TS_x, rad a mm; NaN where they do not move the chain."""
    slopes = np.moveaxis(_in_blocks(_chain_slopes, (_batched(girdle, angles), jnp.asarray(angles))), -1, 0)
    finite = np.asarray(np.isfinite(slopes).all(axis=(1, 2)))
    slopes = np.where(finite[:, None, None], slopes, np.eye(6))
    regular = finite & np.asarray(np.linalg.cond(slopes) < _WORST_CONDITION)
    free = np.linalg.solve(np.where(regular[:, None, None], slopes, np.eye(6)), np.eye(6)[:, :3])
    return np.moveaxis(np.where(regular[:, None, None], free, np.nan), 0, -1)


@jax.jit
def _chain_slopes(girdle: Girdle, q) -> Float[Array, " 6 6 postures"]:
    return _by_angle(lambda q: equations_mm(girdle, 0.0, q), q)


_WORST_CONDITION = 1e10
"""Of the six equations by angle: beyond it a free coordinate does not tell the posture."""


def arms_in_free_directions(
    by_angle_mm: Float[np.ndarray, " 6 lines postures"], free: Float[np.ndarray, " 6 3 postures"]
) -> Float[np.ndarray, " 3 lines postures"]:
    """Compute -dL/dc of AC_y, AC_z and TS_x."""
    return np.einsum("qlp,qcp->clp", by_angle_mm, free)


def muscle_arms_mm(
    lines: MuscleLines, about_mm: Float[np.ndarray, " 3 lines postures"]
) -> Float[np.ndarray, " muscles postures"]:
    """Compute the length of the mean arm of each muscle's lines in each posture (thesis 3.3.1), mm."""
    means = [about_mm[:, lines.of(muscle)].mean(axis=1) for muscle in lines.muscles]
    return np.linalg.norm(np.stack(means, axis=1), axis=0)


def _batched(girdle: Girdle, angles) -> Girdle:
    axes = np.ndim(angles) - 1 - np.ndim(girdle.conoid_length_mm)
    return jax.tree.map(jnp.asarray, girdle).over_axes(axes)


class _Which(NamedTuple):
    """What a compiled program is made for."""

    wrap: tuple[int, ...]
    """The lines that go round the ellipsoid."""
    on_scapula: tuple[bool, ...]


def _arguments(lines: MuscleLines, girdle: Girdle, angles) -> tuple[_Which, tuple]:
    """Everything a line depends on; attachments, girdle and angles as JAX's arrays."""
    points = [_a_posture(jnp.asarray(one)) for one in (lines.thorax_mm, lines.bone_mm)]
    which = _Which(tuple(np.flatnonzero(lines.wraps).tolist()), tuple(lines.on_scapula.tolist()))
    return which, (*points, _batched(girdle, angles), jnp.asarray(angles))


_BLOCK = 64
"""Postures that go through a compiled program together: one program then serves any number of them. The twelve lines of
the serratus fill three times the lanes of the search for paths."""


def _in_blocks(program, given) -> Any:
    """Run a program over blocks of the postures (last axis), on all cores; the last block is filled with copies."""
    count = given[-1].shape[-1]
    given = jax.tree.map(lambda x: np.broadcast_to(x, (*x.shape[:-1], count)), given)

    def block(start: int):
        rows = np.minimum(np.arange(start, start + _BLOCK), count - 1)
        return jax.tree.map(np.asarray, program(*jax.tree.map(lambda x: x[..., rows], given)))

    with ThreadPoolExecutor() as cores:
        parts = list(cores.map(block, range(0, count, _BLOCK)))
    return jax.tree.map(lambda *each: np.concatenate(each, axis=-1)[..., :count], *parts)


def _a_posture(points) -> Array:
    """Points with an axis for the postures at the end, of length 1 where they are the same in all."""
    return points if points.ndim == 3 else points[:, :, None]


def _attachments(bone, which: _Which, girdle: Girdle, q) -> Float[Array, " 3 lines postures"]:
    R_clavicle, R_scapula = bone_rotations(q)
    AC = chain_landmarks(girdle, R_clavicle, R_scapula).AC
    with_scapula = AC[:, None] + rotate(R_scapula[:, :, None], bone)
    with_clavicle = girdle.sc_mm[:, None] + rotate(R_clavicle[:, :, None], bone)
    return jnp.where(jnp.array(which.on_scapula)[None, :, None], with_scapula, with_clavicle)


def _round_ellipsoid(P, X, girdle: Girdle):
    """Both ends from the centre of the ellipsoid, outside, and its semi-axes, one each a line and posture."""
    centre, axes = girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None]
    P, X, axes = jnp.broadcast_arrays(P - centre, X - centre, axes)
    return outside(P, axes), outside(X, axes), axes


def _length(P, X, which: _Which, girdle: Girdle) -> Float[Array, " lines postures"]:
    P = jnp.broadcast_to(P, X.shape)
    straight = jnp.sqrt(jnp.sum((X - P) ** 2, axis=0))
    wrap = np.array(which.wrap, int)
    return straight.at[wrap].set(path_length_mm(*_round_ellipsoid(P[:, wrap], X[:, wrap], girdle)))


@partial(jax.jit, static_argnums=0)
def _lines(which: _Which, thorax, bone, girdle: Girdle, q):
    """Lengths, contact, attachments, pulls and their arms about SC and AC, as all ended at the scapula.

    -dL/dX is the direction at X, and what moves the point outside.
    """
    X = _attachments(bone, which, girdle, q)
    P = jnp.broadcast_to(thorax, X.shape)
    wrap = np.array(which.wrap, int)
    (outer_P, outer_X, axes), back = jax.vjp(lambda X: _round_ellipsoid(P[:, wrap], X, girdle), X[:, wrap])
    path = shortest_path(outer_P, outer_X, axes)
    (pull,) = back((jnp.zeros_like(outer_P), path.from_q, jnp.zeros_like(axes)))
    straight = jnp.sqrt(jnp.sum((P - X) ** 2, axis=0))
    length = straight.at[wrap].set(jnp.where(path.found, path.length_mm, jnp.nan))
    contact = jnp.zeros_like(length).at[wrap].set(path.contact_mm)
    f = ((P - X) / straight[None]).at[:, wrap].set(pull)
    AC = chain_landmarks(girdle, *bone_rotations(q)).AC
    about_sc, about_ac = (jnp.cross(X - joint[:, None], f, axis=0) for joint in (girdle.sc_mm, AC))
    return length, contact, X, f, about_sc, about_ac


@partial(jax.jit, static_argnums=0, static_argnames="curved")
def _points(which: _Which, thorax, bone, girdle: Girdle, q, *, curved: int):
    X = _attachments(bone, which, girdle, q)
    P = jnp.broadcast_to(thorax, X.shape)
    wrap = np.array(which.wrap, int)
    share = jnp.linspace(0.0, 1.0, curved + 2).reshape(-1, 1, 1, 1)
    outer = _round_ellipsoid(P[:, wrap], X[:, wrap], girdle)
    wrapped = path_points_mm(*outer, curved) + girdle.centre_mm[:, None]
    return (P + share * (X - P)).at[:, :, wrap].set(wrapped)


def _depth_mm(lines: MuscleLines, girdle: Girdle, X) -> Float[np.ndarray, " lines postures"]:
    ends = np.broadcast_arrays(_a_posture(lines.thorax_mm), X)
    centre, axes = (
        np.asarray(x)[:, None, None] if np.ndim(x) == 1 else np.asarray(x)[:, None]
        for x in (girdle.centre_mm, girdle.semi_axes_mm)
    )
    radius = np.stack([np.sqrt((((end - centre) / axes) ** 2).sum(axis=0)) for end in ends]).min(axis=0)
    return np.where(lines.wraps[:, None], np.maximum(1.0 - radius, 0.0) * axes.min(axis=0), 0.0)


def _by_angle(function, q):
    """Derivatives by each of the six angles, as a new second axis."""
    units = jnp.broadcast_to(jnp.eye(6).reshape(6, 6, *[1] * (q.ndim - 1)), (6, *q.shape))
    return jax.vmap(lambda unit: jax.jvp(function, (q,), (unit,))[1], out_axes=1)(units)
