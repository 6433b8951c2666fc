"""Posture fits after an adaptation, against its optimum."""

from dataclasses import replace

import numpy as np
import pytest

from adapt import adapt_subjects, fit_postures
from adapt.evaluation.held_out import adapt_with_folds
from adapt.solvers import status
from adapt.solvers.motion_fits import rows_of_optima
from adapt.solvers.objective import WEIGHT
from adapt.solvers.rows import posture_rows
from models import load_model
from models.adapted_parameters import ADAPTED
from motions.rhythm_subjects import simulate_subjects

ROUNDING = 1e-12
"""Relative rounding of a sum of some hundred squares."""


JUMPING_SEED = 2
"""Seed of subjects some of whom jump; the test fails if none does."""


@pytest.fixture(scope="module")
def jumping():
    """Subjects whose chain jumps along their motions with the MRI set, whose conoid is slack at rest."""
    motions = simulate_subjects(10, seed=JUMPING_SEED)
    return motions, adapt_subjects(motions, [load_model("breteler_mri"), load_model("R2")], held_out=())


def test_e_is_that_of_the_rows_jumps_included(jumping):
    _, result = jumping
    after = result.fits[result.fits["adapted"] == 1]
    assert after[after["model"] == "breteler_mri"]["jump"].sum() > 0, "no motion jumps: another case is needed"
    mean_j = after.groupby(["model", "subject"], sort=False)["j_deg2"].mean()
    parameters = result.parameters.set_index(["model", "subject"])
    np.testing.assert_allclose(parameters["mean_j_after_deg2"], mean_j[parameters.index], rtol=ROUNDING)
    E = parameters["D_mm2"] + WEIGHT * parameters["mean_j_after_deg2"]
    assert set(parameters["status"]) == {status.OK}
    np.testing.assert_allclose(parameters["E"], E, rtol=ROUNDING)


def test_multipliers_are_those_of_a_posture_fit(jumping):
    """Check W (q - s) + G' lambda = 0 with the W of J: multipliers as of a posture fit with this girdle."""
    motions, result = jumping
    fitted, adapted = result.by_model["R2"], result.adapted["R2"]
    assert np.all(fitted.status == status.OK)
    assert fitted.stationarity.max() < 1e-8
    assert np.abs(fitted.residual_mm).max() < 1e-8
    theta = adapted.theta_mm[:, [motions.subjects.index(name) for name in motions.subject]]
    girdle = load_model("R2").girdle.over_axes(1).with_adapted(theta)
    gradient = girdle_gradient(girdle, fitted.angles, fitted.multipliers)
    target = motions.angles_deg.T * np.pi / 180.0
    weights = 2.0 * (180.0 / np.pi) ** 2 / 6.0
    np.testing.assert_allclose(weights * (fitted.angles - target), -gradient, atol=1e-6)


def girdle_gradient(girdle, angles, multipliers):
    """Compute G' lambda by central differences."""
    step, columns = 1e-6, []
    for k in range(6):
        moved = [girdle.residuals_mm(angles + sign * step * np.eye(6)[:, [k]]) for sign in (1.0, -1.0)]
        columns.append(((moved[0] - moved[1]) / (2.0 * step) * multipliers).sum(axis=0))
    return np.stack(columns)


def test_a_parameter_has_one_sd(jumping):
    _, result = jumping
    sd = result.parameters[[f"{name}_mm_sd" for name in ADAPTED]].to_numpy()
    np.testing.assert_array_equal(sd, result.uncertainty.sd_mm.T)


def test_where_e_does_not_hold_the_postures_they_are_fitted():
    """Check w = 0: the ellipsoid comes from the points alone, and the postures are those of a fit with it."""
    motions, model = simulate_subjects(2, seed=1), load_model("R2")
    found = adapt_with_folds(posture_rows(motions), [model], (), weight=0.0)
    assert set(found.adapted.status) == {status.OK}
    after = rows_of_optima(found.rows, found.data, found.adapted).j_deg2
    np.testing.assert_allclose(after, fit_postures(motions, model).by_model["R2"].j_deg2, rtol=1e-6)


def test_a_wrong_posture_leaves_the_fits_of_the_others():
    """Check a scapula turned inside out by a typing error: the other postures of its motion keep their fits."""
    motions, wrong, model = simulate_subjects(1, seed=1), 3, load_model("R2")
    angles_deg = motions.angles_deg.copy()
    angles_deg[wrong, 3] = -90.0
    sound, found = (fit_postures(one, model).fits for one in (motions, replace(motions, angles_deg=angles_deg)))
    assert found["jump"].to_numpy().any(), "the chain does not jump at the wrong posture: another case is needed"
    others = np.arange(len(sound)) != wrong
    np.testing.assert_allclose(found["j_deg2"][others], sound["j_deg2"][others], rtol=1e-6)
