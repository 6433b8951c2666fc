"""The studies of measured shoulders: '-' without held-out data, no person both seen and held out, table cells."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnoses import cause, verdict

from adapt.diagnosis.fit.candidates import build_design
from adapt.diagnosis.fit.shoulders import usable
from models import load_model
from models.effects import EFFECTS
from motions import read_motions
from scripts.research.named_causes.measured_check import named_without
from scripts.research.named_causes.measured_control import LEFT_OUT, Gaps, cells, drawn_at_random, tried
from scripts.research.named_causes.measured_fewer import LESS, ONE, REST, SHOULDER, parts, table
from scripts.research.named_causes.measured_noise import compared

BIAS, TILT, SIZE = "scapula_landmark_bias", "thorax_tilt", "scapula_size"

SHIPPED = Path(__file__).parents[3] / "motions" / "data" / "simulated_subjects.csv"


@pytest.mark.parametrize("column", ["subject", "motion"])
def test_with_one_person_or_one_motion_there_is_nothing_to_predict(column):
    every = read_motions(SHIPPED)
    values = getattr(every, column)
    found = named_without(every.select(values == values[0]), load_model("R2"))
    assert set(found) == {"scapula", "clavicle"}
    assert np.isnan(list(found.values())).all()


def test_what_is_seen_is_never_of_a_person_of_whom_the_gap_is_told():
    """Two persons: the left and right shoulder of one, and the right of another, with two kinds of motion."""
    ten = read_motions(SHIPPED)
    names = dict(zip(ten.subjects[:3], ("one_left", "one_right", "two"), strict=True))
    some = ten.select(np.isin(ten.subject, list(names)))
    motions = replace(some, subject=np.array([names[name] for name in some.subject.tolist()]))
    counts = Counter()
    for seen in parts(motions):
        counts[seen.what] += 1
        some, others = ({name.split("_")[0] for name in part.subjects} for part in (seen.motions, seen.others))
        assert some
        assert others
        assert not some & others
    assert counts == {REST: 2, ONE: 2, SHOULDER: 3, LESS: 2}
    assert not list(parts(motions.select(motions.subject != "two")))


def test_the_table_of_fewer_says_what_is_left_and_where_it_is_more():
    row = table({ONE: [(2.0, 1.0), (2.0, 3.0), (1.0, 0.2)]}).splitlines()[-1]
    assert [cell.strip() for cell in row.strip("|").split("|")] == [ONE, "3", "1.67", "1.40", "50%", "150%", "1 of 3"]


def test_what_noise_changes_is_told_of_every_two_diagnoses():
    """The first two diagnoses share two of three first names, the third shares none; second names do not count."""
    first = verdict("effect", cause(BIAS, SIZE), cause(TILT), **{BIAS: 0.9, TILT: 0.9})
    second = verdict("effect", cause(BIAS), cause(TILT), cause(SIZE), **{BIAS: 0.9, TILT: 0.9, SIZE: 0.92})
    none = verdict("none", **{BIAS: 0.9, TILT: 0.9})
    alike, apart = compared([first, second, none])
    assert alike == f"{2.0 / 9.0:.2f}"
    assert apart == f"{2.0 * 0.9 / 3.0 / len(none.inclusion):.3f}"
    assert compared([none, none]) == ("1.00", "0.000")


def test_causes_at_random_are_different_ones_with_all_their_numbers():
    shoulders, _ = usable(read_motions(SHIPPED))
    candidates = build_design(
        [EFFECTS[name] for name in ("conoid_strain", "ac_translation", "ac_translation:posture")], shoulders
    )
    for seed in range(5):
        found = drawn_at_random(candidates, 2, np.random.default_rng(seed))
        assert sorted(found) == ["ac_translation:posture", "conoid_strain"]
        assert len(drawn_at_random(candidates, 1, np.random.default_rng(seed))) == 1


def test_the_table_of_the_control_counts_sets_at_random_that_leave_no_more():
    first = (2.0, 1.5, Gaps(1.0, 0.5), Gaps(0.9, 0.6), Gaps(1.1, 0.5))
    second = (1.0, 0.5, Gaps(2.0, 0.7), Gaps(3.0, 0.8), Gaps(3.0, 0.9))
    assert cells([first, second]) == ["1.50", "1.00", "1.50", "2.05", "1 of 4", "0.60", "0.70", "1 of 4"]


def test_causes_are_tried_on_nobody_on_whom_they_were_named():
    ten = read_motions(SHIPPED)
    here, elsewhere = (ten.select(np.isin(ten.subject, names)) for names in (ten.subjects[:3], ten.subjects[3:5]))
    every = tried(here, elsewhere)
    assert list(every) == list(elsewhere.subjects)
    for who, [(seen, unseen)] in every.items():
        assert seen.subjects == here.subjects
        assert unseen.subjects == (who,)
    turns = tried(here, None)[LEFT_OUT]
    assert [unseen.subjects for _, unseen in turns] == [(one,) for one in here.subjects]
    assert all(not set(seen.subjects) & set(unseen.subjects) for seen, unseen in turns)
