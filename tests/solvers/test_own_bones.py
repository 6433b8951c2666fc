# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
# pyright: reportGeneralTypeIssues=false, reportCallIssue=false, reportOperatorIssue=false
# (own_bones is None after a plain adaptation; pandas and SciPy type nearly every result as "Series | object")
"""Adaptation with own bones: against IPOPT on the same objective, cases worked by hand, and simulated persons."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from oracles import bones, slsqp
from own_girdles import OWN, ipopt_own, own_objective
from own_people import NOISE_DEG, R2, SD, adapted, of_subject, people, simulated
from scipy.optimize import minimize_scalar

from adapt import adapt_subjects, fit_postures
from adapt.api import Adaptations
from adapt.evaluation import own_or_plain
from adapt.evaluation.held_out import adapt_with_folds
from adapt.own_bones import lowest_minimum
from adapt.own_bones.own_adaptation import People
from adapt.own_bones.scales import (
    Scales,
)
from adapt.solvers.objective import WEIGHT
from adapt.solvers.rows import posture_rows
from adapt.tables.folds import motions_and_thirds
from models import load_model
from models.adapted_parameters import ADAPTED
from models.effects.amplitudes import PersonalSize
from models.person.own_bones import NAMES, SIZES
from motions import InputError, Motions, read_motions
from motions.rhythm import REST_DEG
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG

SAME = 1e-9
"""Relative tolerance for E."""

UNMEASURED_SD_DEG = 1000.0
"""SD of an unmeasured angle about its value at rest."""

FREE_OF_ALL = dict.fromkeys(NAMES, 0.0)


def only(**sds: float) -> People:
    """Return people who differ only in these sizes."""
    return people(**FREE_OF_ALL | sds)


def F_deg2(found: Adaptations, motions: Motions, model: str = "R2") -> np.ndarray:
    """Compute F of each subject from E = w F / m."""
    measured = [np.isfinite(motions.angles_deg[motions.subject == name]).sum() for name in motions.subjects]
    return found.adapted[model].E * measured / WEIGHT


@pytest.fixture(scope="module")
def shipped() -> Motions:
    """Four subjects who follow the rhythm; none of them is exactly a girdle of the model."""
    motions = read_motions(DATA_FILE)
    return motions.select(np.isin(motions.subject, motions.subjects[:4]))


@pytest.fixture(scope="module")
def of_shipped(shipped) -> Adaptations:
    return adapted(shipped, model=[R2, load_model("breteler_dissection")])


@pytest.fixture(scope="module")
def world() -> SimpleNamespace:
    return simulated(60)


@pytest.fixture(scope="module")
def of_world(world) -> Adaptations:
    return adapted(world.motions)


@pytest.fixture(scope="module")
def world_of_a_set() -> SimpleNamespace:
    """A person who differs from the set only in the six adapted parameters."""
    return simulated(1, factor=0.0)


def test_sizes_are_in_the_order_of_the_definitions():
    assert NAMES == OWN


@pytest.mark.parametrize("model", ["R2", "breteler_dissection"])
def test_ipopt_finds_the_same_optimum_over_all_sizes_and_postures(shipped, of_shipped, model):
    """Check eight adaptations against IPOPT, started at our optimum and beside it."""
    girdle, found = bones(load_model(model).girdle), of_shipped.of(model)
    own, F = found.own_bones, F_deg2(of_shipped, shipped, model)
    generator = np.random.default_rng(2)
    for k, name in enumerate(shipped.subjects):
        measured = of_subject(shipped, name).angles_deg.T
        angles = found.adapted.angles[:, : measured.shape[1], k] * DEG
        at = girdle, own.prior_sd[:, k], NOISE_DEG, measured
        value, open_mm = own_objective(*at, own.sizes[:, k], angles)
        assert value == pytest.approx(F[k], rel=SAME)
        assert open_mm < 1e-8
        for away in (0.0, 0.1):  # distance of the start in SDs; twice that in degrees
            sizes = own.sizes[:, k] + away * own.prior_sd[:, k] * generator.standard_normal(len(OWN))
            other = ipopt_own(*at, sizes, angles + 2.0 * away * generator.standard_normal(angles.shape))
            assert other.success
            assert F[k] == pytest.approx(other.F, rel=SAME)
            np.testing.assert_allclose(own.sizes[:, k], other.sizes, atol=1e-5 * own.prior_sd[:, k].max())


def test_where_nobody_differs_it_is_the_set_and_its_posture_fits(shipped):
    found, plain = adapted(shipped, people(**FREE_OF_ALL)), fit_postures(shipped, R2)
    np.testing.assert_allclose(found.adapted["R2"].theta_mm.T, np.tile(R2.girdle.adapted_mm, (4, 1)), rtol=1e-14)
    np.testing.assert_array_equal(found.problems.own_bones.sizes, 0.0)
    np.testing.assert_array_equal(found.problems.own_bones.sd, 0.0)
    np.testing.assert_allclose(found.by_model["R2"].angles, plain.by_model["R2"].angles, atol=1e-9)
    J = plain.fits.groupby("subject", sort=False)["j_deg2"].mean()
    np.testing.assert_allclose(found.parameters["E"], WEIGHT * J, rtol=SAME)


@pytest.mark.parametrize(
    ("name", "key", "sd"), [("conoid_length", "conoid_length_mm", 1.5), ("TS_distance", "ts_distance_mm", 4.0)]
)
def test_one_size_alone_is_a_scalar_minimum(world_of_a_set, name, key, sd):
    """Check against Brent's method on S, from posture fits by SLSQP, plus the prior of one number."""
    motions = world_of_a_set.motions.select(world_of_a_set.motions.posture % 3 == 1)
    plain, start = bones(R2.girdle), fit_postures(motions, R2).by_model["R2"].angles * DEG
    found = adapted(motions, only(**{name: sd}))

    def F(size: float) -> float:
        girdle = replace(plain, **{key: getattr(plain, key) + size})
        postures = [slsqp(girdle, s, q) for s, q in zip(motions.angles_deg, start.T, strict=True)]
        assert all(one.open_mm < 1e-6 for one in postures)
        return sum(6.0 * one.j_deg2 for one in postures) + NOISE_DEG**2 * (size / sd) ** 2

    best = minimize_scalar(F, bounds=(-2.0 * sd, 2.0 * sd), method="bounded", options={"xatol": 1e-5})
    assert abs(best.x) > 0.01 * sd
    assert F_deg2(found, motions)[0] == pytest.approx(best.fun, rel=1e-7)
    assert found.problems.own_bones.sizes[OWN.index(name), 0] == pytest.approx(best.x, abs=1e-3)


def test_the_sd_of_one_size_is_that_of_the_curvature_of_F(world_of_a_set):
    """Check the SD at postures of the set without noise, where F is lowest: F'' / 2 sigma^2 is the precision."""
    sd, beside = 4.0, 0.2
    at_set = fit_postures(world_of_a_set.true, R2).by_model["R2"]
    motions = replace(world_of_a_set.true, angles_deg=at_set.angles.T * DEG)
    own = adapted(motions, only(AI_distance=sd)).problems.own_bones
    k, plain = OWN.index("AI_distance"), bones(R2.girdle)
    assert own.sizes[k, 0] == pytest.approx(0.0, abs=1e-6)

    def F(size: float) -> float:
        girdle = replace(plain, ai_distance_mm=plain.ai_distance_mm + size)
        S = sum(6.0 * slsqp(girdle, q, q).j_deg2 for q in motions.angles_deg)
        return S + NOISE_DEG**2 * (size / sd) ** 2

    curvature = (F(beside) + F(-beside)) / beside**2
    assert own.sd[k, 0] == pytest.approx(NOISE_DEG * np.sqrt(2.0 / curvature), rel=1e-3)
    assert own.sd[k, 0] < 0.5 * sd


def test_a_size_moves_farther_the_more_people_differ_in_it(shipped, monkeypatch):
    """Check sizes from the set to the minimum of S alone, with the test of predictions switched off."""
    monkeypatch.setattr(own_or_plain, "DOUBTFUL_SDS", np.inf)
    k = OWN.index("TS_distance")
    runs = [adapted(shipped, only(TS_distance=sd)) for sd in (1e-3, 1.0, 4.0, 16.0, 1e4)]
    sizes = np.array([run.problems.own_bones.sizes[k] for run in runs])
    F = np.array([F_deg2(run, shipped) for run in runs])
    assert (np.diff(np.abs(sizes), axis=0) > 0.0).all()
    assert (np.diff(F, axis=0) < 0.0).all()
    assert (np.abs(sizes[0]) < 1e-4).all()
    free = adapted(shipped, only(TS_distance=1e6)).problems.own_bones.sizes[k]
    np.testing.assert_allclose(sizes[-1], free, atol=1e-4)


def test_thorax_and_sc_share_what_is_found_of_both_by_their_variances(of_world):
    """A1-A3 depend on M - SC alone; var_M^-1 M + var_SC^-1 SC is independent of it, and keeps its prior."""
    own = of_world.problems.own_bones
    for axis in "yz":
        M, SC = OWN.index(f"M_{axis}"), OWN.index(f"SC_{axis}")
        to_both = 1.0 / SD[[M, SC]] ** 2
        np.testing.assert_allclose(to_both @ own.sizes[[M, SC]], 0.0, atol=1e-10)
        covariance = np.moveaxis(own.covariance[np.ix_([M, SC], [M, SC])], -1, 0)
        np.testing.assert_allclose(to_both @ covariance @ to_both, to_both.sum(), rtol=1e-9)
        assert (own.sd[[M, SC]].max(axis=1) < SD[[M, SC]]).all()


def test_a_thorax_that_is_elsewhere_with_its_sc_is_the_same_thorax(shipped, of_shipped):
    away = np.array([0.0, 30.0, -20.0])
    girdle = replace(R2.girdle, centre_mm=R2.girdle.centre_mm + away, sc_mm=R2.girdle.sc_mm + away)
    moved = adapted(shipped, model=replace(R2, girdle=girdle, points_mm=R2.points_mm + away[:, None]))
    np.testing.assert_allclose(moved.adapted["R2"].E, of_shipped.adapted["R2"].E, rtol=SAME)
    np.testing.assert_allclose(moved.problems.own_bones.sizes, of_shipped.of("R2").own_bones.sizes, atol=1e-4)


def test_with_much_noise_people_are_as_the_set(shipped):
    own = adapted(shipped, people(Scales(noise_deg=1e4))).problems.own_bones
    np.testing.assert_allclose(own.sizes / own.prior_sd, 0.0, atol=1e-4)
    np.testing.assert_allclose(own.sd, own.prior_sd, rtol=1e-4)


def test_without_noise_F_is_no_higher_than_at_the_truth():
    person = simulated(6, noise_deg=0.0, seed=4)
    little = 0.05
    found = adapted(person.motions, people(Scales(noise_deg=little)))
    assert (found.adapted["R2"].status == "ok").all()
    of_truth = little**2 * ((person.sizes / SD[:, None]) ** 2).sum(axis=0)
    assert (F_deg2(found, person.motions) <= of_truth).all()


def test_single_precision_is_left_to_the_plain_adaptation(shipped, of_shipped):
    found = adapted(shipped, dtype=np.float32)
    np.testing.assert_array_equal(found.adapted["R2"].E, of_shipped.adapted["R2"].E)


def test_intervals_hold_the_truth_as_often_as_they_say(world, of_world):
    """Check 95 % intervals of 60 persons: of the six adapted parameters, and of the other sizes together."""
    assert (of_world.adapted["R2"].status == "ok").all()
    own = of_world.problems.own_bones
    within = np.abs(own.sizes - world.sizes) <= 1.96 * own.sd
    six = len(ADAPTED)
    assert 0.90 <= within[:six].mean() <= 0.99
    assert 0.90 <= within[six:].mean() <= 0.99
    np.testing.assert_array_equal(of_world.uncertainty.sd_mm, own.sd[:six])
    np.testing.assert_allclose(own.prior_sd, np.repeat(SD[:, None], within.shape[1], axis=1), rtol=1e-12)


def test_nothing_adapted_is_farther_from_the_truth_than_the_set_is(world, of_world):
    off = of_world.problems.own_bones.sizes - world.sizes
    by_size, of_set = (np.sqrt((x**2).mean(axis=1)) for x in (off, world.sizes))
    assert (by_size <= 1.05 * of_set).all()
    six = slice(len(ADAPTED))
    assert np.mean((by_size / of_set)[six]) < 0.97


def test_motions_that_were_held_out_are_predicted_better_than_by_the_plain_adaptation(world):
    some = world.motions.select(np.isin(world.motions.subject, world.motions.subjects[:20]))
    plain, own = (adapt_subjects(some, R2, own_bones=how).heldout for how in (False, people()))
    assert own["status"].eq("ok").all()
    for bone in ("clavicle", "scapula"):
        column = f"{bone}_gap_unseen_deg"
        assert own[column].mean() < 0.95 * plain[column].mean()


def test_a_subject_alone_is_the_same_as_among_others(shipped):
    """Check bitwise equality, on which a run in parts relies, for subjects with unequal numbers of postures."""
    names = shipped.subjects
    fewer = shipped.select(shipped.posture <= 7 - np.array([2 * names.index(one) for one in shipped.subject.tolist()]))
    together = adapted(fewer)
    for k, name in enumerate(names):
        alone = adapted(of_subject(fewer, name))
        assert alone.adapted["R2"].E[0] == together.adapted["R2"].E[k]
        for field in ("sizes", "sd"):
            one, other = (getattr(run.problems.own_bones, field) for run in (alone, together))
            np.testing.assert_array_equal(one[:, 0], other[:, k])


def test_angles_that_nobody_measured_do_not_count(shipped):
    """Check against IPOPT where two angles, the clavicle's axial rotation among them, were never measured.

    IPOPT has the four other angles, and the weak weights that hold these two.
    """
    angles = shipped.angles_deg.copy()
    angles[:, [2, 5]] = np.nan
    motions = of_subject(replace(shipped, angles_deg=angles), shipped.subjects[1])
    found = adapted(motions)
    own, ended = found.problems.own_bones, found.adapted["R2"]
    assert ended.status.tolist() == ["ok"]
    measured = np.isfinite(motions.angles_deg.T)
    target = np.where(measured, motions.angles_deg.T, REST_DEG[:, None])
    at = bones(R2.girdle), own.prior_sd[:, 0], NOISE_DEG, target
    weights = np.where(measured, 1.0, UNMEASURED_SD_DEG**-2.0)
    other = ipopt_own(*at, own.sizes[:, 0], ended.angles[..., 0] * DEG, weights)
    assert other.success
    assert F_deg2(found, motions)[0] == pytest.approx(other.F, rel=SAME)


def test_of_three_postures_the_prior_says_the_rest(shipped):
    motions = of_subject(shipped, shipped.subjects[0])
    three = motions.select(np.arange(len(motions.posture)) < 3)
    found = adapted(three)
    own = found.problems.own_bones
    assert found.adapted["R2"].status.tolist() == ["ok"]
    assert (np.abs(own.sizes) <= 3.0 * own.prior_sd).all()
    assert (own.sd > 0.7 * own.prior_sd).mean() > 0.5
    assert "A_y" in found.parameters["not_told"][0].split()
    assert (own.sd[:, 0] >= adapted(motions).problems.own_bones.sd[:, 0] - 1e-9).mean() > 0.9


def test_bad_subjects_leave_the_others_as_they_are(shipped, of_shipped):
    """Three bad subjects: postures that no girdle can take, a posture with only two angles, no number at all."""
    angles = shipped.angles_deg.copy()
    far, few, none = (shipped.subject == name for name in shipped.subjects[1:])
    angles[far] = np.array([-60.0, 80.0, 90.0, 120.0, -80.0, 100.0])
    angles[np.flatnonzero(few)[0], :4] = np.nan
    angles[none] = np.nan
    found = adapted(replace(shipped, angles_deg=angles))
    words, good = found.adapted["R2"].status.tolist(), of_shipped.of("R2").own_bones
    assert words[0] == "ok"
    assert words[2:] == ["invalid", "invalid"]
    np.testing.assert_allclose(found.problems.own_bones.sizes[:, 0], good.sizes[:, 0], rtol=SAME, atol=1e-9)
    cells = found.parameters[[size.key for size in SIZES[len(ADAPTED) :]]].to_numpy(float)
    assert np.isfinite(cells[0]).all()
    assert np.isnan(cells[2:]).all()


@pytest.mark.parametrize(
    ("how", "cause"),
    [
        ({"objective": "mm2_deg2_landmarks"}, "no variant of E and no down-weighting changes it"),
        ({"thorax_downweighting": 30.0}, "no variant of E and no down-weighting changes it"),
        ({"effects": {"scapula_landmark_bias": PersonalSize((0.0,) * 3, (1.0,) * 3)}}, "are not fitted beside them"),
    ],
)
def test_what_has_no_part_in_the_objective_is_refused(shipped, how, cause):
    with pytest.raises(InputError) as caught:
        adapted(shipped, True, **how)
    assert caught.value.file == "--own-bones"
    assert cause in caught.value.cause
    assert caught.value.remedy == "Leave one of the two out"


@pytest.mark.parametrize(
    ("sds", "cause", "remedy"),
    [
        ({"TS_y": 1.0}, "there is no size 'TS_y'", "TS_x"),
        ({"TS_x": -1.0}, "the SD of TS_x is -1", "0 or more"),
        ({"TS_x": np.nan}, "the SD of TS_x is nan", "0 or more"),
        ({"TS_x": np.inf}, "the SD of TS_x is inf", "0 or more"),
    ],
)
def test_an_sd_that_is_none_is_refused(shipped, sds, cause, remedy):
    with pytest.raises(InputError) as caught:
        adapted(shipped, sds)
    assert cause in caught.value.cause
    assert remedy in caught.value.remedy


def test_parts_are_started_where_others_of_the_person_ended(shipped, monkeypatch):
    """Check that with starts from other parts of the person no part ends higher, and some end a hundredth lower."""

    def E_of_parts() -> np.ndarray:
        rows, folds = posture_rows(shipped), motions_and_thirds(shipped)
        return adapt_with_folds(rows, [load_model("breteler_dissection")], folds, people=people()).held_out.adapted.E

    with_others = E_of_parts()
    monkeypatch.setattr(lowest_minimum, "_with_starts_of_kin", lambda *_: None)
    alone = E_of_parts()
    assert (with_others <= alone * (1.0 + SAME)).all()
    assert (with_others < 0.99 * alone).any()


def test_a_first_start_that_no_other_helps_goes_on_to_its_end(world, monkeypatch):
    """Check that a first start cut short after one step ends where an uninterrupted search ends."""
    monkeypatch.setattr(lowest_minimum, "_keep_lower", lambda *_: None)
    in_one_go = adapted(world.motions).adapted["R2"]
    monkeypatch.setattr(lowest_minimum, "_FIRST_STEPS", 1)
    found = adapted(world.motions).adapted["R2"]
    assert (found.status == "ok").all()
    np.testing.assert_allclose(found.E, in_one_go.E, rtol=SAME)
