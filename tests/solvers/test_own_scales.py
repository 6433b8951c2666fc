# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
# pyright: reportGeneralTypeIssues=false, reportCallIssue=false, reportOperatorIssue=false
# (own_bones is None after a plain adaptation; pandas and SciPy type nearly every result as "Series | object")
"""Scales of the variation between persons, and the noise of their angles: likelihood, optimum, few persons."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from own_people import NOISE_DEG, R2, adapted, of_subject, simulated
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from adapt.own_bones.own_adaptation import learn_people, misfit
from adapt.own_bones.scales import (
    LOG_NOISE_SD,
    SCALE_SD,
    TYPICAL_NOISE_DEG,
    Moments,
    Scales,
    log_likelihoods,
    minus_two_log_likelihood,
    misfits,
)
from adapt.own_bones.scales import learnt as scales_of_runs
from adapt.solvers.rows import posture_rows
from models.person.own_bones import GROUPS, SIZES
from motions import Motions


@pytest.fixture(scope="module")
def world() -> SimpleNamespace:
    return simulated(60)


def test_the_likelihood_is_that_of_a_normal_distribution():
    """Check the likelihood of b ~ N(0, sigma^2 1 + T C S^2 C' T') against SciPy, its derivatives against
    differences."""
    generator = np.random.default_rng(5)
    n, rows, persons = len(SIZES), 12, 3
    slopes, b = generator.standard_normal((persons, rows, n)), generator.standard_normal((persons, rows))
    A = np.stack([one.T @ one for one in slopes], axis=-1)
    c = np.stack([one.T @ y for one, y in zip(slopes, b, strict=True)], axis=-1)
    of = Moments(A, c, (b**2).sum(axis=1), np.full(persons, rows))
    for logarithms in generator.standard_normal((3, 4)):
        six, bones_scale, frames_scale, noise = np.exp(logarithms)
        of_group = {"adapted": six, "bones": bones_scale, "frames": frames_scale}
        scaled = slopes * [of_group[one.group] for one in SIZES]
        sigma2 = (TYPICAL_NOISE_DEG * noise) ** 2
        dense = [
            multivariate_normal(np.zeros(rows), sigma2 * np.eye(rows) + one @ one.T).logpdf(y)
            for one, y in zip(scaled, b, strict=True)
        ]
        constant = 0.5 * rows * np.log(2.0 * np.pi)
        prior = (((np.exp(logarithms[:3]) - 1.0) / SCALE_SD) ** 2).sum() + (logarithms[3] / LOG_NOISE_SD) ** 2
        run = np.zeros(persons, int)
        value, slope, curvature, _ = minus_two_log_likelihood(logarithms[:, None], of, run)
        assert value[0] == pytest.approx(-2.0 * sum(one + constant for one in dense) + prior, rel=1e-10)
        scales = Scales(six, bones_scale, frames_scale, TYPICAL_NOISE_DEG * noise)
        np.testing.assert_allclose(log_likelihoods(of, [scales] * persons) - constant, dense, rtol=1e-10)
        covariances = [sigma2 * np.eye(rows) + one @ one.T for one in scaled]
        expected = [y @ np.linalg.solve(one, y) for one, y in zip(covariances, b, strict=True)]
        np.testing.assert_allclose(misfits(of, [scales] * persons), expected, rtol=1e-9)
        beside = [
            [minus_two_log_likelihood((logarithms + sign * 1e-5 * unit)[:, None], of, run) for sign in (1.0, -1.0)]
            for unit in np.eye(4)
        ]
        for k, (up, down) in enumerate(beside):
            assert slope[k, 0] == pytest.approx((up[0][0] - down[0][0]) / 2e-5, rel=1e-6, abs=1e-5)
            np.testing.assert_allclose(curvature[k, :, 0], (up[1] - down[1])[:, 0] / 2e-5, rtol=1e-5, atol=1e-4)


def test_the_misfit_of_people_as_expected_is_chi_square(world):
    """Check the sum of some 60 persons against its degrees of freedom, with the true noise and with half of it."""
    rows, freedom = posture_rows(world.motions), 3 * len(world.motions.posture)
    people = learn_people(rows, [R2], held_out=False)
    found = misfit(rows, R2, people, NOISE_DEG)
    assert found == (pytest.approx(freedom, abs=3.0 * np.sqrt(2.0 * freedom)), freedom)
    assert misfit(rows, R2, people, 0.5 * NOISE_DEG)[0] > 2.0 * freedom


def test_no_problem_has_no_likelihood():
    n = len(SIZES)
    assert log_likelihoods(Moments(np.zeros((n, n, 0)), np.zeros((n, 0)), np.zeros(0), np.zeros(0, int)), []).shape == (
        0,
    )


def test_the_curvature_of_the_likelihood_is_expected_in_the_mean():
    """Check the expected curvature against the mean one, for persons drawn with these scales."""
    generator = np.random.default_rng(6)
    n, rows, persons, noise_deg = len(SIZES), 12, 4000, 1.3
    slopes = generator.standard_normal((rows, n))
    b = slopes @ generator.standard_normal((n, persons)) + noise_deg * generator.standard_normal((rows, persons))
    A = np.repeat((slopes.T @ slopes)[..., None], persons, axis=-1)
    of = Moments(A, slopes.T @ b, (b**2).sum(axis=0), np.full(persons, rows))
    logarithms = np.array([0.0, 0.0, 0.0, np.log(noise_deg / TYPICAL_NOISE_DEG)])
    _, _, curvature, expected = minus_two_log_likelihood(logarithms[:, None], of, np.zeros(persons, int))
    np.testing.assert_allclose(curvature[..., 0], expected[..., 0], atol=0.05 * np.abs(expected).max())


def test_scales_are_learnt_where_the_likelihood_is_lowest():
    """Check three runs of the same persons at once, against L-BFGS-B on each."""
    generator = np.random.default_rng(7)
    n, rows, persons = len(SIZES), 12, 30
    slopes = generator.standard_normal((persons, rows, n))
    z = generator.standard_normal((persons, n)) * np.array([0.6, 1.0, 0.1])[[GROUPS.index(one.group) for one in SIZES]]
    b = np.einsum("pij,pj->pi", slopes, z) + 0.5 * generator.standard_normal((persons, rows))
    A, c = np.einsum("pij,pik->jkp", slopes, slopes), np.einsum("pij,pi->jp", slopes, b)
    of = Moments(A, c, (b**2).sum(axis=1), np.full(persons, rows))
    runs = np.arange(persons) % 3 != np.arange(3)[:, None]
    runs[2] = True
    found = scales_of_runs(of, runs, [Scales()] * 3)
    limits = [*[np.log((0.02, 2.0))] * 3, np.log(np.array((0.05, 10.0)) / TYPICAL_NOISE_DEG)]
    for mine, scales in zip(runs, found, strict=True):
        some = Moments(*(one[..., mine] for one in of))

        def value(x, some=some):
            return minus_two_log_likelihood(x[:, None], some, np.zeros(some.A.shape[-1], int))[0][0]

        sharp = {"ftol": 1e-13}  # the default tolerance ends 3e-3 off
        other = minimize(value, np.zeros(4), method="L-BFGS-B", jac="3-point", bounds=limits, options=sharp)
        np.testing.assert_allclose(np.log(np.array(scales) / np.array(Scales())), other.x, atol=3e-3)


def learnt(motions: Motions) -> Scales:
    return learn_people(posture_rows(motions, {}), [R2]).everybody["R2"]


@pytest.mark.parametrize(("factor", "lowest", "highest"), [(0.0, 0.0, 0.2), (0.5, 0.35, 0.75), (1.0, 0.75, 1.3)])
def test_how_much_persons_differ_is_learnt(factor, lowest, highest):
    """Check scales from 60 persons whose bones do not differ, or differ half as much or as much as people do."""
    scales = learnt(simulated(60, factor).motions)
    assert lowest <= scales.bones <= highest
    assert lowest <= scales.frames <= highest
    assert scales.noise_deg == pytest.approx(NOISE_DEG, rel=0.08)


def test_angles_that_nobody_measured_do_not_make_the_noise_less(world):
    """Check the noise with two informative numbers per posture instead of three; persons without any do not matter."""
    angles = world.motions.angles_deg.copy()
    angles[:, 2] = np.nan
    assert learnt(replace(world.motions, angles_deg=angles)).noise_deg == pytest.approx(NOISE_DEG, rel=0.08)
    some = world.motions.select(np.isin(world.motions.subject, world.motions.subjects[:12]))
    angles = some.angles_deg.copy()
    angles[np.isin(some.subject, some.subjects[:2])] = np.nan
    without = learnt(some.select(~np.isin(some.subject, some.subjects[:2])))
    np.testing.assert_allclose(learnt(replace(some, angles_deg=angles)), without, rtol=1e-3)


def test_of_few_persons_the_noise_of_each_alone_is_learnt(world):
    """Check nine persons, and one of them: each has the noise learnt from this person alone."""
    few = world.motions.select(np.isin(world.motions.subject, world.motions.subjects[:9]))
    assert learnt(few) == Scales(1.0, 1.0, 1.0, TYPICAL_NOISE_DEG)
    found = adapted(few, True).problems.own_bones.scales
    np.testing.assert_array_equal(found[:3], 1.0)
    assert np.median(found[3]) == pytest.approx(NOISE_DEG, rel=0.15)
    assert len(np.unique(found[3])) == 9
    one = adapted(of_subject(few, few.subjects[4]), True).problems.own_bones.scales
    np.testing.assert_array_equal(one[:, 0], found[:, 4])


@pytest.mark.parametrize("noise_deg", [0.4, 3.0])
def test_the_noise_of_few_is_that_of_the_laboratory(noise_deg):
    few = simulated(6, noise_deg=noise_deg, seed=8).motions
    assert np.median(adapted(few, True).problems.own_bones.scales[3]) == pytest.approx(noise_deg, rel=0.25)


def test_a_person_s_own_parts_are_held_out_with_scales_of_others(world):
    """Check that both shoulders of a person are held out together."""
    motions = world.motions.select(np.isin(world.motions.subject, world.motions.subjects[:20]))
    sides = {name: f"p{k // 2}_{'LR'[k % 2]}" for k, name in enumerate(motions.subjects)}
    motions = replace(motions, subject=np.array([sides[name] for name in motions.subject.tolist()]))
    found = learn_people(posture_rows(motions, {}), [R2])
    both = found.of([R2], ["p0_L", "p0_R"], held_out=True)
    assert both[0] == both[1] != found.everybody["R2"]
    assert found.of([R2], ["p0_L"]) == [found.everybody["R2"]]
    changed = motions.angles_deg.copy()
    changed[np.isin(motions.subject, ["p0_L", "p0_R"])] += np.array([5.0, -5.0, 5.0, -5.0, 5.0, -5.0])
    other = learn_people(posture_rows(replace(motions, angles_deg=changed), {}), [R2])
    assert other.everybody["R2"] != found.everybody["R2"]


def test_of_ten_persons_scales_are_learnt_without_each_too(world):
    ten = world.motions.select(np.isin(world.motions.subject, world.motions.subjects[:10]))
    found = learn_people(posture_rows(ten, {}), [R2])
    assert all(one != Scales() for one in (found.everybody["R2"], *found.without["R2"].values()))
