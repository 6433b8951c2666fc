"""A diagnosis as plain JSON types: the contents of diagnosis.json.

Its keys are what scripts of users rely on; they stay where a field has another name.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from adapt.diagnosis.result import (
    HELD_OUT,
    Diagnoses,
    Diagnosis,
    EffectAmplitude,
    HeldOutGaps,
    PredictedPower,
    Verdict,
)
from adapt.diagnosis.wording import sentence

JsonObject = dict[str, Any]
"""An object of plain JSON types."""


def as_json(diagnoses: Diagnoses) -> JsonObject:
    """Turn diagnoses into one object a model under ``by_model``, with that of the closest model at the top level too.

    What is not a finite number is null.
    """
    by_model = {name: _diagnosis(diagnosis) for name, diagnosis in diagnoses.by_model.items()}
    return {**by_model[diagnoses.closest.model], "by_model": by_model}


def _diagnosis(diagnosis: Diagnosis) -> JsonObject:
    noise = diagnosis.noise
    return plain(
        {
            "model": diagnosis.model,
            "verdict": {**_verdict(diagnosis.verdict), "sentence": sentence(diagnosis)},
            "probability": diagnosis.verdict.probability,
            "pairs": diagnosis.verdict.pairs,
            "tests": {
                "discrepancy_gain": diagnosis.tests.discrepancy_gain,
                "excess": diagnosis.tests.excess,
                "oversize": diagnosis.tests.amplitude_excess,
            },
            "amplitude": {name: _amplitude(one) for name, one in diagnosis.amplitude.items()},
            "gap_deg": gaps_as_json(diagnosis.gaps),
            "where": diagnosis.cells,
            "where_by": diagnosis.profile,
            "shares": diagnosis.variance_fractions,
            "constraints": diagnosis.constraints,
            "parameters": diagnosis.parameters,
            "indistinguishable": diagnosis.indistinguishable,
            "smallest_detectable": diagnosis.smallest_detectable,
            "foreseen": {name: _predicted_power(one) for name, one in diagnosis.predicted_power.items()},
            "next_measurement": diagnosis.next_measurement,
            "noise": {**asdict(noise.noise), "source": noise.source, "freedom": noise.freedom},
            "at_other_noise": [
                {"noise_deg": noise_deg, **_verdict(verdict)}
                for noise_deg, verdict in sorted(diagnosis.at_other_noise.items())
            ],
            "expected": diagnosis.declared_effects,
            "subjects": diagnosis.subjects,
            "left_out": diagnosis.left_out,
            "postures": diagnosis.postures,
            "highest_elevation_deg": diagnosis.highest_elevation_deg,
            "best": diagnosis.best,
        }
    )


def gaps_as_json(gaps: HeldOutGaps) -> JsonObject:
    """Turn gaps into the object ``gap_deg``: those held out by kind, the others and how far they shrink."""
    return plain(
        {
            **gaps.unseen,
            "in_sample": gaps.in_sample,
            "other_motion": gaps.other_motion,
            "held_out": HELD_OUT,
            "shrinkage": gaps.shrinkage,
        }
    )


def _verdict(verdict: Verdict) -> JsonObject:
    return {"answer": verdict.answer, "effects": verdict.effects, "together": verdict.together}


def _amplitude(amplitude: EffectAmplitude) -> JsonObject:
    channels = {one.channel: {"value": one.value, "low": one.low, "high": one.high} for one in amplitude.channels}
    return {**vars(amplitude), "channels": channels}


def _predicted_power(power: PredictedPower) -> JsonObject:
    return {"named": power.named, "none": power.none, "taken_for": power.confused_with}


def plain(value: Any) -> Any:
    """Turn a value into the types of JSON; what is not a finite number becomes None."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
