"""Attachments of the muscle lines: read from the table, and placed on the bones of a parameter set.

A set has other bones than the cadaver. Each attachment goes along with its bone:

- scapula: in the plane AC-TS-AI by the linear map that brings the cadaver's TS and AI to the set's; normal to it by
  the ratio of |AC-TS|. So an attachment keeps its place between the landmarks.
- clavicle: by the ratio of the lengths.
- humerus, with the contours that lines go round: by the ratio of |AC-TS|, as the head has to fit the glenoid.
- ribs: at its height y, with its azimuth and its share of the radius of the set's own ellipsoid at that height:
  x' = x A_x' w' / (A_x w), z' - M_z' = (z - M_z) A_z' w' / (A_z w), w = sqrt(1 - ((y - M_y) / A_y)^2).
- spine and pelvis: as in the cadaver.

Assumed: nobody has published the attachments of R2, R4 and R6, nor their humeri. An adaptation leaves all attachments
where they are: they are bone, and the ellipsoid is what changes (thesis 6.2.6).
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
"""The muscle that the ellipsoid is the bony contour of (thesis 6.4)."""

OFF_FRAME_MM = 1.0
"""How far TS may lie off the x-axis and AI off the plane of the thesis's scapula frame: a palpator's noise."""


BONES = ("thorax", "clavicle", "scapula", "humerus")
"""From the trunk outward: each hangs in the joint of its place, SC, AC and GH, on the one before."""

THORAX, CLAVICLE, SCAPULA, HUMERUS = range(4)

_ON_BONE = {"ribs": THORAX, "spine": THORAX, "clavicle": CLAVICLE, "scapula": SCAPULA} | {
    "humerus": HUMERUS,
    "forearm": HUMERUS,  # it does not move against the humerus: thesis, chapter 1
}
"""What an attachment of the table is on, by the start of its key, from the trunk outward."""


@dataclass(frozen=True)
class MuscleLines:
    """Lines between two bones; mm, N."""

    name: tuple[str, ...]
    muscle: tuple[str, ...]
    start: Int[np.ndarray, " lines"]
    """Which of BONES the line comes from, the one nearer to the trunk."""
    end: Int[np.ndarray, " lines"]
    """Which one it goes to."""
    contour: tuple[str, ...]
    """What each line goes round: ``thorax``, the ellipsoid; one of the contours of the humerus; nothing, empty."""
    strongest_force_N: Float[np.ndarray, " lines"]
    start_mm: Float[np.ndarray, "3 lines *postures"]
    """Frame of its bone (thesis, Appendix A)."""
    end_mm: Float[np.ndarray, "3 lines *postures"]
    gh_mm: Float[np.ndarray, " 3 *postures"]
    """Centre of the glenohumeral joint, scapula frame: where the arm hangs, and the origin of the humerus."""
    humerus_size: Float[np.ndarray, " *postures"]
    """Of the humerus, over the cadaver's."""

    @property
    def muscles(self) -> tuple[str, ...]:
        """The muscles, each once."""
        return tuple(dict.fromkeys(self.muscle))

    @property
    def wraps(self) -> Bool[np.ndarray, " lines"]:
        """Which lines go round a contour."""
        return np.array([contour != "" for contour in self.contour])

    def of(self, muscle: str) -> Bool[np.ndarray, " lines"]:
        """Tell which lines belong to the muscle."""
        return np.array([name == muscle for name in self.muscle])

    def crosses(self, joint: int) -> Bool[np.ndarray, " lines"]:
        """Tell which lines pass the joint in which this one of BONES hangs."""
        return (self.start < joint) & (joint <= self.end)

    def only(self, muscle: str) -> "MuscleLines":
        """Select the lines of one muscle."""
        mine = self.of(muscle)
        numbers = {key: getattr(self, key)[mine] for key in ("start", "end", "strongest_force_N")}
        points = {key: getattr(self, key)[:, mine] for key in ("start_mm", "end_mm")}
        names = {key: tuple(np.array(getattr(self, key))[mine].tolist()) for key in ("name", "muscle", "contour")}
        return replace(self, **numbers, **points, **names)


def muscle_lines_of(model: AnyModel, subjects: Sequence[str]) -> MuscleLines:
    """Place the lines on the bones of the set of each of these subjects, as often as it is named.

    InputError as :func:`muscle_lines`.
    """
    sets, place = unique_sets([model], subjects)
    each = [muscle_lines(one) for one in sets]
    points = {key: np.stack([getattr(one, key) for one in each], axis=-1)[..., place] for key in _PLACED}
    return replace(each[0], **points)


_PLACED = ("start_mm", "end_mm", "gh_mm", "humerus_size")


def muscle_lines(model: ParameterSet) -> MuscleLines:
    """Place the shipped lines on the bones of a set. InputError where its scapula frame is not the thesis's.

    Place them on the set as it is, before an adaptation: see the module.
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
    """Where a line ends, as the table has it."""

    on: str
    at_mm: list[float]


def _ends(row: dict[str, Any]) -> tuple[_End, _End]:
    start, end = (_End(on, row[f"{on}_mm"]) for on in _ON_BONE if f"{on}_mm" in row)
    return start, end


def _placed(ends: Sequence[_End], document: dict[str, Any], girdle: Girdle) -> Float[np.ndarray, "3 lines"]:
    """Bring ends from where the table has them to the bones of a set, each in the frame of its bone."""
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
    """|AC-TS| of the set over the cadaver's."""
    own = scapula_in_thorax(cadaver).inward(np.array(cadaver["ts_mm"])[:, None])[0, 0]
    return float(girdle.ts_mm[0] / own)


def all_have_landmarks(model: AnyModel, subjects: Sequence[str]) -> bool:
    """Tell whether the sets of all these subjects have TS and AI as landmarks."""
    return all(has_landmarks(one.girdle) for one in unique_sets([model], subjects)[0])


def has_landmarks(girdle: Girdle) -> bool:
    """Tell whether TS and AI are where the thesis's scapula frame has them: on its x-axis, and in the plane z = 0."""
    off = abs(girdle.ts_mm[1]) + abs(girdle.ts_mm[2]) + abs(girdle.ai_mm[2])
    return bool(off <= OFF_FRAME_MM)


@cache
def published_lines() -> dict[str, Any]:
    """Read the file of the lines, with the landmarks of the cadaver: ``cadaver`` and ``das3``."""
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
    """Centre and radii, in x and z, of the horizontal section of an ellipsoid at heights; NaN above its top."""
    with np.errstate(invalid="ignore"):
        width = np.sqrt(1.0 - ((y - centre[1]) / axes[1]) ** 2)
    return (centre[0], centre[2]), np.stack([axes[0] * width, axes[2] * width])
