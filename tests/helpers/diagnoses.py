"""Diagnoses that no data made: every kind of answer, with numbers that are known."""

from dataclasses import replace
from typing import Any

import numpy as np

from adapt.diagnosis import Amplitude, Changed, Diagnosis
from adapt.diagnosis.design.next_measurement import Proposal
from adapt.diagnosis.design.predicted_power import PredictedPower
from adapt.diagnosis.fit.held_out_gaps import Gap, HeldOut
from adapt.diagnosis.fit.measurement_noise import Noise, NoiseEstimate
from adapt.diagnosis.gap_location import Cell, ConstraintResidual, Level, Profile, Shares
from adapt.diagnosis.inference.ranking import Ranking
from adapt.diagnosis.inference.verdict import EFFECT, NONE, UNKNOWN, Verdict
from adapt.diagnosis.json_form import as_json
from models.effects import EFFECTS
from models.girdle import ADAPTED

ANSWERS = {*EFFECTS, NONE, UNKNOWN}
BONES = ("all", "clavicle", "scapula")


def levels(**values: float) -> dict[str, dict[str, Gap]]:
    """The same gap in both bones, each with an interval of 0.1 to either side."""
    return {kind: dict.fromkeys(BONES, Gap(value, value - 0.1, value + 0.1)) for kind, value in values.items()}


def gap_of(adapted: float, with_effect: float) -> HeldOut:
    return HeldOut(
        in_sample=levels(noise_floor=0.8, base=2.0, adapted=adapted - 0.2, with_effect=with_effect - 0.2),
        unseen=levels(noise_floor=0.89, base=2.1, adapted=adapted, with_effect=with_effect),
        other_motion=levels(noise_floor=0.89, base=2.1, adapted=adapted + 0.1, with_effect=with_effect + 0.05),
    )


def verdict(answer: str, *effects: str, together: bool = False, **probability: float) -> Verdict:
    """The probabilities given; the other answers share the rest."""
    others = ANSWERS - set(probability)
    rest = (1.0 - sum(probability.values())) / len(others)
    return Verdict(answer, effects, together, {**dict.fromkeys(sorted(others), rest), **probability}, {})


def cell(angle: str, low: float, mean_absolute: float, share: float) -> Cell:
    bone = angle.split("_")[0]
    return Cell(angle, bone, "abduction", low, low + 30.0, 10, -mean_absolute, mean_absolute, 0.9, share)


ARTEFACT = (
    Amplitude("about x", 5.6, 3.6, 7.6),
    Amplitude("about y", 0.0, -9.0, 9.0),
    Amplitude("about z", -4.2, -5.0, -3.4),
)
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
    highest_deg=120.0,
    noise=NoiseEstimate(Noise(1.4, 2.0), 166.0, "estimated"),
    expected=(),
    verdict=verdict(EFFECT, "skin_artefact", skin_artefact=0.98),
    at_other_noise={2.1: verdict(NONE, none=0.9), 0.94: verdict(EFFECT, "skin_artefact", skin_artefact=0.99)},
    amplitude={"skin_artefact": ARTEFACT},
    best=("skin_artefact",),
    gap=gap_of(1.34, 1.02),
    parameters={name: Changed(100.0, 101.0) for name in ADAPTED},
    cells=[cell("scapula_y", 0.0, 1.8, 0.7), cell("clavicle_x", 30.0, 1.2, 0.3), cell("clavicle_z", 0.0, 0.5, 0.0)],
    profile=Profile({}, {"scapula": Level(1.8, 0.9)}, {}, {}, {}),
    shares=Shares(None, {}, {}, None),
    constraints=[ConstraintResidual("A1", None, 140, 0.1, None, -2.0, 2.0, None)],
    indistinguishable=[["conoid_strain", "clavicle_axial_estimate"]],
    detectable=dict.fromkeys(EFFECTS, 1.5) | {"thorax_asymmetry": None, "thorax_shape": 0.15},
    predicted_power=dict.fromkeys(EFFECTS, PredictedPower(0.9, 0.1, {})) | {"sc_translation": SELDOM},
    next_measurement=PROPOSALS,
    ranking=Ranking((), np.zeros(0), np.zeros(0), -5.0, 1.0, 1.0, 0.3, 0.0),  # what else it says is in the other fields
)
"""Ten subjects, one effect."""

ALIKE = replace(
    SKIN,
    verdict=verdict(EFFECT, "clavicle_length", "scapula_size", clavicle_length=0.6, scapula_size=0.35),
    amplitude={name: (Amplitude("size", -8.06, -9.0, -7.12),) for name in ("clavicle_length", "scapula_size")},
    best=("clavicle_length",),
)
"""Two effects that cannot be told apart."""

PAIR = replace(
    SKIN,
    verdict=replace(
        verdict(EFFECT, "skin_artefact", "clavicle_length", together=True, skin_artefact=0.45, clavicle_length=0.45),
        pairs={"skin_artefact+clavicle_length": 0.9},
    ),
    amplitude={"skin_artefact": ARTEFACT, "clavicle_length": (Amplitude("length", 8.0, 7.0, 9.0),)},
    best=("skin_artefact", "clavicle_length"),
)
HEDGED = replace(
    PAIR,
    verdict=replace(PAIR.verdict, effects=("skin_artefact", "clavicle_length", "scapula_size")),
    amplitude=PAIR.amplitude | {"scapula_size": (Amplitude("size", 0.5, 0.25, 0.75),)},
)
"""A pair, and an effect that may be there in place of one of the two."""

NOTHING = replace(
    SKIN,
    subjects=("s1",),
    verdict=verdict(NONE, none=0.8, thorax_asymmetry=0.06, thorax_shape=0.05, conoid_strain=0.04, skin_artefact=0.03),
    amplitude={},
    best=(),
    gap=gap_of(0.93, 0.93),
)
OUTSIDE = replace(SKIN, verdict=verdict(UNKNOWN, unknown=0.99))
IN_PART = replace(SKIN, verdict=verdict(UNKNOWN, "skin_artefact", unknown=0.99))
TOO_LARGE = replace(IN_PART, ranking=replace(IN_PART.ranking, amplitude_excess=1.9))
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


def of(diagnosis: Diagnosis) -> dict[str, Any]:
    return as_json({diagnosis.model: diagnosis})
