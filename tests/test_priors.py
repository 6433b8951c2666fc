"""Evidence over all priors: what people may have in common or not decides where the data say so."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.diagnosis import priors
from adapt.diagnosis.evidence import Linear, products
from adapt.diagnosis.priors import OverPriors, over_priors
from models.effects import EFFECTS, Effect

CLEAR = 3.0
"""Nats: odds of 20 to 1."""

LITTLE = 0.1
"""Nats: what is as good as impossible adds less."""

EFFECT = EFFECTS["scapula_landmark_bias"]
SUBJECTS, RESIDUALS = 8, 30


def subjects(amplitudes: np.ndarray, shift: float = 0.0, seed: int = 0, effect: Effect = EFFECT) -> Linear:
    """Amplitudes (subjects, amplitudes) in units of their scale, and adapted parameters that are all off by
    ``shift``."""
    generator = np.random.default_rng(seed)
    X, A = (3.0 * generator.standard_normal((SUBJECTS, RESIDUALS, k)) for k in (6, amplitudes.shape[1]))
    scale = np.asarray(effect.prior_sd)
    u = 0.2 * generator.standard_normal((SUBJECTS, 6)) + shift
    linear = np.einsum("srk,sk->sr", X, u) + np.einsum("srk,sk->sr", A, amplitudes)
    linear = linear + generator.standard_normal((SUBJECTS, RESIDUALS))
    nothing = np.zeros(0)
    return Linear((effect.name,), nothing, nothing, linear, X, A / scale, scale, nothing, nothing, linear, nothing)


def weighed(fitted: Linear) -> OverPriors:
    return over_priors(products(fitted), fitted.scale, [EFFECT], [(1.0, 1.0)])


def plain(fitted: Linear) -> float:
    """Log evidence without an amplitude."""
    none = replace(fitted, A=fitted.A[..., :0], scale=fitted.scale[:0])
    return float(over_priors(products(none), none.scale, [], [(1.0, 1.0)]).log_evidence)


WAY = np.array([0.6, -0.3, 0.5])
SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0])


def test_amplitudes_of_all_alike_are_found_alike():
    found = weighed(subjects(np.tile(WAY, (SUBJECTS, 1))))
    assert found.unlike < -CLEAR


@pytest.mark.parametrize(
    "amplitudes",
    [SIGNS[:, None] * WAY, np.random.default_rng(5).standard_normal((SUBJECTS, 3))],
    ids=["signs differ", "all differ"],
)
def test_amplitudes_that_differ_are_found_to_differ(amplitudes):
    fitted = subjects(amplitudes)
    assert weighed(fitted).unlike > CLEAR
    assert weighed(fitted).log_evidence > plain(fitted) + CLEAR


def test_signs_that_differ_cost_less_than_amplitudes_of_ones_own():
    """Half of 2^8 patterns, but one direction in place of eight."""
    opposed = weighed(subjects(SIGNS[:, None] * WAY)).log_evidence
    alike = weighed(subjects(np.tile(WAY, (SUBJECTS, 1)))).log_evidence
    own = weighed(
        subjects(np.linalg.norm(WAY) / np.sqrt(3.0) * np.sign(np.random.default_rng(6).standard_normal((8, 3))))
    )
    assert own.log_evidence < opposed < alike


def test_parameters_off_by_the_same_in_all_need_no_effect():
    """A shift of half a SD in eight subjects: sixteen times as improbable as it is where only subjects differ."""
    fitted = subjects(np.zeros((SUBJECTS, 3)), shift=0.5)
    assert plain(fitted) > float(weighed(fitted).log_evidence)
    spread = over_priors(products(replace(fitted, A=fitted.A[..., :0])), np.zeros(0), [], [(1.0, 1.0)]).spread
    assert spread < 0.5


def test_the_spread_is_the_one_that_the_subjects_have():
    assert weighed(subjects(np.tile(WAY, (SUBJECTS, 1)))).spread == 0.2


GAP = EFFECTS["scapulothoracic_gap"]
"""TS and AI, three terms of a course each."""

ONE_COURSE = np.array([0.5, -0.4, 0.3, -1.0, 0.8, -0.6])
TWO_COURSES = np.array([0.5, -2.0, 2.0, -1.0, -2.0, -2.0])


def gained_by_one_course(amplitudes: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> float:
    """Log evidence that channels may go together, over that of free ones alone."""
    fitted = subjects(np.tile(amplitudes, (SUBJECTS, 1)), effect=GAP)
    logs = []
    for share in (priors._TOGETHER_SHARE, 0.0):
        monkeypatch.setattr(priors, "_TOGETHER_SHARE", max(share, 1e-300))
        logs.append(float(over_priors(products(fitted), fitted.scale, [GAP], [(1.0, 1.0)]).log_evidence))
    return logs[0] - logs[1]


def test_channels_that_follow_one_course_say_more(monkeypatch):
    assert gained_by_one_course(ONE_COURSE, monkeypatch) > CLEAR


def test_channels_that_do_not_are_left_free(monkeypatch):
    """All that is lost is the prior probability of going together."""
    expected = np.log(1.0 - priors._TOGETHER_SHARE)
    assert gained_by_one_course(TWO_COURSES, monkeypatch) == pytest.approx(expected, abs=LITTLE)
