"""The withheld-effect check: statistics against hand computation, resumption, seeds, one case from world to line."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import typer

from adapt.diagnosis.result import ALL, Cause, Interval, Noise, Verdict
from models import ParameterSet
from models.effects import EFFECTS, Effect
from motions import Motions
from scripts.research.named_causes import blind_check
from scripts.research.named_causes.blind import report
from scripts.research.named_causes.blind.cases import (
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
from scripts.research.named_causes.blind.lines import line_of, true_directions
from scripts.research.named_causes.blind.runs import Line, append_lines, key, missing, read_lines, run_missing

TRUE, OTHER, THIRD = "conoid_strain", "ac_translation", "thorax_tilt"


GAPS = {
    "unseen_deg": {"adapted": {"value": 2.0}, "with_effect": {"value": 1.5}},
    "other_motion_deg": {"adapted": {"value": 2.0}, "with_effect": {"value": 1.0}},
}
"""Predicted gaps, from held-out postures and from a held-out motion."""

REALISED = {"adapted": 1.0, "with_effect": 0.6}


def line(label: str, answer: str, *names: str, **more: Any) -> Line:
    """Make the line of a finished case with one cause of these names, whose first one has probability 1 by default."""
    sure = names[0] if names else answer
    return {
        **asdict(Case("standard", label, 0)),
        "model": "R2",
        "code": "0",
        "answer": answer,
        "causes": [list(names)] if names else [],
        "probability": {**dict.fromkeys([*EFFECTS, "none", "unknown"], 0.0), sure: 1.0},
        "inclusion": {name: float(name in names) for name in report.CAUSES},
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


def test_what_is_surely_at_work_is_counted_by_candidate() -> None:
    lines = [line(TRUE, "effect", TRUE), line(TRUE, "effect", OTHER), line("none", "none")]
    assert report.surely_at_work(lines).startswith("50.0 %")
    wrong, every = 2, 3 * len(report.CAUSES)  # OTHER has probability 1 and is not active, TRUE has 0 and is active
    assert report.calibration(lines).startswith(f"{wrong / every:.3f} (0.000 by chance; {every})")


def test_calibration_error_by_hand() -> None:
    # bin 9: 4 cases, mean 0.95, 3 right: 0.2; bin 5: 2 cases, mean 0.55, none right: 0.55; bin 2: 0.25, right: 0.75
    confidence = [0.92, 0.94, 0.96, 0.98, 0.54, 0.56, 0.25]
    right = [True, True, True, False, False, False, True]
    expected = (4 * 0.2 + 2 * 0.55 + 0.75) / 7
    assert report.expected_calibration_error(confidence, right) == pytest.approx(expected)
    assert report.expected_calibration_error([1.0, 1.0], [True, True]) == 0.0


def test_calibration_error_by_chance_by_hand() -> None:
    # One case of 0.8: the error is 0.2 in 80 % of the draws and 0.8 in the others, SD 0.24 per draw.
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
    wrong_pair, half_pair = (line(TRUE, "effect", OTHER, causes=[[OTHER], [x]]) for x in (THIRD, TRUE))
    silent = line(TRUE, "none"), line(TRUE, "unknown")
    cases = [right, hedged, wrong, wrong_set, wrong_pair, half_pair, *silent]
    assert [report.covered(x) for x in cases] == [True, True, False, False, False, True, False, False]
    assert [report.confidently_wrong(x) for x in cases] == [False, False, True, False, True, False, False, False]
    names = [TRUE, OTHER, OTHER, OTHER, OTHER, OTHER, "none", "unknown"]
    assert [report.first(x) for x in cases] == names
    assert [report.one_too_many(x) for x in cases] == [False, False, True, True, True, True, False, False]


def test_outside_effects_are_right_as_unknown_and_any_single_name_is_wrong() -> None:
    known, blamed = line("outside_drift", "unknown"), line("outside_drift", "effect", OTHER)
    assert report.surest(known) == (1.0, True)
    assert report.surest(blamed) == (1.0, False)
    assert report.confidently_wrong(blamed)
    # an unknown answer may name the cause of a part of the gap: that blames nothing
    partly = line("outside_drift", "unknown", OTHER)
    assert (report.first(partly), report.confidently_wrong(partly)) == ("unknown", False)
    assert not report.covered(line(TRUE, "unknown", TRUE))
    assert not report.confidently_wrong(line("outside_drift", "effect", OTHER, THIRD))


def test_the_most_probable_effect_counts_whatever_the_answer() -> None:
    doubtful = line(TRUE, "none", probability={"none": 0.7, TRUE: 0.2, OTHER: 0.1, "unknown": 0.0})
    assert report.most_probable_effect(doubtful) == TRUE
    assert report.surest(doubtful) == (0.7, False)


def test_intervals_count_where_the_effect_is_named_and_its_truth_known() -> None:
    directions = {"TS": {"low": 0.0, "high": 2.0}, "AI": {"low": 0.0, "high": 2.0}, "AI, bend": {}}
    both = {"amplitude": {TRUE: directions}, "true_directions": {TRUE: {"TS": 1.0, "AI": 3.0}}}
    unknown = {"amplitude": {TRUE: directions}, "true_directions": {}}
    unseen = {**both, "amplitude": {TRUE: {"TS": {"low": None, "high": None}}}}
    lines = [line(TRUE, "effect", TRUE, **both), line(TRUE, "effect", OTHER, **both), line(TRUE, "unknown", **both)]
    lines += [line(TRUE, "effect", TRUE, **one) for one in (unknown, unseen)]
    assert report.intervals_that_cover(lines) == [True, False]
    # several active causes: only the named ones count
    several = {
        "amplitude": dict.fromkeys((TRUE, OTHER), directions),
        "true_directions": {TRUE: {"TS": 1.0}, THIRD: {"TS": 1.0}},
    }
    assert report.intervals_that_cover([line(f"{TRUE}+{THIRD}", "effect", TRUE, OTHER, **several)]) == [True]


def test_shrinkage_predicted_and_realised() -> None:
    seen = line(TRUE, "effect", TRUE, **GAPS, realised_deg={"adapted": 1.0, "with_effect": 0.7})
    assert report.shrinkages([seen, line(TRUE, "none")]) == [pytest.approx((0.25, 0.3))]
    seen |= {"amplitude": {TRUE: {}}, "true_directions": {}}
    table = report.measure_table({"standard": [seen], "alone_standard": [seen | {"realised_deg": REALISED}]})
    assert f"| {report.SHRINKAGE_ALONE} |  | 15.0, 15.0 points (1) |" in table
    assert "| error of the predicted shrinkage: median, 90 % | <= 2, 5 points | 5.0, 5.0 points (1) |" in table
    assert "| error of the shrinkage predicted of a motion held out |  | 20.0, 20.0 points (1) |" in table


def test_what_could_be_found_stands_beside_what_is() -> None:
    found = line(TRUE, "effect", TRUE, amplitude={TRUE: {}}, true_directions={})
    missed = line(TRUE, "none")
    by_condition = {"half": [found, missed, missed, missed], "alone_half": [found, found, missed, missed]}
    table = report.measure_table(by_condition)
    assert "| measure | aim | half |\n" in table
    assert f"| {report.COULD_BE_FOUND} |  | 50.0 % (15-85; 4) |" in table
    assert f"| {report.LESS_THAN_COULD} | <= 5 points | 25.0 |" in table
    assert f"| {report.LESS_THAN_COULD} | <= 5 points | - |" in report.measure_table({"half": [found]})


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
    table = report.mimicry_table([*left_out[:1], left_out[1] | {"causes": [[OTHER, THIRD]]}], whole)
    assert "| gap on a motion that nobody saw, deg | a wrong name (2) | a confident one (1) |" in table
    assert "| with the effect at work, mean | 1.350 | 1.500 |" in table
    assert "| with what was named in its place, mean | 1.600 | 1.400 |" in table
    assert "| more than with the effect at work, median | 0.250 | -0.100 |" in table
    assert "| more than with the effect at work, most | 0.600 | -0.100 |" in table


def test_pairs_are_named_in_part_or_whole() -> None:
    label = f"{TRUE}+{OTHER}"
    answers = [[[TRUE], [THIRD, OTHER]], [[TRUE, OTHER]], [[OTHER], [THIRD]], [[OTHER]], [[THIRD]]]
    expected = ["both named", "one named", "one named", "one named", "wrong"]
    assert [report.pair_outcome(line(label, "effect", TRUE, causes=x)) for x in answers] == expected
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
    more = {"amplitude": {}, "true_directions": {}}
    names = list(report.CAUSES)
    lines = [
        line(TRUE, "effect", TRUE, **more),
        line(TRUE, "effect", OTHER, seed=1, code="1", **more),
        line("none", "none"),
        line("outside_drift", "unknown"),
        line(f"{TRUE}+{OTHER}", "effect", TRUE, causes=[[TRUE], [OTHER]]),
        line(TRUE, "unknown", condition="loo"),
        line(TRUE, "effect", TRUE, condition="power_2", **more),
        {**asdict(Case("half", THIRD, 0)), "model": "R2", "code": "0", "failed": "ValueError: no"},
    ]
    text = report.report(lines)
    assert "Simulated cases: 7, seeds 0 to 1 (2)" in text
    assert "2 states of the code" in text
    assert "- ('half', 'thorax_tilt', 0, 0): ValueError: no" in text
    assert "| true effect in the reported set |  | 50.0 % (9-91; 2) |" in text
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
    seen = {"amplitude": {TRUE: {}}, "true_directions": {}, **GAPS}
    lines = [
        line(TRUE, "effect", TRUE, realised_deg={"adapted": 2.0, "with_effect": 0.9}, **seen),
        line(TRUE, "effect", OTHER, condition="loo", realised_deg={"adapted": 2.0, "with_effect": 1.0}),
    ]
    text = report.report(lines)
    assert "| confident wrong name | 100.0 % (21-100; 1) |" in text
    assert f"| {report.MIMICRY} | a wrong name (1) | a confident one (1) |" in text
    assert "| with what was named in its place, mean | 1.000 | 1.000 |" in text


def test_every_reach_is_of_a_measure() -> None:
    assert report.REACH.keys() <= report.MEASURES.keys() | {report.LESS_THAN_COULD}


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
    for condition in ("half", "three", "one"):
        first, second = (world_of(Case(c, OTHER, 3)).table for c in (condition, f"alone_{condition}"))
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
    def examined(case: Case) -> Line:
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
    ],
)
def test_wrong_requests_say_what_is_wrong(tmp_path: Path, wrong: dict[str, Any], cause: str) -> None:
    with pytest.raises(typer.BadParameter, match=cause):
        blind_check.main(tmp_path, **wrong)


def test_power_means_its_three_sizes() -> None:
    assert blind_check._conditions(["power", "one"]) == ["one", "power_0.25", "power_1.5", "power_2"]


# The truth ----------------------------------------------------------------------------------------------------------


def test_true_directions_are_means_at_full_elevation() -> None:
    drawn = {"factor_by_motion": {"abduction": 1.0, "forward_flexion": 1.1, "scapular_plane": 9.0}}
    amplitude = {"a": 2.0, "b": 4.0, "c": 100.0}
    conoid = true_directions(TRUE, {"amplitude": amplitude, "parameters": drawn}, ("a", "b"))
    assert conoid == pytest.approx({"length": 3.0 * 1.05})
    turns = {"direction_by_subject": [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]]}
    tilt = true_directions(THIRD, {"amplitude": amplitude, "parameters": turns}, ("a", "b"))
    assert tilt == pytest.approx({"about x": 1.0, "about y": 1.2, "about z": 1.6})
    gap = {"ts_fraction_by_subject": [0.5, -0.5, 0.0]}
    both = true_directions("scapulothoracic_gap", {"amplitude": amplitude, "parameters": gap}, ("a", "b"))
    assert both == pytest.approx({"TS": -0.5, "AI": 3.0})
    assert true_directions("skin_artefact", {"amplitude": amplitude, "parameters": {}}, ("a",)) == {}


# One case -----------------------------------------------------------------------------------------------------------


def diagnosed(*causes: Cause, **more: Any) -> Any:
    """Make the fields of a diagnosis that the lines read."""
    level = {ALL: Interval(1.0, 0.9, 1.1)}
    levels = dict.fromkeys(("noise_floor", "base", "adapted", "with_effect"), level)
    gaps = SimpleNamespace(other_postures=levels, other_motion=None, hardest=levels)
    names = [name for cause in causes for name in cause.names]
    share = dict.fromkeys(names, 0.9 / max(1, len(names)))
    verdict = Verdict("effect" if causes else "none", causes, dict.fromkeys(names, 0.8), {**share, "unknown": 0.1})
    fields = {"subjects": ("S01", "S02", "S03"), "left_out": {}, "options": (), "effects": {}, "amplitude": {}}
    return SimpleNamespace(
        verdict=verdict,
        noise=Noise(1.5, "estimated", 100.0),
        gaps=gaps,
        left_over_share=0.2,
        indistinguishable=[[f"{TRUE}:posture", OTHER]],
        thorax_downweighting=1.0,
        **fields | more,
    )


def test_a_cause_has_one_name_whatever_its_course() -> None:
    found = line_of(diagnosed(Cause((f"{TRUE}:posture", TRUE, OTHER), (0.5, 0.3, 0.2), 0.4, 5.0, ())))
    assert found["causes"] == [[TRUE, OTHER]]
    assert found["courses"] == [f"{TRUE}:posture"]
    assert found["probability"] == pytest.approx({TRUE: 0.6, OTHER: 0.3, "unknown": 0.1})
    assert found["inclusion"] == {TRUE: 0.8, OTHER: 0.8}
    assert found["indistinguishable"] == [[TRUE, OTHER]]
    assert found["unseen_deg"]["adapted"] == {"value": 1.0, "low": 0.9, "high": 1.1}
    assert found["other_motion_deg"] == {}


@pytest.mark.filterwarnings("ignore::motions.errors.InputWarning")  # the effect is a wrong frame, which reading notices
def test_one_case_from_its_world_to_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The diagnosis gets two of three motions, and names the active effect."""
    label, seen = "scapula_landmark_bias", []
    sizes = {"about x": Interval(1.0, -50.0, 50.0), "about y": Interval(0.0, 90.0, 95.0)}

    def diagnose(motions: Motions, model: ParameterSet, effects: Sequence[Effect]) -> dict[str, Any]:
        seen.append((set(motions.motion.tolist()), model.name, len(effects)))
        cause = Cause((label,), (1.0,), 0.5, 9.0, ())
        return {model.name: diagnosed(cause, amplitude={label: size}, subjects=motions.subjects)}

    size = SimpleNamespace(directions=sizes)
    monkeypatch.setattr(blind_check, "diagnose", diagnose)
    monkeypatch.setitem(CONDITIONS, "standard", replace(CONDITIONS["standard"], subjects=3))
    asked: dict[str, Any] = {"condition": ["standard"], "seeds": "1:2", "labels": [label], "jobs": 1}
    blind_check.main(tmp_path, **asked)
    printed = capsys.readouterr().out
    assert seen == [({"abduction", "forward_flexion"}, "R4", len(EFFECTS))]
    (found,) = read_lines(tmp_path / "cases.jsonl")
    assert found.get("failed") is None
    assert (found["model"], found["origin"], found["causes"]) == ("R4", "simulated", [[label]])
    assert set(found["true_directions"][label]) == {"about x", "about y", "about z"}
    assert report.intervals_that_cover([found]) == [True, False]
    realised = found["realised_deg"]
    assert 0.0 < realised["with_effect"] < realised["adapted"] < 5.0  # with own bones, since no option was given
    assert "Simulated cases: 1, seeds 1 to 1 (1)" in printed
    assert "| true effect in the reported set |  | 100.0 % (21-100; 1) |" in printed
    # a second run diagnoses nothing again
    monkeypatch.setattr(blind_check, "examine", lambda case: pytest.fail("ran again"))
    blind_check.main(tmp_path, **asked)
    assert capsys.readouterr().out == printed


@pytest.mark.parametrize("condition", ["loo", "alone_standard"])
def test_the_library_is_all_but_the_effect_at_work_with_its_courses_or_that_alone(
    condition: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[str] = []

    def diagnose(motions: Motions, model: ParameterSet, effects: Sequence[Effect]) -> dict[str, Any]:
        given.extend(effect.name for effect in effects)
        subjects = motions.subjects
        return {model.name: diagnosed(subjects=subjects)}

    monkeypatch.setattr(blind_check, "diagnose", diagnose)
    assert blind_check.examine(Case(condition, TRUE, 1))["answer"] == "none"
    own = {TRUE, f"{TRUE}:posture"} & set(EFFECTS)
    assert set(given) == (own if condition == "alone_standard" else set(EFFECTS) - own)
