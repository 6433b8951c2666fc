"""What no effect explains, drawn into residuals that are otherwise noise: it is seen, and noise alone is not."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.diagnosis.fit.linear_model import LinearisedFit, shared_prior
from adapt.diagnosis.fit.measurement_noise import Noise, NoiseEstimate
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.discrepancy import (
    FINE,
    SMOOTH,
    discrepancy_columns,
    discrepancy_gain,
    landmark_columns,
    scatter_columns,
)
from motions.rotations import DEG

SUBJECTS, POSTURES = 10, 14
ROOT = np.array([[1.0, 0.0, 0.0], [-0.4, 0.9, 0.0], [0.2, 0.1, 0.6]])
"""What a mm of A1-A3 adds to the residuals of a posture, in standard deviations: about that of angles with 1.5 deg."""

BY_ANGLE = np.diag([30.0, 25.0, 20.0])
"""What a rad of a bone's angles adds to the equations of a landmark, in standard deviations: up to 60 mm of 2 mm."""

KNOWN = NoiseEstimate(Noise(1.5), np.inf, "given")
ESTIMATED = NoiseEstimate(Noise(1.5), 150.0, "estimated")
each_noise = pytest.mark.parametrize("noise", [KNOWN, ESTIMATED], ids=["known", "estimated"])

CLEAR = 5.0
"""Nats: odds of 150 to 1."""


def observed() -> Observed:
    """Seven elevations in each of two motions; nothing but their numbers matters here."""
    elevation = np.tile(np.tile(np.linspace(0.0, 150.0, POSTURES // 2), 2)[:, None], SUBJECTS)
    motion = np.repeat(np.repeat([0, 1], POSTURES // 2)[:, None], SUBJECTS, axis=1)
    shape = (6, POSTURES, SUBJECTS)
    names = tuple(f"simulated{s}" for s in range(SUBJECTS))
    return Observed(
        np.zeros(shape), np.ones(shape, bool), elevation, np.ones(shape[1:], bool), motion, names, ("up", "forward")
    )


def with_offsets(offsets_mm: np.ndarray, share: float = 1.0, seed: int = 0) -> LinearisedFit:
    """Residuals of A1-A3 that are off by (subjects, postures, 3) mm, with ``share`` of the noise they are taken for."""
    generator = np.random.default_rng(seed)
    residuals = 3 * POSTURES
    noise = share * generator.standard_normal((SUBJECTS, POSTURES, 3))
    y = (noise + offsets_mm @ ROOT.T).reshape(SUBJECTS, residuals)
    X = generator.standard_normal((SUBJECTS, residuals, 6))
    return LinearisedFit(
        hypothesis=(),
        z=np.zeros((6, SUBJECTS)),
        nearest=np.zeros((6, POSTURES, SUBJECTS)),
        y=y,
        X=X,
        A=np.zeros((SUBJECTS, residuals, 0)),
        scale=np.zeros(0),
        u=np.zeros((SUBJECTS, 6)),
        a=np.zeros((SUBJECTS, 0)),
        linear=-y,
        root=np.tile(ROOT, (SUBJECTS, POSTURES, 1, 1)),
        by_angle=np.zeros((SUBJECTS, POSTURES, 3, 6)),
    )


def against_landmarks(clavicle_deg: np.ndarray, seed: int = 0) -> LinearisedFit:
    """The same, nothing off in A1-A3, with three equations of a landmark that both bones move: the clavicle's angles
    are off against them by (subjects, postures, 3) degrees."""
    fitted = with_offsets(np.zeros((SUBJECTS, POSTURES, 3)), seed=seed)
    noise = np.random.default_rng(100 + seed).standard_normal((SUBJECTS, POSTURES, 3))
    seen = noise + clavicle_deg @ BY_ANGLE / DEG

    def beside(of_constraints, more) -> np.ndarray:
        both = of_constraints.reshape(SUBJECTS, POSTURES, 3, -1)
        return np.concatenate([both, more.reshape(SUBJECTS, POSTURES, 3, -1)], axis=2)

    y = beside(fitted.y, seen).reshape(SUBJECTS, -1)
    root = np.zeros((6, 6))
    root[:3, :3], root[3:, 3:] = ROOT, 0.5 * np.eye(3)
    by_angle = np.zeros((6, 6))
    by_angle[3:, :3], by_angle[3:, 3:] = BY_ANGLE, 0.5 * BY_ANGLE
    return replace(
        fitted,
        y=y,
        X=beside(fitted.X, np.zeros((SUBJECTS, POSTURES, 3, 6))).reshape(*y.shape, 6),
        A=np.zeros((*y.shape, 0)),
        linear=-y,
        root=np.tile(root, (SUBJECTS, POSTURES, 1, 1)),
        by_angle=np.tile(by_angle, (SUBJECTS, POSTURES, 1, 1)),
    )


def gain(fitted: LinearisedFit, noise: NoiseEstimate) -> float:
    return discrepancy_gain(fitted, observed(), shared_prior(fitted.scale), noise)


def breath(size_mm: float, held_by: tuple[float, float, float]) -> np.ndarray:
    """Another offset in each posture, which knows nothing of the arm."""
    of_posture = size_mm * np.random.default_rng(7).standard_normal((SUBJECTS, POSTURES, 1))
    return of_posture * np.array(held_by)


@each_noise
@pytest.mark.parametrize("seed", range(5))
def test_noise_alone_is_no_discrepancy(noise, seed):
    assert gain(with_offsets(np.zeros((SUBJECTS, POSTURES, 3)), seed=seed), noise) < 0.0


@pytest.mark.parametrize("seed", range(5))
def test_a_noise_estimated_too_low_from_few_degrees_is_no_discrepancy(seed):
    fitted = with_offsets(np.zeros((SUBJECTS, POSTURES, 3)), seed=seed).with_noise(0.7)
    assert gain(fitted, replace(ESTIMATED, freedom=12.0)) < 0.0


@each_noise
def test_a_course_over_elevation_is_seen(noise):
    bump = np.exp(-0.5 * ((observed().elevation_deg.T[..., None] - 75.0) / 30.0) ** 2)
    assert gain(with_offsets(3.0 * bump * np.array([1.0, -1.0, 0.0])), noise) > CLEAR


@each_noise
@pytest.mark.parametrize("seed", range(5))
def test_angles_that_agree_with_landmarks_are_no_discrepancy(noise, seed):
    assert gain(against_landmarks(np.zeros((SUBJECTS, POSTURES, 3)), seed), noise) < 0.0


@each_noise
def test_angles_that_are_off_against_landmarks_are_seen(noise):
    """By three degrees in mid-range, out in one motion and in in the other: A1-A3 know nothing of it."""
    data = observed()
    bump = np.exp(-0.5 * ((data.elevation_deg - 75.0) / 30.0) ** 2) * np.where(data.motion == 0, 3.0, -3.0)
    assert gain(against_landmarks(bump.T[..., None] * np.array([0.0, 1.0, 0.0])), noise) > CLEAR


@each_noise
def test_a_landmark_that_drifts_against_the_angles_is_seen(noise):
    """By four mm from the arm hanging to the arm up, in every subject."""
    fitted, data = against_landmarks(np.zeros((SUBJECTS, POSTURES, 3))), observed()
    drift_mm = 4.0 * data.elevation_deg.T[..., None] / 150.0 * np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
    y = fitted.y + (drift_mm @ fitted.root[0, 0].T).reshape(fitted.y.shape)
    assert gain(replace(fitted, y=y, linear=-y), noise) > CLEAR


def test_a_degree_and_a_mm_add_what_the_fit_says():
    """The first term of each motion is a constant."""
    fitted, data = against_landmarks(np.zeros((SUBJECTS, POSTURES, 3))), observed()
    clavicle_scapula_landmark = (BY_ANGLE / DEG, 0.5 * BY_ANGLE / DEG, 0.5 * np.eye(3))
    for (columns, _), expected in zip(landmark_columns(fitted, data), clavicle_scapula_landmark, strict=True):
        by_term = columns.reshape(SUBJECTS, POSTURES, 6, 3, SMOOTH, 2)
        for motion in (0, 1):
            there, at = by_term[..., 0, motion], data.motion[:, 0] == motion
            np.testing.assert_allclose(there[:, at, 3:], np.tile(expected, (SUBJECTS, 7, 1, 1)))
            assert not there[:, ~at].any()
            assert not there[:, at, :3].any()


def test_without_landmarks_there_is_nothing_to_be_off_against():
    assert landmark_columns(with_offsets(np.zeros((SUBJECTS, POSTURES, 3))), observed()) == []


@each_noise
@pytest.mark.parametrize("held_by", [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0)], ids=["thorax", "conoid"])
def test_scatter_beyond_the_noise_is_seen(noise, held_by):
    assert gain(with_offsets(breath(4.0, held_by)), noise) > CLEAR


def test_scatter_that_passed_for_noise_is_seen_only_where_the_noise_was_estimated():
    """The estimate took scatter for noise: as given, it leaves nothing."""
    fitted = with_offsets(0.7 * breath(2.5, (1.0, 1.0, 0.0)), share=0.7)
    assert gain(fitted, KNOWN) < gain(fitted, ESTIMATED)
    assert gain(fitted, ESTIMATED) > CLEAR


def test_scatter_columns_act_on_their_own_posture_alone():
    columns = scatter_columns(with_offsets(np.zeros((SUBJECTS, POSTURES, 3))), (1.0, 1.0, 0.0))
    of_posture = columns.reshape(SUBJECTS, POSTURES, 3, POSTURES)
    for p in range(POSTURES):
        np.testing.assert_allclose(of_posture[:, p, :, p], np.tile(ROOT @ [1.0, 1.0, 0.0], (SUBJECTS, 1)))
        assert not np.delete(of_posture[:, p], p, axis=2).any()


@pytest.mark.parametrize("terms", [SMOOTH, FINE])
def test_courses_are_offsets_of_one_motion_and_constraint(terms):
    """A sum of columns with random weights is an offset of A1-A3 that is a polynomial of elevation in each motion."""
    fitted, data = with_offsets(np.zeros((SUBJECTS, POSTURES, 3))), observed()
    columns = discrepancy_columns(fitted, data, terms)
    y = columns @ np.random.default_rng(3).standard_normal(columns.shape[2])
    offsets = np.linalg.solve(ROOT, y.reshape(SUBJECTS, POSTURES, 3, 1))[..., 0]
    for motion in (0, 1):
        at = data.motion[:, 0] == motion
        fit = np.polynomial.Polynomial.fit
        for constraint in range(3):
            seen = offsets[0, at, constraint]
            np.testing.assert_allclose(fit(data.elevation_deg[at, 0], seen, terms - 1)(data.elevation_deg[at, 0]), seen)


def test_factors_of_the_noise_have_the_spread_of_an_estimate_from_so_many_degrees():
    factors, weights = np.array(replace(ESTIMATED, freedom=50.0).likely_factors).T
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ np.log(factors) == pytest.approx(0.0, abs=1e-12)
    assert weights @ np.log(factors) ** 2 == pytest.approx(1.0 / 100.0)


def test_a_noise_that_was_given_has_no_spread():
    assert KNOWN.known
    assert not ESTIMATED.known
    assert KNOWN.likely_factors == [(1.0, 1.0)]
