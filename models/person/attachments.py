"""The conoid's attachments of a generic girdle, carried to a person's bones by their landmarks (thesis, Chapter 5).

With landmarks alone, a thin-plate deformation is the affine map that takes the generic landmarks to the person's. All
landmarks are in the frames of their bones (Appendix A):

- scapula: AC is the origin of both frames, so the map is linear: M (ts, ai) = (ts', ai') in the plane of AC, TS and AI,
  and the scale sqrt(det M) at right angles to this plane, as if the bone grew with the same proportions;
- clavicle: two landmarks determine only the ratio of the lengths.

The conoid length scales as the scapula does. The map is exact for a bone of the same shape, whatever its size.
``ATTACHMENT_SD_MM`` is the error from differences in shape that the landmarks do not show.

If surfaces of both scapulae are given, they carry the scapular attachment in place of the landmarks
(``models.person.transfer``). Surfaces do not carry the clavicular attachment, because two landmarks do not determine
the rotation of a clavicle about its axis.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from models.girdle import Girdle
from models.person.transfer.carried_attachments import Bone, carry_attachments
from models.person.transfer.mesh import Mesh

ATTACHMENT_SD_MM = 8.0
"""SD of one coordinate of an attachment carried by landmarks. MRI and dissection of one cadaver place attachments 4 to
21 mm apart (Tables 4.6 and 4.7)."""

CONOID_SD_MM = 2.5
"""SD of a ligament's length between people: assumed, above the 1-2 mm of ten subjects (thesis Table 6.5)."""


def scapular_map(
    generic_ts_mm: Float[np.ndarray, "3"],
    generic_ai_mm: Float[np.ndarray, "3"],
    ts_mm: Float[np.ndarray, "3"],
    ai_mm: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "3 3"]:
    """Compute the linear map, in the scapula frame, that takes the generic TS and AI to the person's TS and AI."""
    plane = np.column_stack([ts_mm[:2], ai_mm[:2]]) @ np.linalg.inv(
        np.column_stack([generic_ts_mm[:2], generic_ai_mm[:2]])
    )
    carried = np.zeros((3, 3))
    carried[:2, :2] = plane
    carried[2, 2] = np.sqrt(abs(np.linalg.det(plane)))
    return carried


@dataclass(frozen=True)
class ScapularSurfaces:
    """The surfaces of two scapulae, each in its own scapula frame (Appendix A)."""

    generic: Mesh
    person: Mesh

    def carried(self, person: Girdle, generic: Girdle) -> Float[np.ndarray, "3"]:
        """Carry the conoid's scapular attachment (scapula frame) by the surfaces, held at AC, TS and AI."""
        bones = [
            Bone({"AC": np.zeros(3), "TS": np.asarray(of.ts_mm), "AI": np.asarray(of.ai_mm)}, mesh)
            for of, mesh in ((generic, self.generic), (person, self.person))
        ]
        attachment = {"conoid": np.asarray(generic.scapula_conoid_mm).reshape(3, 1)}
        return carry_attachments(attachment, *bones).points_mm["conoid"][:, 0]


def with_carried_conoid(person: Girdle, generic: Girdle, surfaces: ScapularSurfaces | None = None) -> Girdle:
    """Return the person's girdle with the conoid of the generic girdle, carried to the person's bones."""
    scapula = scapular_map(*(np.asarray(v) for v in (generic.ts_mm, generic.ai_mm, person.ts_mm, person.ai_mm)))
    longer = float(person.ac_mm[0]) / float(generic.ac_mm[0])
    by_landmarks = scapula @ np.asarray(generic.scapula_conoid_mm)
    return replace(
        person,
        clavicle_conoid_mm=np.asarray(generic.clavicle_conoid_mm) * longer,
        scapula_conoid_mm=by_landmarks if surfaces is None else surfaces.carried(person, generic),
        conoid_length_mm=np.asarray(float(generic.conoid_length_mm) * scapula[2, 2]),
    )
