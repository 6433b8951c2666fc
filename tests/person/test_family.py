"""A parameter set for each subject: sets in a batch against each set alone."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.api import adapt_subjects
from adapt.cli.inputs import subjects_without_set
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.solvers.problems import sets_of
from models import load_model
from models.adapted_parameters import ADAPTED
from models.parameter_sets import ParameterSet
from models.person.family import PersonalSets, girdles_of
from models.person.thorax_ellipsoid import fit_thorax, fitted_girdle

MANY = 12
"""More sets than are fitted one by one."""

SAME_MM = 1e-4
"""Tolerance: in the flat direction of M_y and A_y the end of a fit depends on its steps."""


def sets(count: int) -> dict[str, ParameterSet]:
    """Make sets from R2 with individual thoraxes, fitted to noisy points, of two different numbers."""
    base, rng = load_model("R2"), np.random.default_rng(0)
    found = {}
    for k in range(count):
        points = base.points_mm[:, : 24 - 2 * (k % 2)]
        points = points + 1.0 * rng.standard_normal(points.shape)
        thorax = fit_thorax(points, base.girdle)
        girdle = replace(base.girdle, centre_mm=thorax.centre_mm, semi_axes_mm=thorax.semi_axes_mm)
        found[f"P{k:02d}"] = replace(base, name=f"P{k:02d}", girdle=girdle, points_mm=points)
    return found


def test_many_sets_are_fitted_together_as_each_alone():
    own = PersonalSets("own", sets(MANY))
    found = sets_of([own], list(own.by_subject))
    for k, one in enumerate(own.by_subject.values()):
        alone = fitted_girdle(one.girdle, one.points_mm)
        np.testing.assert_allclose(np.asarray(found.girdle.adapted_mm)[:, k], alone.adapted_mm, atol=SAME_MM)
        count = one.points_mm.shape[1]
        np.testing.assert_array_equal(found.points_mm[:, :count, k], one.points_mm)
        assert found.point_weights[:, k].sum() == pytest.approx(1.0)


def test_a_batch_with_own_sets_is_each_subject_with_its_own():
    motions = simulate_model_subjects(load_model("R2"), None, 3, 0.5, 4).motions
    own = PersonalSets("own", dict(zip(motions.subjects, sets(3).values(), strict=True)))
    together = adapt_subjects(motions, [load_model("R4"), own], held_out=())
    for k, subject in enumerate(motions.subjects):
        alone = adapt_subjects(motions.select(motions.subject == subject), own.of(subject), held_out=())
        theta = next(iter(alone.adapted.values())).theta_mm[:, 0]
        np.testing.assert_allclose(together.adapted["own"].theta_mm[:, k], theta, atol=1e-6)
    table = together.parameters[together.parameters["model"] == "own"]
    assert table["A_y_mm_model"].tolist() == [float(own.of(s).girdle.semi_axes_mm[1]) for s in motions.subjects]
    assert len(ADAPTED) == together.adapted["own"].theta_mm.shape[0]


def test_who_has_no_set():
    own = PersonalSets("own", sets(2))
    (missing,) = subjects_without_set([load_model("R2"), own], ["P00", "P01", "P07"]).items()
    assert (missing[0], missing[1].file) == ("P07", "own")
    np.testing.assert_array_equal(girdles_of(own, ["P01", "P01"]).sc_mm[:, 1], own.of("P01").girdle.sc_mm)
