"""The diagnosis from motions to answer, on subjects that the model itself simulates: what is put in is found."""

from dataclasses import replace

import numpy as np
import pytest
from made_effects import without_details
from threadpoolctl import threadpool_info

from adapt.diagnosis import Diagnosis, diagnose
from adapt.diagnosis.fit.map_fit import fit_hypotheses
from adapt.diagnosis.fit.observations import observe
from adapt.diagnosis.inference.held_out_gaps import measure_gaps
from adapt.diagnosis.result import EFFECT, NONE, UNKNOWN
from adapt.model_subjects import Simulated, simulate_model_subjects
from models import load_model
from models.effects import EFFECTS
from motions.errors import InputError
from motions.table import Motions

SAME_PROBABILITY = 1e-6
"""Another order of subjects sums in another order; descents end where a step changes -2 log posterior by 0.02, at the
same step for all."""

NOISY_TOOK_PART = 1e-5
"""Of a probability: the noise is estimated from a fit in which the noisy subject took part, and by which those of the
others end elsewhere, within what ends a descent."""

DEVIATIONS = 3.0
"""Standard deviations between an amplitude and the truth: a right interval is exceeded once in 370 times, for one
seed."""

MODEL = load_model("R2")
SMALL_EFFECTS = tuple(EFFECTS[name] for name in ("scapula_landmark_bias", "conoid_strain", "thorax_asymmetry"))
NAMES = {effect.name for effect in SMALL_EFFECTS}
SUBJECTS, NOISE_DEG = 4, 1.0
FULL = 14
"""Postures of a subject."""


def simulated(size: float) -> Simulated:
    """Four subjects with a biased scapula, or at size 0 with nothing: one chain, one compilation.

    Angles feel no details, so none are drawn.
    """
    bias = without_details(EFFECTS["scapula_landmark_bias"])
    return simulate_model_subjects(MODEL, bias, SUBJECTS, NOISE_DEG, seed=3, size=size)


def diagnosed(motions: Motions) -> Diagnosis:
    return diagnose(motions, MODEL, effects=SMALL_EFFECTS)["R2"]


def taken(motions: Motions, rows: np.ndarray) -> Motions:
    """The given rows in the given order."""
    arrays = {k: v[rows] for k, v in vars(motions).items() if isinstance(v, np.ndarray)}
    return replace(motions, **arrays, extra=motions.extra.iloc[rows].reset_index(drop=True))


@pytest.fixture(scope="module")
def biased() -> Simulated:
    return simulated(1.0)


@pytest.fixture(scope="module")
def found(biased) -> Diagnosis:
    return diagnosed(biased.motions)


@pytest.fixture(scope="module")
def nothing() -> Diagnosis:
    return diagnosed(simulated(0.0).motions)


# --- what is put in -------------------------------------------------------------------------------


def test_an_effect_at_work_is_found(found):
    assert (found.verdict.answer, found.verdict.effects) == (EFFECT, ("scapula_landmark_bias",))
    assert found.best == ("scapula_landmark_bias",)
    assert found.verdict.probability["scapula_landmark_bias"] > 0.9
    assert found.ranking.hypotheses[0] == ("scapula_landmark_bias",)


def test_its_amplitude_is_the_one_put_in(found, biased):
    """Each channel: the mean of the subjects', within its interval, which does not hold 0."""
    assert set(found.amplitude) == {"scapula_landmark_bias"}
    truth = biased.truth[["amplitude_1", "amplitude_2", "amplitude_3"]].mean()
    for channel, expected in zip(found.amplitude["scapula_landmark_bias"].channels, truth, strict=True):
        deviation = (channel.high - channel.low) / (2.0 * 1.96)
        assert abs(channel.value - expected) <= DEVIATIONS * deviation
        assert channel.low * channel.high > 0.0
        assert channel.value == pytest.approx(0.5 * (channel.low + channel.high))


def test_a_noisy_subject_is_left_out_and_named(biased, found):
    """It would be explained before all others."""
    motions, last = biased.motions, biased.motions.subject == biased.motions.subject[-1]
    error = 10.0 * np.random.default_rng(6).standard_normal(motions.angles_deg.shape)
    noisy = diagnosed(replace(motions, angles_deg=motions.angles_deg + np.where(last[:, None], error, 0.0)))
    assert noisy.subjects == found.subjects[:-1]
    assert list(noisy.left_out) == [found.subjects[-1]]
    assert "scatter" in noisy.left_out[found.subjects[-1]]
    assert (noisy.verdict.answer, noisy.verdict.effects[0]) == (EFFECT, "scapula_landmark_bias")
    without = diagnosed(taken(motions, np.flatnonzero(~last)))
    assert noisy.verdict.probability == pytest.approx(without.verdict.probability, abs=NOISY_TOOK_PART)


def test_no_effect_is_none(nothing):
    assert (nothing.verdict.answer, nothing.verdict.effects, nothing.amplitude) == (NONE, (), {})
    assert nothing.verdict.probability[NONE] == max(nothing.verdict.probability.values())
    assert nothing.best == ()


@pytest.mark.parametrize("name", ["found", "nothing"])
def test_probabilities_are_of_every_answer_and_sum_to_1(name, request):
    verdict = request.getfixturevalue(name).verdict
    assert set(verdict.probability) == {*NAMES, NONE, UNKNOWN}
    assert sum(verdict.probability.values()) == pytest.approx(1.0)


def test_threads_of_one_diagnosis_do_not_wait_for_those_of_its_linear_algebra(biased):
    class AskedError(Exception):
        pass

    def threads() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    def ask(stage: str) -> None:
        raise AskedError(threads())

    before = threads()
    with pytest.raises(AskedError, match=r"^\{1\}$"):
        diagnose(biased.motions, MODEL, effects=SMALL_EFFECTS, progress=ask)
    assert threads() == before


def test_the_verdict_is_looked_at_again_at_other_noise(found):
    assert list(found.at_other_noise) == pytest.approx([s * found.noise.noise.angle_deg for s in (0.67, 1.5)])
    probable = [one.probability["scapula_landmark_bias"] for one in found.at_other_noise.values()]
    assert min(probable) > max(one.probability[NONE] for one in found.at_other_noise.values())
    unknown = [one.probability[UNKNOWN] for one in found.at_other_noise.values()]
    assert unknown[0] > found.verdict.probability[UNKNOWN] > unknown[1]


# --- how far --------------------------------------------------------------------------------------


def test_the_gap_shrinks_with_the_effect_on_postures_seen_and_unseen(found):
    for levels in (found.gaps.in_sample, found.gaps.unseen, found.gaps.other_motion):
        assert levels["with_effect"]["all"].value < levels["adapted"]["all"].value
        for of_bone in levels["adapted"].values():
            assert of_bone.low <= of_bone.value <= of_bone.high
    assert found.gaps.in_sample["adapted"]["all"].value < found.gaps.in_sample["base"]["all"].value
    in_sample, unseen, other_motion = (
        levels["adapted"]["all"].value for levels in (found.gaps.in_sample, found.gaps.unseen, found.gaps.other_motion)
    )
    assert in_sample < unseen < other_motion, "the less a model has seen, the less it knows"


def test_of_one_motion_postures_alone_are_held_out(biased, found):
    one = observe(taken(biased.motions, np.flatnonzero(biased.motions.motion == biased.motions.motion[0])))
    noise = found.noise.noise
    (none,) = fit_hypotheses(MODEL.girdle, SMALL_EFFECTS, [()], one, noise)
    levels = measure_gaps(MODEL.girdle, SMALL_EFFECTS, one, noise, [none, none])
    assert levels.other_motion is None
    assert levels.unseen["adapted"] == levels.unseen["with_effect"]
    assert levels.in_sample["adapted"]["all"].value < levels.unseen["adapted"]["all"].value


def test_without_an_effect_adapted_and_explained_are_one(nothing):
    for levels in (nothing.gaps.in_sample, nothing.gaps.unseen, nothing.gaps.other_motion):
        assert levels["with_effect"] == levels["adapted"]
    assert {changed.adapted_mm - changed.with_effect_mm for changed in nothing.parameters.values()} == {0.0}


def test_the_gap_of_a_right_model_is_near_the_noise_floor(nothing):
    """Adapted to 14 postures, six parameters take a little of the noise with them."""
    levels = nothing.gaps.in_sample
    assert 0.7 < levels["adapted"]["all"].value / levels["noise_floor"]["all"].value < 1.1


def test_subjects_and_postures_are_counted(found, biased):
    assert found.subjects == biased.motions.subjects
    assert found.left_out == {}
    assert found.postures == len(biased.motions.posture)
    assert found.noise.source == "estimated"


def test_proposals_are_sorted_and_none_separates_less_than_now(found):
    then = [proposal.separation_then for proposal in found.next_measurement]
    assert then == sorted(then, reverse=True)
    assert len({proposal.separation_now for proposal in found.next_measurement}) == 1
    assert min(then) > found.next_measurement[0].separation_now


# --- what must not matter -------------------------------------------------------------------------


def test_the_order_of_subjects_and_those_who_say_too_little_change_nothing(found, biased):
    """Reversed; one more with three postures; one more of whom only three angles are known in all but three."""
    motions = biased.motions
    named = [np.flatnonzero(motions.subject == name) for name in motions.subjects]
    assert min(map(len, named)) == FULL
    rows = np.concatenate([named[1][:3], *named[::-1], named[2]])
    more = taken(motions, rows)
    subject, angles_deg = more.subject.astype(object), more.angles_deg.copy()
    subject[:3], subject[-FULL:] = "short", "blind"
    angles_deg[-FULL:-3, :3] = np.nan
    again = diagnosed(replace(more, subject=subject.astype(str), angles_deg=angles_deg))
    assert again.subjects == found.subjects[::-1]
    assert set(again.left_out) == {"short", "blind"}
    assert all(reason.startswith("3 postures") for reason in again.left_out.values())
    assert again.postures == found.postures
    assert again.noise.noise.angle_deg == pytest.approx(found.noise.noise.angle_deg, rel=SAME_PROBABILITY)
    for name, probability in found.verdict.probability.items():
        assert again.verdict.probability[name] == pytest.approx(probability, abs=SAME_PROBABILITY)


@pytest.mark.parametrize("angles", [3, 6])
def test_too_little_of_everyone_is_an_error_with_a_remedy(biased, angles):
    """Three postures each, or three angles in each."""
    motions = biased.motions
    if angles == 6:
        of_each = [np.flatnonzero(motions.subject == name)[:3] for name in motions.subjects]
        poor = taken(motions, np.concatenate(of_each))
    else:
        angles_deg = motions.angles_deg.copy()
        angles_deg[:, angles:] = np.nan
        poor = replace(motions, angles_deg=angles_deg)
    with pytest.raises(InputError, match="no subject has 4 postures with more than 3 measured angles"):
        diagnosed(poor)
