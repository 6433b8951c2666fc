"""Evidence over all priors: what people may have in common or not decides where the data say so."""

from dataclasses import replace

import numpy as np
import pytest
from made_effects import without_details

from adapt.diagnosis.fit.linear_evidence import inner_products, log_evidence
from adapt.diagnosis.fit.linear_model import LinearisedFit, independent_prior
from adapt.diagnosis.inference import priors
from adapt.diagnosis.inference.priors import OverPriors, likely_spreads, over_priors
from models.adapted_parameters import PRIOR_SD_MM, SPREADS_MM
from models.effects import EFFECTS, Effect

CLEAR = 3.0
"""Nats: odds of 20 to 1."""

LITTLE = 0.1
"""Nats: what is as good as impossible adds less."""

SPREADS = np.outer((0.2, 0.4, 0.7, 1.0), np.ones(6))
"""Of all parameters alike: what is tested here does not depend on which."""

EFFECT = without_details(EFFECTS["scapula_landmark_bias"])
SUBJECTS, RESIDUALS = 8, 30


def subjects(amplitudes: np.ndarray, shift: float = 0.0, seed: int = 0, effect: Effect = EFFECT) -> LinearisedFit:
    """Amplitudes (subjects, amplitudes) in units of their scale, and adapted parameters that are all off by
    ``shift``."""
    generator = np.random.default_rng(seed)
    X, A = (3.0 * generator.standard_normal((SUBJECTS, RESIDUALS, k)) for k in (6, amplitudes.shape[1]))
    scale = np.asarray(effect.prior_sd)
    u = 0.2 * generator.standard_normal((SUBJECTS, 6)) + shift
    linear = np.einsum("srk,sk->sr", X, u) + np.einsum("srk,sk->sr", A, amplitudes)
    linear = linear + generator.standard_normal((SUBJECTS, RESIDUALS))
    nothing = np.zeros(0)
    return LinearisedFit(
        (effect.name,), nothing, nothing, linear, X, A / scale, scale, nothing, nothing, linear, nothing, nothing
    )


def weighed(fitted: LinearisedFit, effect: Effect = EFFECT) -> OverPriors:
    return over_priors(inner_products(fitted), fitted.scale, [effect], [(1.0, 1.0)], SPREADS)


def plain(fitted: LinearisedFit) -> float:
    """Log evidence without an amplitude."""
    none = replace(fitted, A=fitted.A[..., :0], scale=fitted.scale[:0])
    return float(over_priors(inner_products(none), none.scale, [], [(1.0, 1.0)], SPREADS).log_evidence)


WAY = np.array([0.6, -0.3, 0.5])
SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0])


def test_amplitudes_of_all_alike_are_found_alike():
    found = weighed(subjects(np.tile(WAY, (SUBJECTS, 1))))
    assert found.independent_log_odds < -CLEAR


@pytest.mark.parametrize(
    "amplitudes",
    [SIGNS[:, None] * WAY, np.random.default_rng(5).standard_normal((SUBJECTS, 3))],
    ids=["signs differ", "all differ"],
)
def test_amplitudes_that_differ_are_found_to_differ(amplitudes):
    fitted = subjects(amplitudes)
    assert weighed(fitted).independent_log_odds > CLEAR
    assert weighed(fitted).log_evidence > plain(fitted) + CLEAR


def test_signs_that_differ_cost_less_than_amplitudes_of_ones_own():
    """Half of 2^8 patterns, but one direction in place of eight."""
    opposed = weighed(subjects(SIGNS[:, None] * WAY)).log_evidence
    shared_prior = weighed(subjects(np.tile(WAY, (SUBJECTS, 1)))).log_evidence
    own = weighed(
        subjects(np.linalg.norm(WAY) / np.sqrt(3.0) * np.sign(np.random.default_rng(6).standard_normal((8, 3))))
    )
    assert own.log_evidence < opposed < shared_prior


def test_signs_that_differ_are_less_likely_of_an_effect_whose_nature_has_one():
    fitted = subjects(SIGNS[:, None] * WAY)
    change = (
        weighed(fitted, replace(EFFECT, prior=replace(EFFECT.prior, sign=(1, 0, 0)))).log_evidence
        - weighed(fitted).log_evidence
    )
    assert change == pytest.approx(np.log(priors._OPPOSED_SIGNED_PROBABILITY / priors._OPPOSED_PROBABILITY), abs=LITTLE)


def test_parameters_off_by_the_same_in_all_need_no_effect():
    """A shift of half a SD in eight subjects: sixteen times as improbable as it is where only subjects differ."""
    fitted = subjects(np.zeros((SUBJECTS, 3)), shift=0.5)
    assert plain(fitted) > float(weighed(fitted).log_evidence)
    spread = over_priors(
        inner_products(replace(fitted, A=fitted.A[..., :0])), np.zeros(0), [], [(1.0, 1.0)], SPREADS
    ).spread
    assert (spread < 0.5).all()


def test_the_spread_is_the_one_that_the_subjects_have():
    np.testing.assert_array_equal(weighed(subjects(np.tile(WAY, (SUBJECTS, 1)))).spread, SPREADS[0])


def wider_chests() -> LinearisedFit:
    """Without effect; A_x differs by 8 mm either way, all else by what is least in ``SPREADS_MM``."""
    fitted = subjects(np.zeros((SUBJECTS, 3)))
    generator = np.random.default_rng(3)
    sd = np.array([least for least, *_ in SPREADS_MM]) / PRIOR_SD_MM
    u = sd * generator.choice([-1.0, 1.0], (SUBJECTS, 6))
    u[:, 2] *= 8.0 / SPREADS_MM[2][0]
    y = np.einsum("srk,sk->sr", fitted.X, u) + generator.standard_normal((SUBJECTS, RESIDUALS))
    return replace(fitted, linear=y)


def test_each_parameter_has_a_spread_of_its_own():
    spreads, log_share = likely_spreads(inner_products(wider_chests()), np.zeros((SUBJECTS, 3)))
    assert np.log(0.2) < log_share <= 0.0
    weighed_spreads = over_priors(inner_products(wider_chests()), np.ones(3), [EFFECT], [(1.0, 1.0)], spreads)
    least = np.array([least for least, *_ in SPREADS_MM]) / PRIOR_SD_MM
    np.testing.assert_allclose(weighed_spreads.spread, np.where(np.arange(6) == 2, 8.0 / PRIOR_SD_MM, least))


def test_likely_spreads_are_those_of_the_evidence_without_the_amplitudes():
    """Amplitudes taken out of what was seen leave the evidence of the adapted parameters alone."""
    fitted, amplitudes = wider_chests(), np.random.default_rng(4).standard_normal((SUBJECTS, 3))
    bare = replace(fitted, A=fitted.A[..., :0], linear=fitted.linear - np.einsum("srk,sk->sr", fitted.A, amplitudes))
    expected = [float(log_evidence(inner_products(bare).at(spread=s), independent_prior(np.zeros(0)))) for s in SPREADS]
    found = inner_products(fitted).given_amplitudes(amplitudes).at(spread=SPREADS).log
    np.testing.assert_allclose(found, expected, atol=1e-8)


GAP = EFFECTS["scapulothoracic_gap"]
"""TS and AI, three terms of a course each."""

ONE_COURSE = np.array([0.5, -0.4, 0.3, -1.0, 0.8, -0.6])
TWO_COURSES = np.array([0.5, -2.0, 2.0, -1.0, -2.0, -2.0])


def gained_by_one_course(amplitudes: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> float:
    """Log evidence that channels may go together, over that of free ones alone."""
    fitted = subjects(np.tile(amplitudes, (SUBJECTS, 1)), effect=GAP)
    logs = []
    for share in (priors._TOGETHER_PROBABILITY, 0.0):
        monkeypatch.setattr(priors, "_TOGETHER_PROBABILITY", max(share, 1e-300))
        logs.append(float(over_priors(inner_products(fitted), fitted.scale, [GAP], [(1.0, 1.0)], SPREADS).log_evidence))
    return logs[0] - logs[1]


def test_channels_that_follow_one_course_say_more(monkeypatch):
    assert gained_by_one_course(ONE_COURSE, monkeypatch) > CLEAR


def test_channels_that_do_not_are_left_free(monkeypatch):
    """All that is lost is the prior probability of going together."""
    expected = np.log(1.0 - priors._TOGETHER_PROBABILITY)
    assert gained_by_one_course(TWO_COURSES, monkeypatch) == pytest.approx(expected, abs=LITTLE)
