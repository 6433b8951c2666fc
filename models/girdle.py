"""The shoulder girdle: thorax ellipsoid, clavicle, scapula and conoid, and the constraints A1-A3 that close the chain.

Right shoulder, thorax frame (origin IJ, x lateral, y up, z backward), mm and radians. Six angles minus three
constraints leave three degrees of freedom (thesis 6.2.3). Arrays have the component first and the batch last.
"""

from dataclasses import dataclass, fields, replace

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from models.adapted_parameters import adapted_components, conoid_length, ellipsoid_components
from models.ellipsoid import signed_distance_mm
from motions.arrays import Array, batch_text, xp
from motions.rotations import rotate, rotation_from_cardan

CONSTRAINT_NAMES = {"A1": "A1: TS to the ellipsoid", "A2": "A2: AI to the ellipsoid", "A3": "A3: length of the conoid"}
"""Constraints of thesis Eq. 6.2, with their labels."""

CONSTRAINTS = tuple(CONSTRAINT_NAMES)


def refuse_degrees(angles: Float[Array, " 6 *batch"]) -> None:
    """Raise ValueError if there are not six angles along the first axis, or if one exceeds a full turn, as angles in
    degrees do; under ``jit`` only the shape is checked."""
    if np.shape(angles)[:1] != (6,):
        raise ValueError(f"component first: angles of shape {np.shape(angles)} should have shape (6, ...)")
    if not isinstance(angles, Tracer) and np.max(np.abs(np.nan_to_num(angles)), initial=0.0) > 2.0 * np.pi:
        raise ValueError("angles are in radians: give np.deg2rad(motions.angles_deg).T")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, repr=False)
class Girdle:
    """Geometry of one girdle, or of a batch of them. Vectors are ``(3, *batch)``, lengths ``(*batch)``, in mm."""

    centre_mm: Float[Array, " 3 *batch"]
    """Centre M of the thorax ellipsoid, thorax frame."""
    semi_axes_mm: Float[Array, " 3 *batch"]
    """Semi-axes A of the ellipsoid, along the thorax axes."""
    sc_mm: Float[Array, " 3 *batch"]
    """Sternoclavicular joint, thorax frame."""
    ac_mm: Float[Array, " 3 *batch"]
    """Acromioclavicular joint, clavicle frame: (length of the clavicle, 0, 0)."""
    clavicle_conoid_mm: Float[Array, " 3 *batch"]
    """Attachment of the conoid, clavicle frame."""
    ts_mm: Float[Array, " 3 *batch"]
    """Trigonum spinae, scapula frame (origin AC)."""
    ai_mm: Float[Array, " 3 *batch"]
    """Angulus inferior, scapula frame."""
    scapula_conoid_mm: Float[Array, " 3 *batch"]
    """Attachment of the conoid, scapula frame."""
    ts_distance_mm: Float[Array, " *batch"]
    """const1 of A1, positive outside the ellipsoid."""
    ai_distance_mm: Float[Array, " *batch"]
    """const2 of A2."""
    conoid_length_mm: Float[Array, " *batch"]
    """const3 of A3."""

    def __repr__(self) -> str:
        return f"Girdle({batch_text('girdle', self.conoid_length_mm)})"

    def residuals_mm(self, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
        """Compute A1, A2, A3 at six angles in radians: :func:`constraint_residuals_mm`.

        A single girdle accepts any batch of angles, ``(6, *batch)``. Raises ValueError for another shape, or if an
        angle exceeds a full turn, as angles in degrees do; under ``jit`` only the shape is checked.
        """
        refuse_degrees(angles)
        more = np.ndim(angles) - np.ndim(self.sc_mm)
        return constraint_residuals_mm(self.over_axes(more) if more > 0 else self, angles)

    @property
    def adapted_mm(self) -> Float[Array, " adapted *batch"]:
        """Adapted parameters, in the order of ``ADAPTED_PARAMETERS``."""
        return xp.stack(adapted_components(self))

    def with_adapted(self, adapted_mm: Float[Array, " adapted *#batch"]) -> "Girdle":
        """Return a copy with other adapted parameters; all other numbers, such as M_x (A4 of the thesis), are kept."""
        centre, semi_axes = ellipsoid_components(self, adapted_mm)
        return replace(
            self,
            centre_mm=xp.stack(xp.broadcast_arrays(*centre)),
            semi_axes_mm=xp.stack(xp.broadcast_arrays(*semi_axes)),
            conoid_length_mm=conoid_length(adapted_mm),
        )

    @property
    def numbers_mm(self) -> Float[Array, " numbers *batch"]:
        """All numbers of the girdle in one vector, each field at its slice in ``NUMBERS``."""
        return xp.concatenate([x[None] if name in _LENGTHS else x for name, x in vars(self).items()])

    @classmethod
    def of_numbers(cls, numbers_mm: Float[Array, " numbers *batch"]) -> "Girdle":
        """Return the girdle with these ``numbers_mm``."""
        parts = {name: numbers_mm[place] for name, place in NUMBERS.items()}
        return cls(**{name: part[0] if name in _LENGTHS else part for name, part in parts.items()})

    def over_axes(self, count: int) -> "Girdle":
        """Return this girdle with ``count`` more batch axes of length 1 at the end."""
        return jax.tree.map(lambda value: value.reshape(*value.shape, *[1] * count), self)

    def repeated(self, count: int) -> "Girdle":
        """Return this girdle repeated for ``count`` problems, as numpy views: ``(3)`` to ``(3, count)``."""
        return jax.tree.map(lambda x: np.broadcast_to(np.asarray(x)[..., None], (*np.shape(x), count)), self)

    def over_postures(self) -> "Girdle":
        """Return this girdle with an axis of postures before the batch: ``(3, *batch)`` to ``(3, 1, *batch)``."""
        return Girdle(**{k: v[None] if k in _LENGTHS else v[:, None] for k, v in vars(self).items()})


_LENGTHS = ("ts_distance_mm", "ai_distance_mm", "conoid_length_mm")
"""Names of the fields with a single number."""


def _places() -> dict[str, slice]:
    ends = np.cumsum([1 if one.name in _LENGTHS else 3 for one in fields(Girdle)]).tolist()
    return {one.name: slice(a, b) for one, a, b in zip(fields(Girdle), [0, *ends], ends, strict=False)}


NUMBERS = _places()
"""Slice of each field in ``numbers_mm``."""

COUNT_OF_NUMBERS = max(place.stop for place in NUMBERS.values())


@dataclass(frozen=True)
class Landmarks:
    """Positions of landmarks in the thorax frame, mm, each ``(3, *batch)``."""

    AC: Float[Array, " 3 *batch"]
    TS: Float[Array, " 3 *batch"]
    AI: Float[Array, " 3 *batch"]
    clavicle_conoid: Float[Array, " 3 *batch"]
    scapula_conoid: Float[Array, " 3 *batch"]


def chain_landmarks(
    girdle: Girdle, R_thorax_clavicle: Float[Array, " 3 3 *batch"], R_thorax_scapula: Float[Array, " 3 3 *batch"]
) -> Landmarks:
    """Compute the landmarks: AC = SC + R_C ac; TS, AI and the attachments of the conoid move with their bones."""
    AC = girdle.sc_mm + rotate(R_thorax_clavicle, girdle.ac_mm)
    return Landmarks(
        AC=AC,
        TS=AC + rotate(R_thorax_scapula, girdle.ts_mm),
        AI=AC + rotate(R_thorax_scapula, girdle.ai_mm),
        clavicle_conoid=girdle.sc_mm + rotate(R_thorax_clavicle, girdle.clavicle_conoid_mm),
        scapula_conoid=AC + rotate(R_thorax_scapula, girdle.scapula_conoid_mm),
    )


def bone_rotations(
    angles: Float[Array, " 6 *batch"],
) -> tuple[Float[Array, " 3 3 *batch"], Float[Array, " 3 3 *batch"]]:
    """Compute R_thorax_clavicle and R_thorax_scapula from clavicle (y, z, x) and scapula (y, z, x) in radians."""
    both = rotation_from_cardan(xp.stack([angles[:3], angles[3:]], axis=1))
    return both[:, :, 0], both[:, :, 1]


def chain_residuals_mm(
    girdle: Girdle, R_thorax_clavicle: Float[Array, " 3 3 *batch"], R_thorax_scapula: Float[Array, " 3 3 *batch"]
) -> Float[Array, " 3 *batch"]:
    """Compute A1, A2, A3 from rotations, mm; 0 where the chain is closed (thesis Eq. 6.2)."""
    at = chain_landmarks(girdle, R_thorax_clavicle, R_thorax_scapula)
    centre, semi_axes = girdle.centre_mm[:, None], girdle.semi_axes_mm[:, None]
    ts, ai = signed_distance_mm(xp.stack([at.TS, at.AI], axis=1), centre, semi_axes)
    conoid = at.scapula_conoid - at.clavicle_conoid
    return xp.stack([ts - girdle.ts_distance_mm, ai - girdle.ai_distance_mm, _length(conoid) - girdle.conoid_length_mm])


def landmarks(girdle: Girdle, angles: Float[Array, " 6 *batch"]) -> Landmarks:
    """Compute the landmarks at six angles in radians."""
    return chain_landmarks(girdle, *bone_rotations(angles))


def constraint_residuals_mm(girdle: Girdle, angles: Float[Array, " 6 *batch"]) -> Float[Array, " 3 *batch"]:
    """Compute A1, A2, A3 in mm at six angles in radians: clavicle (y, z, x), scapula (y, z, x) (thesis, Appendix A)."""
    return chain_residuals_mm(girdle, *bone_rotations(angles))


def _length(v: Float[Array, " 3 *batch"]) -> Float[Array, " *batch"]:
    """Compute |v|, with derivative 0 instead of 0/0 where the two attachments coincide."""
    return _differentiable_length(v) if isinstance(v, jax.Array) else np.sqrt(np.sum(v * v, axis=0))


@jax.custom_jvp
def _differentiable_length(v: Float[Array, " 3 *batch"]) -> Float[Array, " *batch"]:
    return jnp.sqrt(jnp.sum(v * v, axis=0))


@_differentiable_length.defjvp
def _length_jvp(primals, tangents):
    (v,), (dv,) = primals, tangents
    length = _differentiable_length(v)
    return length, jnp.sum(v * dv, axis=0) / jnp.where(length > 0.0, length, 1.0)
