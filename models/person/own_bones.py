"""Own bones: prior of the numbers of a person's girdle (bones and frames) about the numbers of a parameter set.

Nobody has the cadaver's bones. The numbers x of a person's girdle (``Girdle.numbers_mm``) are the numbers x_0 of the
set plus a sum over sizes z_k. The column c_k is the change of the numbers by one SD of size k:

    x = x_0 + sum_k z_k c_k,     z_k ~ N(0, scale of its group)

The posture does not depend on a common translation of thorax and joint SC. The chain depends on the ellipsoid's centre
M relative to SC (:func:`of_chain`), and a change of this vector is divided between M and SC. The frames in which
clavicle and scapula were measured rotate about their origins SC and AC; for a measured orientation this is the same as
an opposite rotation of the landmarks. Several sizes change the same numbers: a rotated scapula, for example, and other
places of TS, AI and the conoid on it. The prior of x is therefore one covariance, the sum of c c', and an estimate of x
is divided between the sizes in proportion to their variances.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ADAPTED, ADAPTED_PARAMETERS
from models.effects import EFFECTS
from models.effects.bones.ac_offset import ON_SCAPULA
from models.effects.bones.scapula_size import CORACOID_SHARE
from models.girdle import COUNT_OF_NUMBERS, NUMBERS, Girdle
from models.parameter_sets import ParameterSet
from models.person.positions.landmark_numbers import IN_GIRDLE, LandmarkNumbers
from motions.errors import InputError, did_you_mean
from motions.rotations import DEG

Group = Literal["adapted", "bones", "frames"]

GROUPS: tuple[Group, ...] = ("adapted", "bones", "frames")
"""Groups of sizes: the six adapted parameters, the other numbers of bones and joints, and the measured frames."""

Column = Float[np.ndarray, " numbers *batch"]


@dataclass(frozen=True)
class OwnSize:
    """One way in which the girdles of persons differ."""

    name: str
    group: Group
    unit: Literal["mm", "percent", "deg"]
    sd: float
    """SD between persons, in ``unit``."""
    source: str
    """Source of the SD."""
    keys: tuple[str, ...]
    """Keys of the numbers of a parameter set that determine this size; the size is measured if they all are."""
    per_unit: Callable[[Girdle], Column]
    """Function that returns the change of a girdle's numbers by one unit of this size."""

    @property
    def key(self) -> str:
        """Name with the unit, as in files."""
        return f"{self.name}_{self.unit}"


_AXES = "xyz"
_ON_CLAVICLE = ("ac_mm", "clavicle_conoid_mm")


def _nothing(girdle: Girdle) -> Column:
    return np.zeros((COUNT_OF_NUMBERS, *np.shape(girdle.ts_mm)[1:]))


def _moved(axis: int, *names: str) -> Callable[[Girdle], Column]:
    """Return the ``per_unit`` of a translation of the named places: 1 mm along an axis."""

    def per_unit(girdle: Girdle) -> Column:
        column = _nothing(girdle)
        for name in names:
            column[NUMBERS[name].start + axis] = 1.0
        return column

    return per_unit


def _larger(**shares: float) -> Callable[[Girdle], Column]:
    """Return the ``per_unit`` of a bone's growth by 1 %, in which each vector takes part with its share."""
    return _sum_over(shares, lambda vector, share: share * vector / 100.0)


def _turned(axis: int, names: tuple[str, ...]) -> Callable[[Girdle], Column]:
    """Return the ``per_unit`` of a rotation of the named vectors by 1 degree about an axis of the frame."""
    return _sum_over(
        dict.fromkeys(names, 1.0), lambda vector, _: np.cross(np.eye(3)[axis], vector, axisb=0, axisc=0) / float(DEG)
    )


def _sum_over(shares: Mapping[str, float], change: Callable) -> Callable[[Girdle], Column]:
    def per_unit(girdle: Girdle) -> Column:
        column = _nothing(girdle)
        for name, share in shares.items():
            column[NUMBERS[name]] = change(np.asarray(getattr(girdle, name)), share)
        return column

    return per_unit


def _each_axis(name: str, axes: str, sd: float, source: str, key: str, *fields: str) -> tuple[OwnSize, ...]:
    """Build the sizes of a place, one per axis; without axes, the one size of a length."""
    keys = (key,) if key else ()
    if not axes:
        return (OwnSize(name, "bones", "mm", sd, source, keys, _moved(0, *fields)),)
    return tuple(
        OwnSize(f"{name}_{axis}", "bones", "mm", sd, source, keys, _moved(_AXES.index(axis), *fields)) for axis in axes
    )


def _frame(name: str, sds_deg: tuple[float, float, float], source: str, fields: tuple[str, ...]) -> tuple[OwnSize, ...]:
    return tuple(
        OwnSize(f"{name}_{axis}", "frames", "deg", sd, source, (), _turned(k, fields))
        for k, (axis, sd) in enumerate(zip(_AXES, sds_deg, strict=True))
    )


_LENGTH, _SIZE = EFFECTS["clavicle_length"].prior, EFFECTS["scapula_size"].prior

_SDS_IN_A_RANGE = 2.0
"""Number of SDs in the range that a set states for a number that it had to assume."""

_CONOID = (
    "assumed: beside the bones' sizes, joints and frames, which move it by some 4 mm; the conoids of the sets are 20 "
    "deg from where both bones stop turning about each other, and 4 mm more would bring every third person there"
)

_TABLE_6_5 = (
    "assumed: ten adapted subjects scatter by 8-31, 6-7, 2-3, 13-24, 15-17 and 1-2 mm (thesis, Table 6.5), with what "
    "their ellipsoids pay for own bones"
)

_JOINT = "assumed: AC of the sets is a landmark, not the joint"

SIZES: tuple[OwnSize, ...] = (
    *(
        OwnSize(
            *(one.name, "adapted", "mm", one.beside_bones_sd_mm or one.person_sd_mm / 2.0, _TABLE_6_5),
            (f"thorax.{one.field}",) if one.of_ellipsoid else ("constraint.conoid_length_mm",),
            _moved(one.component, one.field),
        )
        for one in ADAPTED_PARAMETERS
    ),
    *_each_axis("SC", "xyz", 5.0, "bone pins: 13-16 mm apart in ten shoulders", "clavicle.sc_mm", "sc_mm"),
    OwnSize(
        *("clavicle_length", "bones", "percent", _LENGTH.scale[0], _LENGTH.source, ("clavicle.length_mm",)),
        _larger(ac_mm=1.0, clavicle_conoid_mm=1.0),
    ),
    OwnSize(
        *("scapula_size", "bones", "percent", _SIZE.scale[0], _SIZE.source, ("scapula.ts_mm", "scapula.ai_mm")),
        _larger(ts_mm=1.0, ai_mm=1.0, scapula_conoid_mm=CORACOID_SHARE),
    ),
    *_each_axis("TS", "x", 6.0, "spread between the shipped sets", "scapula.ts_mm", "ts_mm"),
    *_each_axis("AI", "xy", 6.0, "spread between the shipped sets", "scapula.ai_mm", "ai_mm"),
    *_each_axis("clavicle_conoid", "xyz", 2.0, _CONOID, "", "clavicle_conoid_mm"),
    *_each_axis("scapula_conoid", "xyz", 2.0, _CONOID, "", "scapula_conoid_mm"),
    *_each_axis("clavicle_AC", "yz", 3.0, _JOINT, "", "ac_mm"),
    *_each_axis("scapula_AC", "xyz", 3.0, _JOINT, "", *ON_SCAPULA),
    *_each_axis("TS_distance", "", 4.0, "assumed: soft tissue", "constraint.ts_distance_mm", "ts_distance_mm"),
    *_each_axis("AI_distance", "", 4.0, "assumed: soft tissue", "constraint.ai_distance_mm", "ai_distance_mm"),
    *_frame(
        *("clavicle_frame", (10.0, 4.0, 4.0)),
        "zeros of its axial rotation differ by 35 deg between laboratories, persons within one by less",
        _ON_CLAVICLE,
    ),
    *_frame("scapula_frame", (4.0, 4.0, 4.0), "palpation of AC, TS, AI; AC for AA leaves 1-8 deg", ON_SCAPULA),
)
"""All ways in which persons differ; the six adapted parameters come first, in the order of ``ADAPTED``."""

NAMES = tuple(one.name for one in SIZES)

if NAMES[: len(ADAPTED)] != ADAPTED:
    raise ValueError("SIZES: the adapted parameters first")


def sds_of(place: str) -> Float[np.ndarray, " axes"]:
    """Return the SDs of the sizes along the axes of a place or about the axes of a frame."""
    return np.array([one.sd for one in SIZES if one.name.rpartition("_")[0] == place])


OwnSDs = Mapping[str, float]
"""SDs that replace the SDs of ``SIZES``, by name, in the same units; 0 fixes a size at the set's value."""

NO_SDS: OwnSDs = MappingProxyType({})


def with_own_sizes(girdle: Girdle, sizes: Mapping[str, Float[np.ndarray, " *batch"]]) -> Girdle:
    """Add sizes, given by ``OwnSize.key`` in their units, to the numbers of a girdle."""
    moved = sum(size.per_unit(girdle) * sizes[size.key] for size in SIZES if size.key in sizes)
    return Girdle.of_numbers(np.asarray(girdle.numbers_mm) + moved)


def of_chain(numbers_mm: Float[np.ndarray, " numbers *batch"]) -> Float[np.ndarray, " numbers *batch"]:
    """Translate the girdle so that SC is at 0, because postures do not depend on its position."""
    moved = np.array(numbers_mm)
    moved[NUMBERS["centre_mm"]] -= moved[NUMBERS["sc_mm"]]
    moved[NUMBERS["sc_mm"]] = 0.0
    return moved


SHOWN_BY_LANDMARKS = np.array(
    [name in {"SC_x", "SC_y", "SC_z", "clavicle_length", "scapula_size", "TS_x", "AI_x", "AI_y"} for name in NAMES]
)
"""Mask of the sizes that landmark positions show. The positions show neither the offset of the joint AC from its
landmark nor the rotation of the measured frames."""


class Spread(NamedTuple):
    """Differences between persons about one parameter set, or about each of several."""

    sd: Float[np.ndarray, " sizes *batch"]
    """SD of each of ``SIZES``, in its unit."""
    columns_mm: Float[np.ndarray, "numbers sizes *batch"]
    """Change of the girdle's numbers by one SD of each size."""
    more_mm: Float[np.ndarray, " seven *batch"]
    """Person's numbers by landmarks (``landmark_numbers``) minus the set's; NaN where not measured."""
    more_sd_mm: Float[np.ndarray, " seven *batch"]

    def from_landmarks(self, found: LandmarkNumbers, set_mm: Float[np.ndarray, " seven *batch"], known) -> "Spread":
        """Add the numbers measured by each person's landmarks, and their SDs, where ``known`` is True: the set has not
        measured this number itself."""
        return self._replace(
            more_mm=np.where(known, found.values_mm - set_mm, np.nan), more_sd_mm=np.where(known, found.sd_mm, np.nan)
        )


def spread_about(one: ParameterSet, sds: OwnSDs = NO_SDS) -> Spread:
    """Compute the SD of each size about a parameter set.

    An SD combines the spread between people with the range that the set states for its own number. For a number
    measured on this person (``girdle model``) it is only the SD that the source states. InputError where ``sds`` names
    no size of ``SIZES`` or gives a value that is no SD.
    """
    sd = np.array([_sd(one, size) for size in SIZES])
    for name, given in sds.items():
        if name not in NAMES:
            remedy = f"{did_you_mean(name, NAMES)}Use one of {', '.join(NAMES)}"
            raise InputError("own_bones", None, f"there is no size '{name}'", remedy)
        if not 0.0 <= given < np.inf:
            raise InputError("own_bones", None, f"the SD of {name} is {given:g}", "Give an SD of 0 or more")
        sd[NAMES.index(name)] = given
    columns = np.stack([x * size.per_unit(one.girdle) for size, x in zip(SIZES, sd, strict=True)], axis=-1)
    return Spread(sd, columns, *np.full((2, len(IN_GIRDLE)), np.nan))


def _sd(one: ParameterSet, size: OwnSize) -> float:
    measured = bool(size.keys) and all(map(one.is_measured, size.keys))
    stated = max((one.range_mm(key) or 0.0 for key in size.keys), default=0.0)
    if size.name == "clavicle_length":
        return min(100.0 * stated / float(one.girdle.ac_mm[0]), size.sd) if measured else size.sd
    if size.unit != "mm":
        return 0.0 if measured else size.sd  # the SDs of TS and AI hold the measurement error of the scapula
    if measured:
        return min(stated or size.sd, size.sd)
    return float(np.hypot(size.sd, stated / _SDS_IN_A_RANGE))
