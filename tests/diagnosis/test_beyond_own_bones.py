"""The null hypothesis of own bones: the causes that are tested against it, and those that are not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_worlds import CANDIDATES, searched, simulated

from adapt import adapt_subjects
from adapt.diagnosis.beyond_own_bones import LEAST_PROBABILITY, LEAST_SHARE, SURE, OwnBonesNull
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.search import Search, search_of
from adapt.evaluation.held_out import HeldOut
from adapt.own_bones.own_adaptation import People
from models import load_model
from models.effects import EFFECTS

BIAS, GAP, AC = "scapula_landmark_bias", "scapulothoracic_gap", "ac_translation"

FLOOR_DEG = 0.2

SAME_DEG = 1e-6


def null_of(world: str) -> OwnBonesNull:
    search = searched(world)
    shoulders = search.joint.shoulders
    person = dict(zip(shoulders.subjects, shoulders.person.tolist(), strict=True))
    return OwnBonesNull(search, load_model("R2"), shoulders.motions, dict(EFFECTS), person)


class _Gaps:
    """Given held-out gaps, in place of those of fits."""

    def __init__(self, null: OwnBonesNull, gaps_deg: dict[tuple[str, ...], list[float]]):
        self.null, self.gaps_deg = null, gaps_deg

    def __enter__(self) -> OwnBonesNull:
        persons = [self.null.person[self.null.motions.subjects[fold.subject]] for fold in self.null.folds]
        for names, of_persons in self.gaps_deg.items():
            held_out = tuple(np.full((6, 1), of_persons[person]) for person in persons)
            self.null.found[names, (BIAS, GAP, AC)] = HeldOut((), None, held_out, None, ())  # pyright: ignore
        return self.null

    def __exit__(self, *_) -> None:
        self.null.found.clear()


EVERY, WITH_GAP, WITH_AC, ALONE = (BIAS, GAP, AC), (BIAS, GAP), (BIAS, AC), (BIAS,)


@pytest.mark.parametrize(
    ("with_gap", "kept"),
    [([0.6, 0.6, 0.6], WITH_GAP), ([0.97, 0.98, 0.97], ALONE), ([0.1, 1.5, 1.4], ALONE)],
    ids=["takes half", "takes less than a tenth", "takes it of one person"],
)
def test_a_cause_beyond_own_bones_takes_a_tenth_in_every_person(with_gap, kept, monkeypatch):
    """Check against gaps set by hand: own bones leave 1.0 deg, noise 0.2.

    AC makes predictions worse and is removed first; a constant of a frame is never tested against own bones.
    """
    monkeypatch.setattr(OwnBonesNull, "_is_common", lambda *_: True)
    gaps = {
        (): [1.0] * 3,
        ALONE: [1.0] * 3,
        WITH_GAP: with_gap,
        WITH_AC: [1.1] * 3,
        EVERY: [x + 0.05 for x in with_gap],
    }
    with _Gaps(null_of(BIAS), gaps) as null:
        assert null.beyond(EVERY, FLOOR_DEG) == kept
        share = null.probability(WITH_GAP, EVERY, FLOOR_DEG)
        assert (share >= LEAST_PROBABILITY) == (kept == WITH_GAP)
        assert null.probability(ALONE, EVERY, FLOOR_DEG) == 1.0
        assert [step.added for step in null.budget(WITH_GAP, EVERY)] in (["", BIAS, GAP], ["", GAP, BIAS])


TEN = 10
"""Persons from whom scales are learnt."""


@pytest.mark.parametrize("world", [GAP, ""])
def test_a_cause_that_all_persons_have_is_evident_beyond_own_bones(world):
    """Check ten persons with noise of 1.5 deg, in whom bones of their own predict the other motion nearly as well."""
    shoulders, _ = usable(simulated(world, subjects=TEN, noise_deg=1.5).motions)
    search = search_of(load_model("R2"), shoulders, [EFFECTS[name] for name in CANDIDATES]).run()
    null = OwnBonesNull(
        search,
        load_model("R2"),
        shoulders.motions,
        dict(EFFECTS),
        dict(zip(shoulders.subjects, range(TEN), strict=True)),
    )
    null.predict([(), (GAP,)], (GAP,))
    assert search.leaves_noise
    assert (null.evident((), (GAP,), (GAP,)) > SURE) == bool(world)


def set_by_hand(world: str, gains: list[float]) -> OwnBonesNull:
    """Return a null in which the gap cause has these log likelihood ratios in three persons."""
    null = null_of(world)
    for names, values in (((), [0.0] * 3), ((GAP,), gains)):
        likelihood = dict(zip(null.search.joint.shoulders.subjects, values, strict=True))
        null.learnt[names] = People({}, {}, {}, log_likelihood={"R2": likelihood})
    return null


def test_evidence_is_weighed_against_what_the_size_costs_and_vetoed_by_prediction(monkeypatch):
    """Check evidence of 20 nats each, which no size costs; of none; beside a discrepancy; and of a gap that grows."""
    same, worse = {(): [1.0] * 3, (GAP,): [1.0] * 3}, {(): [1.0] * 3, (GAP,): [1.1] * 3}
    monkeypatch.setattr(Search, "leaves_noise", True)

    def evident(gains: list[float], gaps_deg: dict) -> float:
        with _Gaps(set_by_hand(GAP, gains), gaps_deg) as null:
            return null.evident((), (GAP,), EVERY)

    assert evident([20.0] * 3, same) > SURE
    assert evident([0.0] * 3, same) < 1.0 / 11.0, (
        "prior odds of two causes among the candidates, less what the size costs"
    )
    assert 0.2 < evident([60.0, -60.0, 0.0], same) < 0.8, "persons disagree"
    assert evident([20.0] * 3, worse) == 0.0
    monkeypatch.setattr(Search, "leaves_noise", False)
    assert evident([20.0] * 3, same) == 0.0


def test_of_few_persons_nothing_is_evident():
    null = null_of(GAP)
    assert null.people.are_few
    with _Gaps(null, {(): [1.0] * 3, (GAP,): [1.0] * 3}):
        assert null.evident((), (GAP,), EVERY) == 0.0


def test_a_constant_is_named_that_all_have_alike_and_not_one_that_differs():
    """Check the scapula's frame turned by 18 deg, as with AA in the place of AC: in all alike, or differently."""
    vectors = {True: [(12.4, 6.1, 11.6)] * 3, False: [(12.4, -6.1, 0.0), (-12.4, 0.0, 11.6), (0.0, 6.1, -11.6)]}
    for alike, own_deg in vectors.items():
        motions = simulated().motions
        angles = motions.angles_deg.copy()
        for name, turn in zip(motions.subjects, own_deg, strict=True):
            rows = motions.subject == name
            R_scapula = Rotation.from_euler("YZX", angles[rows, 3:], degrees=True)
            turned = R_scapula * Rotation.from_rotvec(turn, degrees=True)
            angles[rows, 3:] = turned.as_euler("YZX", degrees=True)
        shoulders, _ = usable(replace(motions, angles_deg=angles))
        search = search_of(load_model("R2"), shoulders, [EFFECTS[name] for name in CANDIDATES]).run()
        person = {name: number for number, name in enumerate(shoulders.subjects)}
        null = OwnBonesNull(search, load_model("R2"), shoulders.motions, dict(EFFECTS), person)
        assert (null.common(BIAS, (BIAS,)) > SURE) == alike


@pytest.mark.parametrize(("world", "named"), [(BIAS, ALONE), (GAP, ())])
def test_a_constant_whose_size_may_be_0_is_not_named(world, named, monkeypatch):
    """Check the frame where it is turned in all persons, and where it only stands beside what is active."""
    monkeypatch.setattr(OwnBonesNull, "common", lambda *_: 1.0)
    null = null_of(world)
    sizes = amplitudes(null.search, ALONE, ())
    assert (sizes[BIAS].size.low > 0.0) == bool(named)
    assert null.beyond(ALONE, FLOOR_DEG) == named


def test_gains_are_shares_of_what_own_bones_leave_beyond_noise():
    """Check the gain (1.0 - 0.6) / (1.0 - 0.2) = half; it is alike in all persons, and so has no error."""
    gaps = {(): [1.0] * 3, ALONE: [1.0] * 3, (GAP,): [0.6] * 3, WITH_GAP: [0.6] * 3}
    with _Gaps(null_of(BIAS), gaps) as null:
        found = null.gains(null.budget(WITH_GAP, EVERY), EVERY, FLOOR_DEG)
        assert found[GAP].share == pytest.approx(0.5)
        assert found[BIAS].share == pytest.approx(0.0)
        assert found[GAP].share > LEAST_SHARE


def test_the_null_is_what_girdle_adapt_with_own_bones_reports():
    null = null_of(BIAS)
    rows = adapt_subjects(null.motions, null.model, own_bones=True).heldout
    assert null.adapted().held_out["motion"]["all"].value == pytest.approx(rows["gap_unseen_deg"].mean(), abs=SAME_DEG)


def test_what_positions_show_is_not_held_against_own_bones():
    null = null_of(BIAS)
    assert [null.is_held(name) for name in (BIAS, "thorax_tilt", "ac_translation")] == [False, False, True]
    seen = replace(null, seen=frozenset({"ac_translation"}))
    assert not seen.is_held("ac_translation:posture")
    assert seen.is_held("scapulothoracic_gap")
