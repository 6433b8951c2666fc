"""A part of the study of corrupted trials: wrong landmarks and signs are named, correct trials raise no alarm."""

from dataclasses import replace

import numpy as np
import pytest

from motions import InputError
from motions.landmarks.sampled_postures import Labels, postures_from_landmarks
from scripts.research.landmarks.corrupted_trials import sound_trial
from scripts.research.landmarks.study_corrupted import KINDS, SIGNS, Result, corrupted_results, sound_alarms, table

TRIALS = 10 * (len(KINDS) + len(SIGNS))
SEED = 20261128
"""Seed of trials that were not used for tuning."""


@pytest.fixture(scope="module")
def results() -> list[Result]:
    return list(corrupted_results(TRIALS, SEED))


def test_wrong_landmarks_and_signs_are_named(results):
    counted = [one for one in results if one.counts]
    assert len(counted) > 0.9 * TRIALS
    assert np.mean([one.named for one in counted]) >= 0.97
    assert np.mean([one.silent for one in counted]) <= 0.02  # 0.5 % of 2000 trials, see docs/research
    assert np.mean([one.alone for one in counted]) >= 0.9


def test_sound_trials_raise_no_alarm_but_few():
    said = [text for texts in sound_alarms(60, SEED, (30.0, 60.0, 90.0)).values() for text in texts]
    assert sum(map(bool, said)) <= 2


def test_the_table_counts_by_hand():
    one = Result("ghost", 0.3, True, True, True, False, "")
    silent = replace(one, kind="zero", named=False, silent=True)
    found = table([one, one, silent, replace(one, kind="zero", counts=False)]).set_index("kind")
    assert found.loc["ghost"].tolist() == [2, "100.0 %", "100.0 %", "0.0 %"]
    assert found.loc["zero"].tolist() == [1, "0.0 %", "100.0 %", "100.0 %"]
    assert found.loc["all", "trials"] == 3


def test_a_simulated_trial_is_one_of_its_side():
    """The study's own simulation is read without a message, but only with the right side."""
    sound = sound_trial(np.random.default_rng(3), False)
    other = "left" if sound.side == "right" else "right"
    assert len(postures_from_landmarks(sound.lab_mm, Labels("P", "m", sound.side), "t").posture) > 10
    with pytest.raises(InputError, match=f"Say --side {sound.side}"):
        postures_from_landmarks(sound.lab_mm, Labels("P", "m", other), "t")
