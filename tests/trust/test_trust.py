# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportGeneralTypeIssues=false
# pyright: reportIndexIssue=false
# (pandas and SciPy type nearly every result as "this or that")
"""Uncertainty of adapted parameters, against independent code and cases worked by hand. All subjects are simulated."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from command import girdle, written
from oracles import bones, ellipsoid_distance, with_theta
from scipy.optimize import approx_fprime

from adapt.api import adapt_subjects
from adapt.evaluation.covariance import (
    NORMAL_95,
    Uncertainty,
    reduced_inverse,
    sd,
    uncertainty,
    within_bounds,
)
from adapt.evaluation.held_out import held_out
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.output.written_files import LIST
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch, adapted_from
from adapt.solvers.problems import Problems, problems_of, select_problems
from adapt.solvers.rows import posture_rows
from adapt.tables.folds import MOTION, POSTURES, motions_and_thirds
from adapt.tables.held_out import by_subject
from adapt.tables.results import HELD_OUT
from adapt.trust.assessment import BOUNDS, NONE, intervals
from adapt.trust.flat_directions import flat_directions
from adapt.trust.profile import profile_intervals
from adapt.trust.weight_choice import WEIGHTS, weight_table
from models import ParameterSet, load_model
from models.adapted_parameters import PERSON_SD_MM
from motions import Motions
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG

SUBJECTS = 4

STEP_DEG = 0.05
"""Step of a measured angle for differences of theta; the third order of E changes them by 1e-4 of their size."""

FOLLOWS = 2e-3
"""Relative to the largest: a central difference over that step, of optima exact to 1e-8 mm^2 per mm of slope."""

SAME_THETA_MM = 1e-6
"""Tolerance between adaptations from different starts: slope tolerance, 1e-8, over curvature."""

REPLICATES = 128

SAME_SPREAD = 0.25
"""Tolerance for |ln| of the ratio of two SDs: 128 repetitions determine theirs to 13 % at two SDs; E is not exactly a
parabola either. A single subject may differ more in M_y and A_y, which are flat: there the mean over subjects
counts."""

FIRM = [1, 4, 5]
"""M_z, A_z and the conoid."""


@dataclass(frozen=True)
class Case:
    """Simulated subjects with their adaptations."""

    model: ParameterSet
    motions: Motions
    data: Problems
    adapted: Adapted
    found: Uncertainty


@pytest.fixture(scope="module")
def case() -> Case:
    model = load_model("breteler_dissection")
    motions = simulate_model_subjects(model, None, SUBJECTS, 1.5, seed=7).motions
    data = problems_of(posture_rows(motions), [model])
    adapted = adapt_batch(data)
    assert set(adapted.status) == {status.OK}
    assert not adapted.at_bound.any()
    return Case(model, motions, data, adapted, uncertainty(data, adapted))


# --- curvature -----------------------------------------------------------------------------------------------------


def test_the_optimum_follows_the_measured_angles_as_the_derivative_says(case):
    """Check dtheta/ds = -H^-1 B against adaptations to measurements that differ by a twentieth of a degree."""
    curved = case.found.curvature
    slope = -np.linalg.solve(
        np.moveaxis(curved.of_points + curved.of_motion, -1, 0), np.moveaxis(curved.by_angle, -1, 0).reshape(4, 6, -1)
    ).reshape(SUBJECTS, 6, 6, -1)
    for angle, posture in ((0, 2), (2, 5), (4, 9), (5, 13)):
        moved = []
        for sign in (1.0, -1.0):
            angles = np.array(case.data.angles)
            angles[angle, posture] += sign * STEP_DEG / DEG
            moved.append(adapted_from(select_problems(case.data, np.arange(4), angles=angles), case.adapted.theta_mm))
        found = (moved[0].theta_mm - moved[1].theta_mm) / (2.0 * STEP_DEG / DEG)
        expected = np.moveaxis(slope[:, :, angle, posture], 0, -1)
        assert np.abs(found - expected).max() <= FOLLOWS * np.abs(slope).max()


def test_the_curvature_of_the_points_is_that_of_the_other_engine(case):
    """Check H_D against SciPy's finite differences of D, twice, with distances by Brent's method."""
    girdle = bones(case.model.girdle)

    def D(theta):
        moved = with_theta(girdle, theta)
        return np.mean([ellipsoid_distance(p - moved.centre_mm, moved.semi_axes_mm)[0] ** 2 for p in points.T])

    points, theta = np.asarray(case.model.points_mm), case.adapted.theta_mm[:, 1]
    second = np.array([approx_fprime(theta, lambda x, k=k: approx_fprime(x, D, 1e-3)[k], 1e-1) for k in range(6)])
    of_points = case.found.curvature.of_points[..., 1]
    assert np.abs(second - of_points).max() <= 5e-3 * np.abs(of_points).max()


def test_curvature_of_the_motion_is_the_rise_of_e(case):
    """Check E beside the optimum, with refitted postures: a rise of 1/2 v' H v, in flat and stiff directions."""
    H = case.found.curvature.of_points + case.found.curvature.of_motion
    for problem in range(SUBJECTS):
        values, directions = np.linalg.eigh(H[..., problem])
        for k in (0, 3, 5):
            size = 0.05 / np.sqrt(values[k])
            E = []
            for sign in (1.0, -1.0):
                theta = case.adapted.theta_mm + sign * size * directions[:, [k]]
                held = np.stack([theta, theta])
                E.append(adapted_from(select_problems(case.data, np.arange(4), bounds_mm=held), theta).E[problem])
            rise = np.mean(E) - case.adapted.E[problem]
            assert rise == pytest.approx(0.5 * 0.05**2, rel=0.02)


# --- covariance ----------------------------------------------------------------------------------------------------


def test_the_noise_part_is_what_repeated_measurements_scatter_by(case):
    """Check by a parametric bootstrap: closed postures of each adapted subject with new errors, adapted anew."""
    _, postures, count = case.adapted.angles.shape
    problem = np.tile(np.arange(count), REPLICATES)
    errors = np.random.default_rng(3).standard_normal((REPLICATES, count, 6, postures))
    errors *= (case.found.noise_deg / DEG)[:, None, None]
    angles = case.adapted.angles[..., problem] + np.moveaxis(errors.reshape(-1, 6, postures), 0, -1)
    again = adapted_from(select_problems(case.data, problem, angles=angles), case.adapted.theta_mm[:, problem])
    assert (again.status == status.OK).all()
    ratio = np.std(again.theta_mm.reshape(-1, REPLICATES, count), axis=1) / sd(case.found.noise_mm2)
    print("bootstrap SD / SD:", np.round(ratio, 2))
    assert np.abs(np.log(ratio[FIRM])).max() <= SAME_SPREAD
    assert np.abs(np.log(ratio).mean(axis=1)).max() <= SAME_SPREAD


def test_noise_of_no_subject_is_no_uncertainty(case):
    """Check both parts of the covariance: no noise where the chain takes the angles exactly, no person at Sigma = 0."""
    exact = select_problems(case.data, np.arange(4), angles=np.asarray(case.adapted.angles))
    adapted = case.adapted._replace()
    found = uncertainty(exact, adapted)
    assert found.noise_deg.max() == 0.0
    assert sd(found.noise_mm2).max() == 0.0
    none = uncertainty(case.data, adapted, person_sd_mm=np.zeros(6))
    assert sd(none.person_mm2).max() == 0.0
    np.testing.assert_allclose(none.noise_mm2, case.found.noise_mm2)
    assert (none.sd_mm <= sd(case.found.noise_mm2)).all()


def test_points_alone_forbid_everything_and_motion_alone_nothing(case):
    """Check w -> 0, where theta comes from the points alone, and has the person's Sigma. The conoid has no points."""
    tiny = uncertainty(case.data, case.adapted._replace(weight=np.full(4, 1e-9)))
    np.testing.assert_allclose(tiny.points_share[:5], 1.0, rtol=0.0, atol=1e-5)
    # At the geometric fit, where D has no residual, only Sigma remains.
    own_mm = np.asarray(case.data.girdle.adapted_mm)
    own = uncertainty(case.data, case.adapted._replace(theta_mm=own_mm, weight=np.full(4, 1e-9)))
    np.testing.assert_allclose(sd(own.person_mm2)[:5], PERSON_SD_MM[:5, None] * np.ones(4), rtol=1e-3)
    huge = uncertainty(case.data, case.adapted._replace(weight=np.full(4, 1e9)))
    # The information of the motion in its flattest direction is 1e-8 of that in the stiffest.
    np.testing.assert_allclose(huge.points_share, 0.0, rtol=0.0, atol=1e-2)


def test_a_parameter_at_its_bound_may_be_anywhere_between_them_and_takes_others_along(case):
    """Check M_y at a bound 10 mm off: a uniform deviation from one end has an SD of W / sqrt(3), and A_y follows."""
    bounds = np.array(case.data.bounds_mm)
    bounds[0, 0] = case.adapted.theta_mm[0] + 10.0
    narrow = select_problems(case.data, np.arange(4), bounds_mm=bounds)
    adapted = adapted_from(narrow, np.clip(case.adapted.theta_mm, *bounds))
    assert adapted.at_bound[0].all()
    found = uncertainty(narrow, adapted)
    np.testing.assert_allclose(found.sd_mm[0], (bounds[1] - bounds[0])[0] / np.sqrt(3.0))
    assert np.isnan(found.points_share[0]).all()
    # The two optima, 10 mm of M_y apart, show how A_y follows M_y.
    seen = (adapted.theta_mm[3] - case.adapted.theta_mm[3]) / 10.0
    told = found.bound_mm2[0, 3] / found.bound_mm2[0, 0]
    np.testing.assert_allclose(told, seen, rtol=0.5)
    assert (np.sign(told) == np.sign(seen)).all()


def test_what_nothing_holds_is_held_by_its_bounds_alone(case):
    """Check loose parameters: two uniform values in an interval of length W differ by W / sqrt(6); firm ones stay."""
    everybody = uncertainty(case.data, case.adapted, person_sd_mm=np.full(6, 1e6))
    room_mm = np.subtract(*np.asarray(case.data.bounds_mm)[::-1]) / np.sqrt(6.0)
    assert (everybody.sd_mm <= room_mm + 1e-9).all()
    assert (everybody.sd_mm[0] >= 0.7 * room_mm[0]).all()  # bounds of A_y limit the correlated M_y too
    firm = uncertainty(case.data, case.adapted, person_sd_mm=np.zeros(6))
    np.testing.assert_allclose(firm.sd_mm[FIRM], sd(firm.noise_mm2)[FIRM], rtol=0.02)
    two = np.zeros((6, 6, 1))
    two[0, 0] = two[1, 1] = 24.0
    two[0, 1] = two[1, 0] = 12.0
    found = within_bounds(two, np.full((6, 1), 12.0))
    expected = np.linalg.inv(np.linalg.inv(two[:2, :2, 0]) + np.eye(2) / 24.0)
    np.testing.assert_allclose(found[:2, :2, 0], expected)
    assert np.abs(found[2:]).max() == 0.0


def test_without_an_angle_to_spare_nothing_is_said_of_the_noise(case):
    """Check three angles per posture, which three degrees of freedom follow: no noise, no interval, no direction."""
    few = np.array(case.data.measured)
    few[[2, 4, 5]] = False
    found = uncertainty(select_problems(case.data, np.arange(SUBJECTS), measured=few), case.adapted)
    assert np.isnan(found.noise_deg).all()
    _, origin = intervals(case.data, case.adapted, found)
    assert set(origin.ravel()) == {NONE}
    assert flat_directions(found.covariance_mm2[..., 0]) == ["not determined: motion and points leave a direction open"]


def test_a_reduced_inverse_by_hand():
    matrix = np.array([[4.0, 2.0, 0.0], [2.0, 5.0, 0.0], [0.0, 0.0, 2.0]])
    whole = np.eye(6)
    whole[:3, :3] = matrix
    free = np.array([True, False, True, True, True, True])
    both = reduced_inverse(np.stack([whole, -whole], axis=-1), np.stack([free, free], axis=-1))
    assert both[0, 0, 0] == 0.25  # 1 / 4: the second parameter is fixed, so its coupling does not count
    assert both[1, 1, 0] == 0.0
    assert both[2, 2, 0] == 0.5
    assert np.isnan(both[0, 0, 1])  # a maximum has no spread


# --- profiles ------------------------------------------------------------------------------------------------------


def test_profile_intervals_are_the_parabola_where_e_is_one_and_longer_where_it_is_flat(case):
    """Check at a tenth of the spread, where E is a parabola: the profile ends where the curvature says."""
    small = uncertainty(case.data, case.adapted, person_sd_mm=0.1 * PERSON_SD_MM)
    small = replace(small, covariance_mm2=0.01 * small.noise_mm2 + small.person_mm2)
    profile = profile_intervals(case.data, case.adapted, small, np.ones((6, SUBJECTS), bool))
    assert not profile.open.any()
    half = np.abs(profile.ends_mm - case.adapted.theta_mm) / (NORMAL_95 * small.sd_mm)
    print("profile / parabola:", np.round(half, 2))
    assert half.min() >= 0.8
    assert half.max() <= 1.25


# --- flat directions -----------------------------------------------------------------------------------------------


def test_a_flat_direction_is_named_with_its_sizes():
    """SD 20 along (0.8, 0, 0, -0.6, 0, 0) and 1 in all other directions."""
    v = np.array([0.8, 0.0, 0.0, -0.6, 0.0, 0.0])
    covariance = np.eye(6) + (20.0**2 - 1.0) * np.outer(v, v)
    assert flat_directions(covariance) == ["M_y and A_y only together: 16 mm against 12 mm"]
    w = np.array([0.8, 0.0, 0.0, 0.6, 0.0, 0.0])
    assert flat_directions(np.eye(6) + 399.0 * np.outer(w, w)) == ["M_y and A_y only together: 16 mm with 12 mm"]


def test_a_loose_parameter_is_named_alone_and_a_firm_one_not():
    assert flat_directions(np.diag([1.0, 4.0, 9.0, 1.0, 144.0, 1.0])) == ["A_z loose: 12 mm"]
    assert flat_directions(np.eye(6)) == []
    assert "not determined" in flat_directions(np.full((6, 6), np.nan))[0]


# --- held out ------------------------------------------------------------------------------------------------------


def test_postures_held_out_have_no_part_in_the_adaptation(case):
    """Check one third held out, then spoilt by 40 degrees: only its own gap changes."""
    batch = posture_rows(case.motions)
    fold = next(fold for fold in motions_and_thirds(case.motions) if fold.kind == POSTURES)
    clean = held_out(case.data, batch, [fold])
    angles = np.array(case.data.angles)
    angles[:, np.isin(batch.place[:, 0], fold.tested), 0] += 40.0 / DEG
    spoilt = held_out(select_problems(case.data, np.arange(SUBJECTS), angles=angles), batch, [fold])
    np.testing.assert_allclose(spoilt.adapted.theta_mm, clean.adapted.theta_mm, rtol=0.0, atol=SAME_THETA_MM)
    (before,), (after,) = clean.gaps_deg, spoilt.gaps_deg
    assert before.shape == (6, len(fold.tested))
    assert np.isfinite(before).all()
    assert after.mean() > 5.0 + before.mean()


def test_the_gap_in_sample_is_that_of_the_adapted_postures(case):
    """Check the gap over both motions: every posture counts once, with the gap of the adaptation itself."""
    result = adapt_subjects(case.motions, case.model, held_out=case.motions.subjects[:2])
    assert set(result.heldout["subject"]) == set(case.motions.subjects[:2])
    seen = by_subject(result.heldout)
    for problem in range(2):
        counted = np.asarray(case.data.counted)[:, problem]
        off = np.abs(case.adapted.angles[..., problem] - np.asarray(case.data.angles)[..., problem])[:, counted] * DEG
        for bone, angles in (("", slice(0, 6)), ("clavicle_", slice(0, 3)), ("scapula_", slice(3, 6))):
            assert seen[f"{bone}gap_in_sample_deg"][problem] == pytest.approx(off[angles].mean(), abs=1e-6)
    # A held-out motion is fitted by a girdle that was adapted without it.
    assert (seen["gap_unseen_deg"] > seen["gap_in_sample_deg"]).all()


def test_every_subject_has_a_held_out_gap_unless_nobody_shall(case):
    """Check two held-out motions per subject; with none held out, only the columns of the held-out gap are empty."""
    short = case.motions.select(np.isin(case.motions.subject, case.motions.subjects[:2]))
    result, spared = (adapt_subjects(short, case.model, **options) for options in ({}, {"held_out": ()}))
    assert len(result.heldout) == 2 * 2
    assert len(spared.heldout) == 0
    assert spared.summary[list(HELD_OUT.values())].isna().to_numpy().all()
    pd.testing.assert_frame_equal(
        *(one.summary.drop(columns=list(HELD_OUT.values())) for one in (result, spared)), check_exact=True
    )


# --- w -------------------------------------------------------------------------------------------------------------


def test_more_weight_on_the_motion_costs_the_points_and_the_best_is_that_of_the_smallest_held_out_gap(case):
    """Check optima of D + w J: a larger w has no larger J and no smaller D. The thesis's w is the adaptation itself."""
    batch, folds = posture_rows(case.motions), motions_and_thirds(case.motions)
    table = weight_table(case.data, batch, [case.model.name], folds, weights=(0.1, 10.0, 1000.0))
    assert table["weight"].tolist() == [0.1, 10.0, 1000.0]
    assert (table["subjects_ok"] == SUBJECTS).all()
    assert (table["thorax_points_rms_mm"].diff().dropna() >= 0.0).all()
    assert (table["j_rms_deg"].diff().dropna() <= 0.0).all()
    of_thesis = table.iloc[1]
    assert of_thesis["thorax_points_rms_mm"] == pytest.approx(np.sqrt(case.adapted.D_mm2.mean()))
    assert of_thesis["j_rms_deg"] == pytest.approx(np.sqrt(case.adapted.mean_j_deg2.mean()))
    motions_alone = [fold for fold in folds if fold.kind == MOTION]
    gaps = np.concatenate(held_out(case.data, batch, motions_alone).gaps_deg, axis=1)
    assert of_thesis["gap_unseen_deg"] == pytest.approx(np.nanmean(gaps), rel=1e-9)  # all motions have the same length
    assert table["best"].tolist() == [int(gap == table["gap_unseen_deg"].min()) for gap in table["gap_unseen_deg"]]


# --- the command ---------------------------------------------------------------------------------------------------


def test_the_command_writes_its_tables(tmp_path):
    """Check two shipped (simulated) subjects: files, their numbers of rows, and the output in the terminal."""
    lines = DATA_FILE.read_text().splitlines()[: 1 + 14 * 2]
    ended = girdle("trust", written(tmp_path, lines), "--model", "R6", "--choose-weight", "--out", tmp_path / "out")
    assert (ended.status, ended.messages) == (0, [])
    names = ("contact", "fits", "heldout", "parameters", "plausibility", "summary", "trust", "uncertainty", "weights")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        [*(f"{n}.csv" for n in names), "run.json", LIST]
    )
    table = {name: pd.read_csv(tmp_path / "out" / f"{name}.csv") for name in names}
    assert len(table["trust"]) == 2
    assert len(table["uncertainty"]) == 12
    assert len(table["heldout"]) == 2 * (2 + 3)
    gap = table["summary"].query("adapted == 1 and motion == 'all' and subject == 'simulated01'")
    assert table["trust"]["gap_in_sample_deg"][0] == pytest.approx(
        gap[["clavicle_deg", "scapula_deg"]].mean(axis=1).item()
    )
    held_out = gap[["clavicle_held_out_deg", "scapula_held_out_deg"]].mean(axis=1).item()
    assert table["trust"]["gap_unseen_motion_deg"][0] == pytest.approx(held_out)
    spread = table["uncertainty"]
    assert (spread["low_mm"] <= spread["adapted_mm"]).all()
    assert (spread["adapted_mm"] <= spread["high_mm"]).all()
    assert np.array_equal(spread["interval"] == BOUNDS, spread["at_bound"] == 1)
    forbidden = table["trust"]["points_forbid"].dropna()  # empty where w x 1000 did not converge
    assert len(forbidden) >= 1
    assert forbidden.between(0.0, 1.0).all()
    assert table["weights"]["weight"].tolist() == list(WEIGHTS)
    assert table["weights"]["best"].sum() == 1
    assert "95 % intervals" in ended.out
    assert "simulated02" in ended.out
