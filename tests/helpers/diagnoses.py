"""Diagnoses that no data made: every kind of answer, with numbers that are known."""

from dataclasses import replace

from adapt.diagnosis.fit.measurement_noise import Noise, NoiseEstimate
from adapt.diagnosis.gap_location import Cell, ConstraintResidual, GapLevel, Profile
from adapt.diagnosis.gap_rotations import VarianceFractions
from adapt.diagnosis.inference.amplitude import effect_amplitude
from adapt.diagnosis.json_form import JsonObject, as_json
from adapt.diagnosis.result import (
    ALL,
    EFFECT,
    NONE,
    UNKNOWN,
    Answer,
    ChannelAmplitude,
    DetectableAmplitude,
    Diagnoses,
    Diagnosis,
    EffectAmplitude,
    GapKind,
    HeldOutGaps,
    MeanGap,
    ParameterMeans,
    PredictedPower,
    Proposal,
    UnknownTests,
    Verdict,
)
from models.adapted_parameters import ADAPTED
from models.effects import EFFECTS
from motions.table import BONES

ANSWERS = {*EFFECTS, NONE, UNKNOWN}
ALL_AND_BONES = (ALL, *BONES)
HIGHEST_DEG = 120.0


def levels(noise_floor: float, base: float, adapted: float, with_effect: float) -> dict[GapKind, dict[str, MeanGap]]:
    """The same gap in both bones, each with an interval of 0.1 to either side."""
    values: dict[GapKind, float] = {
        "noise_floor": noise_floor,
        "base": base,
        "adapted": adapted,
        "with_effect": with_effect,
    }
    return {kind: dict.fromkeys(ALL_AND_BONES, MeanGap(v, v - 0.1, v + 0.1)) for kind, v in values.items()}


def gap_of(adapted: float, with_effect: float) -> HeldOutGaps:
    return HeldOutGaps(
        in_sample=levels(noise_floor=0.8, base=2.0, adapted=adapted - 0.2, with_effect=with_effect - 0.2),
        unseen=levels(noise_floor=0.89, base=2.1, adapted=adapted, with_effect=with_effect),
        other_motion=levels(noise_floor=0.89, base=2.1, adapted=adapted + 0.1, with_effect=with_effect + 0.05),
    )


def verdict(answer: Answer, *effects: str, together: bool = False, **probability: float) -> Verdict:
    """The probabilities given; the other answers share the rest."""
    others = ANSWERS - set(probability)
    rest = (1.0 - sum(probability.values())) / len(others)
    return Verdict(answer, effects, together, {**dict.fromkeys(sorted(others), rest), **probability}, {})


def cell(angle: str, low: float, mean_absolute: float, share: float) -> Cell:
    bone = angle.split("_")[0]
    return Cell(angle, bone, "abduction", low, low + 30.0, 10, -mean_absolute, mean_absolute, 0.9, share)


def amplitude(name: str, *channels: tuple[float, float, float]) -> EffectAmplitude:
    """Of an effect whose directions have these values, lows and highs."""
    directions = EFFECTS[name].directions
    made = tuple(ChannelAmplitude(one, *values) for one, values in zip(directions, channels, strict=True))
    return effect_amplitude(EFFECTS[name], made, HIGHEST_DEG)


ARTEFACT = amplitude("skin_artefact", (5.6, 3.6, 7.6), (0.0, -9.0, 9.0), (-4.2, -5.0, -3.4))
"""7.0 deg long, half interval sqrt((5.6 * 2)^2 + (4.2 * 0.8)^2) / 7.0 = 1.67."""

PROPOSALS = [
    Proposal("positions of AC beside the angles", 0.5, 12.0, 0.99),
    Proposal("twice as many subjects (20)", 0.5, 1.2, 0.77),
]

SELDOM = PredictedPower(0.25, 0.45, {"skin_artefact": 0.3})

SKIN = Diagnosis(
    model="R2",
    subjects=tuple(f"s{k}" for k in range(10)),
    left_out={},
    postures=140,
    highest_elevation_deg=HIGHEST_DEG,
    noise=NoiseEstimate(Noise(1.4, 2.0), 166.0, "estimated"),
    declared_effects=(),
    verdict=verdict(EFFECT, "skin_artefact", skin_artefact=0.98),
    at_other_noise={2.1: verdict(NONE, none=0.9), 0.94: verdict(EFFECT, "skin_artefact", skin_artefact=0.99)},
    tests=UnknownTests(discrepancy_gain=-5.0, excess=0.3, amplitude_excess=0.0),
    amplitude={"skin_artefact": ARTEFACT},
    best=("skin_artefact",),
    gaps=gap_of(1.34, 1.02),
    parameters={name: ParameterMeans(100.0, 101.0) for name in ADAPTED},
    cells=[cell("scapula_y", 0.0, 1.8, 0.7), cell("clavicle_x", 30.0, 1.2, 0.3), cell("clavicle_z", 0.0, 0.5, 0.0)],
    profile=Profile({}, {"scapula": GapLevel(1.8, 0.9)}, {}, {}, {}),
    variance_fractions=VarianceFractions(None, {}, {}, None),
    constraints=[ConstraintResidual("A1", None, 140, 0.1, None, -2.0, 2.0, None)],
    indistinguishable=[["conoid_strain", "clavicle_axial_estimate"]],
    smallest_detectable={name: DetectableAmplitude(1.5, effect.unit) for name, effect in EFFECTS.items()}
    | {"thorax_asymmetry": None, "thorax_shape": DetectableAmplitude(0.15, "1")},
    predicted_power=dict.fromkeys(EFFECTS, PredictedPower(0.9, 0.1, {})) | {"sc_translation": SELDOM},
    next_measurement=PROPOSALS,
)
"""Ten subjects, one effect."""

ALIKE = replace(
    SKIN,
    verdict=verdict(EFFECT, "clavicle_length", "scapula_size", clavicle_length=0.6, scapula_size=0.35),
    amplitude={name: amplitude(name, (-8.06, -9.0, -7.12)) for name in ("clavicle_length", "scapula_size")},
    best=("clavicle_length",),
)
"""Two effects that cannot be told apart."""

PAIR = replace(
    SKIN,
    verdict=replace(
        verdict(EFFECT, "skin_artefact", "clavicle_length", together=True, skin_artefact=0.45, clavicle_length=0.45),
        pairs={"skin_artefact+clavicle_length": 0.9},
    ),
    amplitude={"skin_artefact": ARTEFACT, "clavicle_length": amplitude("clavicle_length", (8.0, 7.0, 9.0))},
    best=("skin_artefact", "clavicle_length"),
)
HEDGED = replace(
    PAIR,
    verdict=replace(PAIR.verdict, effects=("skin_artefact", "clavicle_length", "scapula_size")),
    amplitude=PAIR.amplitude | {"scapula_size": amplitude("scapula_size", (0.5, 0.25, 0.75))},
)
"""A pair, and an effect that may be there in place of one of the two."""

NOTHING = replace(
    SKIN,
    subjects=("s1",),
    verdict=verdict(NONE, none=0.8, thorax_asymmetry=0.06, thorax_shape=0.05, conoid_strain=0.04, skin_artefact=0.03),
    amplitude={},
    best=(),
    gaps=gap_of(0.93, 0.93),
)
OUTSIDE = replace(SKIN, verdict=verdict(UNKNOWN, unknown=0.99))
IN_PART = replace(SKIN, verdict=verdict(UNKNOWN, "skin_artefact", unknown=0.99))
TOO_LARGE = replace(IN_PART, tests=replace(IN_PART.tests, amplitude_excess=1.9))
"""Explained in part by an effect that is larger than such effects are."""

BY_KIND = {
    "skin": SKIN,
    "alike": ALIKE,
    "pair": PAIR,
    "hedged": HEDGED,
    "nothing": NOTHING,
    "outside": OUTSIDE,
    "in part": IN_PART,
    "too large": TOO_LARGE,
}


def alone(diagnosis: Diagnosis) -> Diagnoses:
    """The diagnosis as that of the only model."""
    return Diagnoses({diagnosis.model: diagnosis})


def json_of(diagnosis: Diagnosis) -> JsonObject:
    """What diagnosis.json holds of it."""
    return as_json(alone(diagnosis))
