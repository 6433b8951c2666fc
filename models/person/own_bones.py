"""Bones and frames of a person's own: how the numbers of a person's girdle spread about those of a parameter set.

Nobody has the cadaver's bones. The numbers x of a person's girdle (``Girdle.numbers_mm``) are those of the set and a
sum over sizes z, each of which moves them along a column of one SD:

    x = x_0 + sum_k z_k c_k,     z_k ~ N(0, scale of its group)

The posture says nothing of a common translation of thorax and joint SC: the chain sees the ellipsoid's centre from SC
(:func:`of_chain`), and M and SC share what it finds there. The frames in which clavicle and scapula were measured are
turned about their origins SC and AC: to a measured orientation that is the same as landmarks turned the other way.
Several sizes move the same numbers (a turned scapula and TS, AI and the conoid elsewhere on it). The prior of x is
therefore one covariance, the sum of c c'; what x is found shares out to the sizes by their variances.
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
"""The six adapted parameters, the other numbers of bones and joints, and the measured frames."""

Column = Float[np.ndarray, " numbers *batch"]


@dataclass(frozen=True)
class OwnSize:
    """One way in which persons differ."""

    name: str
    group: Group
    unit: Literal["mm", "percent", "deg"]
    sd: float
    """Between persons, in the unit."""
    source: str
    """Of the SD."""
    keys: tuple[str, ...]
    """The keys of a parameter set that would have measured it."""
    per_unit: Callable[[Girdle], Column]
    """What one unit of it adds to the numbers of a girdle."""

    @property
    def key(self) -> str:
        """Its name with the unit, as files have it."""
        return f"{self.name}_{self.unit}"


_AXES = "xyz"
_ON_CLAVICLE = ("ac_mm", "clavicle_conoid_mm")


def _nothing(girdle: Girdle) -> Column:
    return np.zeros((COUNT_OF_NUMBERS, *np.shape(girdle.ts_mm)[1:]))


def _moved(axis: int, *names: str) -> Callable[[Girdle], Column]:
    """By a millimetre along an axis."""

    def per_unit(girdle: Girdle) -> Column:
        column = _nothing(girdle)
        for name in names:
            column[NUMBERS[name].start + axis] = 1.0
        return column

    return per_unit


def _larger(**shares: float) -> Callable[[Girdle], Column]:
    """By a percent of the bone, each vector with its share in it."""
    return _sum_over(shares, lambda vector, share: share * vector / 100.0)


def _turned(axis: int, names: tuple[str, ...]) -> Callable[[Girdle], Column]:
    """By a degree about an axis of the frame."""
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
    """A place that may be elsewhere along these axes, or, without one, another length."""
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
"""A set states how far off a number that it had to assume may be: taken for two SDs."""

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
"""The six adapted parameters first, in their order."""

NAMES = tuple(one.name for one in SIZES)

if NAMES[: len(ADAPTED)] != ADAPTED:
    raise ValueError("SIZES: the adapted parameters first")


def sds_of(place: str) -> Float[np.ndarray, " axes"]:
    """Give the SDs of the sizes along or about the axes of a place or a frame."""
    return np.array([one.sd for one in SIZES if one.name.rpartition("_")[0] == place])


OwnSDs = Mapping[str, float]
"""Other SDs than those of ``SIZES``, in their units, by name; 0 holds a size at the set's."""

NO_SDS: OwnSDs = MappingProxyType({})


def with_own_sizes(girdle: Girdle, sizes: Mapping[str, Float[np.ndarray, " *batch"]]) -> Girdle:
    """Add sizes, by ``OwnSize.key`` in their units, to the numbers of a girdle."""
    moved = sum(size.per_unit(girdle) * sizes[size.key] for size in SIZES if size.key in sizes)
    return Girdle.of_numbers(np.asarray(girdle.numbers_mm) + moved)


def of_chain(numbers_mm: Float[np.ndarray, " numbers *batch"]) -> Float[np.ndarray, " numbers *batch"]:
    """Move the girdle so that SC is at 0: what postures depend on."""
    moved = np.array(numbers_mm)
    moved[NUMBERS["centre_mm"]] -= moved[NUMBERS["sc_mm"]]
    moved[NUMBERS["sc_mm"]] = 0.0
    return moved


SHOWN_BY_LANDMARKS = np.array(
    [name in {"SC_x", "SC_y", "SC_z", "clavicle_length", "scapula_size", "TS_x", "AI_x", "AI_y"} for name in NAMES]
)
"""Sizes that positions of landmarks show. Where the joint AC is beside the landmark they do not, nor how the measured
frames are turned."""


class Spread(NamedTuple):
    """How persons differ about a set, or about each of several."""

    sd: Float[np.ndarray, " sizes *batch"]
    """In the unit of each of ``SIZES``."""
    columns_mm: Float[np.ndarray, "numbers sizes *batch"]
    """What one SD of each adds to the numbers of the girdle."""
    more_mm: Float[np.ndarray, " seven *batch"]
    """By how much landmarks say that a person's numbers (``landmark_numbers``) exceed the set's; NaN of what was not
    measured."""
    more_sd_mm: Float[np.ndarray, " seven *batch"]

    def from_landmarks(self, found: LandmarkNumbers, set_mm: Float[np.ndarray, " seven *batch"], known) -> "Spread":
        """Add what landmarks of each person say of numbers that are ``known`` from nowhere else."""
        return self._replace(
            more_mm=np.where(known, found.values_mm - set_mm, np.nan), more_sd_mm=np.where(known, found.sd_mm, np.nan)
        )


def spread_about(one: ParameterSet, sds: OwnSDs = NO_SDS) -> Spread:
    """Give the SD of each size about a set.

    An SD holds the spread of people and the range that the set states of its own number; of a number that was measured
    of this person (``girdle model``), only what its source states. InputError for an SD of no size, or that is none.
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
        return 0.0 if measured else size.sd  # TS and AI have what their sources state
    if measured:
        return min(stated or size.sd, size.sd)
    return float(np.hypot(size.sd, stated / _SDS_IN_A_RANGE))
