"""Diagnosis as plain JSON types: the contents of diagnosis.json.

Scripts of users rely on its keys: a key stays the same where its field has got another name.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

from adapt.diagnosis.result import (
    CauseAmplitude,
    Diagnoses,
    Diagnosis,
    Gaps,
    Positions,
    Step,
)
from adapt.diagnosis.texts.measure_next import measure_next
from adapt.diagnosis.texts.wording import sentence

JsonObject = dict[str, Any]
"""Object of plain JSON types."""

_POSTURES = "every third posture in turn, after the others"
"""Description of the postures held out for the gaps at the top level of ``gap_deg``."""


def as_json(diagnoses: Diagnoses) -> JsonObject:
    """Turn diagnoses into one object per model (``by_model``), with the closest model's object at the top level too.

    Numbers that are not finite become null.
    """
    by_model = {name: _diagnosis(diagnosis) for name, diagnosis in diagnoses.by_model.items()}
    return {**by_model[diagnoses.closest.model], "by_model": by_model}


def _diagnosis(diagnosis: Diagnosis) -> JsonObject:
    amplitude = {name: _amplitude(diagnosis.amplitude[name]) for name in diagnosis.verdict.names}
    return plain(
        {
            "model": diagnosis.model,
            "verdict": _verdict(diagnosis),
            "inclusion": diagnosis.verdict.inclusion,
            "probability": diagnosis.verdict.probability,
            "amplitude": amplitude,
            "landmark_sizes": diagnosis.landmark_sizes,
            "budget": [_step(one) for one in diagnosis.budget],
            "left_over_share": diagnosis.left_over_share,
            "gap_deg": _gaps(diagnosis.gaps),
            "where": diagnosis.where.cells,
            "where_by": diagnosis.where.profile,
            "constraints": diagnosis.where.constraints,
            "constraint_spread": diagnosis.where.constraint_spread,
            "parameters": diagnosis.parameters,
            "indistinguishable": diagnosis.indistinguishable,
            "lacking": diagnosis.lacking,
            "next_measurement": diagnosis.next_measurement,
            "measure_next": measure_next(diagnosis),
            "noise": diagnosis.noise,
            "positions": _positions(diagnosis.positions),
            "expected": diagnosis.declared_effects,
            "axial_is_computed": diagnosis.axial_is_computed,
            "subjects": diagnosis.subjects,
            "left_out": diagnosis.left_out,
            "landmark_outliers": diagnosis.outliers,
            "persons": diagnosis.persons,
            "kinds": diagnosis.kinds,
            "postures": diagnosis.postures,
            "searched_postures": diagnosis.searched_postures,
            "highest_elevation_deg": diagnosis.highest_elevation_deg,
            "options": [one["option"] for one in amplitude.values() if one["option"]],
        }
    )


def _verdict(diagnosis: Diagnosis) -> JsonObject:
    """Lay out a verdict: ``effects`` has the first name of each cause; ``shares`` to ``tested_on`` have one entry per
    cause."""
    causes = diagnosis.verdict.causes
    return {
        "answer": diagnosis.verdict.answer,
        "causes": [one.names for one in causes],
        "effects": [one.names[0] for one in causes],
        "sentence": sentence(diagnosis),
        "shares": [one.shares for one in causes],
        "gain": [one.gain for one in causes],
        "t": [one.t for one in causes],
        "tested_on": [one.tested_on for one in causes],
        "not_named": dict(diagnosis.verdict.not_named),
    }


def _amplitude(amplitude: CauseAmplitude) -> JsonObject:
    return {
        "what": amplitude.what,
        "basis": amplitude.basis,
        "unit": amplitude.unit,
        **amplitude.size._asdict(),
        "typical": amplitude.typical,
        "too_large": amplitude.too_large,
        "directions": amplitude.directions,
        "option": amplitude.option,
        "by_subject": amplitude.by_subject,
        "extent": amplitude.extent,
    }


def _step(step: Step) -> JsonObject:
    return {"step": step.step, "gap_deg": step.gap_deg.value, "low": step.gap_deg.low, "high": step.gap_deg.high}


def _gaps(gaps: Gaps) -> JsonObject:
    """Lay out the gaps by held-out data, those of postures at the top level too; ``shrinkage`` is of the hardest."""
    postures = plain(gaps.other_postures)
    return {
        **postures,
        "in_sample": plain(gaps.in_sample),
        "postures": postures,
        "other_motion": plain(gaps.other_motion),
        "other_person": plain(gaps.other_person),
        "held_out": _POSTURES,
        "shrinkage": gaps.shrinkage,
    }


def _positions(positions: Positions) -> JsonObject:
    nothing = dict.fromkeys(positions.in_sample)
    kinds = ("in_sample", "other_motion", "other_person")
    return {
        "used": positions.used,
        "note": positions.note,
        "noise_mm": positions.noise_mm,
        "gap_mm": {kind: getattr(positions, kind) or nothing for kind in kinds},
        "not_told": positions.not_told,
    }


def plain(value: Any) -> Any:
    """Turn a value into the types of JSON; numbers that are not finite become None."""
    if type(value) in (int, str):  # these and float, below, come first: a report has a million values
        return value
    if type(value) is float:
        return value if math.isfinite(value) else None
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain(value._asdict())  # pyright: ignore[reportAttributeAccessIssue]
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
