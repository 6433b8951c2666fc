"""Search, weights, names, intervals and noise on small simulated worlds, and the parts that can be checked by hand."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from small_worlds import joint_fit, searched, simulated

from adapt.diagnosis.fit.noise import estimate_noise
from adapt.diagnosis.fit.shoulders import shoulders_of
from adapt.diagnosis.fit.unseen_folds import PERSON, folds_of
from adapt.diagnosis.inference.alternatives import in_place_of, similarity
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.budget import alone_deg, ladder, refitted
from adapt.diagnosis.inference.correlation import independence_of, mean_of_others, weight_of_common
from adapt.diagnosis.inference.fingerprint import axial_is_computed
from adapt.diagnosis.inference.intervals import interval
from adapt.diagnosis.inference.left_over import left_over_share
from adapt.diagnosis.inference.naming import Named, gain, name_causes, settle
from adapt.diagnosis.inference.weights import fold_weights, weigh
from adapt.diagnosis.result import NONE
from adapt.tables.held_out import MOTION
from motions.rhythm import clavicle_axial_rotation
from motions.rotations import DEG, rotation_from_cardan

BIAS = "scapula_landmark_bias"


def test_left_and_right_of_a_person_are_held_out_together():
    motions = simulated().motions
    names = {name: f"p{k // 2}_{'left' if k % 2 else 'right'}" for k, name in enumerate(motions.subjects)}
    renamed = replace(motions, subject=np.array([names[s] for s in motions.subject.tolist()]))
    shoulders = shoulders_of(renamed)
    assert shoulders.person.tolist() == [0, 0, 1]
    folds = folds_of(shoulders)
    for test in folds.tests:
        part = folds.parts[test.part]
        assert not set(test.rows) & set(part.rows)
        group = [one for one in folds.parts if one.group == part.group]
        assert not any(shoulders.motion[one.rows[0]] == test.motion for one in group)
        unfelt = {one.subject for one in group if one.importance < 1.0}
        expected = {s for s in range(3) if shoulders.person[s] == shoulders.person[test.subject]}
        assert unfelt == (expected if test.kind == PERSON else set())
    assert set(folds.kinds) == {MOTION, PERSON}


def test_linear_predictions_are_near_exact_refits():
    search = searched(BIAS)
    node = search.nodes[(BIAS,)]
    exact = refitted(search, node).predicted.gaps_deg.mean()
    assert node.predicted.gaps_deg.mean() == pytest.approx(exact, rel=0.05)


def test_a_hidden_bias_is_named_with_its_size():
    search = searched(BIAS)
    weights = weigh(search)
    assert sum(weights.probability.values()) == pytest.approx(1.0)
    named = name_causes(search, 0.1)
    assert BIAS in named.hypothesis
    truth = simulated(BIAS).truth[[f"amplitude_{k}" for k in (1, 2, 3)]].mean().to_numpy()
    size = amplitudes(search, named.node)[BIAS]
    for value, one in zip(truth, size.directions.values(), strict=True):
        assert one.low - 1.0 < value < one.high + 1.0
    assert size.option.startswith(BIAS)
    steps = ladder(search, named.node)
    assert [rung.added for rung in steps][:2] == ["", BIAS]
    assert steps[1].gaps_deg.mean() < 0.7 * steps[0].gaps_deg.mean()
    assert named.sets[BIAS].names[0] == BIAS


def test_a_hidden_bias_predicts_best_alone_and_better_than_nothing():
    search = searched(BIAS)
    alone = alone_deg(search)
    assert next(iter(alone)) == BIAS
    assert list(alone.values()) == sorted(alone.values())
    assert alone[NONE] == pytest.approx(search.nodes[()].predicted.gaps_deg.mean(), rel=1e-9)
    assert alone[BIAS] < 0.7 * alone[NONE]


def test_nothing_is_named_where_nothing_is_hidden():
    search = searched()
    assert name_causes(search, 0.1).hypothesis == ()


def test_a_candidate_is_the_same_as_itself():
    at = searched().nodes[()].linearised
    assert similarity(at, BIAS, BIAS) == pytest.approx(1.0)
    assert similarity(at, BIAS, "thorax_tilt") == pytest.approx(similarity(at, "thorax_tilt", BIAS))


def test_a_gain_that_is_the_same_in_every_fold_is_probable_and_one_that_is_noise_is_not():
    """Of one set in the place of two, so that their priors are alike but for one cause."""
    search = searched(BIAS)
    less, node = search.nodes[()], search.nodes[(BIAS,)]
    none = np.zeros_like(node.fitted.amplitude)
    tests = len(search.folds.tests)
    generator = np.random.default_rng(0)

    def with_gaps(share_left: float, scatter: float):
        factor = share_left * (1.0 + scatter * generator.standard_normal(tests))
        gaps = np.full((tests, 6), 2.0) * factor[:, None]
        return node.predicted._replace(gaps_deg=gaps, squares=np.outer(6.0 * gaps[:, 0] ** 2, [1.0, 0.0]))

    before = less._replace(predicted=with_gaps(1.0, 0.0))
    alike = node._replace(fitted=replace(node.fitted, amplitude=none), predicted=with_gaps(0.5, 0.01))
    sure = gain(search, before, alike, 1.0)
    assert sure.share == pytest.approx(1.0, abs=0.02)
    assert sure.enough
    noise = alike._replace(predicted=with_gaps(1.0, 0.3))
    assert not gain(search, before, noise, 1.0).enough


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


WHITE = 0.25
"""Correlations of so few postures are not quite 0, and what is below it is cut: on the mean a fifth is lost."""

REPEATS = 20


def white_noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((len(joint_fit().shoulders.subject), 3))


def test_postures_that_share_a_discrepancy_are_one_and_those_of_white_noise_each_one():
    shoulders = joint_fit().shoulders
    n = len(shoulders.subject) / (len(shoulders.subjects) * len(shoulders.kinds))
    each_its_own = np.random.default_rng(3).standard_normal((len(shoulders.subjects), len(shoulders.kinds), 3))
    assert independence_of(shoulders, each_its_own[shoulders.subject, shoulders.motion]).numbers == pytest.approx(3.0)
    found = np.mean([independence_of(shoulders, white_noise(seed)) for seed in range(REPEATS)], axis=0)
    np.testing.assert_allclose(found, [3.0 * n, 1.0], rtol=WHITE)


def test_what_all_shoulders_have_in_common_counts_less_the_more_it_is():
    """Common and own noise of the same size have rho = 1/2: (1 - rho) / (1 + (S - 1) rho) of S shoulders."""
    shoulders = joint_fit().shoulders
    count, places = len(shoulders.subjects), shoulders.places
    assert independence_of(shoulders, np.ones((len(places), 3))) == pytest.approx((3.0, 0.0))
    courses = np.random.default_rng(5).standard_normal((REPEATS, places.max() + 1, 3))
    np.testing.assert_allclose(mean_of_others(shoulders, courses[0, places]), courses[0, places], atol=1e-12)
    weights = [
        independence_of(shoulders, course[places] + white_noise(seed)).common_weight
        for seed, course in enumerate(courses)
    ]
    assert np.mean(weights) == pytest.approx(0.5 / (1.0 + (count - 1) * 0.5), rel=WHITE)


def test_one_shoulder_shares_with_nobody():
    alone = shoulders_of(simulated(subjects=1).motions)
    constant = np.ones((len(alone.subject), 3))
    assert np.isnan(mean_of_others(alone, constant)).all()
    assert independence_of(alone, constant) == pytest.approx((3.0, 1.0))


def test_squares_are_parted_into_what_is_own_and_what_is_common():
    """Shoulders that differ by +-1 about a common 2; and all of it together is the mean square."""
    joint = joint_fit()
    folds, shoulders = folds_of(joint.shoulders), joint.shoulders
    side = np.array([1.0, -1.0, 0.0])[shoulders.subject[folds.rows]]
    everywhere = np.bincount(shoulders.places) == len(shoulders.subjects)
    assert everywhere.all()
    own, common = folds.parted(np.outer(2.0 + side, [1.0, 0.0, 0.0])).T
    np.testing.assert_allclose(common, 4.0)
    np.testing.assert_allclose(own, side[np.searchsorted(folds.test_of, np.arange(len(folds.tests)))] ** 2)
    y = white_noise(6)[folds.rows]
    np.testing.assert_allclose(folds.parted(y).sum(axis=1).mean(), (y**2).sum(axis=1).mean(), rtol=1e-12)


def test_the_weight_of_what_is_common_is_that_of_its_covariance():
    """y' C^-1 y of C = (1 - rho) I + rho 1 1', by inversion."""
    y, rho = np.array([1.3, -0.4, 2.0, 0.7]), 0.3
    count = len(y)
    C = (1.0 - rho) * np.eye(count) + rho
    parted = ((y - y.mean()) ** 2).sum() + weight_of_common(rho, count, 1.0) * count * y.mean() ** 2
    assert parted == pytest.approx((1.0 - rho) * y @ np.linalg.solve(C, y))


def test_an_axial_rotation_that_is_computed_is_known_by_it():
    motions = simulated().motions
    assert not axial_is_computed(shoulders_of(motions))
    angles = jnp.asarray(motions.angles_deg.T / DEG)
    made = motions.angles_deg.copy()
    for subject in motions.subjects:
        rows = np.flatnonzero(motions.subject == subject)
        first = rows[np.argmin(motions.humerus_elevation_deg[rows])]
        own = [
            jnp.broadcast_to(rotation_from_cardan(angles[part, first])[..., None], (3, 3, len(rows)))
            for part in (slice(3), slice(3, 6))
        ]
        made[rows, 2] = np.asarray(clavicle_axial_rotation(angles[:2, rows], angles[3:, rows], *own)) * DEG + 5.0
    assert axial_is_computed(shoulders_of(replace(motions, angles_deg=made)))


def test_the_share_left_over_goes_from_none_to_all():
    assert left_over_share(3.0, 1.0, 1.0) == 0.0
    assert left_over_share(3.0, 3.0, 1.0) == 1.0
    assert left_over_share(3.0, 2.0, 1.0) == pytest.approx(0.5)
    assert np.isnan(left_over_share(1.0, 1.0, 1.0))


def test_the_first_name_of_each_cause_is_the_most_probable_and_the_one_that_is_sized():
    """Of every cause, by exact fits, whatever the linear prediction thought."""
    search = searched(BIAS)
    named = name_causes(search, 0.1)
    causes = search.joint.candidates.causes
    assert set(named.sets) == set(named.hypothesis)
    for name, one in named.sets.items():
        assert one.names[0] == causes[name]
        assert list(one.shares) == sorted(one.shares, reverse=True)
        alternatives = in_place_of(search, named.node, name, ())
        assert sum(other.share for other in alternatives.values()) == pytest.approx(1.0)
        assert all(other.node.hypothesis in search.refits for other in alternatives.values())


def test_a_stand_in_gives_way_to_what_exact_fits_find_more_probable():
    """Even if the set that is named at first has the wrong cause in the place of the right one."""
    search = searched(BIAS)
    stand_in = search.fit(("scapulothoracic_gap",), search.nodes[()])
    rungs = [ladder(search, search.nodes[(BIAS,)])[0]._replace(added="")]
    found = settle(search, Named(stand_in, {}, rungs), 0.1)
    assert found.hypothesis == (BIAS,)
    assert found.rungs[-1].added == BIAS


def test_whatever_is_set_aside_the_named_cause_stays_in_its_place():
    search = searched(BIAS)
    node = search.nodes[(BIAS,)]
    every = {one.hypothesis for one in search.usable} - {node.hypothesis}
    (only,) = in_place_of(search, node, BIAS, every).values()
    assert (only.node.hypothesis, only.share) == (node.hypothesis, pytest.approx(1.0))
