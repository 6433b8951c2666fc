"""The study of own bones on three persons: predictions of a known girdle, and positions of a rigid chain."""

from dataclasses import replace

import numpy as np
import pytest

from models import load_model
from models.girdle import bone_rotations
from motions.rotations import DEG, rotate
from scripts.research.person.own_bone_predictions import (
    adapted_to,
    without,
)
from scripts.research.person.own_bone_worlds import OTHER_SDS, WORLDS, limit, simulate_people
from scripts.research.person.study_own_bones import (
    cases,
    error_lines,
    gap_line,
    held_out_table,
    in_runs,
    intervals_table,
    positions_table,
)

PERSONS = 3

CONSTANTS_MM = 1.5
"""Error that the priors of the constants leave where SC and AA are 20 and 40 mm off."""


@pytest.fixture(scope="module")
def people():
    """Simulate three persons with own bones."""
    model = load_model("R2")
    return simulate_people(model, WORLDS["as the prior"](model), PERSONS, 1.5, 0)


def test_the_limit_is_a_share_that_more_noise_brings_to_one(people):
    little, much = limit(people, 0.1), limit(people, 1e6)
    assert np.all(little > 0.0)
    assert np.all(little < limit(people, 1.5))
    np.testing.assert_allclose(much, 1.0, atol=1e-6)


def test_simulated_people_close_with_their_own_girdles(people):
    from models.girdle import Girdle

    girdle = Girdle.of_numbers(people.numbers_mm[:, people.motions.subject_number])
    np.testing.assert_allclose(girdle.residuals_mm(people.true_deg.T / DEG), 0.0, atol=1e-8)


def test_lines_of_the_truth(people):
    lines = list(error_lines("world", people))
    assert [line[1] for line in lines][:3] == ["the set as it is", "plain", "own bones"]
    assert float(lines[0][2]) == pytest.approx(np.sqrt(np.mean(people.sizes[0] ** 2)), abs=0.06)
    assert len(gap_line("world", people)) == 10


def test_runs_hold_the_persons_one_after_the_other(people):
    runs = list(in_runs(people, 1))
    assert [run.motions.subjects for run in runs] == [(name,) for name in people.motions.subjects]
    np.testing.assert_array_equal(np.concatenate([run.sizes for run in runs], axis=1), people.sizes)
    np.testing.assert_array_equal(np.concatenate([run.true_deg for run in runs]), people.true_deg)
    assert [run.sizes.shape[1] for run in in_runs(people, 2)] == [2]


def test_a_person_has_the_same_intervals_whoever_else_is_in_a_small_run(people):
    lines = intervals_table(people.model, ["nobody"], [0], PERSONS).splitlines()[2:]
    assert [line.split(" | ")[1:3] for line in lines] == [["1", "3"], ["3", "1"]]
    assert all(line.count("100.0%") == 3 for line in lines)


def test_nobody_differs_in_a_world_of_nobody():
    assert not WORLDS["nobody"](load_model("R2")).any()
    assert np.count_nonzero(WORLDS["other SDs"](load_model("R2"))) == len(OTHER_SDS)


def test_cases_predict_only_other_motions(people):
    names = []
    for name, changed, seen, unseen in cases(people.motions):
        names.append(name)
        assert not np.any(seen & unseen)
        assert set(changed.motion[seen]) == {"abduction"}
        assert set(changed.motion[unseen]) == {"forward_flexion"}
    assert names[0] == "1 posture"


def test_positions_of_a_rigid_chain_are_predicted(people):
    angles = people.true_deg.T / DEG
    ac, a, SC = np.array([150.0, 3.0, -2.0]), np.array([5.0, 25.0, -20.0]), np.array([25.0, 5.0, -8.0])
    clavicle, scapula = bone_rotations(angles)
    AA = SC[:, None] + rotate(clavicle, ac[:, None]) + rotate(scapula, a[:, None])
    landmarks = {"SC": np.tile(SC, (angles.shape[1], 1)), "AA": AA.T}
    motions = replace(people.motions, angles_deg=people.true_deg, landmarks_mm=landmarks)
    first = positions_table(motions, [people.model]).splitlines()[2]
    assert first.startswith("| R2 | measured angles |")
    assert [float(cell) for cell in first.split(" | ")[2:4]] == pytest.approx([0.0, 0.0], abs=CONSTANTS_MM)


def test_an_adapted_girdle_predicts_other_motions(people):
    seen, unseen = without(people.motions, "abduction")
    angles = adapted_to(people.motions.select(seen), people.model, own_bones=True).angles(people.motions.select(unseen))
    assert angles.shape == (6, unseen.sum())
    assert np.abs(angles * DEG - people.true_deg[unseen].T).mean() < 3.0


def test_held_out_table(people):
    lines = held_out_table(people.motions, [people.model]).splitlines()
    assert [line.split(" | ")[1] for line in lines[2:]] == ["plain", "w 300", "own bones"]
    assert lines[-1].endswith("| 0 |")
