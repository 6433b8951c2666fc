"""How amplitudes may depart from their courses: columns against differences, and what they are for."""

from dataclasses import replace

import numpy as np
import pytest
from test_discrepancy import KNOWN, POSTURES, SUBJECTS, observed, with_offsets

from adapt.diagnosis.fit.linear_evidence import inner_products
from adapt.diagnosis.fit.linear_model import LinearisedFit
from adapt.diagnosis.inference.departures import with_departures
from adapt.diagnosis.inference.discrepancy import discrepancy_gain
from adapt.diagnosis.inference.priors import likeliest_prior, likely_spreads, over_priors
from models.effects import EFFECTS
from models.effects.effect import FULL_ELEVATION_DEG

SAME = 1e-12
"""Relative: a few products."""

CLEAR = 5.0
"""Nats: odds of 150 to 1."""

GAP = EFFECTS["scapulothoracic_gap"]
DATA = observed()
F = DATA.elevation_deg.T / FULL_ELEVATION_DEG


def fitted_to(course: np.ndarray, size_mm: float = 15.0) -> LinearisedFit:
    """Two channels that change A1 and A2; TS alone follows ``course`` (subjects, postures), on top of noise."""
    offsets = size_mm * course[..., None] * np.array([1.0, 0.0, 0.0])
    one = with_offsets(offsets)
    terms = np.stack([F, 4.0 * F * (1.0 - F), 8.0 * F * (1.0 - F) * (1.0 - 2.0 * F)], axis=-1)
    A = np.concatenate(
        [(one.root[..., k][..., None] * terms[:, :, None]).reshape(SUBJECTS, -1, 3) for k in (0, 1)], axis=2
    )
    scale = np.asarray(GAP.prior_sd)
    return replace(one, hypothesis=(GAP.name,), A=A, scale=scale, a=np.zeros((SUBJECTS, 6)), linear=one.y)


def test_columns_are_those_of_the_first_term_times_the_departure():
    fitted = fitted_to(F)
    wide = with_departures(fitted, [GAP], DATA)
    finer = 0.1 * 8.0 * (1.0 - F) * (2.0 * (1.0 - 2.0 * F) ** 2 - 1.0)
    apart = 0.1 * np.where(DATA.motion.T == 0, 0.5, -0.5)
    for channel, start in ((0, 6), (3, 10)):
        first = fitted.A[..., channel].reshape(SUBJECTS, POSTURES, 3)
        for column, d in ((start, finer), (start + 2, apart), (start + 3, -apart)):
            expected = (first * d[..., None]).reshape(SUBJECTS, -1)
            np.testing.assert_allclose(wide.A[..., column], expected, rtol=SAME, atol=SAME)
    np.testing.assert_array_equal(wide.A[..., :6], fitted.A)
    np.testing.assert_array_equal(wide.scale, [*fitted.scale, *[GAP.prior.scale[0]] * 4, *[GAP.prior.scale[1]] * 4])


def test_an_effect_that_is_constant_has_none():
    fitted = replace(fitted_to(F), A=np.ones((SUBJECTS, 3 * POSTURES, 1)), scale=np.ones(1), a=np.zeros((SUBJECTS, 1)))
    assert with_departures(fitted, [EFFECTS["clavicle_length"]], DATA) is fitted


def test_one_motion_has_nothing_to_depart_from():
    data = replace(DATA, motion=np.zeros_like(DATA.motion), motions=("up",))
    assert with_departures(fitted_to(F), [GAP], data).A.shape[2] == 6 + 2 * 2


def evidence_of(fitted: LinearisedFit) -> float:
    products = inner_products(fitted)
    spreads, log_share = likely_spreads(products, fitted.a)
    return float(over_priors(products, fitted.scale, [GAP], [(1.0, 1.0)], spreads).log_evidence) - log_share


CORNER = 2.0 * np.maximum(0.0, 2.0 * F - 1.0)
STRONGER_FORWARD = F * np.where(DATA.motion.T == 0, 0.85, 1.15)


@pytest.mark.parametrize("course", [CORNER, STRONGER_FORWARD], ids=["corner", "motions"])
def test_a_large_effect_with_a_course_of_its_own_is_no_unknown_one(course):
    fitted = fitted_to(course)
    wide = with_departures(fitted, [GAP], DATA)
    assert evidence_of(wide) > evidence_of(fitted)
    plain, wider = (discrepancy_gain(one, DATA, likeliest_prior(one), KNOWN) for one in (fitted, wide))
    assert wider < 0.0 < plain


def test_what_departs_by_more_than_courses_do_is_still_seen():
    back_and_forth = np.where(np.arange(POSTURES) % 2, 1.0, -1.0) * F
    fitted = with_departures(fitted_to(back_and_forth), [GAP], DATA)
    assert discrepancy_gain(fitted, DATA, likeliest_prior(fitted), KNOWN) > CLEAR
