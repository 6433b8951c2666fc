"""Attachments of the muscle lines: read from the table, and placed on the bones of a parameter set.

The bones of a set are not those of the cadaver in the table. Attachments are scaled with their bone:

- scapula: in the plane AC-TS-AI by the linear map from the cadaver's TS and AI to the set's; normal to this plane by
  the ratio of |AC-TS|. So an attachment keeps its place between the landmarks.
- clavicle: by the ratio of the lengths.
- humerus, with the contours that lines wrap round: by the ratio of |AC-TS|, as the head has to fit the glenoid.
- ribs: the attachment keeps its height y, its azimuth and its share of the ellipsoid's radius at that height:
  x' = x A_x' w' / (A_x w), z' - M_z' = (z - M_z) A_z' w' / (A_z w), w = sqrt(1 - ((y - M_y) / A_y)^2).
- spine and pelvis: as in the cadaver.

This scaling is an assumption: the attachments and humeri of R2, R4 and R6 are not published. An adaptation does not
move attachments: they are on bone, and only the ellipsoid changes (thesis 6.2.6).
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from models.girdle import Girdle
from models.muscles.das3_frames import (
    clavicle_in_thorax,
    scapula_in_thorax,
)
from models.parameter_sets import ParameterSet
from models.person.family import AnyModel, unique_sets
from motions.errors import InputError

TABLE = Path(__file__).parent / "delft_lines.toml"

SERRATUS = "serratus_anterior"
"""Muscle whose bony contour is the ellipsoid (thesis 6.4)."""

OFF_FRAME_MM = 1.0
"""Largest sum of the offsets of TS from the x-axis and of AI from the plane z = 0 of the thesis's scapula frame: the
noise of palpation."""


BONES = ("thorax", "clavicle", "scapula", "humerus")
"""Bones from the trunk outward; SC, AC and GH join each bone to the previous one."""

THORAX, CLAVICLE, SCAPULA, HUMERUS = range(4)

_ON_BONE = {"ribs": THORAX, "spine": THORAX, "clavicle": CLAVICLE, "scapula": SCAPULA} | {
    "humerus": HUMERUS,
    "forearm": HUMERUS,  # does not move against the humerus: thesis, chapter 1
}
"""Bone of an attachment in the table, by the beginning of its key, from the trunk outward."""


@dataclass(frozen=True)
class MuscleLines:
    """Muscle lines between two bones; mm, N."""

    name: tuple[str, ...]
    muscle: tuple[str, ...]
    start: Int[np.ndarray, " lines"]
    """Index in ``BONES`` of the bone nearer to the trunk."""
    end: Int[np.ndarray, " lines"]
    """Index in ``BONES`` of the bone farther from the trunk."""
    contour: tuple[str, ...]
    """Contour that each line wraps round: ``thorax`` (the ellipsoid), a contour of the humerus, or empty for none."""
    strongest_force_N: Float[np.ndarray, " lines"]
    start_mm: Float[np.ndarray, "3 lines *postures"]
    """Attachment in the frame of its bone (thesis, Appendix A)."""
    end_mm: Float[np.ndarray, "3 lines *postures"]
    gh_mm: Float[np.ndarray, " 3 *postures"]
    """Centre of the glenohumeral joint, scapula frame: the origin of the humerus."""
    humerus_size: Float[np.ndarray, " *postures"]
    """Size of the humerus over the size of the cadaver's."""

    @property
    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles, without repetition."""
        return tuple(dict.fromkeys(self.muscle))

    @property
    def wraps(self) -> Bool[np.ndarray, " lines"]:
        """True where a line has a contour to wrap round."""
        return np.array([contour != "" for contour in self.contour])

    def of(self, muscle: str) -> Bool[np.ndarray, " lines"]:
        """Return the mask of the lines of a muscle."""
        return np.array([name == muscle for name in self.muscle])

    def crosses(self, joint: int) -> Bool[np.ndarray, " lines"]:
        """Return the mask of the lines that cross the joint between this bone (index in ``BONES``) and the previous
        one."""
        return (self.start < joint) & (joint <= self.end)

    def only(self, muscle: str) -> "MuscleLines":
        """Return the lines of one muscle."""
        mine = self.of(muscle)
        numbers = {key: getattr(self, key)[mine] for key in ("start", "end", "strongest_force_N")}
        points = {key: getattr(self, key)[:, mine] for key in ("start_mm", "end_mm")}
        names = {key: tuple(np.array(getattr(self, key))[mine].tolist()) for key in ("name", "muscle", "contour")}
        return replace(self, **numbers, **points, **names)


def muscle_lines_of(model: AnyModel, subjects: Sequence[str]) -> MuscleLines:
    """Place the lines on the bones of each subject's set; a subject may be named several times.

    Raises InputError as :func:`muscle_lines` does.
    """
    sets, place = unique_sets([model], subjects)
    each = [muscle_lines(one) for one in sets]
    points = {key: np.stack([getattr(one, key) for one in each], axis=-1)[..., place] for key in _PLACED}
    return replace(each[0], **points)


_PLACED = ("start_mm", "end_mm", "gh_mm", "humerus_size")


def muscle_lines(model: ParameterSet) -> MuscleLines:
    """Place the shipped lines on the bones of a set. Raises InputError where its scapula frame is not the thesis's.

    The set must be the one before adaptation (see the module).
    """
    girdle = model.girdle
    if not has_landmarks(girdle):
        cause = "TS is not on the x-axis of the scapula frame, or AI not in its plane z = 0"
        remedy = "Muscle lines need TS and AI as landmarks in the frame AC-TS-AI (thesis, Appendix A); use another set"
        raise InputError(model.name, None, cause, remedy)
    document = published_lines()
    cadaver = document["cadaver"]
    rows = [
        {"muscle": muscle, "contour": part["contour"], **row}
        for muscle, part in document["muscle"].items()
        for row in part["lines"]
    ]
    size = _scapula_ratio(cadaver, girdle)
    start, end = zip(*(_ends(row) for row in rows), strict=True)
    gh = _on_scapula(np.array(cadaver["gh_mm"])[:, None], cadaver, girdle)
    return MuscleLines(
        name=tuple(row["name"] for row in rows),
        muscle=tuple(row["muscle"] for row in rows),
        start=np.array([_ON_BONE[one.on] for one in start]),
        end=np.array([_ON_BONE[one.on] for one in end]),
        contour=tuple(row["contour"] for row in rows),
        strongest_force_N=np.array([float(row["force_n"]) for row in rows]),
        start_mm=_placed(start, document, girdle),
        end_mm=_placed(end, document, girdle),
        gh_mm=gh[:, 0],
        humerus_size=np.asarray(size),
    )


class _End(NamedTuple):
    """End of a line, as in the table."""

    on: str
    at_mm: list[float]


def _ends(row: dict[str, Any]) -> tuple[_End, _End]:
    start, end = (_End(on, row[f"{on}_mm"]) for on in _ON_BONE if f"{on}_mm" in row)
    return start, end


def _placed(ends: Sequence[_End], document: dict[str, Any], girdle: Girdle) -> Float[np.ndarray, "3 lines"]:
    """Place ends of the table on the bones of a set, each in the frame of its bone."""
    cadaver, das3 = document["cadaver"], document["das3"]
    points = np.array([end.at_mm for end in ends]).T
    on_bones = {
        "ribs": _on_ribs(points, cadaver, girdle),
        "spine": points,
        "clavicle": _on_clavicle(clavicle_in_thorax(das3, "joint_sc").outward(points), cadaver, girdle),
        "scapula": _on_scapula(scapula_in_thorax(das3, "aa").outward(points), cadaver, girdle),
    } | dict.fromkeys(("humerus", "forearm"), points * _scapula_ratio(cadaver, girdle))
    return np.stack([on_bones[end.on][:, k] for k, end in enumerate(ends)], axis=1)


def _scapula_ratio(cadaver: dict[str, Any], girdle: Girdle) -> float:
    """Compute |AC-TS| of the set over |AC-TS| of the cadaver."""
    own = scapula_in_thorax(cadaver).inward(np.array(cadaver["ts_mm"])[:, None])[0, 0]
    return float(girdle.ts_mm[0] / own)


def all_have_landmarks(model: AnyModel, subjects: Sequence[str]) -> bool:
    """Check whether the sets of all these subjects have TS and AI as landmarks."""
    return all(has_landmarks(one.girdle) for one in unique_sets([model], subjects)[0])


def has_landmarks(girdle: Girdle) -> bool:
    """Check whether TS is on the x-axis and AI in the plane z = 0, as in the thesis's scapula frame."""
    off = abs(girdle.ts_mm[1]) + abs(girdle.ts_mm[2]) + abs(girdle.ai_mm[2])
    return bool(off <= OFF_FRAME_MM)


@cache
def published_lines() -> dict[str, Any]:
    """Return the table of the lines, with the landmarks of the cadaver under ``cadaver`` and ``das3``."""
    with TABLE.open("rb") as file:
        return tomllib.load(file)


def _on_scapula(in_thorax, cadaver: dict[str, Any], girdle: Girdle) -> Float[np.ndarray, "3 points"]:
    pose = scapula_in_thorax(cadaver)
    points = pose.inward(in_thorax)
    own = pose.inward(np.array([cadaver["ts_mm"], cadaver["ai_mm"]]).T)
    new = np.stack([girdle.ts_mm, girdle.ai_mm], axis=1)
    in_plane = new[:2] @ np.linalg.solve(own[:2], points[:2])
    return np.concatenate([in_plane, points[2:] * _scapula_ratio(cadaver, girdle)])


def _on_clavicle(in_thorax, cadaver: dict[str, Any], girdle: Girdle) -> Float[np.ndarray, "3 points"]:
    length = np.linalg.norm(np.subtract(cadaver["ac_mm"], cadaver["sc_mm"]))
    return clavicle_in_thorax(cadaver).inward(in_thorax) * (np.linalg.norm(girdle.ac_mm, axis=0) / length)


def _on_ribs(points, cadaver: dict[str, Any], girdle: Girdle) -> Float[np.ndarray, "3 points"]:
    y = points[1]
    (_, own_z), own_radii = _section(np.array(cadaver["centre_mm"]), np.array(cadaver["semi_axes_mm"]), y)
    (_, new_z), new_radii = _section(np.asarray(girdle.centre_mm), np.asarray(girdle.semi_axes_mm), y)
    x = points[0] / own_radii[0] * new_radii[0]
    z = (points[2] - own_z) / own_radii[1] * new_radii[1] + new_z
    return np.stack([x, y, z])


def _section(centre, axes, y) -> tuple[tuple[float, float], Float[np.ndarray, "2 points"]]:
    """Compute centre and radii, in x and z, of horizontal sections of an ellipsoid at heights y; NaN radii beyond its
    top and bottom."""
    with np.errstate(invalid="ignore"):
        width = np.sqrt(1.0 - ((y - centre[1]) / axes[1]) ** 2)
    return (centre[0], centre[2]), np.stack([axes[0] * width, axes[2] * width])
