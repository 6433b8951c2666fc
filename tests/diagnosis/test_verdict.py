"""From evidence to an answer: rankings made by hand."""

import numpy as np
import pytest

from adapt.diagnosis.declared_effects import declared_effects
from adapt.diagnosis.fit.linear_model import Hypothesis, LinearisedFit
from adapt.diagnosis.inference.ranking import Ranking
from adapt.diagnosis.inference.verdict import judge
from adapt.diagnosis.result import EFFECT, NONE, UNKNOWN, Verdict
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE

SUM = 1e-12
"""Of a dozen probabilities: rounding."""

NAMES = ("a", "b", "c", "d")

SURE = 100.0
"""Nats that no prior of the verdict outweighs."""

NOTHING_LEFT = {"discrepancy_gain": -5.0, "excess": 0.0}
"""What the tests of the best hypothesis say if it is right."""


def linear(hypothesis: Hypothesis) -> LinearisedFit:
    """A fit of which only the name is looked at."""
    n = len(hypothesis)
    return LinearisedFit(
        hypothesis=hypothesis,
        z=np.zeros((6 + n, 1)),
        nearest=np.zeros((6, 1, 1)),
        y=np.zeros((1, 3)),
        X=np.zeros((1, 3, 6)),
        A=np.zeros((1, 3, n)),
        scale=np.ones(n),
        u=np.zeros((1, 6)),
        a=np.zeros((1, n)),
        linear=np.zeros((1, 3)),
        root=np.zeros((1, 1, 3, 3)),
        by_angle=np.zeros((1, 1, 3, 6)),
    )


def ranking(
    evidence: dict[Hypothesis, float],
    discrepancy_gain: float = -5.0,
    excess: float = 0.0,
    amplitude_excess: float = 0.0,
) -> Ranking:
    """None and all of NAMES, far behind where nothing else is said; most probable first."""
    every = {**dict.fromkeys([(), *((name,) for name in NAMES)], -SURE), **evidence}
    order = sorted(every, key=lambda hypothesis: -every[hypothesis])
    log = np.array([every[hypothesis] for hypothesis in order])
    return Ranking(
        fitted=tuple(linear(hypothesis) for hypothesis in order),
        log_evidence=log - log.max(),
        independent_log_odds=np.zeros(len(order)),
        discrepancy_gain=discrepancy_gain,
        chi_square=1.0,
        freedom=1.0,
        excess=excess,
        amplitude_excess=amplitude_excess,
    )


def judged(evidence: dict[Hypothesis, float], **left: float) -> Verdict:
    return judge(ranking(evidence, **left), NAMES)


@pytest.mark.parametrize(
    ("evidence", "left"),
    [
        ({(): 0.0}, {}),
        ({("a",): 0.0, ("b",): -1.0}, {}),
        ({("a", "b"): 0.0, ("a",): -6.0, ("b", "c"): -7.0}, {}),
        ({("a",): 0.0, (): -3.0}, {"discrepancy_gain": 2.0, "excess": 1.0}),
        ({("a",): 0.0}, {"discrepancy_gain": 1e6, "excess": -1e6}),
    ],
    ids=["none", "effect", "pair", "unknown", "beyond"],
)
def test_probabilities_sum_to_1_and_name_everything(evidence, left):
    verdict = judged(evidence, **left)
    assert set(verdict.probability) == {*NAMES, NONE, UNKNOWN}
    assert sum(verdict.probability.values()) == pytest.approx(1.0, abs=SUM)
    assert min(verdict.probability.values()) >= 0.0


def test_a_clear_effect_is_the_answer():
    verdict = judged({("b",): 0.0})
    assert (verdict.answer, verdict.effects, verdict.together) == (EFFECT, ("b",), False)
    assert max(verdict.probability, key=lambda name: verdict.probability[name]) == "b"


def test_none_is_kept_where_its_evidence_is_the_best():
    verdict = judged({(): 0.0, ("a",): -1.0})
    assert (verdict.answer, verdict.effects) == (NONE, ())


@pytest.mark.parametrize(("behind", "answer"), [(0.5, NONE), (2.9, NONE), (3.1, EFFECT), (20.0, EFFECT)])
def test_none_is_given_up_only_where_it_is_improbable(behind, answer):
    """Prior odds of one of four effects to none 0.65 / 4 to 0.35, so that 9 to 1 are log evidence of 2.96."""
    assert judged({("a",): 0.0, (): -behind}).answer == answer


@pytest.mark.parametrize(("excess", "answer"), [(-0.1, EFFECT), (0.1, UNKNOWN)])
def test_no_name_is_given_where_unknown_is_nearly_as_probable(excess, answer):
    """Log odds of unknown 0.85 excess - 0.7: probability 0.31 and 0.35."""
    verdict = judged({("a",): 0.0}, discrepancy_gain=0.0, excess=excess)
    assert verdict.probability["a"] > verdict.probability[UNKNOWN]
    assert verdict.answer == answer


def test_equal_evidence_gives_the_effects_equal_shares_and_none_a_third():
    verdict = judged({(): 0.0, **{(name,): 0.0 for name in NAMES}})
    known = 1.0 - verdict.probability[UNKNOWN]
    for name in NAMES:
        assert verdict.probability[name] == pytest.approx(0.65 * known / len(NAMES), abs=SUM)
    assert verdict.probability[NONE] == pytest.approx(0.35 * known, abs=SUM)


def test_a_marked_effect_is_as_probable_beforehand_as_all_others():
    verdict = judge(ranking({(): 0.0, **{(name,): 0.0 for name in NAMES}}), NAMES, declared=("b", "left out"))
    known = 1.0 - verdict.probability[UNKNOWN]
    assert verdict.probability["b"] == pytest.approx(0.325 * known, abs=SUM)
    assert verdict.probability["a"] == pytest.approx(0.325 * known / 3, abs=SUM)
    assert verdict.probability[NONE] == pytest.approx(0.35 * known, abs=SUM)


def test_a_mark_does_not_outweigh_the_angles():
    assert judge(ranking({("a",): 0.0, ("b",): -SURE}), NAMES, declared=("b",)).effects == ("a",)


@pytest.mark.parametrize(
    ("column", "marks", "effects"),
    [
        ("clavicle_x_estimated", ["yes", "yes", ""], ("clavicle_axial_estimate",)),
        ("clavicle_x_estimated", ["yes", "", ""], ()),
        ("scapula_frame", ["AA brought to AC by kolz2020 +- 4 deg"] * 3, ("scapula_landmark_bias",)),
        ("scapula_frame", ["AC"] * 3, ()),
        ("remarks", ["yes"] * 3, ()),
    ],
)
def test_what_a_file_says_of_itself(column, marks, effects):
    motions = read_motions(DATA_FILE)
    motions = motions.select(np.arange(len(motions.subject)) < len(marks))
    motions.extra[column] = marks
    assert declared_effects(motions) == effects


def test_more_evidence_is_more_probability():
    found = [judged({("a",): 0.0, (): -gain, ("b",): -gain}).probability["a"] for gain in (0.0, 2.0, 4.0, 8.0)]
    assert found == sorted(found)
    assert found[0] < found[-1]


# --- sets -----------------------------------------------------------------------------------------


def test_effects_alike_are_named_together_most_probable_first():
    verdict = judged({("c",): 0.0, ("a",): -0.5})
    assert (verdict.answer, verdict.effects, verdict.together) == (EFFECT, ("c", "a"), False)


@pytest.mark.parametrize("evidence", [(0.0, 0.0, 0.0, 0.0), (0.0, -1.0, -4.0, -6.0), (0.0, -2.0, -3.0, -20.0)])
def test_the_set_is_the_smallest_that_holds_95_percent_of_all_effects(evidence):
    verdict = judged({(name,): value for name, value in zip(NAMES, evidence, strict=True)})
    probability = np.array([verdict.probability[name] for name in verdict.effects])
    of_all = sum(verdict.probability[name] for name in NAMES)
    assert list(probability) == sorted(probability, reverse=True)
    assert probability.sum() >= 0.95 * of_all
    assert probability[:-1].sum() < 0.95 * of_all


def test_the_set_grows_as_effects_come_closer():
    sizes = [len(judged({(name,): -behind * k for k, name in enumerate(NAMES)}).effects) for behind in (20.0, 2.0, 0.0)]
    assert sizes[0] == 1
    assert sizes == sorted(sizes)
    assert sizes[-1] == len(NAMES)


# --- unknown --------------------------------------------------------------------------------------


@pytest.mark.parametrize("left", [{"discrepancy_gain": 10.0}, {"discrepancy_gain": 0.0, "excess": 4.0}])
def test_what_leaves_something_systematic_or_too_much_is_unknown(left):
    verdict = judged({("a",): 0.0}, **left)
    assert verdict.answer == UNKNOWN
    assert verdict.probability[UNKNOWN] > 0.5


def test_what_leaves_nothing_is_not_unknown():
    assert judged({("a",): 0.0}, **NOTHING_LEFT).probability[UNKNOWN] < 0.5


@pytest.mark.parametrize("test", ["discrepancy_gain", "excess", "amplitude_excess"])
def test_unknown_grows_with_each_test_up_to_a_limit(test):
    def probability(value: float) -> float:
        return judged({(): 0.0}, **{**NOTHING_LEFT, test: value}).probability[UNKNOWN]

    found = [probability(value) for value in (-3.0, 0.0, 1.0, 3.0)]
    assert found == sorted(found)
    assert len(set(found)) == len(found)
    assert probability(1e3) == probability(1e6) < 1.0


def test_unknown_names_the_part_that_an_effect_explains():
    verdict = judged({("a",): 0.0, (): -50.0}, discrepancy_gain=10.0)
    assert (verdict.answer, verdict.effects, verdict.together) == (UNKNOWN, ("a",), False)


def test_unknown_names_a_pair_that_explains_a_part():
    verdict = judged({("a", "b"): 0.0, ("a",): -20.0, (): -50.0}, discrepancy_gain=10.0)
    assert (verdict.answer, verdict.effects, verdict.together) == (UNKNOWN, ("a", "b"), True)


@pytest.mark.parametrize("behind", [-2.0, 0.0, 5.0])
def test_unknown_names_nothing_where_no_effect_explains_much_more_than_none(behind):
    verdict = judged({("a",): 0.0, (): -behind}, discrepancy_gain=10.0)
    assert (verdict.answer, verdict.effects, verdict.together) == (UNKNOWN, (), False)


# --- pairs ----------------------------------------------------------------------------------------


def test_a_pair_gives_half_to_each_of_its_two():
    verdict = judged({("a", "c"): 0.0}, discrepancy_gain=-10.0)
    known = 1.0 - verdict.probability[UNKNOWN]
    assert verdict.probability["a"] == pytest.approx(verdict.probability["c"], abs=SUM)
    assert verdict.probability["a"] + verdict.probability["c"] == pytest.approx(known, abs=SUM)
    assert verdict.pairs == {"a+c": pytest.approx(known, abs=SUM)}
    assert (verdict.answer, verdict.effects, verdict.together) == (EFFECT, ("a", "c"), True)


def test_a_pair_needs_more_evidence_than_an_effect_alone():
    """Two effects are less likely to act together: 0.02 against an eighth, tempered."""
    assert judged({("a", "c"): 0.0, ("a",): 0.0}).together is False
    assert judged({("a", "c"): 0.0, ("a",): -10.0}).together is True


def test_a_pair_has_to_leave_less_than_an_effect_alone():
    """What is not in the list is mimicked more easily by two effects than by one."""
    left = {"discrepancy_gain": -2.0, "excess": 0.5}
    alone, pair = judged({("a",): 0.0}, **left), judged({("a", "c"): 0.0, ("a",): -50.0}, **left)
    assert alone.answer == EFFECT
    assert pair.answer == UNKNOWN


def test_an_effect_larger_than_such_effects_are_has_to_leave_less():
    left = {"discrepancy_gain": -4.0, "excess": 0.5}
    assert judged({("a",): 0.0}, **left).answer == EFFECT
    assert judged({("a",): 0.0}, **left, amplitude_excess=2.0).answer == UNKNOWN


def test_no_pairs_tried_are_no_pairs_reported():
    assert judged({("a",): 0.0}).pairs == {}
