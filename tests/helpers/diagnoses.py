"""Diagnoses made by hand, one for every kind of answer, with known numbers."""

import math
from dataclasses import replace

import numpy as np

from adapt.diagnosis.location.constraint_spread import ConstraintSpread
from adapt.diagnosis.location.gap_location import Cell, ConstraintResidual, GapLevel, Profile
from adapt.diagnosis.location.where import Where
from adapt.diagnosis.result import (
    ADAPTED_STEP,
    ALL,
    BASE,
    EFFECT,
    ELEVATION,
    NOISE,
    NONE,
    OWN_BONES,
    UNKNOWN,
    Answer,
    Cause,
    CauseAmplitude,
    Diagnoses,
    Diagnosis,
    Extent,
    GapKind,
    Gaps,
    Interval,
    Noise,
    ParameterMeans,
    Positions,
    Proposal,
    Step,
    Verdict,
)
from adapt.diagnosis.texts.json_form import JsonObject, as_json
from models.adapted_parameters import ADAPTED
from models.effects import EFFECTS
from motions.rhythm_subjects import simulate_subjects
from motions.table import BONES

CAUSES = tuple(dict.fromkeys(effect.cause for effect in EFFECTS.values()))
ANSWERS = {*CAUSES, NONE, UNKNOWN}
ALL_AND_BONES = (ALL, *BONES)


def around(value: float) -> Interval:
    """Return the value with an interval of 0.1 to either side."""
    return Interval(value, value - 0.1, value + 0.1)


def levels(
    noise_floor: float, base: float, adapted: float, own_bones: float, with_effect: float
) -> dict[GapKind, dict[str, Interval]]:
    """Return these gaps, the same for both bones."""
    values: dict[GapKind, float] = {
        "noise_floor": noise_floor,
        "base": base,
        "adapted": adapted,
        "own_bones": own_bones,
        "with_effect": with_effect,
    }
    return {kind: dict.fromkeys(ALL_AND_BONES, around(value)) for kind, value in values.items()}


def gap_of(adapted: float, with_effect: float, own_bones: float | None = None) -> Gaps:
    """Return gaps of all kinds around the given ones.

    The given gaps are those of other motions of other persons, where most was held out.
    """
    own = with_effect if own_bones is None else own_bones
    return Gaps(
        in_sample=levels(0.2, 4.0, adapted - 0.4, own - 0.4, with_effect - 0.4),
        other_postures=levels(0.3, 4.1, adapted - 0.2, own - 0.2, with_effect - 0.2),
        other_motion=levels(0.3, 4.1, adapted - 0.1, own - 0.1, with_effect - 0.1),
        other_person=levels(0.3, 4.1, adapted, own, with_effect),
    )


def gap_budget(**steps: float) -> tuple[Step, ...]:
    return tuple(Step(name, around(gap_deg)) for name, gap_deg in steps.items())


def verdict(answer: Answer, *causes: Cause, **inclusion: float) -> Verdict:
    """Return a verdict with the given inclusion probabilities, and 0.02 for every other candidate."""
    every = dict.fromkeys(CAUSES, 0.02) | inclusion
    ordered = dict(sorted(every.items(), key=lambda one: -one[1]))
    answers = {cause.names[0]: 0.9 / len(causes) for cause in causes} if answer == EFFECT else {answer: 0.9}
    rest = (1.0 - sum(answers.values())) / len(ANSWERS - set(answers))
    return Verdict(answer, causes, ordered, dict.fromkeys(sorted(ANSWERS), rest) | answers)


def cause(*names: str, gain: float = 0.5) -> Cause:
    return Cause(names, tuple(1.0 / len(names) for _ in names), gain, 6.0, ("other_motion", "other_person"))


def amplitude(
    name: str, size: float, typical: float, basis: str = "", suffix: str = "", follows: str = ""
) -> CauseAmplitude:
    """Return the amplitude of a cause that acts in its first direction alone and ``follows`` a quantity."""
    effect = EFFECTS[name + suffix]
    first, *others = effect.directions
    directions = {first: around(size)} | dict.fromkeys(others, Interval(0.0, -0.1, 0.1))
    values = (size, *(0.0 for _ in others))
    extent = Extent(1.5 * size if basis else size, {first.partition(" by ")[0]: 0.8}, follows)
    return CauseAmplitude(
        effect.name, effect.what, basis, effect.size_unit, around(size), typical, directions, values, extent=extent
    )


def cell(angle: str, low: float, mean_absolute: float, share: float) -> Cell:
    bone = angle.split("_")[0]
    return Cell(angle, bone, "abduction", low, low + 30.0, 10, -mean_absolute, mean_absolute, 0.9, share)


PROPOSALS = [
    Proposal("positions of SC AC, to 2 mm", ("ac_translation", "conoid_strain"), 0.5, 12.0, 0.4),
    Proposal("twice as many persons", ("ac_translation", "conoid_strain"), 0.5, 1.2, 0.4),
]

_RHYTHM = simulate_subjects(6, seed=0)

_NOTHING_MM = {"base": math.nan, "adapted": math.nan, "with_causes": math.nan}

NO_POSITIONS = Positions(
    used=False,
    note="",
    noise_mm=math.nan,
    in_sample=_NOTHING_MM,
    other_motion=None,
    other_person=None,
    not_told=(),
    motions=_RHYTHM,
    measured_mm={},
    simulated_mm={state: {"SC": np.ones((3, len(_RHYTHM.posture)))} for state in _NOTHING_MM},
)
"""Positions where no landmark was measured."""

POSITIONS = replace(
    NO_POSITIONS,
    noise_mm=0.3,
    in_sample={"base": 4.2, "adapted": 2.7, "with_causes": 6.4},
    other_motion={"base": 4.8, "adapted": 3.2, "with_causes": 6.1},
    not_told=("AC",),
    measured_mm={"SC": np.zeros((3, len(_RHYTHM.posture)))},
)
"""Measured SC is at 0 and simulated SC at 1 mm in every coordinate."""

ONE = Diagnosis(
    model="R2",
    subjects=tuple(f"s{k}" for k in range(6)),
    left_out={},
    outliers=(),
    persons=5,
    kinds=("abduction", "flexion"),
    postures=84,
    searched_postures=84,
    highest_elevation_deg=120.0,
    noise=Noise(1.4, "estimated", 166.0),
    declared_effects=(),
    axial_is_computed=False,
    verdict=verdict(EFFECT, cause("scapula_landmark_bias", gain=0.6), scapula_landmark_bias=0.97),
    amplitude={"scapula_landmark_bias": amplitude("scapula_landmark_bias", 7.0, 5.0)},
    landmark_sizes={},
    budget=gap_budget(**{BASE: 4.1, ADAPTED_STEP: 2.8, OWN_BONES: 2.0, "scapula_landmark_bias": 0.9, NOISE: 0.3}),
    left_over_share=0.24,
    gaps=gap_of(2.8, 0.9, 2.0),
    parameters={name: ParameterMeans(100.0, 101.0) for name in ADAPTED},
    where=Where(
        cells=[cell("scapula_y", 0.0, 1.8, 0.7), cell("clavicle_x", 30.0, 1.2, 0.3), cell("clavicle_z", 0.0, 0.5, 0.0)],
        profile=Profile({}, {"scapula": GapLevel(1.8, 0.9)}, {}, {}, {}),
        constraints=[ConstraintResidual("A1", None, 84, 0.1, None, -2.0, 2.0, None)],
        constraint_spread=[ConstraintSpread("A1", 4.1, 1.2, 0.8), ConstraintSpread("A3", 9.7, 1.1, 0.9)],
    ),
    indistinguishable=[["conoid_strain", "clavicle_axial_estimate"]],
    lacking=("more persons",),
    next_measurement=PROPOSALS,
    positions=NO_POSITIONS,
)
"""Six shoulders of five persons, two kinds of motion, one cause."""

TWO = replace(
    ONE,
    verdict=verdict(
        EFFECT,
        cause("ac_translation", "conoid_strain", gain=0.5),
        cause("scapulothoracic_gap", gain=0.3),
        ac_translation=0.62,
        conoid_strain=0.31,
        scapulothoracic_gap=0.88,
    ),
    amplitude={
        "ac_translation": amplitude("ac_translation", 4.0, 3.0, "posture of the bones", ":posture", "scapula_y"),
        "scapulothoracic_gap": amplitude("scapulothoracic_gap", 12.0, 5.0, "elevation of the arm", follows=ELEVATION),
    },
    budget=gap_budget(
        **{BASE: 4.1, ADAPTED_STEP: 2.8, OWN_BONES: 2.0, "ac_translation": 1.4, "scapulothoracic_gap": 0.9, NOISE: 0.3},
    ),
)
"""Two causes: one with two names, and one that is larger than its typical size."""

_MANY = (
    cause("ac_translation", "conoid_strain", "sc_translation", "thorax_tilt"),
    cause("scapulothoracic_gap", "ts_distance_offset", "ai_distance_offset"),
    cause("clavicle_length", "thorax_asymmetry", "sc_offset"),
    cause("scapula_size", "scapula_conoid_offset"),
    cause("clavicle_frame_bias"),
)
MANY = replace(
    ONE,
    verdict=verdict(EFFECT, *_MANY, **{one.names[0]: 0.9 for one in _MANY}),
    amplitude={one.names[0]: amplitude(one.names[0], 4.0, 3.0) for one in _MANY},
    budget=gap_budget(
        **{BASE: 4.1, ADAPTED_STEP: 2.8, OWN_BONES: 2.6}
        | {one.names[0]: 2.5 - 0.4 * k for k, one in enumerate(_MANY)}
        | {NOISE: 0.3},
    ),
)
"""More causes and names than one sentence can hold."""

NOTHING = replace(
    ONE,
    subjects=("s1",),
    persons=1,
    verdict=verdict(NONE, thorax_asymmetry=0.1),
    amplitude={},
    budget=gap_budget(**{BASE: 4.1, ADAPTED_STEP: 0.5, OWN_BONES: 0.5, NOISE: 0.3}),
    left_over_share=math.nan,
    gaps=replace(gap_of(0.6, 0.6), other_person=None),
)
"""One person, with no gap beyond noise."""

OUTSIDE = replace(
    ONE,
    verdict=verdict(UNKNOWN, skin_artefact=0.4),
    amplitude={},
    budget=gap_budget(**{BASE: 4.1, ADAPTED_STEP: 2.8, OWN_BONES: 2.8, NOISE: 0.3}),
    left_over_share=1.0,
    gaps=gap_of(2.8, 2.8),
)
"""A gap that no candidate explains."""

CHECKED = replace(ONE, positions=POSITIONS)
"""Measured positions, from which the cause moves the landmarks away."""

LONE = replace(ONE, kinds=("abduction",), gaps=replace(ONE.gaps, other_motion=None, other_person=None))
"""One kind of motion."""

UNTESTED = replace(LONE, persons=1, verdict=verdict(UNKNOWN), amplitude={}, budget=OUTSIDE.budget)
"""One kind of motion of one person: no cause can be tested."""

BLIND = replace(
    NOTHING,
    budget=gap_budget(**{BASE: math.nan, ADAPTED_STEP: math.nan, OWN_BONES: math.nan, NOISE: math.nan}),
    gaps=gap_of(math.nan, math.nan),
    indistinguishable=[],
    lacking=(),
    next_measurement=[],
)
"""Every gap is NaN."""

BY_KIND = {
    "one": ONE,
    "two": TWO,
    "many": MANY,
    "nothing": NOTHING,
    "outside": OUTSIDE,
    "lone": LONE,
    "untested": UNTESTED,
    "blind": BLIND,
}


def alone(diagnosis: Diagnosis) -> Diagnoses:
    """Return the diagnosis as that of the only model."""
    return Diagnoses({diagnosis.model: diagnosis})


def json_of(diagnosis: Diagnosis) -> JsonObject:
    """Return the content of ``diagnosis.json`` for a diagnosis."""
    return as_json(alone(diagnosis))
