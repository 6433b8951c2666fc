"""What can be told apart, against the dense formula; and the noise estimate, against known noise."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from made_effects import without_details
from scipy.stats import chi2, multivariate_normal

from adapt.diagnosis.design import separability
from adapt.diagnosis.design.separability import (
    indistinguishable_sets,
    projected_onto_model,
    separation,
    smallest_detectable,
)
from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS
from adapt.diagnosis.fit.measurement_noise import Noise, NoiseEstimate
from adapt.diagnosis.fit.noise import ASSUMED, FEWEST_DEGREES, estimate_noise
from adapt.diagnosis.fit.observations import Observed, observe
from adapt.diagnosis.result import TOLD_APART
from adapt.model_subjects import simulate_model_subjects
from models import load_model
from models.adapted_parameters import PRIOR_SD_MM
from models.effects import EFFECTS
from motions.rotations import DEG

SAME = 1e-9
"""Relative: two ways through systems of condition below 1e4, and a difference of traces of a few hundred."""

SURE = 1e-4
"""Probability that a right noise estimate falls outside the interval, on each side."""

RESTS = 1e-5
"""Relative: descents begin where the medians of all subjects are, and end where a step changes little."""

STAYS = 0.01
"""Share of the way to the closed posture that is left after it: four projections do not settle the widest gaps."""

DRAWS = 20_000
"""Of the log evidence, whose mean is the divergence."""

_NORMAL: Any = multivariate_normal
"""Its type would have the covariance a number."""

MODEL = load_model("R2")
GIRDLE = MODEL.girdle
SMALL_EFFECTS = tuple(
    without_details(EFFECTS[name]) for name in ("scapula_landmark_bias", "conoid_strain", "thorax_asymmetry")
)
NAMES = tuple(effect.name for effect in SMALL_EFFECTS)
HYPOTHESES = ((), *((name,) for name in NAMES), NAMES[:2])
SUBJECTS, POSTURES = 3, 4
NOISE = Noise(angle_deg=1.5)


def observed(subjects: int = SUBJECTS) -> Observed:
    """Postures of which only the shape is looked at."""
    return Observed(
        values=np.zeros((6, POSTURES, subjects)),
        measured=np.ones((6, POSTURES, subjects), bool),
        elevation_deg=np.zeros((POSTURES, subjects)),
        counted=np.ones((POSTURES, subjects), bool),
        motion=np.zeros((POSTURES, subjects), int),
        subjects=tuple(map(str, range(subjects))),
        motions=("abduction",),
    )


@dataclass(frozen=True)
class _Slopes:
    """All that ``separability`` looks at of a misfit."""

    slopes: np.ndarray


@pytest.fixture
def random_slopes(monkeypatch):
    """Random derivatives in the place of a girdle's; returns those of every parameter (subjects, residuals, z).

    The same for a subject under every hypothesis, so large that effects stand out of the noise.
    """
    width = 6 + sum(effect.amplitudes for effect in SMALL_EFFECTS)
    every = np.random.default_rng(1).standard_normal((SUBJECTS, POSTURES, 3, width))
    every[..., :6] /= PRIOR_SD_MM
    every[..., 6:] /= np.concatenate([np.asarray(effect.prior_sd) for effect in SMALL_EFFECTS])

    def misfit(girdle, effects, data, noise, z, columns):
        chosen = every[np.arange(columns.shape[1]) % SUBJECTS]
        picked = np.take_along_axis(chosen, np.maximum(columns, 0).T[:, None, None], axis=3)
        return _Slopes(np.where(columns.T[:, None, None] >= 0, picked, 0.0) / noise.angle_deg)

    monkeypatch.setattr(separability, "misfit", misfit)
    return every.reshape(SUBJECTS, -1, width) / NOISE.angle_deg


def covariance(slopes: np.ndarray, hypothesis: tuple[str, ...], size: float = 1.0) -> np.ndarray:
    """Of the residuals of all subjects stacked, with effects of ``size`` times their typical size."""
    prior = np.concatenate([np.asarray(e.prior_sd) for e in SMALL_EFFECTS])
    acts = np.concatenate([np.full(effect.amplitudes, effect.name in hypothesis) for effect in SMALL_EFFECTS])
    X, A = slopes[..., :6] * PRIOR_SD_MM, slopes[..., 6:] * np.where(acts, size * prior, 0.0)
    n = X.shape[1]
    common = A.reshape(-1, A.shape[2])
    C = common @ common.T + np.eye(len(common))
    for s in range(len(X)):
        rows = slice(s * n, (s + 1) * n)
        C[rows, rows] += X[s] @ X[s].T + BETWEEN_SUBJECTS**2 * A[s] @ A[s].T
    return C


def dense_divergence(C_i: np.ndarray, C_j: np.ndarray) -> float:
    logs = np.linalg.slogdet(C_j)[1] - np.linalg.slogdet(C_i)[1]
    return 0.5 * float(np.trace(np.linalg.solve(C_j, C_i)) - len(C_i) + logs)


# --- divergence -----------------------------------------------------------------------------------


def test_separation_is_the_divergence_of_the_dense_gaussians(random_slopes):
    found = separation(GIRDLE, SMALL_EFFECTS, HYPOTHESES, observed(), NOISE)
    C = [covariance(random_slopes, hypothesis) for hypothesis in HYPOTHESES]
    expected = np.array([[dense_divergence(i, j) for j in C] for i in C])
    np.testing.assert_allclose(found, expected, rtol=SAME, atol=SAME * expected.max())
    assert np.min(expected + TOLD_APART * np.eye(len(C))) > 0.1


def test_separation_is_the_mean_log_evidence_of_the_right_one_over_the_other(random_slopes):
    """Of residuals drawn under the right one."""
    found = separation(GIRDLE, SMALL_EFFECTS, HYPOTHESES, observed(), NOISE)
    C = [covariance(random_slopes, hypothesis) for hypothesis in HYPOTHESES]
    zero = np.zeros(len(C[0]))
    y = np.random.default_rng(2).multivariate_normal(zero, C[1], DRAWS)
    gains = _NORMAL.logpdf(y, zero, C[1]) - _NORMAL.logpdf(y, zero, C[2])
    assert abs(gains.mean() - found[1, 2]) <= 4.0 * gains.std() / np.sqrt(DRAWS)


def test_identical_hypotheses_are_not_separated(random_slopes):
    names = NAMES[0]
    found = separation(GIRDLE, SMALL_EFFECTS, [(names,), (names,), ()], observed(), NOISE)
    scale = found.max()
    np.testing.assert_allclose(found[:2, :2], 0.0, rtol=0.0, atol=SAME * scale)
    np.testing.assert_allclose(found[0], found[1], rtol=SAME, atol=SAME * scale)
    assert min(found[0, 2], found[2, 0]) > 0.1


def test_many_subjects_are_represented_by_the_first_24(monkeypatch):
    every = np.random.default_rng(3).standard_normal((40, POSTURES, 3, 7))

    def misfit(girdle, effects, data, noise, z, columns):
        assert data.counted.shape[1] == columns.shape[1] == z.shape[1]
        subject = np.array([int(name) for name in data.subjects])
        return _Slopes(every[subject][..., : len(columns)])

    monkeypatch.setattr(separability, "misfit", misfit)
    hypotheses = [(), ("thorax_asymmetry",)]
    found = [separation(GIRDLE, SMALL_EFFECTS, hypotheses, observed(n), NOISE) for n in (12, 24, 40)]
    np.testing.assert_array_equal(found[1], found[2])
    assert found[0][1, 0] < found[1][1, 0]


def test_the_smallest_detectable_amplitude_is_the_first_of_its_steps_that_is_told_from_nothing(random_slopes):
    """Steps of half an octave from a 16th of the typical size to 16 times it, by the dense formula."""
    found = smallest_detectable(GIRDLE, SMALL_EFFECTS, observed(), NOISE)
    sizes = 2.0 ** np.arange(-4.0, 4.5, 0.5)
    for effect in SMALL_EFFECTS:
        D = [
            dense_divergence(covariance(random_slopes, (effect.name,), size), covariance(random_slopes, ()))
            for size in sizes
        ]
        k = int(np.argmax(np.array(D) >= TOLD_APART))
        assert k > 0, "the slopes of this test are too large to be a test"
        smallest = found[effect.name]
        assert smallest is not None
        assert smallest.value == pytest.approx(sizes[k] * np.linalg.norm(effect.prior.scale))
        assert smallest.unit == effect.unit


def test_what_nothing_shows_is_not_detectable(random_slopes):
    """Noise of a thousand degrees."""
    found = smallest_detectable(GIRDLE, SMALL_EFFECTS, observed(), Noise(1000.0 * NOISE.angle_deg))
    assert set(found.values()) == {None}


# --- sets -----------------------------------------------------------------------------------------


def apart(n: int, near: list[tuple[int, int]]) -> np.ndarray:
    """All told apart but the given pairs, one way round."""
    D = np.full((n, n), 2.0 * TOLD_APART)
    np.fill_diagonal(D, 0.0)
    for i, j in near:
        D[i, j] = 0.5 * TOLD_APART
    return D


@pytest.mark.parametrize(
    ("near", "sets"),
    [
        ([], []),
        ([(1, 3)], [["a", "c"]]),
        ([(3, 1)], [["a", "c"]]),
        ([(1, 3), (3, 4)], [["a", "c", "d"]]),
        ([(1, 2), (3, 4)], [["a", "b"], ["c", "d"]]),
        ([(0, 1), (0, 2)], []),
        ([(5, 1), (5, 2)], []),
    ],
    ids=["all apart", "a pair", "either way round", "a chain", "two sets", "none is no effect", "pairs are no effect"],
)
def test_sets_are_linked_by_pairs_that_are_not_told_apart(near, sets):
    hypotheses = [(), ("a",), ("b",), ("c",), ("d",), ("a", "b")]
    found = indistinguishable_sets(hypotheses, apart(len(hypotheses), near))
    assert [sorted(group) for group in found] == sets


def test_told_apart_begins_at_the_limit():
    D = apart(2, [])
    D[0, 1] = TOLD_APART
    assert indistinguishable_sets([("a",), ("b",)], D) == []
    D[0, 1] = np.nextafter(TOLD_APART, 0.0)
    assert indistinguishable_sets([("a",), ("b",)], D) == [["a", "b"]]


# --- on a girdle ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def world() -> Observed:
    """Six simulated subjects of 14 postures with an effect at work and one degree of noise."""
    return observe(simulate_model_subjects(MODEL, SMALL_EFFECTS[0], 6, 1.0, seed=3).motions)


@pytest.fixture(scope="module")
def postures(world) -> Observed:
    return projected_onto_model(GIRDLE, SMALL_EFFECTS, world, NOISE)


def test_closed_postures_stay_where_they_are_closed_again(postures, world):
    again = projected_onto_model(GIRDLE, SMALL_EFFECTS, postures, NOISE)
    first, second = (
        np.abs(one.values - other.values)[:, world.counted] for one, other in ((postures, world), (again, postures))
    )
    assert np.median(second) <= STAYS * np.median(first)
    np.testing.assert_array_equal(again.elevation_deg, world.elevation_deg)


def test_less_noise_shows_smaller_amplitudes(postures):
    found = [smallest_detectable(GIRDLE, SMALL_EFFECTS, postures, Noise(deg)) for deg in (0.75, 1.5, 3.0, 30.0)]
    for name in NAMES:
        sizes = [smallest.value if (smallest := one[name]) else np.inf for one in found]
        assert sizes == sorted(sizes), name
        assert 0.0 < sizes[0] < sizes[2], name


def test_more_subjects_and_less_noise_tell_more_apart(postures):
    hypotheses = HYPOTHESES[:4]

    def least(data, noise) -> np.ndarray:
        D = separation(GIRDLE, SMALL_EFFECTS, hypotheses, data, noise)
        return D[~np.eye(len(D), dtype=bool)]

    few = least(postures.select_subjects(np.arange(2)), NOISE)
    assert (least(postures, NOISE) > few).all()
    assert (least(postures.select_subjects(np.arange(2)), Noise(0.75)) > few).all()


# --- noise ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise_deg", [1.0, 2.0])
def test_known_noise_is_estimated_with_an_effect_at_work(world, noise_deg):
    """Within the chi square interval of its degrees of freedom. The world has 1 degree; more is added to it."""
    error = np.random.default_rng(4).standard_normal(world.values.shape) / DEG
    more = world.values + np.sqrt(noise_deg**2 - 1.0) * np.asarray(error)
    found = estimate_noise(GIRDLE, SMALL_EFFECTS, replace(world, values=more))
    assert found.source == "estimated"
    low, high = np.sqrt(chi2.ppf([SURE, 1.0 - SURE], found.freedom) / found.freedom)
    assert low <= found.noise.angle_deg / noise_deg <= high
    assert FEWEST_DEGREES < found.freedom < 3 * world.counted.sum() - 6 * len(world.subjects)


def test_a_noisy_subject_is_told_and_is_not_in_the_estimate(world):
    """6 degrees in one subject of five, 1 degree in the others; 2.5 degrees are no fault."""
    data = world.select_subjects(np.arange(5))
    error = np.random.default_rng(5).standard_normal(data.values.shape) / DEG

    def estimated(noisy_deg: float) -> NoiseEstimate:
        each = np.sqrt(np.array([1.0, 1.0, 1.0, noisy_deg, 1.0]) ** 2 - 1.0)
        return estimate_noise(GIRDLE, SMALL_EFFECTS, replace(data, values=data.values + each * error))

    found, others = estimated(6.0), data.select_subjects(np.array([0, 1, 2, 4]))
    assert set(found.noisy_deg) == {3}
    assert found.noisy_deg[3] == pytest.approx(6.0, rel=0.4)
    expected = estimate_noise(GIRDLE, SMALL_EFFECTS, others).noise.angle_deg
    assert found.noise.angle_deg == pytest.approx(expected, rel=RESTS)
    assert not estimated(2.5).noisy_deg
    assert estimated(2.5).noise.angle_deg > found.noise.angle_deg


def test_where_many_are_noisy_none_is_an_exception(world):
    data = world.select_subjects(np.arange(5))
    error = np.random.default_rng(5).standard_normal(data.values.shape) / DEG
    more = data.values + np.array([0.0, 8.0, 0.0, 8.0, 0.0]) * error
    assert not estimate_noise(GIRDLE, SMALL_EFFECTS, replace(data, values=more)).noisy_deg


def test_given_noise_is_taken(world):
    found = estimate_noise(GIRDLE, SMALL_EFFECTS, world, given_deg=2.5)
    assert (found.noise.angle_deg, found.source, found.freedom) == (2.5, "given", np.inf)


def test_too_few_postures_leave_the_assumed_noise(world):
    """One subject with four postures: fewer numbers than a parabola and the adapted parameters take up."""
    few = world.select_subjects(np.array([0]))
    few = replace(few, counted=few.counted & (np.arange(len(few.counted))[:, None] < 4))
    found = estimate_noise(GIRDLE, SMALL_EFFECTS, few)
    assert (found.noise.angle_deg, found.source, found.freedom) == (ASSUMED.angle_deg, "assumed", FEWEST_DEGREES)


@pytest.mark.parametrize("noise_mm", [0.5, 3.0])
def test_landmark_noise_comes_from_sc_beyond_a_smooth_course(noise_mm):
    """SC glides along a parabola: only its scatter is noise. 5 subjects x (14 - 3) postures x 3 coordinates."""
    elevation_deg = np.tile(np.linspace(0.0, 150.0, 14)[:, None], 5)
    data = replace(
        observed(5),
        values=np.zeros((18, 14, 5)),
        measured=np.ones((18, 14, 5), bool),
        elevation_deg=elevation_deg,
        counted=np.ones((14, 5), bool),
        motion=np.zeros((14, 5), int),
    )
    glide = 10.0 * (elevation_deg / 150.0) ** 2 + np.arange(3.0)[:, None, None]
    data.values[6:9] = glide + noise_mm * np.random.default_rng(6).standard_normal(glide.shape)
    found = estimate_noise(GIRDLE, SMALL_EFFECTS, data, given_deg=1.0).noise.landmark_mm
    freedom = 5 * (14 - 3) * 3
    low, high = np.sqrt(chi2.ppf([SURE, 1.0 - SURE], freedom) / freedom)
    assert low <= found / noise_mm <= high
