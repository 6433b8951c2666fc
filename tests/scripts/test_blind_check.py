"""The withheld-effect check: its statistics by hand, its resumption, its fits, and one case from world to line."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import typer

from adapt.diagnosis.inference import verdict
from models.effects import EFFECTS
from scripts import blind_check
from scripts.blind import calibration, report
from scripts.blind.cases import (
    CALIBRATION_SEEDS,
    CONDITIONS,
    MODELS,
    MOST_SEEDS,
    NONE_WORLDS,
    REPORTED_SEEDS,
    Case,
    plan,
    world_of,
)
from scripts.blind.lines import true_channels
from scripts.blind.runs import Line, append_lines, key, missing, read_lines, run_missing

TRUE, OTHER, THIRD = "conoid_strain", "ac_translation", "thorax_tilt"


GAPS = {
    "gap_deg": {"adapted": {"value": 2.0}, "with_effect": {"value": 1.5}},
    "other_motion_deg": {"adapted": {"value": 2.0}, "with_effect": {"value": 1.0}},
}
"""Predicted, from postures and from a motion held out."""


def line(label: str, answer: str, *effects: str, **more: Any) -> Line:
    """A finished case by hand; sure of its answer unless told otherwise."""
    sure = effects[0] if effects else answer
    return {
        **asdict(Case("standard", label, 0)),
        "model": "R2",
        "code": "0",
        "answer": answer,
        "effects": list(effects),
        "together": False,
        "best": list(effects[:1]),
        "probability": {**dict.fromkeys([*EFFECTS, "none", "unknown"], 0.0), sure: 1.0},
        "indistinguishable": [],
        "seconds": 1.0,
        **more,
    }


# Statistics ---------------------------------------------------------------------------------------------------------


def test_wilson_interval_by_hand() -> None:
    # 8 of 10: (0.8 + 0.19208 -+ 1.96 sqrt(0.016 + 0.009604)) / 1.38416
    assert report.wilson(8, 10) == pytest.approx((0.4901625, 0.9433178), abs=1e-5)
    assert report.wilson(0, 10) == pytest.approx((0.0, 3.8416 / 13.8416))
    assert report.rate([True] * 8 + [False] * 2) == "80.0 % (49-94; 10)"
    assert report.rate([]) == "-"


def test_calibration_error_by_hand() -> None:
    # bin 9: 4 cases, mean 0.95, 3 right: 0.2; bin 5: 2 cases, mean 0.55, none right: 0.55; bin 2: 0.25, right: 0.75
    confidence = [0.92, 0.94, 0.96, 0.98, 0.54, 0.56, 0.25]
    right = [True, True, True, False, False, False, True]
    expected = (4 * 0.2 + 2 * 0.55 + 0.75) / 7
    assert report.expected_calibration_error(confidence, right) == pytest.approx(expected)
    assert report.expected_calibration_error([1.0, 1.0], [True, True]) == 0.0


def test_calibration_error_by_chance_by_hand() -> None:
    # One case of 0.8: off by 0.2 in 0.8 of the draws, by 0.8 in the others. An SD of a draw is 0.24.
    assert report.error_by_chance([0.8]) == pytest.approx(0.32, abs=4 * 0.24 / 1000**0.5)
    assert report.error_by_chance([1.0, 0.0]) == 0.0


def test_log_score_by_hand() -> None:
    probability = {TRUE: 0.5, "none": 0.25, "unknown": 0.25}
    lines = [line(label, "none", probability=probability) for label in (TRUE, "none", "outside_drift")]
    assert report.log_score(lines) == f"{-5.0 * math.log(2.0) / 3.0:.2f} (3)"
    impossible = line(TRUE, "none", probability=probability | {TRUE: 0.0})
    assert report.log_score([impossible]) == f"{math.log(1e-6):.2f} (1)"
    assert report.log_score([]) == "-"


def test_an_answer_covers_with_any_name_and_is_confidently_wrong_with_one() -> None:
    right, hedged = line(TRUE, "effect", TRUE), line(TRUE, "effect", OTHER, TRUE)
    wrong, wrong_set = line(TRUE, "effect", OTHER), line(TRUE, "effect", OTHER, THIRD)
    wrong_pair, half_pair = (line(TRUE, "effect", OTHER, x, together=True) for x in (THIRD, TRUE))
    silent = line(TRUE, "none"), line(TRUE, "unknown")
    cases = [right, hedged, wrong, wrong_set, wrong_pair, half_pair, *silent]
    assert [report.covered(x) for x in cases] == [True, True, False, False, False, True, False, False]
    assert [report.confidently_wrong(x) for x in cases] == [False, False, True, False, True, False, False, False]
    names = [TRUE, OTHER, OTHER, OTHER, OTHER, OTHER, "none", "unknown"]
    assert [report.first(x) for x in cases] == names


def test_outside_effects_are_right_as_unknown_and_any_single_name_is_wrong() -> None:
    known, blamed = line("outside_drift", "unknown"), line("outside_drift", "effect", OTHER)
    assert report.surest(known) == (1.0, True)
    assert report.surest(blamed) == (1.0, False)
    assert report.confidently_wrong(blamed)
    # an unknown answer may name what explains a part: that blames nothing
    partly = line("outside_drift", "unknown", OTHER)
    assert (report.first(partly), report.confidently_wrong(partly)) == ("unknown", False)
    assert not report.covered(line(TRUE, "unknown", TRUE))
    assert not report.confidently_wrong(line("outside_drift", "effect", OTHER, THIRD))


def test_the_most_probable_effect_counts_whatever_the_answer() -> None:
    doubtful = line(TRUE, "none", probability={"none": 0.7, TRUE: 0.2, OTHER: 0.1, "unknown": 0.0})
    assert report.most_probable_effect(doubtful) == TRUE
    assert report.surest(doubtful) == (0.7, False)


def test_intervals_count_where_the_effect_is_named_and_its_truth_known() -> None:
    channels = [{"channel": "TS", "low": 0.0, "high": 2.0}, {"channel": "AI", "low": 0.0, "high": 2.0}]
    both = {"amplitude": {TRUE: channels}, "true_channels": {TRUE: {"TS": 1.0, "AI": 3.0}}}
    unknown = {"amplitude": {TRUE: channels}, "true_channels": {}}
    lines = [line(TRUE, "effect", TRUE, **both), line(TRUE, "effect", OTHER, **both), line(TRUE, "unknown", **both)]
    assert report.intervals_that_cover([*lines, line(TRUE, "effect", TRUE, **unknown)]) == [True, False]


def test_shrinkage_predicted_and_realised() -> None:
    seen = line(TRUE, "effect", TRUE, **GAPS, realised_deg={"adapted": 1.0, "with_effect": 0.7})
    assert report.shrinkages([seen, line(TRUE, "none")]) == [pytest.approx((0.25, 0.3))]
    table = report.measure_table({"standard": [seen | {"amplitude": {TRUE: []}, "true_channels": {}}]})
    assert "| median error of the predicted shrinkage |  | 5.0 points (1) |" in table
    assert "| the same, of a motion held out |  | 20.0 points (1) |" in table
    assert "| shrinkage within 10 points of the realised |  | 100.0 % (21-100; 1) |" in table
    assert "| shrinkage within 10 % of the realised | all | 0.0 % (0-79; 1) |" in table


def test_a_left_out_effect_may_be_mimicked_only_by_what_was_alike_before() -> None:
    like = report.mimics([line(TRUE, "effect", TRUE, indistinguishable=[[OTHER, TRUE]])])
    outcomes = [
        (line(TRUE, "unknown"), "unknown"),
        (line(TRUE, "none"), "none"),
        (line(TRUE, "effect", OTHER), "honest mimic"),
        (line(TRUE, "effect", THIRD), "confident wrong name"),
        (line(TRUE, "effect", THIRD, "skin_artefact"), "wrong set"),
        (line(TRUE, "effect", OTHER, seed=1), "a name; not judged, `standard` not run"),
    ]
    for case, expected in outcomes:
        assert report.left_out_outcome(case, like) == expected


def test_a_wrong_name_is_held_against_the_right_one_on_the_motion_that_nobody_saw() -> None:
    def gaps(with_effect: float) -> dict[str, float]:
        return {"adapted": 2.0, "with_effect": with_effect}

    whole = [
        line(TRUE, "effect", TRUE, realised_deg=gaps(1.5)),
        line(TRUE, "effect", TRUE, seed=1, realised_deg=gaps(1.2)),
        line(OTHER, "effect", THIRD, OTHER, realised_deg=gaps(1.0)),
        line(THIRD, "none"),
    ]
    left_out = [
        line(TRUE, "effect", OTHER, realised_deg=gaps(1.4)),
        line(TRUE, "effect", OTHER, seed=1, realised_deg=gaps(1.8)),
        line(OTHER, "effect", THIRD, realised_deg=gaps(1.0)),
        line(THIRD, "unknown"),
    ]
    found = report.mimicry(left_out, whole)
    np.testing.assert_array_equal(found, [[2.0, 1.5, 1.4], [2.0, 1.2, 1.8]])
    assert report.mimicry(left_out, []).shape == (0, 3)
    table = report.mimicry_table([*left_out[:1], left_out[1] | {"effects": [OTHER, THIRD]}], whole)
    assert "| gap on a motion that nobody saw, deg | a wrong name (2) | a confident one (1) |" in table
    assert "| with the effect at work, mean | 1.350 | 1.500 |" in table
    assert "| with what was named in its place, mean | 1.600 | 1.400 |" in table
    assert "| more than with the effect at work, median | 0.250 | -0.100 |" in table
    assert "| more than with the effect at work, most | 0.600 | -0.100 |" in table


def test_pairs_are_named_in_part_or_whole() -> None:
    label = f"{TRUE}+{OTHER}"
    answers = [(TRUE, OTHER), (OTHER, THIRD), (OTHER,), (THIRD,)]
    expected = ["both named", "one named", "one named", "wrong"]
    assert [report.pair_outcome(line(label, "effect", *x)) for x in answers] == expected
    assert report.pair_outcome(line(label, "unknown")) == "unknown"


def test_confusions_tell_beside_from_instead() -> None:
    lines = [
        *[line(TRUE, "effect", TRUE, OTHER)] * 2,
        line(TRUE, "effect", OTHER),
        line(OTHER, "effect", THIRD),
        line("outside_drift", "effect", THIRD),
        line(THIRD, "none"),
    ]
    assert report.confusions(lines) == [(TRUE, OTHER, 2, 1), (OTHER, THIRD, 0, 1)]


def test_the_report_has_every_part_and_says_that_it_is_simulated() -> None:
    more = {"amplitude": {}, "true_channels": {}}
    names = list(EFFECTS)
    lines = [
        line(TRUE, "effect", TRUE, **more),
        line(TRUE, "effect", OTHER, seed=1, code="1", **more),
        line("none", "none"),
        line("outside_drift", "unknown"),
        line(f"{TRUE}+{OTHER}", "effect", TRUE, OTHER, together=True),
        line(TRUE, "unknown", condition="loo"),
        line(TRUE, "effect", TRUE, condition="power_2", **more),
        {**asdict(Case("half", THIRD, 0)), "model": "R2", "code": "0", "failed": "ValueError: no"},
    ]
    text = report.report(lines)
    assert "Simulated cases: 7, seeds 0 to 1 (2)" in text
    assert "2 states of the code" in text
    assert "- ('half', 'thorax_tilt', 0, 0): ValueError: no" in text
    assert "| true effect in the reported set | >= 97 % | 50.0 % (9-91; 2) |" in text
    assert "| both named | 100.0 % (21-100; 1) |" in text
    assert "| unknown | 100.0 % (21-100; 1) |" in text
    assert report.MIMICRY not in text
    row = [""] * (len(names) + 2)
    row[names.index(TRUE)] = row[names.index(OTHER)] = "1"
    assert f"| {names.index(TRUE) + 1} {TRUE} | {' | '.join(row)} |" in text
    power = "| conoid_strain | - | - | 50.0 % (9-91; 2) | - | 100.0 % (21-100; 1) |"
    assert power in text
    assert "| conoid_strain - ac_translation | 0 | 1 |" in text
    assert report.report([]) == "No finished case among those asked for."


def test_the_report_has_the_mimics_where_there_are_any() -> None:
    seen = {"amplitude": {TRUE: []}, "true_channels": {}, **GAPS}
    lines = [
        line(TRUE, "effect", TRUE, realised_deg={"adapted": 2.0, "with_effect": 0.9}, **seen),
        line(TRUE, "effect", OTHER, condition="loo", realised_deg={"adapted": 2.0, "with_effect": 1.0}),
    ]
    text = report.report(lines)
    assert "| confident wrong name | 100.0 % (21-100; 1) |" in text
    assert f"| {report.MIMICRY} | a wrong name (1) | a confident one (1) |" in text
    assert "| with what was named in its place, mean | 1.000 | 1.000 |" in text


def test_every_reach_is_of_a_measure() -> None:
    assert report.REACH.keys() <= report.MEASURES.keys()


# The plan and its file ----------------------------------------------------------------------------------------------


def test_reported_and_calibration_seeds_share_nothing() -> None:
    assert not set(REPORTED_SEEDS) & set(CALIBRATION_SEEDS)
    assert REPORTED_SEEDS.stop < MOST_SEEDS


def test_the_plan_has_each_case_once_and_every_label_with_more_of_none() -> None:
    cases = plan(list(CONDITIONS), [0, 1])
    assert len({key(asdict(case)) for case in cases}) == len(cases)
    standard = [case.label for case in cases if case.condition == "standard" and case.seed == 0]
    assert len(standard) == NONE_WORLDS + 13 + 9 + 12
    assert {case.label for case in plan(["standard"], [0], ["none", TRUE])} == {"none", TRUE}
    assert {case.model for case in plan(["one"], range(4))} == set(MODELS)


def test_the_left_out_effect_is_in_the_data_of_the_standard_condition() -> None:
    first, second = (world_of(Case(c, OTHER, 3)).table for c in ("standard", "loo"))
    pd.testing.assert_frame_equal(first, second, check_exact=True)
    none, again = (world_of(Case("three", "none", 3, repeat)).table for repeat in (0, 1))
    assert not np.allclose(none["scapula_x_deg"], again["scapula_x_deg"])


def test_a_rerun_skips_what_is_done_and_forgets_a_broken_last_line(tmp_path: Path) -> None:
    path = tmp_path / "out" / "cases.jsonl"
    cases = plan(["one"], [0], [TRUE, OTHER, THIRD])
    done, failed = line(TRUE, "none", condition="one"), {**asdict(cases[1]), "failed": "ValueError: no"}
    failed["label"] = OTHER
    seen: list[str] = []
    append_lines(path, iter([done, failed]), lambda x: seen.append(x["label"]))
    with path.open("a") as file:
        file.write(json.dumps(line(THIRD, "none", condition="one"))[:40])
    assert seen == [TRUE, OTHER]
    assert [x["label"] for x in read_lines(path)] == [TRUE, OTHER]
    assert {case.label for case in missing(cases, read_lines(path))} == {OTHER, THIRD}
    append_lines(path, iter([line(OTHER, "none", condition="one")]), lambda x: None)
    assert [(x["label"], "failed" in x) for x in read_lines(path)] == [(TRUE, False), (OTHER, False)]
    assert len(path.read_text().splitlines()) == 3
    assert {case.label for case in missing(cases, read_lines(path))} == {THIRD}


def test_a_case_that_raises_is_recorded_and_stops_no_other(tmp_path: Path) -> None:
    def examined(case: Case, fits: Path | None) -> Line:
        if case.label == OTHER:
            raise ValueError("no such shoulder")
        return {"answer": "none", "excess": math.inf}

    path, cases = tmp_path / "cases.jsonl", plan(["one"], [0], [TRUE, OTHER, THIRD])
    run_missing(path, cases, 1, examined)
    found = {x["label"]: x for x in read_lines(path)}
    assert found[OTHER]["failed"] == "ValueError: no such shoulder"
    assert found[TRUE]["answer"] == found[THIRD]["answer"] == "none"
    assert found[TRUE]["excess"] is None
    assert all(x["origin"] == "simulated" for x in found.values())


@pytest.mark.parametrize(
    ("wrong", "cause"),
    [
        ({"seeds": "5:5"}, "'5:5' is no range of seeds"),
        ({"condition": ["fog"]}, "no condition is called 'fog'"),
        ({"labels": ["flat_feet"]}, "no case has such a label"),
        ({"calibrate": True, "seeds": "100000:100012"}, "thresholds are fitted on seeds below 100000 alone"),
    ],
)
def test_wrong_requests_say_what_is_wrong(tmp_path: Path, wrong: dict[str, Any], cause: str) -> None:
    with pytest.raises(typer.BadParameter, match=cause):
        blind_check.main(tmp_path, **wrong)


def test_power_means_its_three_sizes() -> None:
    assert blind_check._conditions(["power", "one"]) == ["one", "power_0.25", "power_1.5", "power_2"]


# The truth ----------------------------------------------------------------------------------------------------------


def test_true_channels_are_means_at_full_elevation() -> None:
    drawn = {"factor_by_motion": {"abduction": 1.0, "forward_flexion": 1.1, "scapular_plane": 9.0}}
    amplitude = {"a": 2.0, "b": 4.0, "c": 100.0}
    conoid = true_channels(TRUE, {"amplitude": amplitude, "parameters": drawn}, ("a", "b"))
    assert conoid == pytest.approx([3.0 * 1.05])
    turns = {"direction_by_subject": [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]]}
    tilt = true_channels(THIRD, {"amplitude": amplitude, "parameters": turns}, ("a", "b"))
    assert tilt == pytest.approx([1.0, 1.2, 1.6])
    gap = {"ts_fraction_by_subject": [0.5, -0.5, 0.0]}
    both = true_channels("scapulothoracic_gap", {"amplitude": amplitude, "parameters": gap}, ("a", "b"))
    assert both == pytest.approx([-0.5, 3.0])
    assert not len(true_channels("skin_artefact", {"amplitude": amplitude, "parameters": {}}, ("a",)))


# Calibration --------------------------------------------------------------------------------------------------------


def test_logistic_regression_recovers_its_coefficients() -> None:
    rng = np.random.default_rng(0)
    terms = (-1.0, 0.4, 0.8)
    x = np.column_stack([rng.uniform(-10.0, 10.0, 40_000), rng.uniform(-5.0, 5.0, 40_000)])
    hit = rng.random(40_000) < 1.0 / (1.0 + np.exp(-terms[0] - x @ np.array(terms[1:])))
    # SDs of the estimates are below 0.02
    assert calibration.weights_of_tests(x, hit) == pytest.approx(terms, abs=0.08)


def test_separated_classes_have_finite_terms() -> None:
    x = np.array([[-9.0, -1.0], [-8.0, 0.0], [7.0, 2.0], [9.0, 4.0]])
    weights = calibration.weights_of_tests(x, np.array([False, False, True, True]))
    assert np.isfinite(weights).all()
    assert calibration.unknown(x, weights).tolist() == [False, False, True, True]


def calibration_lines(temperature: float, n: int) -> list[Line]:
    """Cases whose truth is drawn from the tempered evidence; outside ones lie at large gains."""
    rng, names = np.random.default_rng(1), ["none", *EFFECTS]
    log = rng.normal(0.0, 6.0, (n, len(names)))
    log_prior = np.log([verdict._NONE_PRIOR, *[(1.0 - verdict._NONE_PRIOR) / len(EFFECTS)] * len(EFFECTS)])
    probabilities = calibration.tempered(log, log_prior, temperature)
    truth = [names[rng.choice(len(names), p=p)] for p in probabilities]
    low = [{"discrepancy_gain": g, "excess": 0.0} for g in rng.normal(-30.0, 1.0, n)]
    listed = [_ranked(a, dict(zip(names, b, strict=True)), c) for a, b, c in zip(truth, log, low, strict=True)]
    high = [{"discrepancy_gain": g, "excess": 2.0} for g in rng.normal(30.0, 1.0, n // 4)]
    return [*listed, *(_ranked("outside_drift", dict.fromkeys(names, 0.0), x) for x in high)]


def _ranked(label: str, ranking: dict[str, float], tests: dict[str, float]) -> Line:
    return line(label, "none", ranking=ranking, **tests, tests={**tests, "doubts": [0.0, 0.0]})


def test_calibration_recovers_the_temperature_and_prints_what_follows() -> None:
    lines = calibration_lines(2.5, 3000)
    text = calibration.calibration([*lines, *(x | {"condition": "loo"} for x in lines[:100])])
    assert "From 3750 simulated cases, seeds 0 to 0, of which 750 outside" in text
    fitted = next(row for row in text.splitlines() if row.startswith("| temperature"))
    assert float(fitted.split("|")[3]) == pytest.approx(2.5, rel=0.06)
    assert "| outside | 100.0 % (99-100; 750) |" in text
    nones = sum(x["label"] == "none" for x in lines)
    kept = next(row for row in text.splitlines() if row.startswith("| 0.5 |"))
    assert f"; {nones}) |" in kept
    assert calibration.calibration(lines[:3000]).startswith("No calibration")


def test_thresholds_by_hand() -> None:
    probabilities = np.array([[0.3, 0.5, 0.2], [0.1, 0.6, 0.3], [0.04, 0.24, 0.72]])
    truth, known = np.array([0, 1, 1]), np.array([True, True, False])
    rows = {row[0]: row[1:] for row in calibration.none_rows(probabilities, truth, known)}
    assert rows["0.4"] == [report.rate([True]), report.rate([False, False])]
    assert rows["0.25"] == [report.rate([False]), report.rate([False, False])]
    assert rows["0.05"] == [report.rate([False]), report.rate([True, False])]
    sets = {row[0]: row[1:] for row in calibration.set_rows(probabilities, truth)}
    # without none: (2/3, 1/3) and (1/4, 3/4), the second effect first in the last
    assert sets["0.8"] == [report.rate([True, True]), "2.00"]
    assert _sets_at(probabilities, truth, 0.7) == [report.rate([True, False]), "1.50"]


def _sets_at(probabilities: np.ndarray, truth: np.ndarray, held: float) -> Sequence[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "SET_PROBABILITY", (held,))
        return calibration.set_rows(probabilities, truth)[0][1:]


# One case -----------------------------------------------------------------------------------------------------------


def test_one_case_from_its_world_to_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    label = "scapula_landmark_bias"
    # two effects: the whole library would compile for a minute
    monkeypatch.setattr(blind_check, "EFFECTS", {name: EFFECTS[name] for name in (TRUE, label)})
    monkeypatch.setitem(CONDITIONS, "standard", replace(CONDITIONS["standard"], subjects=3))
    asked: dict[str, Any] = {"condition": ["standard"], "seeds": "1:2", "labels": [label], "jobs": 1}
    blind_check.main(tmp_path, **asked, keep_fits=True)
    printed = capsys.readouterr().out
    (found,) = read_lines(tmp_path / "cases.jsonl")
    assert "failed" not in found
    assert (found["model"], found["origin"], len(found["subjects"])) == ("R4", "simulated", 3)
    assert found["effects"] == [label]
    assert sum(found["probability"].values()) == pytest.approx(1.0)
    assert set(found["ranking"]) == {"none", TRUE, label}
    world = world_of(Case("standard", label, 1))
    truth = world.truth["effects"][label]
    directions = np.array(truth["parameters"]["direction_by_subject"])
    true = (np.array(list(truth["amplitude"].values()))[:, None] * directions).mean(axis=0)
    channels = found["amplitude"][label]
    assert list(found["true_channels"][label].values()) == pytest.approx(true)
    for channel, value in zip(channels, true, strict=True):
        assert channel["value"] == pytest.approx(value, abs=4.0)
    realised = found["realised_deg"]
    assert realised["with_effect"] < realised["adapted"]
    assert "Simulated cases: 1, seeds 1 to 1 (1)" in printed
    # done is done: nothing is diagnosed again
    monkeypatch.setattr(blind_check, "examine", lambda case, fits: pytest.fail("ran again"))
    blind_check.main(tmp_path, **asked)
    assert capsys.readouterr().out == printed
    # the fits that were kept are weighed alike, and otherwise by other code
    blind_check.main(tmp_path, **asked, weigh_kept=True)
    (weighed,) = read_lines(tmp_path / "weighed.jsonl")
    assert (weighed["answer"], weighed["effects"]) == (found["answer"], found["effects"])
    assert weighed["probability"] == pytest.approx(found["probability"], abs=1e-9)  # the spread chosen rounds a digit
    monkeypatch.setattr(verdict, "UNKNOWN_FROM", 0.0)
    blind_check.main(tmp_path, **asked, weigh_kept=True)
    assert read_lines(tmp_path / "weighed.jsonl")[0]["answer"] == "unknown"
