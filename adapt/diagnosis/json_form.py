"""A diagnosis as plain JSON types: the contents of diagnosis.json."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from adapt.diagnosis.diagnosis import Diagnosis
from adapt.diagnosis.fit.held_out_gaps import HeldOut
from adapt.diagnosis.inference.amplitude import Amplitude
from adapt.diagnosis.inference.verdict import Verdict
from adapt.diagnosis.wording import Object, sentence
from models.effects import EFFECTS, Effect
from models.effects.known import as_option


def as_json(by_model: Mapping[str, Diagnosis], effects: Sequence[Effect] = tuple(EFFECTS.values())) -> Object:
    """One object a model under ``by_model``; the top level is that of the smallest held-out adapted gap.

    ``effects`` are those that the diagnosis was given. What is not a finite number is null.
    """
    by_name = {effect.name: effect for effect in effects}
    objects = {name: _object(diagnosis, by_name) for name, diagnosis in by_model.items()}
    return {**objects[min(objects, key=lambda name: _adapted_gap_deg(objects[name]))], "by_model": objects}


def _adapted_gap_deg(of: Object) -> float:
    value = of["gap_deg"]["adapted"]["all"]["value"]
    return math.inf if value is None else value


def _object(of: Diagnosis, effects: Mapping[str, Effect]) -> Object:
    found = {
        "model": of.model,
        "verdict": _verdict(of.verdict),
        "probability": of.verdict.probability,
        "pairs": of.verdict.pairs,
        "tests": {
            "discrepancy_gain": of.ranking.discrepancy_gain,
            "excess": of.ranking.excess,
            "oversize": of.ranking.amplitude_excess,
        },
        "amplitude": {name: _amplitude(effects[name], size, of.highest_deg) for name, size in of.amplitude.items()},
        "gap_deg": _gaps(of.gap),
        "where": of.cells,
        "where_by": of.profile,
        "shares": of.shares,
        "constraints": of.constraints,
        "parameters": of.parameters,
        "indistinguishable": of.indistinguishable,
        "smallest_detectable": {
            name: None if value is None else {"value": value, "unit": effects[name].unit}
            for name, value in of.detectable.items()
        },
        "foreseen": of.predicted_power,
        "next_measurement": of.next_measurement,
        "noise": {**vars(of.noise.noise), "source": of.noise.source, "freedom": of.noise.freedom},
        "at_other_noise": [{"noise_deg": deg, **_verdict(one)} for deg, one in sorted(of.at_other_noise.items())],
        "expected": of.expected,
        "subjects": of.subjects,
        "left_out": of.left_out,
        "postures": of.postures,
        "highest_elevation_deg": of.highest_deg,
        "best": of.best,
    }
    found = plain(found)
    found["verdict"]["sentence"] = sentence(found)
    return found


def _verdict(of: Verdict) -> Object:
    return {"answer": of.answer, "effects": of.effects, "together": of.together}


def _amplitude(effect: Effect, channels: Sequence[Amplitude], highest_deg: float) -> Object:
    value, half = _size(channels)
    return {
        "what": effect.what,
        "unit": effect.unit,
        "value": value,
        "low": value - half if len(channels) == 1 else max(0.0, value - half),
        "high": value + half,
        "channels": {one.channel: {"value": one.value, "low": one.low, "high": one.high} for one in channels},
        "option": as_option(effect, [one.value for one in channels], highest_deg),
    }


def _size(channels: Sequence[Amplitude]) -> tuple[float, float]:
    """The channel, or the length of several, and half its interval.

    The length's interval is by the delta method: the errors of the channels, taken as independent, along the mean. A
    mean of length 0 has no direction: then the widest channel's.
    """
    value = np.array([one.value for one in channels])
    half = np.array([(one.high - one.low) / 2.0 for one in channels])
    if len(channels) == 1:
        return float(value[0]), float(half[0])
    length = float(np.linalg.norm(value))
    return length, float(np.linalg.norm(value * half)) / length if length else float(half.max())


def _gaps(of: HeldOut) -> Object:
    adapted, with_effect = (of.unseen[kind]["all"].value for kind in ("adapted", "with_effect"))
    shrinkage = (adapted - with_effect) / adapted if adapted else 0.0
    levels = {**of.unseen, "in_sample": of.in_sample, "other_motion": of.other_motion}
    return {**levels, "held_out": "every third posture", "shrinkage": shrinkage}


def plain(value: Any) -> Any:
    """The same in the types of JSON; what is not a finite number is None."""
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
