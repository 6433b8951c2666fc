"""The study of unpublished numbers: each number moves alone, and derivatives agree with the compiled fits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from models import load_model
from models.girdle import NUMBERS
from motions import read_motions
from scripts.completion import thorax_points_mm
from scripts.research.thesis import study_unpublished as study
from scripts.research.thesis.outcomes import ABDUCTION, FLEXION
from scripts.rooms import ROOT


@pytest.fixture(scope="module")
def data() -> study.Data:
    """Return two shipped (simulated) subjects and a third as a mean motion, with motions renamed as in the study."""
    every = read_motions(ROOT / "motions" / "data" / "simulated_subjects.csv")
    names = {"abduction": ABDUCTION, "forward_flexion": FLEXION}
    every = replace(every, motion=np.array([names[name] for name in every.motion.tolist()]))
    every = every.select(np.isin(every.subject, every.subjects[:3]))
    return study.prepare(every, every.subjects[2:3])


def test_a_number_moves_alone():
    girdle = load_model("R2").girdle
    for k, one in enumerate(study.NUMBERS_MOVED):
        moved, points = study.moved(girdle, np.eye(len(study.REACH))[k] * 2.0)
        change = np.asarray(moved.numbers_mm) - np.asarray(girdle.numbers_mm)
        assert change.nonzero()[0].tolist() == ([] if one.place is None else [one.place])
        on_rule = thorax_points_mm(girdle.centre_mm, girdle.semi_axes_mm)
        assert np.allclose(points, on_rule, atol=1e-9) == (not one.name.startswith("thorax points"))
    assert [one.name for one in study.NUMBERS_MOVED[:3]] == ["SC, x", "SC, y", "SC, z"]
    assert study.NUMBERS_MOVED[0].place == NUMBERS["sc_mm"].start


def test_shares_are_those_of_means_over_subjects_and_postures(data):
    assert data.shares.sum(axis=1) == pytest.approx([1.0, 1.0, 1.0])
    assert len(np.unique(data.shares[2][data.shares[2] > 0.0])) <= 2


def test_gaps_and_slopes_by_hand():
    """Two postures, weights 1/4 and 3/4, differences of 2 and -4 degrees that grow by 1 and 3 degrees per step."""
    angles, off = np.zeros((6, 2)), np.zeros((6, 2))
    off[0] = np.radians([2.0, -4.0])
    slopes = np.zeros((6, 2, len(study.REACH)))
    slopes[0, :, 0] = np.radians([1.0, 3.0])
    gaps, changes = study.gaps_and_slopes(off, slopes, angles, np.array([0.25, 0.75]))
    assert gaps[0] == pytest.approx(0.25 * 2.0 + 0.75 * 4.0)
    assert changes[0, 0] == pytest.approx(0.25 * 1.0 - 0.75 * 3.0)


def test_differences_keep_the_sign_across_a_corner(data):
    """A gap of 0.5 degrees that becomes -0.5 changes by -1, though |gap| does not change; the other gaps grow by 1."""
    before, after = np.ones(data.angles.shape), np.ones((6, *data.abduction.shape))
    here = study.SignedGaps(before * 0.5, after * -2.0, np.arange(6.0))
    there = study.SignedGaps(before * -0.5, after * -3.0, np.arange(6.0))
    assert there.cells(data) - here.cells(data) == pytest.approx([0.0] * 18 + [1.0] * 6 + [0.0] * 6)
    assert there.cells(data, here) - here.cells(data) == pytest.approx([-1.0] * 18 + [1.0] * 6 + [0.0] * 6)


SLOPES = 2e-4
"""Tolerance: errors of central differences grow with the square of the step: 4e-5 per range, at twice it 1.7e-4."""


def test_slopes_are_those_of_the_other_engine(data):
    """Derivatives of every cell agree with differences of the compiled fits; every number moves some cells."""
    model, rest = load_model("R2"), np.zeros(len(study.REACH))
    found = study.by_derivatives(model, data, lambda _: None)
    np.testing.assert_allclose(found.value, study.by_fits(model, data, rest[None])[0], atol=1e-9, rtol=0.0)
    np.testing.assert_allclose(found.slope, study.differences(model, data, rest), atol=SLOPES, rtol=0.0)
    assert (np.abs(found.slope).max(axis=0) > 1000.0 * SLOPES).all()
    of_points = np.array([one.name.startswith("thorax points") for one in study.NUMBERS_MOVED])
    before = np.abs(found.slope[:18]).max(axis=0)
    assert (before[~of_points] > 1000.0 * SLOPES).all()
    assert not before[of_points].any()


def test_the_closest_numbers_are_the_least_squares_within_the_ranges(data, monkeypatch):
    """For cells that are linear in the numbers, SciPy's bounded least squares from the shipped set gives the same."""
    slope = np.random.default_rng(0).normal(size=(30, len(study.REACH)))
    value = study.printed_cells("R2") + 5.0 * slope.sum(axis=1) * np.cos(np.arange(30))
    monkeypatch.setattr(study, "by_fits", lambda _, __, steps: value + (steps / study.REACH) @ slope.T)
    monkeypatch.setattr(study, "differences", lambda *_: slope)
    steps = study.closest_steps(load_model("R2"), study.Cells(value, slope), data)
    off = (study.printed_cells("R2") - value)[study.GAPS]
    expected = lsq_linear(slope[study.GAPS], off, bounds=(-1.0, 1.0)).x
    assert 0 < (np.abs(expected) > 0.999).sum() < len(expected)
    np.testing.assert_allclose(steps, expected, atol=1e-6)
