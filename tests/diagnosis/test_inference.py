"""Search, weights, names, intervals and noise on small simulated worlds, and their parts by hand."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_worlds import CANDIDATES, every_frame, joint_fit, root_of, searched, simulated

from adapt.api import adapt_with_every_fold
from adapt.diagnosis.adapted_gaps import AdaptedGaps, gaps_of
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.noise import estimate_noise
from adapt.diagnosis.fit.posterior import modes
from adapt.diagnosis.fit.search_folds import folds_of
from adapt.diagnosis.fit.shoulders import MOST_POSTURES, sampled, shoulders_of
from adapt.diagnosis.inference import selection
from adapt.diagnosis.inference.alternatives import CredibleSet, similarity, with_what_does_as_well
from adapt.diagnosis.inference.amplitude import amplitudes, draws_of, share_of
from adapt.diagnosis.inference.intervals import fold_weights, interval, resampled_persons
from adapt.diagnosis.inference.next_measurement import propose
from adapt.diagnosis.inference.search import Search, search_of
from adapt.diagnosis.inference.selection import name_causes
from adapt.diagnosis.inference.unexplained import BY_CHANCE, more_than_noise, unexplained_share
from adapt.diagnosis.inference.weights import Weights, probabilities, probabilities_of_draws, weigh
from adapt.diagnosis.population_amplitudes import held_out_amplitudes
from adapt.diagnosis.result import Noise
from adapt.evaluation.held_out import adapt_with_folds
from adapt.solvers.objective import WEIGHT, down_weighted
from adapt.solvers.rows import posture_rows
from adapt.tables.folds import MOTION, PERSON, POSTURES, motions_and_thirds
from models import ParameterSet, load_model
from models.adapted_parameters import ADAPTED
from models.effects.amplitudes import NO_EFFECTS, Amplitudes
from motions import Motions

BIAS = "scapula_landmark_bias"

SAME_DEG = 1e-3
"""Tolerance between adaptations that end at a decrease of 1e-4 and adaptations that fully converge."""

AT_THE_MODE = 0.3
"""Largest distance of two modes, in posterior SDs of all amplitudes: nonlinearity, and unfinished steps."""

SAME_NATS = 0.05
"""Tolerance for one mode from two starts: a search ends where a step gains a hundredth of a nat."""

SHARE = 0.1
"""Tolerance for a share of the mean bias, 10 degrees: three errors of a constant angle from 14 postures with 0.3
degrees of noise, and the shrinkage to the mean."""


@pytest.mark.parametrize("of_noise", [9.0, np.inf], ids=["estimated", "given"])
def test_noise_is_more_than_noise_as_rarely_as_is_said(of_noise):
    """Check draws of a misfit and of the estimate of the noise."""
    draws, freedom, generator = 4000, 42, np.random.default_rng(4)
    chi2 = generator.chisquare(freedom, draws)
    variance = generator.chisquare(of_noise, draws) / of_noise if np.isfinite(of_noise) else np.ones(draws)
    noises = [Noise(float(np.sqrt(one)), "estimated", of_noise) for one in variance]
    found = np.mean([more_than_noise(x / one.angle_deg**2, freedom, one) for x, one in zip(chi2, noises, strict=True)])
    assert found == pytest.approx(BY_CHANCE, abs=3.0 * np.sqrt(BY_CHANCE / draws))


def test_left_and_right_of_a_person_are_held_out_together():
    motions = simulated().motions
    names = {name: f"p{k // 2}_{'left' if k % 2 else 'right'}" for k, name in enumerate(motions.subjects)}
    renamed = replace(motions, subject=np.array([names[s] for s in motions.subject.tolist()]))
    shoulders = shoulders_of(renamed)
    assert shoulders.person.tolist() == [0, 0, 1]
    folds = folds_of(shoulders)
    for fold in folds.each:
        assert sorted([*fold.tested, *fold.fitted]) == shoulders.rows_of(fold.subject).tolist()
        assert set(renamed.motion[fold.tested]) == {fold.held_out}
        assert fold.held_out not in renamed.motion[fold.fitted]
        expected = {s for s in range(3) if shoulders.person[s] == shoulders.person[fold.subject]}
        assert set(fold.held_out_subjects) == (expected if fold.kind == PERSON else set())
    assert set(folds.kinds) == {MOTION, PERSON}


def test_few_postures_of_a_motion_are_taken_from_end_to_end():
    few = shoulders_of(simulated().motions)
    same, nearest = sampled(few)
    assert same is few
    assert nearest.tolist() == list(range(len(few.subject)))
    every = shoulders_of(every_frame(few.motions, 30))
    some, nearest = sampled(every)
    for taken, given in zip(some.sequences(), every.sequences(), strict=True):
        assert some.motions.posture[taken].tolist() == list(range(1, MOST_POSTURES + 1))
        np.testing.assert_array_equal(some.angles[:, taken[[0, -1]]], every.angles[:, given[[0, -1]]])
        assert nearest[given].tolist() == sorted(nearest[given])
        assert set(nearest[given]) == set(taken)
        assert np.bincount(nearest[given])[taken].max() <= np.ceil(len(given) / (MOST_POSTURES - 1))


def test_amplitudes_of_a_fold_are_those_of_data_without_what_it_holds_out():
    """Check a fold's amplitudes, from the linear model, against the mode of the remaining shoulders and motions."""
    search, hypothesis = searched(BIAS), (BIAS,)
    joint, at = search.joint, search.mode(hypothesis)
    found = held_out_amplitudes(search.folds, joint.candidates, hypothesis, at, search.likelihood_without)
    for fold, amplitude in list(zip(search.folds.each, found, strict=True))[::4]:
        motions, others = (
            joint.shoulders.motions,
            ~np.isin(np.arange(len(joint.shoulders.subjects)), fold.held_out_subjects),
        )
        kept = (search.folds.label != fold.held_out) & others[joint.shoulders.subject]
        left = shoulders_of(motions.select(kept))
        alone = search_of(load_model("R2"), left, joint.model.effects)
        likelihood = Likelihood.of(alone.joint, search.discrepancy)
        (again,) = modes(alone.joint, likelihood, [hypothesis], [at.theta_mm[others]], [at.amplitude])
        given = alone.given(again, hypothesis)
        off = root_of(given).T @ (given.amplitude - amplitude)
        assert np.linalg.norm(off) < AT_THE_MODE


def adapted(motions: Motions, model: ParameterSet, effects: Amplitudes = NO_EFFECTS, k: float = 1.0) -> AdaptedGaps:
    """Compute the gaps of `girdle adapt --effect --thorax-downweighting k`."""
    folds, weight = motions_and_thirds(motions), down_weighted(WEIGHT, k)
    person = {name: number for number, name in enumerate(motions.subjects)}
    return gaps_of(adapt_with_folds(posture_rows(motions, effects), [model], folds, weight), person)


def test_the_gaps_of_the_tables_of_several_sets_are_those_of_a_diagnosis_alone():
    """Check bitwise equality: one adaptation serves the tables of several sets and the diagnosis."""
    motions, R2 = simulated().motions, load_model("R2")
    person = {name: k for k, name in enumerate(motions.subjects)}
    shared = adapt_with_every_fold(motions, [load_model("R4"), R2]).of("R2")
    found, alone = gaps_of(shared, person), adapted(motions, R2)
    assert (found.in_sample, found.held_out) == (alone.in_sample, alone.held_out)
    assert set(found.held_out) == {MOTION, POSTURES}
    np.testing.assert_array_equal(found.adapted.theta_mm, alone.adapted.theta_mm)


def test_a_hidden_bias_is_named_with_its_size():
    search = searched(BIAS)
    weights = weigh(search)
    assert sum(weights.probability.values()) == pytest.approx(1.0)
    named = name_causes(search)
    assert BIAS in named.hypothesis
    truth = simulated(BIAS).truth[[f"amplitude_{k}" for k in (1, 2, 3)]].mean().to_numpy()
    size = amplitudes(search, named.hypothesis, ())[BIAS]
    for value, one in zip(truth, size.directions.values(), strict=True):
        assert one.low - 1.0 < value < one.high + 1.0
    assert size.effect == BIAS
    assert isinstance(size.amplitude, tuple)
    np.testing.assert_allclose(size.amplitude, [one.value for one in size.directions.values()], rtol=5e-4)
    own = simulated(BIAS).truth[[f"amplitude_{k}" for k in (1, 2, 3)]].to_numpy()
    shares = own @ own.mean(axis=0) / (own.mean(axis=0) @ own.mean(axis=0))
    assert list(size.by_subject) == list(simulated(BIAS).motions.subjects)
    np.testing.assert_allclose(list(size.by_subject.values()), shares, atol=SHARE)
    assert named.sets[BIAS].names[0] == BIAS


def test_draws_have_mean_and_spread_of_the_posteriors_of_all_sets_with_the_cause_and_persons_drawn_anew():
    """Check draws against the posteriors of all sets with the cause, each with persons drawn anew.

    The mean is the mean of their means; the variance is the mean of their variances plus the variance of their means.
    """
    search, means, variances = searched(BIAS), [], []
    within = [node for node in search.usable if BIAS in node.hypothesis]
    for node in within:
        given = search.given(node.posterior, node.hypothesis)
        (own,) = (own for one, own in search.joint.candidates.slices(node.hypothesis) if one.name == BIAS)
        for times in resampled_persons(search.joint.shoulders.person, 2.0):
            amplitude, root = given.amplitude_of(times)
            means.append(amplitude[own])
            variances.append(np.diag(np.linalg.inv(root @ root.T))[own])
    weight = probabilities_of_draws([search.resampled(node) for node in within]).ravel() / len(search.times)
    mean = weight @ np.array(means)
    variance = weight @ np.array(variances) + weight @ (np.array(means) - mean) ** 2
    draws = draws_of(search, BIAS)
    assert (np.abs(draws.mean(axis=0) - mean) < 4.0 * np.sqrt(variance / len(draws))).all()
    np.testing.assert_allclose(draws.std(axis=0), np.sqrt(variance), rtol=0.2)


def test_a_share_is_of_what_amplitudes_do_at_the_postures():
    """Check shares by hand: a course 0, 1, 2 of amplitude 2, and a bend 0, 1, 0 that the mean does not have."""
    columns, a = np.array([[[0.0, 1.0, 2.0]], [[0.0, 1.0, 0.0]]]), np.array([2.0, 0.0])
    shares = share_of(np.array([[2.0, 0.0], [-1.0, 0.0], [2.0, 5.0], [0.0, 5.0]]), a, columns)
    np.testing.assert_allclose(shares, [1.0, -0.5, 1.5, 0.5])  # the bend adds (0, 5, 0) x (0, 2, 4) / 20


def test_the_interval_of_a_size_is_that_of_its_share():
    """Check the interval of the size against draws projected on the mean; the length of a draw with errors in all
    directions would give another interval."""
    search = searched(BIAS)
    size = amplitudes(search, name_causes(search).hypothesis, ())[BIAS]
    a = np.array([one.value for one in size.directions.values()])
    along = draws_of(search, BIAS) @ a / np.linalg.norm(a)
    np.testing.assert_allclose(size.size, [np.linalg.norm(a), *np.percentile(along, [2.5, 97.5])])


def test_nothing_is_named_where_nothing_is_hidden():
    search = searched()
    assert name_causes(search).hypothesis == ()


def test_a_candidate_is_the_same_as_itself():
    at = searched().without_causes
    assert similarity(at, BIAS, BIAS) == pytest.approx(1.0)
    assert similarity(at, BIAS, "thorax_tilt") == pytest.approx(similarity(at, "thorax_tilt", BIAS))


def test_a_candidate_that_does_nothing_is_like_no_other():
    """Check a candidate without effect on y, such as a course over elevations that nobody measured."""
    at = searched().without_causes
    Z = at.Z.copy()
    Z[..., len(ADAPTED) + at.joint.candidates.where((BIAS,))] = 0.0
    nothing = replace(at, Z=Z)
    assert similarity(nothing, BIAS, "thorax_tilt") == 0.0
    assert similarity(nothing, BIAS, BIAS) == 0.0


def test_fold_weights_sum_to_the_folds_and_hold_persons_together():
    person = np.array([0, 0, 0, 1, 1, 1])
    weights = fold_weights(person, 2000, 1)
    np.testing.assert_allclose(weights.sum(axis=1), len(person))
    together = np.corrcoef(weights[:, 0], weights[:, 1])[0, 1]
    apart = np.corrcoef(weights[:, 0], weights[:, 3])[0, 1]
    assert together > 0.0 > apart


def test_intervals_hold_their_value_and_leave_out_what_is_unknown():
    found = interval(np.array([1.0, 2.0, np.nan, 3.0]), np.array([0, 1, 2, 3]))
    assert found.value == pytest.approx(2.0)
    assert found.low < 2.0 < found.high
    assert np.isnan(interval(np.array([np.nan]), np.array([0])).value)


@pytest.mark.parametrize("sd", [0.5, 2.0])
def test_noise_is_found_beside_a_smooth_course(sd):
    shoulders = joint_fit().shoulders
    generator = np.random.default_rng(2)
    course = (shoulders.motions.humerus_elevation_deg / 60.0)[:, None] ** 2 * np.array([1.0, -2.0, 3.0])
    noise = estimate_noise(shoulders, course + sd * generator.standard_normal(course.shape))
    assert noise.source == "estimated"
    assert noise.angle_deg == pytest.approx(sd, rel=4.0 / np.sqrt(2.0 * noise.freedom))
    assert estimate_noise(shoulders, course, 1.2).angle_deg == 1.2


def test_the_share_left_over_goes_from_none_to_all():
    assert unexplained_share(3.0, 1.0, 1.0) == 0.0
    assert unexplained_share(3.0, 3.0, 1.0) == 1.0
    assert unexplained_share(3.0, 2.0, 1.0) == pytest.approx(0.5)
    assert np.isnan(unexplained_share(1.0, 1.0, 1.0))


def test_the_first_name_of_each_cause_is_the_one_that_is_sized_and_the_others_go_by_probability():
    search = searched(BIAS)
    named = name_causes(search)
    causes = search.joint.candidates.causes
    assert set(named.sets) == set(named.hypothesis)
    for name, one in named.sets.items():
        assert one.names[0] == causes[name]
        assert list(one.shares[1:]) == sorted(one.shares[1:], reverse=True)


def test_a_cause_of_which_the_data_say_nothing_is_about_as_probable_as_before_them():
    """Check inclusion probabilities without a hidden cause: two of four are expected, and none is high."""
    weights = weigh(searched())
    assert all(0.0 < p < 0.8 for p in weights.inclusion.values())
    assert sum(weights.probability.values()) == pytest.approx(1.0)


def test_persons_are_drawn_with_both_shoulders_and_count_as_much_as_they_are_many():
    """Check the SD 1 / sqrt(2) of a weight: with three persons it has the density 2 (1 - w/3) / 3."""
    times = resampled_persons(np.array([0, 0, 1, 2]))
    assert (times[:, 0] == times[:, 1]).all()
    np.testing.assert_allclose(times[:, 1:].sum(axis=1), 3.0)
    assert times.min() > 0.0
    assert times.std() == pytest.approx(np.sqrt(0.5), abs=0.1)  # 150 numbers
    np.testing.assert_allclose(resampled_persons(np.zeros(2, int)), 1.0)
    np.testing.assert_allclose(resampled_persons(np.zeros(2, int), 2.0), 1.0)


def test_of_twice_as_many_persons_a_size_spreads_as_the_mean_of_those_that_were_measured():
    """Check draws of 2 n persons: their mean varies by s^2 / 2 n within and between draws."""
    persons, values = 8, np.random.default_rng(1).standard_normal(8)
    times = resampled_persons(np.arange(persons), 2.0)
    np.testing.assert_allclose(times.sum(axis=1), 2.0 * persons)
    between = (times @ values / times.sum(axis=1)).var()
    within = values.var() / times.sum(axis=1).mean()
    assert between + within == pytest.approx(values.var() / persons, rel=0.25)


def test_landmarks_that_show_neither_cause_tell_both_apart_by_the_noise_of_the_angles():
    """Check proposals to separate a tilted thorax from bones that leave it: SC and AC show neither cause, but show
    where the bones are without the noise of the angles."""
    search, names = searched("thorax_tilt"), ("thorax_tilt", "scapulothoracic_gap")
    named, _ = (search.fit((name,), search.nodes[()]) for name in names)
    found = {one.what: one for one in propose(search, load_model("R2"), named, [names])}
    persons, some, all_four = (
        found[what]
        for what in ("twice as many persons", "positions of SC AC, to 3 mm", "positions of SC AC TS AI, to 3 mm")
    )
    assert persons.separation_then == pytest.approx(2.0 * persons.separation_now)
    assert persons.separation_now < some.separation_then < all_four.separation_then


def test_probabilities_are_the_mean_over_the_draws():
    """Odds of 3 in one draw and of 1 in the other: 3/4 and 1/2."""
    np.testing.assert_allclose(probabilities([np.log([3.0, 1.0]), np.zeros(2)]), [0.625, 0.375])


def test_from_a_wrong_cause_the_best_of_all_sets_is_reached():
    """Check that the search from a wrong cause reaches the best of all sets of four candidates.

    Its neighbours have one cause more, or another in its place.
    """
    found = searched(BIAS)
    search, every = (
        Search(found.joint, found.folds, beliefs=found.beliefs, discrepancy=found.discrepancy) for _ in range(2)
    )
    nothing = every.fit((), None)
    sets = [some for count in range(1, 5) for some in itertools.combinations(CANDIDATES, count)]
    every.fit_all([(every.joint.candidates.ordered(some), nothing) for some in sets])
    wrong = search.fit(("thorax_tilt",), search.fit((), None))
    others = [name for name in CANDIDATES if name != "thorax_tilt"]
    search.around()
    assert {frozenset(one) for name in others for one in ((name,), (*wrong.hypothesis, name))} <= set(
        map(frozenset, search.nodes)
    )
    assert search.best.hypothesis == every.best.hypothesis
    assert search.best.value == pytest.approx(every.best.value, abs=SAME_NATS)


def test_what_is_left_without_a_cause_is_fitted_and_not_predicted(monkeypatch):
    """Check that the search around a set fits every set with a cause less, even if it fits no other set: the linear
    model predicts what a further cause adds, and not what is left without one."""
    monkeypatch.setattr("adapt.diagnosis.inference.search._FITTED_AROUND", 0)
    found = searched(BIAS)
    search = Search(found.joint, found.folds, beliefs=found.beliefs, discrepancy=found.discrepancy)
    pair = search.joint.candidates.ordered((BIAS, "thorax_tilt"))
    search.fit(pair, search.fit((), None))
    search.around()
    assert set(search.nodes) == {(), pair, (BIAS,), ("thorax_tilt",)}


def test_the_likeliest_cause_stands_in_a_place_after_others_were_left_out():
    """Check four sets by hand: V is 4.2 for the best set (A, C), which does not need C, then 3 for A and 4 for B."""
    every = {some: SimpleNamespace(hypothesis=some, value=V) for some, V in {"AC": 4.2, "B": 4.0, "A": 3.0}.items()}
    nothing = SimpleNamespace(hypothesis="", value=0.0)
    places = {
        "AC": {"A": {"A": "AC"}, "C": {"C": "AC"}},
        "A": {"A": {"A": "A", "B": "B"}},
        "B": {"B": {"A": "A", "B": "B"}},
    }
    search = SimpleNamespace(
        best=every["AC"],
        known=(),
        joint=SimpleNamespace(candidates=SimpleNamespace(causes={})),
        without=lambda node, name: every.get(node.hypothesis.replace(name, ""), nothing),
        in_place_of=lambda node, name: {one: every[some] for one, some in places[node.hypothesis][name].items()},
        resampled=lambda node: np.array([node.value]),
    )
    chosen, found = selection._chosen(search)  # type: ignore[arg-type]
    assert chosen is every["B"]
    assert found == {"B": {"A": every["A"], "B": every["B"]}}


def test_what_is_known_is_in_every_set_and_never_left_out():
    known = ("thorax_tilt",)
    joint = joint_fit(BIAS)
    search = Search(joint, folds_of(joint.shoulders), known=known).run()
    assert all(set(known) <= set(hypothesis) for hypothesis in search.nodes)
    assert BIAS in search.best.hypothesis
    assert weigh(search).inclusion[known[0]] == pytest.approx(1.0)
    assert known[0] in name_causes(search).chosen.hypothesis


def test_angles_alone_do_not_say_which_joint_moves():
    """Check that other ways in which a constraint gives way become names of the joint, unless they are causes."""
    causes = {name: name for name in ("ac_translation", "sc_translation", "conoid_strain", "scapulothoracic_gap", BIAS)}
    sets = {
        "ac_translation": CredibleSet(("ac_translation", "thorax_tilt"), (0.7, 0.3)),
        "conoid_strain": CredibleSet(("conoid_strain",), (1.0,)),
        BIAS: CredibleSet((BIAS,), (1.0,)),
    }
    found = with_what_does_as_well(sets, causes, only_angles=True)
    names = ("ac_translation", "thorax_tilt", "sc_translation", "scapulothoracic_gap")
    assert found["ac_translation"] == CredibleSet(names, (0.7, 0.3, 0.0, 0.0))
    assert [found[name] for name in ("conoid_strain", BIAS)] == [sets[name] for name in ("conoid_strain", BIAS)]


def test_only_an_axial_rotation_that_was_measured_tells_what_changes_a3():
    """Check that without a measured axial rotation a cause of A3 has the estimate as further name, whatever else was
    measured.

    A joint that landmarks show stands alone.
    """
    causes = {name: name for name in ("conoid_strain", "clavicle_axial_estimate", "ac_translation", "sc_translation")}
    sets = {name: CredibleSet((name,), (1.0,)) for name in ("conoid_strain", "ac_translation")}
    found = with_what_does_as_well(sets, causes, only_angles=False)
    assert found["conoid_strain"] == CredibleSet(("conoid_strain", "clavicle_axial_estimate"), (1.0, 0.0))
    assert found["ac_translation"] == sets["ac_translation"]
    sets["clavicle_axial_estimate"] = CredibleSet(("clavicle_axial_estimate",), (1.0,))
    assert with_what_does_as_well(sets, causes, only_angles=False) == sets, "both are named"


def test_what_is_held_against_a_null_loses_its_probability():
    """Check the weights after one cause of a set has failed against the null: the set keeps its other cause."""
    causes = {BIAS: BIAS, "ac_translation": "ac_translation"}
    weights = Weights({(BIAS, "ac_translation"): 0.8, (BIAS,): 0.2}, causes, unexplained=0.0)
    found = weights.beyond(0.25, lambda name: name != BIAS)
    assert found.probability == pytest.approx({(BIAS,): 0.8, (BIAS, "ac_translation"): 0.2})
    assert found.inclusion == pytest.approx({BIAS: 1.0, "ac_translation": 0.2})
