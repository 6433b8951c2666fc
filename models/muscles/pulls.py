"""Lengths and moment arms of muscle lines in postures of girdle and humerus.

A line crosses all joints between its two bones. With a tension of 1 it pulls on the bones beyond such a joint J with a
force f along a straight line through a point X. Its moment arm about J is (X - J) x f, in mm: -dL/dtheta for small
rotations theta, about the thorax axes, of all bones beyond J. These bones are clavicle, scapula and humerus for SC,
scapula and humerus for AC, and the humerus for GH.

- Lines from the thorax to clavicle or scapula, straight or round the thorax: X is the attachment there, f = -dL/dX.
- Lines to the humerus, straight or round its head or shaft: X is the attachment on the other bone, f = dL/dX, because
  the pull on the humerus and the pressure on its surface add up to the opposite of the pull at X.

With respect to the six angles q of clavicle and scapula, at a constant orientation of the humerus, the arms are
-dL/dq = f . dY/dq, mm per rad, with Y = X, or Y = GH - X for lines to the humerus. With respect to the chain's three
free coordinates c (``models.drive``) they are -dL/dc = T' (-dL/dq), without unit (mm per mm), where T = dq/dc keeps
A1-A3 closed:  [dc/dq; dA/dq] T = [1; 0].

The thesis's measure of a muscle (3.3.1) is the length of the mean arm vector of its lines, averaged over the motion.
"""

from collections.abc import Sequence
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
from models.muscles.muscle_lines import CLAVICLE, HUMERUS, SCAPULA, MuscleLines, published_lines
from models.muscles.round_bones import round_contact_mm, round_depth_mm, round_length_mm, round_points_mm
from models.muscles.wrapping import outside, path_length_mm, path_points_mm, shortest_path
from motions.arrays import Array
from motions.landmarks.frames import humerus_rotation
from motions.rotations import rotate


@dataclass(frozen=True)
class Pulls:
    """Lengths, contact, forces and moment arms of the lines in each posture, thorax frame."""

    length_mm: Float[np.ndarray, " lines *batch"]
    """NaN where no path was found."""
    contact_mm: Float[np.ndarray, " lines *batch"]
    """Part of the length that lies on the contour."""
    depth_mm: Float[np.ndarray, " lines *batch"]
    """Depth of the deeper end of a line in its contour, 0 outside (for the ellipsoid, scaled by the shortest axis)."""
    attachment_mm: Float[np.ndarray, " 3 lines *batch"]
    """Point X on the line of action."""
    pull: Float[np.ndarray, " 3 lines *batch"]
    """Force f on the bones beyond the joint at a tension of 1: a unit vector except where an end is inside the
    contour."""
    about_sc_mm: Float[np.ndarray, " 3 lines *batch"]
    """Moment arms about SC; 0 for lines that do not cross the joint, as for the other joints."""
    about_ac_mm: Float[np.ndarray, " 3 lines *batch"]
    about_gh_mm: Float[np.ndarray, " 3 lines *batch"]

    @property
    def about_mm(self) -> Float[np.ndarray, " 9 lines *batch"]:
        """Moment arms about GH, AC and SC, stacked in the order that a balance needs."""
        return np.concatenate([self.about_gh_mm, self.about_ac_mm, self.about_sc_mm])


def pulls(lines: MuscleLines, girdle: Girdle, angles: Float[np.ndarray, " 6 postures"], humerus=None) -> Pulls:
    """Compute paths and moment arms in postures (rad); ``girdle`` has one element per posture or no batch.

    ``humerus`` is p, e, q of the humerus (Appendix A), rad, per posture; None means a hanging arm, with all of them 0.
    """
    which, given = _arguments(lines, girdle, angles, humerus)
    return Pulls(*_in_blocks(partial(_lines, which), given))


def lengths_mm(
    lines: MuscleLines, girdle: Girdle, angles: Float[Array, " 6 postures"], humerus=None
) -> Float[Array, " lines postures"]:
    """Compute the lengths of the lines in postures (rad), mm; twice differentiable in angles and girdle.

    ``-jax.jacfwd`` gives the arms by angle, ``-jax.hessian`` their derivatives: see :func:`path_length_mm`.
    """
    which, given = _arguments(lines, girdle, angles, humerus)
    bones = _bones(*given)
    start, end = (_placed(points, on, bones) for points, on in zip(given[:2], which[:2], strict=True))
    return _length(start, end, which, bones)


def line_points_mm(
    lines: MuscleLines, girdle: Girdle, angles: Float[np.ndarray, " 6 postures"], curved: int, humerus=None
) -> Float[np.ndarray, " points 3 lines postures"]:
    """Return points along the lines in postures (rad), thorax frame, beginning at the bone nearer to the trunk.

    The points are the two ends and ``curved`` points between them, evenly spaced along the part on the contour or along
    a straight line. They are NaN where an angle is NaN.
    """
    which, given = _arguments(lines, girdle, angles, humerus)
    return _in_blocks(partial(_points, which, curved=curved), given)


def arms_by_angle_mm(
    lines: MuscleLines, found: Pulls, girdle: Girdle, angles: Float[np.ndarray, " 6 postures"], humerus=None
) -> Float[np.ndarray, " 6 lines postures"]:
    """Compute -dL/dq for the six angles, mm per rad, at a constant orientation of the humerus."""
    which, given = _arguments(lines, girdle, angles, humerus)
    return np.einsum("xlp,xqlp->qlp", found.pull, _in_blocks(partial(_pulled_slopes, which), given))


@partial(jax.jit, static_argnums=0)
def _pulled_slopes(which: "_Which", start, end, gh, size, R_humerus, girdle: Girdle, q):
    """Compute dY/dq (see the module)."""

    def pulled(q):
        bones = _bones(start, end, gh, size, R_humerus, girdle, q)
        to_humerus = bones.origin[HUMERUS][:, None] - _placed(start, which.start, bones)
        return jnp.where(_reaches_humerus(which), to_humerus, _placed(end, which.end, bones))

    return _by_angle(pulled, q)


def free_directions(girdle: Girdle, angles: Float[np.ndarray, " 6 postures"]) -> Float[np.ndarray, " 6 3 postures"]:
    """Compute T = dq/dc for the free coordinates AC_y, AC_z, TS_x, rad per mm; NaN where they do not determine the
    posture."""
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
"""Largest condition number of the Jacobian of the six equations; beyond it, the free coordinates do not determine the
posture."""


def arms_in_free_directions(
    by_angle_mm: Float[np.ndarray, " 6 lines postures"], free: Float[np.ndarray, " 6 3 postures"]
) -> Float[np.ndarray, " 3 lines postures"]:
    """Compute -dL/dc for the free coordinates AC_y, AC_z and TS_x."""
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
    """Static arguments of a compiled program."""

    start: tuple[int, ...]
    """Index in ``BONES`` of each line's first bone."""
    end: tuple[int, ...]
    contour: tuple[str, ...]

    def round_thorax(self) -> np.ndarray:
        """Return the indices of the lines round the ellipsoid."""
        return np.flatnonzero([contour == "thorax" for contour in self.contour])

    def round_humerus(self) -> np.ndarray:
        """Return the indices of the lines round head or shaft of the humerus."""
        return np.flatnonzero([contour not in ("", "thorax") for contour in self.contour])


def _arguments(lines: MuscleLines, girdle: Girdle, angles, humerus) -> tuple[_Which, tuple]:
    """Collect the arguments of the programs: static ones, and points, sizes, rotation of the humerus, girdle and angles
    as JAX arrays."""
    points = [_a_posture(jnp.asarray(one), 2) for one in (lines.start_mm, lines.end_mm)]
    gh, size = (_a_posture(jnp.asarray(one), axes) for one, axes in ((lines.gh_mm, 1), (lines.humerus_size, 0)))
    which = _Which(tuple(lines.start.tolist()), tuple(lines.end.tolist()), lines.contour)
    hanging = np.zeros((3, *np.shape(angles)[1:]))
    R_humerus = jnp.asarray(humerus_rotation(hanging if humerus is None else np.asarray(humerus)))
    return which, (*points, gh, size, R_humerus, _batched(girdle, angles), jnp.asarray(angles))


_BLOCK = 64
"""Postures per call of a compiled program, so that one program serves any number of them. With this number, the twelve
lines of the serratus fill the lanes of the path search three times."""


def _in_blocks(program, given) -> Any:
    """Run a program on blocks of postures (last axis), on all cores; copies fill the last block."""
    count = given[-1].shape[-1]
    given = jax.tree.map(lambda x: np.broadcast_to(x, (*x.shape[:-1], count)), given)

    def block(start: int):
        rows = np.minimum(np.arange(start, start + _BLOCK), count - 1)
        return jax.tree.map(np.asarray, program(*jax.tree.map(lambda x: x[..., rows], given)))

    with ThreadPoolExecutor() as cores:
        parts = list(cores.map(block, range(0, count, _BLOCK)))
    return jax.tree.map(lambda *each: np.concatenate(each, axis=-1)[..., :count], *parts)


def _a_posture(points, axes: int) -> Array:
    """Append an axis of postures, of length 1, to points that have none."""
    return points if points.ndim > axes else points[..., None]


class _Bones(NamedTuple):
    """Poses of the bones in the thorax frame, in the order of ``BONES``."""

    origin: tuple[Array, ...]
    rotation: tuple[Array, ...]
    size: Array
    """Size of the humerus over the size of the cadaver's."""
    girdle: Girdle


def _bones(start, end, gh, size, R_humerus, girdle: Girdle, q) -> _Bones:
    R_clavicle, R_scapula = bone_rotations(q)
    AC = chain_landmarks(girdle, R_clavicle, R_scapula).AC
    sc, thorax, upright = jnp.broadcast_to(girdle.sc_mm, AC.shape), jnp.zeros_like(AC), jnp.eye(3)[..., None]
    origins = (thorax, sc, AC, AC + rotate(R_scapula, gh))
    return _Bones(origins, (jnp.broadcast_to(upright, R_scapula.shape), R_clavicle, R_scapula, R_humerus), size, girdle)


def _placed(points, on: tuple[int, ...], bones: _Bones) -> Float[Array, " 3 lines postures"]:
    """Transform attachments from the frames of their bones to the thorax frame."""
    placed = jnp.zeros((3, len(on), bones.origin[0].shape[-1]))
    for bone in sorted(set(on)):
        mine = np.flatnonzero(np.array(on) == bone)
        there = bones.origin[bone][:, None] + rotate(bones.rotation[bone][:, :, None], points[:, mine])
        placed = placed.at[:, mine].set(there)
    return placed


def _reaches_humerus(which: _Which) -> Array:
    return jnp.array([bone == HUMERUS for bone in which.end])[None, :, None]


def _round_ellipsoid(P, X, girdle: Girdle):
    """Return both ends relative to the centre of the ellipsoid, moved outside, and the semi-axes, per line and
    posture."""
    centre, axes = girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None]
    P, X, axes = jnp.broadcast_arrays(P - centre, X - centre, axes)
    P, X = jnp.moveaxis(outside(jnp.stack([P, X], axis=1), axes[:, None]), 1, 0)  # one call is compiled once
    return P, X, axes


class _Contours(NamedTuple):
    """Contours of the humerus, per line and posture, thorax frame."""

    centre: Array
    axis: Array
    radius: Array


def _contours(names: Sequence[str], bones: _Bones) -> _Contours:
    table = published_lines()["contour"]
    centre, axis = (jnp.array([table[name][key] for name in names]).T[..., None] for key in ("centre_mm", "axis"))
    radius = jnp.array([table[name]["radius_mm"] for name in names])[:, None] * bones.size
    R = bones.rotation[HUMERUS][:, :, None]
    return _Contours(bones.origin[HUMERUS][:, None] + rotate(R, centre * bones.size), rotate(R, axis), radius)


def _length(P, X, which: _Which, bones: _Bones) -> Float[Array, " lines postures"]:
    length = jnp.sqrt(jnp.sum((X - P) ** 2, axis=0))
    thorax, arm = which.round_thorax(), which.round_humerus()
    if len(thorax):
        length = length.at[thorax].set(path_length_mm(*_round_ellipsoid(P[:, thorax], X[:, thorax], bones.girdle)))
    if len(arm):
        length = length.at[arm].set(_round_arm(round_length_mm, P, X, which, bones))
    return length


def _round_arm(function, P, X, which: _Which, bones: _Bones):
    """Call a function of ``round_bones`` for the lines round the humerus, with their ends relative to the centre of the
    contour."""
    arm = which.round_humerus()
    contours = _contours([which.contour[k] for k in arm], bones)
    return function(P[:, arm] - contours.centre, X[:, arm] - contours.centre, contours.axis, contours.radius)


@partial(jax.jit, static_argnums=0)
def _lines(which: _Which, start, end, gh, size, R_humerus, girdle: Girdle, q):
    """Compute the fields of ``Pulls``, in their order.

    -dL/dX is the direction of the path at X, times the derivative of the move of an inner point to the surface.
    """
    bones = _bones(start, end, gh, size, R_humerus, girdle, q)
    P, X = _placed(start, which.start, bones), _placed(end, which.end, bones)
    straight = jnp.sqrt(jnp.sum((P - X) ** 2, axis=0))
    length, contact, depth = straight, jnp.zeros_like(straight), jnp.zeros_like(straight)
    f = (P - X) / straight[None]
    thorax, arm = which.round_thorax(), which.round_humerus()
    if len(thorax):
        (outer_P, outer_X, axes), back = jax.vjp(lambda X: _round_ellipsoid(P[:, thorax], X, girdle), X[:, thorax])
        path = shortest_path(outer_P, outer_X, axes)
        (pull,) = back((jnp.zeros_like(outer_P), path.from_q, jnp.zeros_like(axes)))
        length = length.at[thorax].set(jnp.where(path.found, path.length_mm, jnp.nan))
        contact, f = contact.at[thorax].set(path.contact_mm), f.at[:, thorax].set(pull)
        depth = depth.at[thorax].set(_ellipsoid_depth(P[:, thorax], X[:, thorax], girdle))
    if len(arm):
        around, back = jax.vjp(lambda P: _round_arm(round_length_mm, P, X, which, bones), P)
        length, f = length.at[arm].set(around), f.at[:, arm].set(back(jnp.ones_like(around))[0][:, arm])
        contact = contact.at[arm].set(_round_arm(round_contact_mm, P, X, which, bones))
        depth = depth.at[arm].set(_round_arm(_deeper, P, X, which, bones))
    through = jnp.where(_reaches_humerus(which), P, X)
    about = [_about(joint, which, through, f, bones) for joint in (CLAVICLE, SCAPULA, HUMERUS)]
    return length, contact, depth, through, f, *about


def _about(joint: int, which: _Which, through, f, bones: _Bones) -> Float[Array, " 3 lines postures"]:
    """Compute the moment arms about the joint between bone ``joint`` (index in ``BONES``) and the previous bone."""
    over = jnp.array([start < joint <= end for start, end in zip(which.start, which.end, strict=True)])[None, :, None]
    return jnp.where(over, jnp.cross(through - bones.origin[joint][:, None], f, axis=0), 0.0)


@partial(jax.jit, static_argnums=0, static_argnames="curved")
def _points(which: _Which, start, end, gh, size, R_humerus, girdle: Girdle, q, *, curved: int):
    bones = _bones(start, end, gh, size, R_humerus, girdle, q)
    P, X = _placed(start, which.start, bones), _placed(end, which.end, bones)
    share = jnp.linspace(0.0, 1.0, curved + 2).reshape(-1, 1, 1, 1)
    points = P + share * (X - P)
    thorax, arm = which.round_thorax(), which.round_humerus()
    if len(thorax):
        outer = _round_ellipsoid(P[:, thorax], X[:, thorax], girdle)
        points = points.at[:, :, thorax].set(path_points_mm(*outer, curved) + girdle.centre_mm[:, None])
    if len(arm):
        around = _round_arm(partial(round_points_mm, count=curved), P, X, which, bones)
        centre = _contours([which.contour[k] for k in arm], bones).centre
        points = points.at[:, :, arm].set(around + centre)
    return points


def _ellipsoid_depth(P, X, girdle: Girdle) -> Float[Array, " lines postures"]:
    centre, axes = girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None]
    radius = jnp.minimum(*(jnp.sqrt(jnp.sum(((end - centre) / axes) ** 2, axis=0)) for end in (P, X)))
    return jnp.maximum(1.0 - radius, 0.0) * jnp.min(axes, axis=0)


def _deeper(p, q, axis, radius) -> Float[Array, " lines postures"]:
    return jnp.maximum(*(round_depth_mm(end, axis, radius) for end in (p, q)))


def _by_angle(function, q):
    """Differentiate with respect to each of the six angles; the derivatives form a new second axis."""
    units = jnp.broadcast_to(jnp.eye(6).reshape(6, 6, *[1] * (q.ndim - 1)), (6, *q.shape))
    return jax.vmap(lambda unit: jax.jvp(function, (q,), (unit,))[1], out_axes=1)(units)
