"""The most that could be told of motions: its evidence against dense Gaussians, and limits known beforehand."""

from collections import Counter
from dataclasses import replace
from math import erfc, sqrt

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal
from typer.testing import CliRunner

from adapt.diagnosis.design.predicted_power import SPREAD
from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS
from models.effects import EFFECTS, EffectPrior
from scripts import study_limit
from scripts.study_limit import Limit, limit_of, log_evidence, row_of

SAME = 1e-8
"""Relative and absolute: a few hundred sums of squares, taken in another order."""

DRAWS = 4000
SE = 4.0 * 0.5 / sqrt(2 * DRAWS)
"""Four standard errors of a rate of two effects."""

HARDLY_THERE = 2e-3
"""Share of subjects, of SD 0.3 about 1, who have a fortieth of an effect or less, four standard errors more."""

ONE_WAY = replace(EFFECTS["thorax_asymmetry"], prior=EffectPrior((1.0,), "made up", sign=(1,)))
"""An effect of one number, which is 1 when all subjects have it alike."""


def two_orthogonal(simulate_statistics: float):
    """One subject without adapted parameters: each of two effects turns a residual of its own by so much."""
    gram = np.zeros((1, 8, 8))
    gram[0, [6, 7], [6, 7]] = simulate_statistics**2
    return gram, [np.arange(6, 6), np.array([6]), np.array([7])]


def test_evidence_is_that_of_the_dense_gaussian():
    generator = np.random.default_rng(0)
    columns = generator.standard_normal((3, 15, 9)) / 2.0
    seen_residuals = generator.standard_normal((4, 3, 15))
    ways = generator.standard_normal((5, 3))
    expected = []
    for y in seen_residuals:
        of_way = []
        for way in ways:
            log = 0.0
            for one, residuals in zip(columns, y, strict=True):
                C = np.eye(15) + SPREAD**2 * one[:, :6] @ one[:, :6].T
                shift = one[:, 6:] @ way
                log += multivariate_normal(shift, C + BETWEEN_SUBJECTS**2 * np.outer(shift, shift)).logpdf(residuals)
                log -= multivariate_normal(np.zeros(15), C).logpdf(residuals)
            of_way.append(log)
        expected.append(logsumexp(of_way) - np.log(len(ways)))
    gram = np.swapaxes(columns, 1, 2) @ columns
    seen = np.einsum("srk,dsr->dsk", columns, seen_residuals)
    np.testing.assert_allclose(log_evidence(gram, seen, np.arange(6, 9), ways), expected, rtol=SAME, atol=SAME)


def test_two_effects_that_show_alone_are_taken_for_each_other_as_often_as_two_gaussians():
    """y_1 ~ N(a, 1 + a^2 b^2) against y_2 ~ N(0, 1): the larger one is at work."""
    a = 1.0
    expected = 0.5 * erfc(-a / sqrt(2.0 + a**2 * BETWEEN_SUBJECTS**2) / sqrt(2.0))
    other = replace(ONE_WAY, name="other")
    found = limit_of(*two_orthogonal(a), (ONE_WAY, other), draws=DRAWS, directions=1)
    assert found.right == pytest.approx(expected, abs=SE)
    assert found.claimed == pytest.approx(expected, abs=SE)
    assert found.first < found.right
    assert found.confused_with == Counter({("thorax_asymmetry", "other"): round(2 * DRAWS * (1.0 - found.right))})


def test_half_the_size_is_twice_the_noise():
    half = limit_of(*two_orthogonal(2.0), (ONE_WAY, ONE_WAY), size=0.5, draws=DRAWS, directions=1)
    whole = limit_of(*two_orthogonal(1.0), (ONE_WAY, ONE_WAY), draws=DRAWS, directions=1)
    assert half.right == pytest.approx(whole.right, abs=SAME)
    assert half.first == pytest.approx(whole.first, abs=SAME)


def test_what_shows_clearly_is_told_and_what_does_not_is_guessed():
    clear = limit_of(*two_orthogonal(100.0), (ONE_WAY, ONE_WAY), draws=DRAWS, directions=1)
    assert min(clear.right, clear.first, 2.0 - clear.set_size) > 1.0 - HARDLY_THERE
    hidden = limit_of(*two_orthogonal(1e-6), (ONE_WAY, ONE_WAY), draws=DRAWS, directions=1)
    assert hidden.right == pytest.approx(0.5, abs=SE)
    assert hidden.first == pytest.approx(0.5 * study_limit.BLAMED, abs=SE)
    assert hidden.set_size == pytest.approx(2.0 * (1.0 - study_limit.MISSED), abs=0.1)


def test_the_command_prints_the_limit_of_a_condition(monkeypatch):
    chosen = ("scapula_landmark_bias", "conoid_strain")
    monkeypatch.setattr(study_limit, "EFFECTS", {name: EFFECTS[name] for name in chosen})
    printed = CliRunner().invoke(study_limit.app, ["--condition", "three", "--model", "R2"], catch_exceptions=False)
    *_, row = printed.stdout.splitlines()
    condition, right, *_ = row.strip("| ").split(" | ")
    assert condition == "three"
    assert 90 <= int(right.rstrip(" %")) <= 100


@pytest.mark.parametrize(
    ("option", "name", "cause"),
    [("--condition", "fog", "no condition is called 'fog'"), ("--model", "R9", "no parameter set is called 'R9'")],
)
def test_wrong_names_say_what_is_wrong(option, name, cause):
    printed = CliRunner().invoke(study_limit.app, [option, name])
    assert printed.exit_code == 2
    assert cause in printed.stderr


def test_a_row_is_the_mean_over_parameter_sets():
    first = Limit(0.8, 0.6, 1.5, 0.7, Counter({("a", "b"): 1}))
    second = Limit(0.9, 0.7, 2.5, 0.8, Counter({("a", "b"): 1, ("d", "c"): 3}))
    assert row_of("one", [first, second]) == ["one", "85 %", "75 %", "65 %", "2.00", "d - c; a - b"]
