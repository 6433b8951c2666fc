"""Sizes of effects that differ between persons, against refits of E with known sizes beside the optimum."""

from dataclasses import replace

import numpy as np
import pytest

from adapt import adapt_subjects
from adapt.evaluation.held_out import adapt_with_folds
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.solvers.objective import WEIGHT
from adapt.solvers.rows import posture_rows
from models import load_model
from models.effects import EFFECTS
from models.effects.amplitudes import PersonalSize, active_effects
from motions import Motions

BIAS = EFFECTS["scapula_landmark_bias"]
MEAN, SD = (2.0, -6.0, 3.0), (4.0, 6.0, 0.0)
"""Population mean and SD, deg; about z all persons are alike."""

STEP = 0.01
"""Step from the optimum, in SDs."""

SAME_SLOPE = 1e-3
"""Tolerance for differences, mm^2 per SD: E is known to 1e-9, and its slope on either side is 10 to 1000."""

SAME_MM = 1e-4
"""Sizes converge to 1e-4 of an SD, and a parameter moves by less than a mm per SD."""


@pytest.fixture(scope="module")
def motions() -> Motions:
    """Two subjects with different biases."""
    return simulate_model_subjects(load_model("R2"), BIAS, 2, 1.0, seed=3).motions


def adapted(motions: Motions, mean=MEAN, sd=SD, **how):
    effects = {BIAS.name: PersonalSize(mean, sd) if sd else mean}
    return adapt_subjects(motions, load_model("R2"), held_out=(), effects=effects, **how).adapted["R2"]


def test_sizes_are_where_what_they_cost_balances_what_they_gain(motions):
    """d E / d v = -2 w / (6 n) v, by adaptations with known sizes beside the optimum."""
    found = adapted(motions)
    assert (found.status == "ok").all()
    assert found.sizes.shape == (2, 2)
    assert (np.abs(found.sizes) > 0.1).any()
    for subject, name in enumerate(motions.subjects):
        one = motions.select(motions.subject == name)
        cost = WEIGHT / (6.0 * len(one.posture))
        sizes = np.array([*found.sizes[:, subject], 0.0])
        middle = np.array(MEAN) + SD * sizes
        at = adapted(one, tuple(middle), ())
        assert at.E[0] == pytest.approx(found.E[subject], rel=1e-7)
        np.testing.assert_allclose(at.theta_mm[:, 0], found.theta_mm[:, subject], atol=SAME_MM)
        for k in range(2):
            beside = [middle + sign * STEP * np.eye(3)[k] * SD for sign in (1.0, -1.0)]
            up, down = (adapted(one, tuple(values), ()).E[0] for values in beside)
            assert (up - down) / (2.0 * STEP) == pytest.approx(-2.0 * cost * sizes[k], abs=SAME_SLOPE)


def test_with_hardly_any_room_all_have_the_mean_and_with_much_a_lower_E(motions):
    mean, none = adapted(motions, sd=()), adapted(motions, sd=(0.0,) * 3)
    hardly, much = adapted(motions, sd=(1e-6,) * 3), adapted(motions, sd=(30.0,) * 3)
    np.testing.assert_array_equal(none.E, mean.E)
    np.testing.assert_allclose(hardly.E, mean.E, rtol=1e-4)
    assert (much.E < 0.9 * mean.E).all()


def test_without_angles_some_of_the_time_they_are_found_too(motions):
    angles = motions.angles_deg.copy()
    angles[::3, 2] = np.nan
    found = adapted(replace(motions, angles_deg=angles))
    assert (found.status == "ok").all()
    assert (found.sizes != adapted(motions).sizes).all()


def test_where_postures_do_not_count_sizes_stay_at_the_mean(motions):
    rows = posture_rows(motions, {BIAS.name: PersonalSize(MEAN, SD)})
    found = adapt_with_folds(rows, [load_model("R2")], (), weight=0.0).adapted
    np.testing.assert_allclose(found.sizes, 0.0, atol=1e-6)


def test_each_way_in_which_persons_differ_has_the_strength_of_an_sd(motions):
    found = active_effects(
        {"thorax_extension": PersonalSize((8.0, 0.0, -3.0), (2.0, 0.0, 1.0)), BIAS.name: MEAN}, motions
    )
    bias, extension = found.own
    assert bias.shape == (0, 3, len(motions.posture))
    share = motions.humerus_elevation_deg / 150.0
    np.testing.assert_allclose(extension, np.eye(3)[[0, 2], :, None] * np.array([2.0, 1.0])[:, None, None] * share)
    sizes = np.array([[0.5], [-1.0]])
    one = replace(
        found, strengths=tuple(x[..., None] for x in found.strengths), own=tuple(x[..., None] for x in found.own)
    )
    strengths = one.with_sizes(sizes).strengths[1][..., 0]
    np.testing.assert_allclose(strengths, np.outer([9.0, 0.0, -4.0], share))
