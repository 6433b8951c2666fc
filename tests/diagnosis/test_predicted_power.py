"""What a diagnosis foresees: its draws against residuals written out, and limits that can be told beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.diagnosis.design import predicted_power as predicted_power
from adapt.diagnosis.design.predicted_power import predict_power, typical_amplitudes
from adapt.diagnosis.design.separability import projected_onto_model, slopes
from adapt.diagnosis.fit.linear_evidence import inner_products
from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS, LinearisedFit
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.observations import observe
from adapt.diagnosis.inference.priors import over_priors
from adapt.model_subjects import simulate_model_subjects
from models import load_model
from models.effects import EFFECTS

SAME = 1e-9
"""Relative: sums of a few hundred squares, taken in another order."""

SURELY = 0.99
"""Share of draws of an effect that nothing hides: one in a hundred may fail."""

DRAWS = 4000
SE = 4.0 / np.sqrt(DRAWS)
"""Four standard errors of a mean of so many draws of variance 1."""

MODEL = load_model("R2")
CHOSEN = tuple(EFFECTS[name] for name in ("scapula_landmark_bias", "conoid_strain", "skin_artefact"))
NAMES = [effect.name for effect in CHOSEN]
HYPOTHESES = [(), *((name,) for name in NAMES)]


@pytest.fixture(scope="module")
def data():
    postures = observe(simulate_model_subjects(MODEL, None, 3, 0.0, seed=1).motions)
    return projected_onto_model(MODEL.girdle, CHOSEN, postures, Noise(1.0))


def test_amplitudes_are_as_long_as_the_scales_and_keep_the_signs_of_nature():
    effect = EFFECTS["skin_artefact"]
    drawn = typical_amplitudes(effect, DRAWS, 3, np.random.default_rng(0))
    channels = drawn.reshape(DRAWS, 3, 3, -1)[..., 0]
    length = np.linalg.norm(channels, axis=2) / np.linalg.norm(effect.prior.scale)
    assert (channels[..., 0] >= 0.0).all()
    assert (channels[..., 2] >= 0.0).all()
    assert abs(np.sign(channels[:, 0, 1]).mean()) < SE
    assert abs(length.mean() - 1.0) < SE
    assert abs(length.std() - BETWEEN_SUBJECTS) < SE


def test_the_direction_that_leads_is_as_large_as_the_scale_beside_the_others():
    """AI and TS before they are made as long as the scales: TS / AI is a Gaussian of theirs."""
    effect = EFFECTS["scapulothoracic_gap"]
    drawn = typical_amplitudes(effect, DRAWS, 1, np.random.default_rng(0))[:, 0, ::3]
    ts, ai = drawn[(drawn != 0.0).all(axis=1)].T
    ratio = ts / ai * effect.prior.scale[1] / effect.prior.scale[0]
    assert abs(ratio.mean()) < SE
    assert abs(ratio.std() - 1.0) < SE


def test_details_make_an_effect_no_larger():
    effect = EFFECTS["clavicle_length"]
    length, detail, _ = np.moveaxis(typical_amplitudes(effect, DRAWS, 1, np.random.default_rng(0))[:, 0], -1, 0)
    assert abs(np.abs(length).mean() / effect.prior.scale[0] - 1.0) < SE
    assert abs(detail.std() / effect.prior.scale[1] - np.hypot(1.0, BETWEEN_SUBJECTS)) < 2.0 * SE


def test_amplitudes_of_one_draw_have_one_direction_and_one_course():
    drawn = typical_amplitudes(EFFECTS["ac_translation"], 5, 4, np.random.default_rng(1))
    relative = drawn / drawn[..., :1]
    np.testing.assert_allclose(relative, np.broadcast_to(relative[:, :1], relative.shape), rtol=SAME)


def test_draws_have_the_mean_and_covariance_of_residuals_written_out(monkeypatch):
    monkeypatch.setattr(predicted_power, "SPREAD", 0.0)
    generator = np.random.default_rng(2)
    columns = generator.standard_normal((2, 20, 7)) / np.sqrt(20.0)
    gram = np.swapaxes(columns, 1, 2) @ columns
    strain = EFFECTS["conoid_strain"]
    effect = replace(strain, over_elevation=False, prior=replace(strain.prior, scale=(1.0,)))
    coefficients = predicted_power.draw(gram, np.array([6]), effect, DRAWS, generator)
    with_data = predicted_power.simulate_statistics(gram, predicted_power.matrix_roots(gram), coefficients, generator)
    np.testing.assert_allclose(with_data.mean(axis=0), gram[..., 6], rtol=0.0, atol=2.0 * SE)
    expected = gram + BETWEEN_SUBJECTS**2 * gram[..., 6:] @ gram[:, 6:]
    for subject in (0, 1):
        found = np.cov(with_data[:, subject].T)
        np.testing.assert_allclose(found, expected[subject], rtol=0.0, atol=4.0 * SE)


def test_draws_are_weighed_as_the_diagnosis_weighs_residuals(data):
    noise = Noise(1.0)
    X, by_amplitudes = slopes(MODEL.girdle, CHOSEN, HYPOTHESES, data, noise)
    y = np.random.default_rng(3).standard_normal(X.shape[:2])
    columns = np.concatenate([X, *by_amplitudes], axis=2)
    gram, with_data = np.swapaxes(columns, 1, 2) @ columns, np.einsum("src,sr->sc", columns, y)
    start, found, expected = 6, [], []
    for effect, A in zip([None, *CHOSEN], by_amplitudes, strict=True):
        own, start = np.arange(start, start + A.shape[2]), start + A.shape[2]
        alone = [effect] if effect else []
        found.append(predicted_power._log_evidence(gram, with_data[None], own, alone)[0])
        scale = np.asarray(effect.prior_sd) if effect else np.zeros(0)
        nothing = np.zeros(0)
        fitted = LinearisedFit(("a",), nothing, nothing, y, X, A, scale, nothing, nothing, y, nothing, nothing)
        weighed = over_priors(inner_products(fitted), scale, alone, [(1.0, 1.0)], spreads=predicted_power._SPREADS)
        expected.append(float(weighed.log_evidence))
    np.testing.assert_allclose(np.subtract(found, found[0]), np.subtract(expected, expected[0]), rtol=SAME, atol=SAME)


def test_without_noise_every_effect_is_named(data):
    found = predict_power(MODEL.girdle, CHOSEN, data, Noise(0.01))
    assert all(one.named >= SURELY for one in found.values())


def test_in_noise_beyond_all_measure_none_is(data):
    found = predict_power(MODEL.girdle, CHOSEN, data, Noise(300.0))
    assert all(one.none >= SURELY and one.named <= 1.0 - SURELY for one in found.values())


def test_shares_add_up_and_are_the_same_again(data):
    found = predict_power(MODEL.girdle, CHOSEN, data, Noise(3.0))
    assert found == predict_power(MODEL.girdle, CHOSEN, data, Noise(3.0))
    for name, one in found.items():
        assert name not in one.confused_with
        assert one.named + one.none + sum(one.confused_with.values()) <= 1.0 + SAME


def test_more_subjects_name_more(data):
    few, many = (
        predict_power(MODEL.girdle, CHOSEN, weighed, Noise(3.0))
        for weighed in (data.select_subjects(np.array([0])), data)
    )
    assert sum(one.named for one in many.values()) > sum(one.named for one in few.values())
