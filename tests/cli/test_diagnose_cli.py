"""`girdle diagnose` as a user meets it: what diagnosis.json holds, the sentence, the figures, the exit statuses."""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from command import Ended, girdle, refused, written
from diagnoses import (
    ALIKE,
    ALL_AND_BONES,
    ANSWERS,
    BY_KIND,
    HEDGED,
    IN_PART,
    NOTHING,
    OUTSIDE,
    PROPOSALS,
    SKIN,
    alone,
    gap_of,
    json_of,
    verdict,
)
from handmade import adaptations

from adapt import diagnose
from adapt.cli import app as cli
from adapt.diagnosis import Diagnoses
from adapt.diagnosis.fit.measurement_noise import Noise, NoiseEstimate
from adapt.diagnosis.inference.amplitude import effect_amplitude
from adapt.diagnosis.json_form import as_json
from adapt.diagnosis.notes import notes
from adapt.diagnosis.result import EFFECT, NONE, UNKNOWN, ChannelAmplitude
from adapt.model_subjects import simulate_model_subjects
from adapt.output.diagnosis_figures import FIGURES, figures
from models import load_model
from models.adapted_parameters import ADAPTED
from models.effects import EFFECTS
from motions import ANGLES, write_motions

TABLES = ("fits.csv", "heldout.csv", "parameters.csv", "summary.csv")
FILES = sorted(["diagnosis.json", "report.html", "run.json", *TABLES, *FIGURES])

KEYS = {
    *("model", "verdict", "probability", "pairs", "amplitude", "gap_deg", "where", "where_by", "shares"),
    *("constraints", "parameters", "indistinguishable", "smallest_detectable", "foreseen"),
    *("next_measurement", "noise"),
    *("at_other_noise", "expected", "subjects", "left_out", "postures", "best"),
}
"""The contract of diagnosis.json: scripts of users rely on it."""

INTERVAL = {"value", "low", "high"}
KINDS = ("noise_floor", "base", "adapted", "with_effect")


# --- the contract --------------------------------------------------------------------------------------------------


def numbers(object: Mapping[str, Any], keys: set[str]) -> bool:
    return set(object) == keys and all(isinstance(value, (float, type(None))) for value in object.values())


def assert_contract(found: Mapping[str, Any]) -> None:
    """Every key of one model's object, with the right types."""
    assert set(found) >= KEYS
    assert set(found["verdict"]) == {"answer", "effects", "together", "sentence"}
    assert found["verdict"]["answer"] in (NONE, EFFECT, UNKNOWN)
    assert isinstance(found["verdict"]["together"], bool)
    assert found["verdict"]["sentence"].endswith(".")
    assert set(found["verdict"]["effects"]) <= set(EFFECTS)
    assert set(found["probability"]) == ANSWERS
    assert abs(sum(found["probability"].values()) - 1.0) <= 1e-9
    for name, amplitude in found["amplitude"].items():
        assert numbers({key: amplitude[key] for key in INTERVAL}, INTERVAL)
        assert amplitude["unit"] == EFFECTS[name].unit
        assert all(numbers(channel, INTERVAL) for channel in amplitude["channels"].values())
    gap = found["gap_deg"]
    assert set(gap) == {*KINDS, "in_sample", "other_motion", "held_out", "shrinkage"}
    assert isinstance(gap["held_out"], str)
    for kinds in filter(None, (gap, gap["in_sample"], gap["other_motion"])):
        assert all(numbers(kinds[kind][bone], INTERVAL) for kind in KINDS for bone in ALL_AND_BONES)
    shares = [cell["share"] for cell in found["where"]]
    assert shares == sorted(shares, reverse=True)
    assert set(found["parameters"]) == set(ADAPTED)
    assert all(numbers(value, {"adapted_mm", "with_effect_mm"}) for value in found["parameters"].values())
    assert all(len(group) > 1 and set(group) <= set(EFFECTS) for group in found["indistinguishable"])
    assert set(found["smallest_detectable"]) == set(EFFECTS)
    assert all(set(one) == {"value", "unit"} for one in found["smallest_detectable"].values() if one)
    proposal = {"what", "separation_now", "separation_then", "probability_then"}
    assert all(set(one) == proposal for one in found["next_measurement"])
    assert set(found["noise"]) == {"angle_deg", "landmark_mm", "source", "freedom"}
    assert all({"noise_deg", "answer", "effects"} <= set(one) for one in found["at_other_noise"])
    assert found["subjects"]
    assert isinstance(found["left_out"], dict)
    assert isinstance(found["postures"], int)


@pytest.mark.parametrize("diagnosis", BY_KIND.values(), ids=BY_KIND)
def test_every_kind_of_answer_keeps_the_contract_in_strict_json(diagnosis):
    found = json_of(diagnosis)
    assert_contract(found)
    assert_contract(found["by_model"]["R2"])
    assert json.loads(json.dumps(found, allow_nan=False)) == found, "plain JSON types"


def test_the_top_level_is_the_model_with_the_smallest_held_out_adapted_gap():
    """Not the one with the smallest gap in sample, nor with the effect; and one whose gap is not a number is not it."""
    fits_best_in_sample = replace(SKIN, model="R6", gaps=replace(gap_of(1.4, 0.5), in_sample=SKIN.gaps.in_sample))
    nothing = replace(SKIN, model="R4", gaps=gap_of(math.nan, math.nan))
    by_model = {"R4": nothing, "R6": fits_best_in_sample, "R2": SKIN}
    found = as_json(Diagnoses(by_model))
    assert list(found["by_model"]) == ["R4", "R6", "R2"]
    assert found["model"] == "R2"
    assert {key: value for key, value in found.items() if key != "by_model"} == found["by_model"]["R2"]
    assert as_json(Diagnoses({"R4": nothing, "R6": fits_best_in_sample}))["model"] == "R6"
    assert as_json(alone(nothing))["gap_deg"]["adapted"]["all"] == {"value": None, "low": None, "high": None}


def test_what_is_not_finite_is_null_and_numpy_numbers_are_plain():
    probability = {name: np.float64(p) for name, p in SKIN.verdict.probability.items()}
    given = replace(
        SKIN,
        noise=NoiseEstimate(Noise(1.5), math.inf, "given"),
        verdict=replace(SKIN.verdict, probability=probability),
        gaps=gap_of(math.inf, 1.0),
    )
    found = json_of(given)
    assert found["noise"]["freedom"] is None
    assert found["gap_deg"]["shrinkage"] is None
    assert json.loads(json.dumps(found, allow_nan=False))["probability"]["skin_artefact"] == 0.98


def test_shrinkage_is_that_of_the_held_out_gap():
    assert json_of(SKIN)["gap_deg"]["shrinkage"] == pytest.approx((1.34 - 1.02) / 1.34)
    assert json_of(NOTHING)["gap_deg"]["shrinkage"] == 0.0


def amplitude(*channels: tuple[float, float]) -> dict[str, Any]:
    """Of channels with a value and half an interval."""
    made = tuple(ChannelAmplitude(f"c{k}", v, v - half, v + half) for k, (v, half) in enumerate(channels))
    size = effect_amplitude(EFFECTS["skin_artefact"], made, SKIN.highest_elevation_deg)
    found = json_of(replace(SKIN, amplitude={"skin_artefact": size}))["amplitude"]["skin_artefact"]
    assert list(found["channels"]) == [one.channel for one in made]
    return {key: found[key] for key in ("value", "low", "high")}


@pytest.mark.parametrize(
    ("channels", "value", "low", "high"),
    [
        ([(-3.0, 4.0)], -3.0, -7.0, 1.0),
        ([(3.0, 1.0), (4.0, 2.0)], 5.0, 5.0 - math.sqrt(73.0) / 5.0, 5.0 + math.sqrt(73.0) / 5.0),
        ([(-3.0, 1.0), (4.0, 1.0)], 5.0, 4.0, 6.0),
        ([(5.0, 1.0), (0.0, 90.0)], 5.0, 4.0, 6.0),
        ([(0.3, 1.0), (0.4, 1.0)], 0.5, 0.0, 1.5),
        ([(0.0, 1.0), (0.0, 2.0)], 0.0, 0.0, 2.0),
    ],
    ids=["one keeps its sign", "two", "alike in any direction", "across the mean", "clipped at 0", "no direction"],
)
def test_the_size_of_an_effect_is_its_channel_or_the_length_of_several(channels, value, low, high):
    assert amplitude(*channels) == pytest.approx({"value": value, "low": low, "high": high})


# --- the sentence --------------------------------------------------------------------------------------------------

WHAT = EFFECTS["skin_artefact"].what
LENGTH = EFFECTS["clavicle_length"].what
SIZE = EFFECTS["scapula_size"].what

DOUBT = "Two effects can also mimic a cause that is not in the list (probability 0.01)."

SENTENCES = {
    "skin": f"The gap of 10 subjects is explained by skin_artefact ({WHAT}; 7.0 [5.3, 8.7] deg): held out, it shrinks "
    "from 1.34 to 1.02 deg, noise alone leaves 0.89.",
    "alike": "The gap of 10 subjects is explained by one of clavicle_length, scapula_size: these data cannot tell them "
    f"apart; positions of AC beside the angles would. With clavicle_length ({LENGTH}; -8.1 [-9.0, -7.1] %), held out, "
    "it shrinks from 1.34 to 1.02 deg, noise alone leaves 0.89.",
    "pair": "The gap of 10 subjects is explained by skin_artefact and clavicle_length together (skin_artefact: "
    f"{WHAT}; 7.0 [5.3, 8.7] deg; clavicle_length: {LENGTH}; 8.0 [7.0, 9.0] %): held out, it shrinks from 1.34 to 1.02 "
    f"deg, noise alone leaves 0.89. {DOUBT}",
    "hedged": "The gap of 10 subjects is explained by skin_artefact and clavicle_length together, or scapula_size in "
    f"place of one of them (skin_artefact: {WHAT}; 7.0 [5.3, 8.7] deg; clavicle_length: {LENGTH}; 8.0 [7.0, 9.0] %; "
    f"scapula_size: {SIZE}; 0.50 [0.25, 0.75] %): held out, it shrinks from 1.34 to 1.02 deg, noise alone leaves 0.89. "
    f"{DOUBT}",
    "nothing": "Nothing beyond noise: held out, the gap of 1 subject is 0.93 deg, noise alone leaves 0.89. An effect "
    "below 0.15 (thorax_shape), 1.5 mm (conoid_strain) or 1.5 deg (skin_artefact) would not show.",
    "outside": "No effect of the list, alone or in pairs, explains the gap of 10 subjects (closest: skin_artefact, "
    "which takes it from 1.34 to 1.02 deg held out, noise alone leaves 0.89).",
    "in part": "No effect of the list, alone or in pairs, explains the gap of 10 subjects: skin_artefact explains a "
    "part of it, from 1.34 to 1.02 deg held out, and leaves something systematic; noise alone leaves 0.89 "
    f"(skin_artefact: {WHAT}; 7.0 [5.3, 8.7] deg).",
    "too large": "No effect of the list, alone or in pairs, explains the gap of 10 subjects: skin_artefact explains a "
    "part of it, from 1.34 to 1.02 deg held out, and is larger than such an effect is; noise alone leaves 0.89 "
    f"(skin_artefact: {WHAT}; 7.0 [5.3, 8.7] deg).",
}


@pytest.mark.parametrize("kind", BY_KIND)
def test_the_sentence_says_the_answer(kind):
    assert json_of(BY_KIND[kind])["verdict"]["sentence"] == SENTENCES[kind]


def test_the_sentence_does_not_promise_more_than_the_next_measurement_gives():
    found = json_of(replace(ALIKE, next_measurement=PROPOSALS[1:]))["verdict"]["sentence"]
    assert "; nothing that was tried surely would, twice as many subjects (20) comes closest." in found


def test_the_sentence_does_not_say_that_a_gap_shrinks_which_grows():
    found = json_of(replace(SKIN, gaps=gap_of(1.0, 1.1)))["verdict"]["sentence"]
    assert "held out, it does not shrink, it goes from 1.00 to 1.10 deg" in found


def test_the_sentence_says_when_none_is_not_sure():
    unsure = replace(NOTHING, verdict=verdict(NONE, none=0.42, scapula_size=0.3))
    assert json_of(unsure)["verdict"]["sentence"].startswith(
        "Nothing surely beyond noise (none 0.42, scapula_size 0.30): "
    )


def test_an_effect_that_no_size_would_show_is_not_named():
    blind = json_of(replace(NOTHING, smallest_detectable=dict.fromkeys(EFFECTS)))
    assert blind["verdict"]["sentence"].endswith("These data would not show any effect of the list.")


# --- terminal notes and figures ------------------------------------------------------------------------------------


def test_the_notes_name_what_the_verdict_rests_on():
    assert notes(replace(SKIN, left_out={"s11": "2 postures"}, declared_effects=("skin_artefact",))) == [
        "Parameter set R2.",
        "Noise: 1.40 deg an angle, estimated from 166 degrees of freedom (landmarks, where given: 2.0 mm).",
        "Were the noise 2.10 deg, the answer would be none.",
        "The motions are marked with skin_artefact: likelier beforehand.",
        "Such data would name an effect of typical size in 85% of cases, least sc_translation in 25%.",
        "These postures and this noise cannot tell apart conoid_strain and clavicle_axial_estimate.",
        "Left out: s11: 2 postures.",
        "To adapt with skin_artefact as found here: girdle adapt ... --effect skin_artefact=8.75,0,-6.56",
    ]


@pytest.mark.parametrize("other", [NOTHING, OUTSIDE, IN_PART])
def test_no_adaptation_is_proposed_where_no_effect_explains_the_gap(other):
    assert not [note for note in notes(other) if "girdle adapt" in note]


def test_two_effects_go_together_into_an_adaptation():
    said = "--effect skin_artefact=8.75,0,-6.56 --effect clavicle_length=8"
    assert notes(HEDGED)[-1].endswith(f" as found here: girdle adapt ... {said}")


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (ALIKE, "clavicle_length or scapula_size"),
        (HEDGED, "skin_artefact and clavicle_length together, or scapula_size in place of one of them"),
        (OUTSIDE, "unknown"),
        (IN_PART, "unknown (in part skin_artefact)"),
    ],
)
def test_the_notes_say_how_the_answer_changes_with_the_noise(other, said):
    found = replace(SKIN, at_other_noise={1.0: other.verdict, 2.0: SKIN.verdict})
    assert [note for note in notes(found) if "Were" in note] == [
        f"Were the noise 1.00 deg, the answer would be {said}."
    ]


def test_the_notes_do_not_list_every_effect():
    found = replace(SKIN, indistinguishable=[list(EFFECTS)])
    assert f"These postures and this noise cannot tell apart any of the {len(EFFECTS)} effects." in notes(found)


@pytest.mark.parametrize(
    ("source", "said"),
    [("given", "1.40 deg an angle, as given"), ("assumed", "too few to estimate it; give --noise-deg")],
)
def test_the_notes_say_where_the_noise_comes_from(source, said):
    assert said in notes(replace(SKIN, noise=NoiseEstimate(Noise(1.4), math.inf, source)))[1]


def words(svg: str) -> list[str]:
    return [node.text or "" for node in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


@pytest.mark.parametrize("diagnosis", BY_KIND.values(), ids=BY_KIND)
def test_figures_are_the_same_bytes_on_a_second_draw_and_valid_xml(diagnosis):
    drawn = figures(diagnosis)
    assert tuple(drawn) == FIGURES
    assert drawn == figures(diagnosis)
    assert all(words(svg) for svg in drawn.values())


def test_figures_say_their_numbers():
    drawn = figures(SKIN)
    assert {"1.8", "1.2", "0.5", "0-30", "30-60", "abduction"} <= set(words(drawn["gap_heatmap.svg"]))
    assert {*ANSWERS, "0.98"} <= set(words(drawn["probabilities.svg"]))
    assert {"noise alone", "model as it is", "adapted", "with skin_artefact"} <= set(words(drawn["gaps.svg"]))
    assert not any("with" in word for word in words(figures(NOTHING)["gaps.svg"])), "there is no effect to add"


@pytest.mark.parametrize("name", ["$x^2$ & <b>", "horizontal_flexion"])
def test_names_from_files_are_drawn_as_they_are(name):
    motions = [replace(one, motion=f"{name} {k}") for k, one in enumerate(5 * SKIN.cells)]
    assert f"{name} 14" in words(figures(replace(SKIN, cells=motions))["gap_heatmap.svg"])


# --- the command, the diagnosis itself taken for granted ------------------------------------------------------------

ROW = "subject,motion,posture,humerus_elevation_deg," + ",".join(f"{angle}_deg" for angle in ANGLES)
ROWS = [f"P1,abduction,{k},{30 * k},-30,12,7,32,{10 * k},-10" for k in range(1, 4)]


@pytest.fixture
def asked(monkeypatch) -> dict[str, Any]:
    """What the command asks of the diagnosis, which answers with two hand-made models."""
    asked: dict[str, Any] = {}

    def answer(motions, models, noise_deg, progress):
        progress("noise")
        asked.update(models=[one.name for one in models], noise_deg=noise_deg)
        return {"R4": replace(NOTHING, model="R4", gaps=gap_of(2.0, 2.0)), "R2": SKIN}

    monkeypatch.setattr(cli, "diagnose", answer)
    monkeypatch.setattr(cli, "adapt_subjects", lambda motions, models, progress: adaptations(motions, models))
    return asked


def test_the_command_writes_its_files_and_nothing_else(asked, tmp_path):
    motion, out = written(tmp_path, [ROW, *ROWS]), tmp_path / "out"
    ended = girdle("diagnose", motion, "--model", "R4", "--model", "R2", "--out", out)
    assert (ended.status, ended.messages) == (0, [])
    assert asked == {"models": ["R4", "R2"], "noise_deg": None}
    assert sorted(path.name for path in out.iterdir()) == FILES
    found = json.loads((out / "diagnosis.json").read_text())
    both = Diagnoses({"R4": replace(NOTHING, model="R4", gaps=gap_of(2.0, 2.0)), "R2": SKIN})
    assert found == as_json(both)
    for name, svg in figures(SKIN).items():
        assert (out / name).read_text() == svg
    record = json.loads((out / "run.json").read_text())
    assert (record["command"], record["options"]) == ("diagnose", {"noise_deg": None})
    assert ended.out.splitlines()[1] == SENTENCES["skin"]
    assert "Every parameter set" in ended.out


@pytest.mark.parametrize("noise_deg", [None, 1.7])
def test_a_repeated_diagnosis_asks_the_same_and_writes_the_same_bytes(asked, tmp_path, noise_deg):
    """The noise, where it was given, and both models, by the record alone."""
    motion, first, again = written(tmp_path, [ROW, *ROWS]), tmp_path / "first", tmp_path / "again"
    given = () if noise_deg is None else ("--noise-deg", noise_deg)
    assert girdle("diagnose", motion, "--model", "R4", "--model", "R2", *given, "--out", first).status == 0
    asked.clear()
    ended = girdle("diagnose", "--repeat", first / "run.json", "--out", again)
    assert (ended.status, ended.messages) == (0, [])
    assert asked == {"models": ["R4", "R2"], "noise_deg": noise_deg}
    assert sorted(path.name for path in again.iterdir()) == FILES
    for name in FILES:
        assert (again / name).read_bytes() == (first / name).read_bytes(), name


@pytest.mark.parametrize("noise", ["0", "-1", "nan", "inf", "100"])
def test_noise_that_cannot_be_is_refused(tmp_path, noise):
    motion = written(tmp_path, [ROW, *ROWS])
    ended = girdle("diagnose", motion, "--noise-deg", noise, "--out", tmp_path / "out")
    refused(ended, "--noise-deg", "is not between 0.1 and 20 degrees", "leave it to be estimated")
    assert not (tmp_path / "out").exists()


BAD_INPUT = {
    "missing column": ([ROW.replace(",scapula_x_deg", ""), *ROWS], "column scapula_x_deg is missing", "Add it"),
    "too few postures": ([ROW, *ROWS], "no subject has 4 postures", "Give subjects with more postures"),
}


@pytest.mark.parametrize(("lines", "cause", "remedy"), BAD_INPUT.values(), ids=BAD_INPUT)
def test_bad_input_is_refused(tmp_path, lines, cause, remedy):
    ended = girdle("diagnose", written(tmp_path, lines), "--out", tmp_path / "out")
    assert ended.status == 2
    (message,) = ended.messages
    assert message.startswith("error: ")
    assert cause in message
    assert remedy in message
    assert not list(tmp_path.glob("out/*"))


def test_diagnose_is_part_of_the_python_api():
    assert diagnose.__module__ == "adapt.diagnosis.diagnosis"


# --- one diagnosis from end to end ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real(tmp_path_factory) -> tuple[Ended, Path]:
    """Three simulated subjects whose scapula was misread, and one with three postures; the noise is given.

    Real but for the next measurement: its further motions have other shapes and take a minute to compile.
    """
    folder = tmp_path_factory.mktemp("diagnose")
    simulated = simulate_model_subjects(load_model("R2"), EFFECTS["scapula_landmark_bias"], 4, 1.5, 3).motions
    rows = np.arange(len(simulated.posture))
    last = np.flatnonzero(simulated.subject == "simulated04")[3:]
    write_motions(simulated.select(~np.isin(rows, last)), folder / "motions.csv")
    arguments = ("--model", "R2", "--noise-deg", "1.7", "--out", folder / "out")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("adapt.diagnosis.diagnosis.propose", lambda *_: PROPOSALS)
        return girdle("diagnose", folder / "motions.csv", *arguments), folder / "out"


def test_a_real_diagnosis_keeps_the_contract(real):
    ended, out = real
    text = (out / "diagnosis.json").read_text()
    found = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not strict JSON"))
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert_contract(found)
    assert list(found["by_model"]) == ["R2"]
    assert found["by_model"]["R2"] == {key: value for key, value in found.items() if key != "by_model"}
    assert found["subjects"] == ["simulated01", "simulated02", "simulated03"]
    assert found["postures"] == 42
    assert {cell["angle"] for cell in found["where"]} == set(ANGLES)
    assert found["verdict"]["sentence"] == ended.out.splitlines()[1]


def test_the_noise_given_is_used_and_reported(real):
    _, out = real
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["noise"] == {"angle_deg": 1.7, "landmark_mm": 2.0, "source": "given", "freedom": None}
    assert json.loads((out / "run.json").read_text())["options"] == {"noise_deg": 1.7}


def test_a_subject_with_too_few_postures_is_left_out_and_named(real):
    ended, out = real
    assert ended.status == 3
    why = "3 postures with more than 3 angles, fewer than 4"
    assert ended.messages == [f"not handled: simulated04: {why}"]
    assert json.loads((out / "diagnosis.json").read_text())["left_out"] == {"simulated04": why}
