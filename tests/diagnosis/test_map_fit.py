"""Hypotheses fitted to all subjects: each as it would be alone, and at no more cost than it needs."""

from itertools import pairwise

import numpy as np
import pytest
from made_effects import without_details

from adapt.diagnosis.fit import map_fit
from adapt.diagnosis.fit.map_fit import _cost, _Estimate, _from_lower_valleys, _Prior, fit_hypotheses
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.misfit import Misfit, misfit
from adapt.diagnosis.fit.observations import observe
from adapt.model_subjects import simulate_model_subjects
from models import load_model
from models.adapted_parameters import PRIOR_SD_MM
from models.effects import EFFECTS

SAME_SD = 1e-9
"""In prior standard deviations: the same descent, rounded in another order."""

SAME_COST = 0.1
"""-2 log posterior: descents stop where a step of all subjects changes it by 0.02."""

MODEL = load_model("R2")
NAMES = ("scapula_landmark_bias", "conoid_strain", "thorax_asymmetry")
SMALL_EFFECTS = tuple(without_details(EFFECTS[name]) for name in NAMES)
HYPOTHESES = [(), ("scapula_landmark_bias",), ("conoid_strain", "thorax_asymmetry")]
SUBJECTS = 4


@pytest.fixture(scope="module")
def data():
    return observe(simulate_model_subjects(MODEL, SMALL_EFFECTS[0], SUBJECTS, 1.0, seed=3).motions)


def fitted(data, hypotheses):
    return fit_hypotheses(MODEL.girdle, SMALL_EFFECTS, hypotheses, data, Noise(1.0))


def test_company_leaves_the_best_hypothesis_as_it_is_and_makes_none_worse(data):
    """Those that lie far behind it may be fetched from another valley."""
    for hypothesis, among in zip(HYPOTHESES, fitted(data, HYPOTHESES), strict=True):
        (alone,) = fitted(data, [hypothesis])
        assert among.hypothesis == hypothesis
        assert _cost(among) <= _cost(alone) + SAME_COST
        if hypothesis == ("scapula_landmark_bias",):
            np.testing.assert_allclose(among.u, alone.u, rtol=0.0, atol=SAME_SD)
            np.testing.assert_allclose(among.a / among.scale, alone.a / alone.scale, rtol=0.0, atol=SAME_SD)


def test_a_subject_left_in_another_valley_is_fetched_from_it():
    """Two valleys at plus and minus one standard deviation of M_y, of which the second is the lower by 64."""
    sd = np.repeat(PRIOR_SD_MM[:, None], 2, axis=1)
    prior = _Prior(np.repeat(np.arange(6)[:, None], 2, axis=1), np.zeros((6, 2)), sd)

    def evaluate(z, nearest, projections, problems) -> Misfit:
        w, nothing = z[0] / PRIOR_SD_MM[0], np.zeros((z.shape[1], 1))
        slopes = np.zeros((len(w), 1, 2, 6))
        slopes[:, 0, :, 0] = np.stack([10.0 * w, 4.0 + 0.0 * w], axis=1) / PRIOR_SD_MM[0]
        y = np.stack([5.0 * (w**2 - 1.0), 4.0 * (w + 1.0)], axis=1)[:, None]
        return Misfit(
            nearest=np.zeros((6, 1, len(w))),
            y=y,
            slopes=slopes,
            root=np.zeros((len(w), 1, 2, 2)),
            by_angle=np.zeros((len(w), 1, 2, 6)),
            open_mm=nothing,
            noise_variance=np.zeros((6, 1, len(w))),
        )

    def at(*w: float) -> _Estimate:
        z = np.zeros((6, 2))
        z[0] = PRIOR_SD_MM[0] * np.array(w)
        some = evaluate(z, None, 0, np.arange(2))
        return _Estimate(z, some.nearest, (some.y**2).sum(axis=(1, 2)) + np.square(w))

    fetched = _from_lower_valleys(evaluate, prior, at(-1.0, 1.0), subjects=1)
    assert fetched.z[0] / PRIOR_SD_MM[0] == pytest.approx([-1.0, -1.0], abs=0.05)
    assert fetched.z[0, 0] == -PRIOR_SD_MM[0]
    assert fetched.cost[1] < 2.0
    shared_prior = at(-1.0, -1.0)
    assert _from_lower_valleys(evaluate, prior, shared_prior, subjects=1) is shared_prior


def test_lanes_that_have_come_to_rest_are_not_looked_at_again(data, monkeypatch):
    """Descents look at ever fewer of the lanes; each of the three rounds begins with all."""
    problems = []

    def counted(girdle, effects, some, *others):
        problems.append(some.counted.shape[1])
        return misfit(girdle, effects, some, *others)

    monkeypatch.setattr(map_fit, "misfit", counted)
    fitted(data, HYPOTHESES)
    all_lanes = len(HYPOTHESES) * SUBJECTS
    assert max(problems) == all_lanes
    fewer = [now for before, now in pairwise(problems) if now < before]
    assert len(fewer) >= 3
    assert sum(problems) < 0.8 * all_lanes * len(problems)
