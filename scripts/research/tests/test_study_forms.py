"""The study of forms: the worlds that it takes, and the true strengths by subject, motion and posture."""

import json
from pathlib import Path

import numpy as np
import pytest

from motions import read_motions
from scripts.research.named_causes import study_forms
from scripts.research.named_causes.synthetic_b.worlds import Case, write_case

NAME = "scapula_landmark_bias"

AHEAD = 2.0
"""Log evidence by which the library's three amplitudes may exceed the true strengths, whose spread is fixed."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a world with one cause, one without and one with two."""
    folder = tmp_path_factory.mktemp("worlds")
    for names in ([NAME], [], [NAME, "thorax_tilt"]):
        write_case(folder / "worlds" / ("+".join(names) or "none"), names, Case("R2", 5, subjects=3))
    return folder


def truth_of(folder: Path, name: str) -> dict:
    return json.loads((folder / "worlds" / name / "truth.json").read_text())


def test_worlds_with_one_cause_whose_strengths_are_known_are_taken(folder):
    taken = [
        path.parent.name
        for path in sorted(folder.rglob("truth.json"))
        if study_forms.told(truth_of(folder, path.parent.name))
    ]
    assert taken == [NAME]
    assert not study_forms.told({"label": NAME, "strengths": {"one": {}}})
    assert not study_forms.told({"label": NAME})


def test_the_true_strengths_are_those_of_each_posture(folder):
    """The rows match also where postures are missing: the truth lists all postures of a subject in order."""
    truth = truth_of(folder, NAME)
    motions = read_motions(folder / "worlds" / NAME / "motions.csv")
    left = motions.select(np.arange(len(motions.posture)) % 3 > 0)
    found = study_forms.true_effect(truth, left).strengths(np.array([2.0]), left)
    for row, (subject, motion, posture) in enumerate(zip(left.subject, left.motion, left.posture, strict=True)):
        place = 7 * int(motion == motions.motion[-1]) + int(posture) - 1
        of_posture = [one[place] for one in truth["strengths"][subject][NAME].values()]
        np.testing.assert_allclose(found[:, row], 2.0 * np.array(of_posture))


def test_what_is_at_work_has_more_evidence_than_no_cause(folder, capsys):
    study_forms.study_forms(folder)
    (line,) = [line for line in capsys.readouterr().out.splitlines() if f"worlds/{NAME}" in line]
    library, true = (float(cell) for cell in line.split("|")[3:5])
    assert true > 0.0
    assert library < true + AHEAD


def test_a_folder_without_such_a_world_says_what_is_missing(folder):
    with pytest.raises(study_forms.typer.BadParameter, match="has one cause with strengths"):
        study_forms.study_forms(folder / "worlds" / "none")
