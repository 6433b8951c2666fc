"""The contract of diagnosis.json, in strict JSON, for every kind of answer."""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnoses import (
    ALL_AND_BONES,
    ANSWERS,
    BLIND,
    BY_KIND,
    CAUSES,
    LONE,
    NOTHING,
    ONE,
    TWO,
    alone,
    cause,
    gap_of,
    json_of,
)

from adapt.diagnosis.inference.amplitude import amplitude_without_size
from adapt.diagnosis.result import ADAPTED_STEP, BASE, EFFECT, NOISE, NONE, OWN_BONES, UNKNOWN, Diagnoses, Noise
from adapt.diagnosis.texts.json_form import as_json
from models.adapted_parameters import ADAPTED
from models.effects import EFFECTS

KEYS = {
    *("model", "verdict", "inclusion", "probability", "amplitude", "budget", "left_over_share", "gap_deg"),
    *("where", "where_by", "constraints", "parameters", "indistinguishable", "next_measurement", "noise"),
    *("expected", "axial_is_computed", "subjects", "left_out", "postures", "highest_elevation_deg", "options"),
}
"""Keys of the contract, on which scripts of users rely."""

INTERVAL = {"value", "low", "high"}
KINDS = ("noise_floor", "base", "adapted", "own_bones", "with_effect")
AMPLITUDE = {*INTERVAL, "what", "basis", "unit", "typical", "too_large", "directions", "option", "by_subject", "extent"}


def numbers(object: Mapping[str, Any], keys: set[str]) -> bool:
    return set(object) == keys and all(isinstance(value, (float, type(None))) for value in object.values())


def assert_contract(found: Mapping[str, Any]) -> None:
    """Check every key of one model's object, with the right types."""
    assert set(found) >= KEYS
    verdict = found["verdict"]
    assert set(verdict) >= {"answer", "causes", "effects", "sentence"}
    assert verdict["answer"] in (NONE, EFFECT, UNKNOWN)
    assert verdict["effects"] == [names[0] for names in verdict["causes"]] == list(found["amplitude"])
    assert len(verdict["sentence"].split()) <= 30
    assert all(len(verdict[key]) == len(verdict["causes"]) for key in ("shares", "gain", "t"))
    assert set(found["inclusion"]) == set(CAUSES)
    assert set(found["probability"]) == ANSWERS
    assert abs(sum(found["probability"].values()) - 1.0) <= 1e-9
    for amplitude in found["amplitude"].values():
        assert set(amplitude) == AMPLITUDE
        assert numbers({key: amplitude[key] for key in INTERVAL}, INTERVAL)
        assert all(numbers(one, INTERVAL) for one in amplitude["directions"].values())
    assert [one["option"] for one in found["amplitude"].values() if one["option"]] == found["options"]
    sized = [name for name, one in found["amplitude"].items() if one["option"]]
    assert [one["step"] for one in found["budget"]] == [BASE, ADAPTED_STEP, OWN_BONES, *sized, NOISE]
    assert all(set(one) == {"step", "gap_deg", "low", "high"} for one in found["budget"])
    gap = found["gap_deg"]
    parts = {"in_sample", "postures", "other_motion", "other_person"}
    assert set(gap) == {*KINDS, *parts, "held_out", "shrinkage"}
    assert {kind: gap[kind] for kind in KINDS} == gap["postures"]
    for levels in filter(None, (gap[part] for part in parts)):
        assert set(levels) == set(KINDS)
        assert all(numbers(levels[kind][bone], INTERVAL) for kind in KINDS for bone in ALL_AND_BONES)
    shares = [cell["share"] for cell in found["where"]]
    assert shares == sorted(shares, reverse=True)
    assert set(found["parameters"]) == set(ADAPTED)
    assert all(len(group) > 1 for group in found["indistinguishable"])
    proposal = {"what", "between", "separation_now", "separation_then", "apart_deg"}
    assert all(set(one) == proposal for one in found["next_measurement"])
    choice = {"what", "how_many", "how", "gain", "gain_deg"}
    assert [set(one) for one in found["measure_next"]] == [choice, choice]
    assert set(found["noise"]) == {"angle_deg", "source", "freedom"}
    assert isinstance(found["axial_is_computed"], bool)


@pytest.mark.parametrize("diagnosis", BY_KIND.values(), ids=BY_KIND)
def test_every_kind_of_answer_keeps_the_contract_in_strict_json(diagnosis):
    found = json_of(diagnosis)
    assert_contract(found)
    assert_contract(found["by_model"]["R2"])
    assert json.loads(json.dumps(found, allow_nan=False)) == found, "plain JSON types"


def test_the_top_level_is_the_model_with_the_smallest_held_out_adapted_gap():
    """Check that neither the gap in sample, nor the gap with causes, nor a gap of NaN decides."""
    best_in_sample = replace(ONE, model="R6", gaps=replace(gap_of(3.0, 0.1), in_sample=gap_of(0.5, 0.1).in_sample))
    nothing = replace(ONE, model="R4", gaps=gap_of(math.nan, math.nan))
    found = as_json(Diagnoses({"R4": nothing, "R6": best_in_sample, "R2": ONE}))
    assert list(found["by_model"]) == ["R4", "R6", "R2"]
    assert found["model"] == "R2"
    assert {key: value for key, value in found.items() if key != "by_model"} == found["by_model"]["R2"]
    assert as_json(Diagnoses({"R4": nothing, "R6": best_in_sample}))["model"] == "R6"
    assert as_json(alone(nothing))["gap_deg"]["adapted"]["all"] == dict.fromkeys(INTERVAL)


def test_causes_that_cannot_be_told_apart_stand_together():
    found = json_of(TWO)
    assert found["verdict"]["causes"] == [["ac_translation", "conoid_strain"], ["scapulothoracic_gap"]]
    assert found["verdict"]["gain"] == [0.5, 0.3]
    assert [one["too_large"] for one in found["amplitude"].values()] == [False, True]
    assert found["budget"][3] == pytest.approx({"gap_deg": 1.4, "low": 1.3, "high": 1.5} | {"step": "ac_translation"})


def test_a_cause_that_no_gap_shows_has_no_size():
    estimate = amplitude_without_size(EFFECTS["clavicle_axial_estimate"])
    causes = (*ONE.verdict.causes, cause("clavicle_axial_estimate"))
    amplitude = ONE.amplitude | {"clavicle_axial_estimate": estimate}
    found = json_of(replace(ONE, verdict=replace(ONE.verdict, causes=causes), amplitude=amplitude))
    assert found["verdict"]["effects"] == ["scapula_landmark_bias", "clavicle_axial_estimate"]
    assert found["options"] == ["scapula_landmark_bias=7,0,0"]
    assert_contract(found)


def test_what_was_not_held_out_is_null():
    assert json_of(NOTHING)["gap_deg"]["other_person"] is None
    gap = json_of(LONE)["gap_deg"]
    assert (gap["other_motion"], gap["other_person"]) == (None, None)


def test_what_is_not_finite_is_null_and_numpy_numbers_are_plain():
    inclusion = {name: np.float64(p) for name, p in ONE.verdict.inclusion.items()}
    noise = Noise(1.5, "given", math.inf)
    found = json_of(replace(BLIND, noise=noise, verdict=replace(BLIND.verdict, inclusion=inclusion)))
    assert found["noise"]["freedom"] is None
    assert found["left_over_share"] is None
    assert found["gap_deg"]["shrinkage"] is None
    assert found["budget"][0] == {"step": BASE, "gap_deg": None, "low": None, "high": None}
    assert json.loads(json.dumps(found, allow_nan=False))["inclusion"]["scapula_landmark_bias"] == 0.97


def test_shrinkage_is_that_of_the_gap_of_which_most_was_held_out():
    assert json_of(ONE)["gap_deg"]["shrinkage"] == pytest.approx((2.8 - 0.9) / 2.8)
    assert json_of(LONE)["gap_deg"]["shrinkage"] == pytest.approx((2.6 - 0.7) / 2.6)
    assert json_of(NOTHING)["gap_deg"]["shrinkage"] == 0.0
