"""External worlds: the search for worlds in a folder, and one world from its files to its report."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from adapt.diagnosis.result import ALL, Cause, Interval, Noise, Verdict
from models import ParameterSet
from models.effects import Effect
from motions import Motions
from scripts.research.named_causes import external_worlds
from scripts.research.named_causes.blind.runs import read_lines
from scripts.research.named_causes.synthetic_a import make_world
from tests.helpers.handmade import motions_of

BIAS = "scapula_landmark_bias"
MODEL = Path(__file__).parents[3] / "models" / "sets" / "R4.toml"


def told(folder: Path, **truth: Any) -> Path:
    folder.mkdir(parents=True)
    (folder / "truth.json").write_text(json.dumps(truth))
    return folder / "motions.csv"


def test_worlds_are_folders_with_motions_and_a_truth(tmp_path: Path) -> None:
    told(tmp_path / "b", label="none_at_all", model="R2").touch()
    told(tmp_path / "a" / "deep", label="none", model="R4", seed=7).touch()
    told(tmp_path / "c", label="outside_fog", model="R6").touch()
    told(tmp_path / "without motions", label="none", model="R2")
    found = external_worlds.worlds(tmp_path)
    assert [(one.label, one.repeat, one.model) for one in found] == [
        ("none", 0, "R4"),
        ("none", 1, "R2"),
        ("outside_fog", 0, "R6"),
    ]


@pytest.fixture
def libraries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[set[str] | None]:
    """Write one world to ``in``; return the library of each call of a fake diagnosis (None: all candidates)."""
    told_each_time: list[set[str] | None] = []

    def diagnosed(motions: Motions, model: ParameterSet, effects: list[Effect] | None) -> dict[str, Any]:
        assert (len(motions.subjects), model.name) == (3, "R4")
        told_each_time.append(None if effects is None else {effect.name for effect in effects})
        verdict = Verdict("effect", (Cause((BIAS,), (1.0,), 0.5, 9.0, ()),), {BIAS: 1.0}, {BIAS: 0.9, "unknown": 0.1})
        levels = {key: {ALL: Interval(1.0, 0.9, 1.1)} for key in ("noise_floor", "adapted", "with_effect")}
        found = SimpleNamespace(
            verdict=verdict,
            noise=Noise(1.5, "estimated", 100.0),
            gaps=SimpleNamespace(other_postures=levels, other_motion=None, hardest=levels),
            left_over_share=0.2,
            indistinguishable=[],
            subjects=motions.subjects,
            left_out={},
            slips=(),
            options=(),
            effects={},
            amplitude={},
        )
        return {model.name: found}

    monkeypatch.setattr(external_worlds, "diagnose", diagnosed)
    world = make_world(BIAS, MODEL, subjects=3, seed=1)
    world.table.to_csv(told(tmp_path / "in" / "theirs", label=BIAS, model="R4"), index=False)
    return told_each_time


def test_one_world_from_its_files_to_its_report(
    tmp_path: Path, libraries: list, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The diagnosis gets the motions and the parameter set, nothing else."""
    external_worlds.main(tmp_path / "in", tmp_path / "out", jobs=1)
    printed = capsys.readouterr().out
    (found,) = read_lines(tmp_path / "out" / "cases.jsonl")
    assert "failed" not in found
    assert (found["label"], found["model"], found["causes"]) == (BIAS, "R4", [[BIAS]])
    assert "| true effect in the reported set, of answers 'effect' | >= 95 % | 100.0 %" in printed
    assert libraries == [None]
    # a second run diagnoses nothing again
    monkeypatch.setattr(external_worlds, "examine", lambda case: pytest.fail("ran again"))
    external_worlds.main(tmp_path / "in", tmp_path / "out", jobs=1)
    assert capsys.readouterr().out == printed


def test_the_library_can_be_what_is_at_work(tmp_path: Path, libraries: list) -> None:
    """A world without an active cause is left out."""
    told(tmp_path / "in" / "nothing", label="none", model="R4").touch()
    external_worlds.main(tmp_path / "in", tmp_path / "out", jobs=1, only_at_work=True)
    (found,) = read_lines(tmp_path / "out" / "cases.jsonl")
    assert "failed" not in found
    assert libraries == [{BIAS}]


def test_true_sizes_are_those_of_the_nearest_course_of_the_library() -> None:
    """A line of 0.1 mm per degree is 15 mm at 150 degrees, a constant is itself; means over the diagnosed subjects."""
    motions = motions_of(np.zeros((2, 4, 6)), ["a", "b"])
    line = (0.1 * motions.humerus_elevation_deg[:4]).tolist()
    moved = {"lateral": line, "up": line, "back": [-x for x in line]}
    tilted, more = ({f"about {x}": [deg] * 4 for x in "xyz"} for deg in (4.0, 6.0))
    strengths = {
        "a": {"sc_translation": moved, "thorax_tilt": tilted, "conoid_strain": {"length": line}},
        "b": {"sc_translation": moved, "thorax_tilt": more},
        "left out": {"thorax_tilt": more},
    }
    found = saying("thorax_tilt", "sc_translation", "thorax_shape")
    true = external_worlds.true_sizes({"strengths": strengths}, motions, found)
    assert set(true) == {"thorax_tilt", "sc_translation"}
    assert true["thorax_tilt"] == pytest.approx({"about x": 5.0, "about y": 5.0, "about z": 5.0})
    assert true["sc_translation"] == pytest.approx({"lateral": 15.0, "up": 15.0, "back": -15.0})
    assert external_worlds.true_sizes({"label": "none"}, motions, found) == {}


@pytest.mark.parametrize(("name", "told"), [("skin_artefact:elevation", 15.0), ("skin_artefact", None)])
def test_a_true_size_is_one_of_the_course_that_is_named(name: str, told: float | None) -> None:
    """With the basis of measured lag the amplitude is a share, which the true strengths do not give."""
    motions = motions_of(np.zeros((1, 4, 6)), ["a"])
    lag = dict.fromkeys(("about x", "about y", "about z"), (0.1 * motions.humerus_elevation_deg).tolist())
    true = external_worlds.true_sizes({"strengths": {"a": {"skin_artefact": lag}}}, motions, saying(name))
    assert true == ({"skin_artefact": pytest.approx(dict.fromkeys(lag, told))} if told else {})


def saying(*names: str) -> Any:
    """Make a diagnosis that names these effects."""
    return SimpleNamespace(subjects=["a", "b"], effects=dict.fromkeys(names, (1.0,)))


def test_a_folder_without_worlds_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(external_worlds.typer.BadParameter, match=r"has a motions.csv and a truth.json"):
        external_worlds.main(tmp_path, tmp_path / "out")
