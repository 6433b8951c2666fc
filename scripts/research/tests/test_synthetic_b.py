"""The second simulated world: files, strengths, and the world without its causes."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_worlds import HAVE_STRENGTHS

from motions import read_motions
from scripts.research.named_causes.external_worlds import worlds
from scripts.research.named_causes.synthetic_b import worlds as worlds_made
from scripts.research.named_causes.synthetic_b.effects import SIZES
from scripts.research.named_causes.synthetic_b.mistakes import OUTSIDE_SIZES
from scripts.research.named_causes.synthetic_b.worlds import (
    COURSE_LENGTH,
    DISCREPANCY_DEG,
    Case,
    smooth_courses,
    write_case,
    write_condition,
)

SAME_DEG = 2e-4
"""Tolerance: angles have four decimals, and the chain is closed again to 1e-9 mm."""


def made(folder: Path, *names: str, **how) -> Path:
    write_case(folder / "one" / "case", list(names), Case(**{"model": "R2", "seed": 3, "subjects": 1, **how}))
    return folder / "one" / "case"


@pytest.mark.parametrize("name", sorted({*SIZES, *OUTSIDE_SIZES} - set(HAVE_STRENGTHS)))
def test_an_effect_that_has_another_form_tells_no_strength(tmp_path, name):
    assert json.loads((made(tmp_path, name) / "truth.json").read_text())["strengths"] == {"simulated_01": {}}


def test_the_same_seed_makes_the_same_world_and_another_another(tmp_path):
    motions = [
        (made(tmp_path / str(k), "skin_artefact", seed=seed) / "motions.csv").read_bytes()
        for k, seed in enumerate((1, 1, 2))
    ]
    assert motions[0] == motions[1] != motions[2]


def test_landmarks_are_given_where_they_are_asked_for(tmp_path):
    found = read_motions(made(tmp_path, "sc_translation", landmark_noise_mm=2.0) / "motions.csv")
    assert set(found.landmarks_mm) == {"SC", "AC", "TS", "AI"}


def test_a_condition_is_found_by_the_check(tmp_path):
    write_condition("one", tmp_path, seed=1, noise_deg=1.5)
    found = worlds(tmp_path)
    assert {case.label for case in found} == {*SIZES, "none"}
    assert {case.model for case in found} == {"R2", "R4", "R6", "breteler_dissection"}


def test_worlds_of_several_causes_have_each_number_of_them_and_smooth_courses_beside(tmp_path, monkeypatch):
    """Only the world with the most causes is made, because making all takes a minute."""
    asked: list[tuple[Path, list[str], Case]] = []
    monkeypatch.setattr(worlds_made, "write_case", lambda *world: asked.append(world))
    write_condition("several", tmp_path, 5, 0.0)
    assert len({folder for folder, *_ in asked}) == len(asked)
    assert Counter(len(set(names)) for _, names, _ in asked) == {0: 3, 1: 4, 2: 4, 3: 4, 4: 4}
    assert {case.discrepancy_deg for *_, case in asked} == {DISCREPANCY_DEG}
    folder, names, case = max(asked, key=lambda world: len(world[1]))
    write_case(folder, names, replace(case, subjects=2))
    truth = json.loads((folder / "truth.json").read_text())
    assert (truth["label"], truth["discrepancy_deg"]) == ("+".join(names), DISCREPANCY_DEG)
    assert set(read_motions(folder / "motions.csv").subjects) == {"simulated_01", "simulated_02"}


def test_a_world_without_a_discrepancy_draws_nothing_for_it(tmp_path, monkeypatch):
    """Otherwise the noise would differ from that of the worlds reported by their seed."""
    monkeypatch.setattr(worlds_made, "smooth_courses", lambda *_: pytest.fail("drew"))
    made(tmp_path, "skin_artefact")


def test_a_smooth_course_has_sd_1_and_neighbours_that_are_alike():
    rng = np.random.default_rng(0)
    elevation = np.tile(np.linspace(20.0, 140.0, 7), 2)
    courses = np.concatenate([smooth_courses(elevation, rng) for _ in range(1000)], axis=1)
    assert courses.std() == pytest.approx(1.0, abs=0.03)
    apart = np.asarray(np.corrcoef(courses))
    assert apart[0, 1] == pytest.approx(np.exp(-0.5 * (20.0 / COURSE_LENGTH) ** 2), abs=0.03)
    assert apart[6, 7] == pytest.approx(0.0, abs=0.05), "another motion has a course of its own"


def test_without_its_causes_a_world_has_the_same_people_discrepancy_and_noise(tmp_path):
    """Without a cause the files are equal to the last digit; with a constant turn of the frame they differ by it."""
    folder = made(tmp_path, discrepancy_deg=DISCREPANCY_DEG)
    assert (folder / "without_causes.csv").read_text() == (folder / "motions.csv").read_text()
    folder = made(tmp_path, "scapula_landmark_bias", discrepancy_deg=DISCREPANCY_DEG)
    seen, without = (read_motions(folder / name).angles_deg for name in ("motions.csv", "without_causes.csv"))
    np.testing.assert_allclose(without[:, :3], seen[:, :3], atol=SAME_DEG)
    assert np.abs(without[:, 3:] - seen[:, 3:]).mean() > 1.0
