"""Location of the gap: cases solved by hand, and independence of padding and unmeasured angles."""

import json
from dataclasses import asdict, astuple, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapt.diagnosis.location.gap_location import AngleGaps, cells, constraint_residuals_mm, profile
from adapt.diagnosis.location.observations import Observed
from motions.table import ANGLES

EXACT = 1e-9
"""Tolerance in degrees, millimetres and fractions: rounding of angles (1e-14 deg), with room for sums and roots."""

ARC_DEG = np.arange(0.0, 151.0, 30.0)
"""Six elevations."""


def observed(values: np.ndarray, elevation_deg: np.ndarray, motion: np.ndarray | None = None) -> Observed:
    """Lay out subjects with all angles measured, and with the same elevations (and motions) for every subject."""
    postures, subjects = values.shape[1:]
    number = np.zeros(postures, int) if motion is None else motion
    return Observed(
        angles=values,
        measured=np.ones(values.shape, bool),
        elevation_deg=np.tile(elevation_deg[:, None], subjects),
        motion=np.tile(number[:, None], subjects),
        subjects=tuple(f"subject{k}" for k in range(subjects)),
        motions=("abduction", "flexion"),
    )


def gap_of(
    difference_deg: np.ndarray,
    noise_deg2: float = 0.0,
    elevation_deg: np.ndarray | None = None,
    motion: np.ndarray | None = None,
) -> AngleGaps:
    """Make gaps from differences, simulated less measured, with simulated angles of 0."""
    elevation_deg = ARC_DEG if elevation_deg is None else elevation_deg
    data = observed(np.deg2rad(-difference_deg), elevation_deg, motion)
    return AngleGaps(data, np.zeros(difference_deg.shape), np.full(difference_deg.shape, noise_deg2))


def course(values_deg: np.ndarray, angle: int = 4) -> np.ndarray:
    """Return the differences of one subject: ``values_deg`` in one angle, 0 in the others."""
    difference = np.zeros((6, len(values_deg), 1))
    difference[angle] = values_deg[:, None]
    return difference


def test_one_cell_holds_the_whole_gap():
    """Check two of six postures, 3 and 5 deg in one bin of one angle; noise in other cells is no negative gap."""
    difference = course(np.array([0.0, 0.0, 3.0, 5.0, 0.0, 0.0]), angle=3)
    found = cells(gap_of(difference, noise_deg2=0.5, elevation_deg=np.array([0.0, 30.0, 60.0, 89.0, 90.0, 120.0])))
    first = found[0]
    assert (first.angle, first.bone, first.motion, first.postures) == ("scapula_y", "scapula", "abduction", 2)
    assert (first.elevation_low_deg, first.elevation_high_deg) == (60.0, 90.0)
    assert (first.mean_difference_deg, first.mean_absolute_deg) == pytest.approx((4.0, 4.0))
    assert first.noise_deg == pytest.approx(np.sqrt(1.0 / np.pi))
    assert [cell.share for cell in found] == [1.0] + [0.0] * 29


def test_cells_are_ranked_by_what_noise_does_not_explain():
    """Clavicle 4 deg and -2 deg in one bin: (16 + 4) - 2 = 18; scapula 3 deg once: 9 - 1 = 8, of 26."""
    difference = np.zeros((6, 3, 1))
    difference[0, :, 0], difference[5, :, 0] = (4.0, -2.0, 0.0), (0.0, 0.0, 3.0)
    gap = gap_of(difference, 1.0, np.array([10.0, 20.0, 100.0]), np.array([0, 0, 1]))
    first, second, *others = cells(gap)
    assert (first.angle, first.motion, first.elevation_low_deg) == ("clavicle_y", "abduction", 0.0)
    assert (second.angle, second.motion, second.elevation_low_deg) == ("scapula_x", "flexion", 90.0)
    assert (first.mean_difference_deg, first.mean_absolute_deg) == pytest.approx((1.0, 3.0))
    assert (first.share, second.share) == pytest.approx((18 / 26, 8 / 26))
    assert len(others) == 10


def test_profile_by_hand():
    """Differences of 6 and -2 deg in the clavicle's y in two postures of different motions."""
    difference = np.zeros((6, 2, 1))
    difference[0, :, 0] = (6.0, -2.0)
    gap = gap_of(difference, np.pi / 2.0, np.array([15.0, 45.0]), np.array([0, 1]))
    found = profile(gap)
    assert list(found.angle) == list(ANGLES)
    for levels, expected in (
        (found.angle, {"clavicle_y": 4.0, "clavicle_z": 0.0}),
        (found.bone, {"clavicle": 4.0 / 3.0, "scapula": 0.0}),
        (found.motion, {"abduction": 1.0, "flexion": 1.0 / 3.0}),
        (found.elevation, {"0-30": 1.0, "30-60": 1.0 / 3.0}),
        (found.subject, {"subject0": 2.0 / 3.0}),
    ):
        for name, value in expected.items():
            assert astuple(levels[name]) == pytest.approx((value, 1.0))


def test_what_noise_alone_would_leave():
    """1 and 9 deg^2: the cell has sqrt(2/pi) of their root mean square, the profile the mean of both expectations."""
    gap = gap_of(course(np.array([3.0, -4.0])), elevation_deg=np.array([0.0, 10.0]))
    gap.noise_deg2[:, 1] += 9.0
    gap.noise_deg2[:, 0] += 1.0
    assert cells(gap)[0].noise_deg == pytest.approx(np.sqrt(10.0 / np.pi))
    assert profile(gap).angle["scapula_z"].noise_deg == pytest.approx(2.0 * np.sqrt(2.0 / np.pi))


def random_gap(seed: int) -> AngleGaps:
    """Draw three subjects and eight postures: gaps of a few degrees, some postures and some angles unmeasured."""
    generator = np.random.default_rng(seed)
    values, simulated = (0.5 * generator.standard_normal((6, 8, 3)) for _ in range(2))
    measured = generator.random((6, 8, 3)) < generator.choice([0.5, 0.95])
    data = replace(
        observed(values, np.linspace(0.0, 150.0, 8), np.repeat([0, 1], [3, 5])),
        measured=measured & (generator.random((8, 3)) < 0.8),
    )
    nearer = values + generator.choice([1e-9, 0.01, 0.3]) * (simulated - values)
    return AngleGaps(data, nearer, generator.choice([0.0, 0.1, 4.0, 100.0]) * generator.random((6, 8, 3)))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_shares_of_cells_sum_to_one(seed):
    by_cell = [cell.share for cell in cells(random_gap(seed))]
    assert by_cell == sorted(by_cell, reverse=True)
    assert sum(by_cell) == pytest.approx(1.0, abs=EXACT) or not any(by_cell)


def everything(gap: AngleGaps, residuals_mm: np.ndarray) -> dict:
    return {
        "cells": [asdict(cell) for cell in cells(gap)],
        "profile": asdict(profile(gap)),
        "constraints": [asdict(row) for row in constraint_residuals_mm(gap.data, residuals_mm)],
    }


def test_padding_and_unmeasured_angles_have_no_influence():
    gap = random_gap(4)
    data, residuals = gap.data, np.random.default_rng(5).normal(size=(3, 8, 3))
    used = data.measured
    padding, closed = ~used.any(axis=0), used.all(axis=0)
    assert padding.any()
    assert not used[:, ~padding].all()
    changed = AngleGaps(
        replace(
            data,
            angles=np.where(used, data.angles, 77.0),
            elevation_deg=np.where(padding, np.nan, data.elevation_deg),
            motion=np.where(padding, 9, data.motion),
        ),
        np.where(used, gap.simulated, np.nan),
        np.where(used, gap.noise_deg2, np.nan),
    )
    before = everything(gap, residuals)
    assert before["constraints"]
    assert everything(changed, np.where(closed, residuals, np.nan)) == before


def test_every_used_value_has_influence():
    gap = random_gap(4)
    posture, subject = np.argwhere(gap.data.measured.all(axis=0))[0]
    simulated = gap.simulated.copy()
    simulated[:, posture, subject] += 0.1
    before, after = (everything(g, np.zeros((3, 8, 3))) for g in (gap, replace(gap, simulated=simulated)))
    assert [name for name in before if before[name] != after[name]] == ["cells", "profile"]


def test_nothing_measured_gives_nothing():
    gap = random_gap(4)
    nothing = replace(gap, data=replace(gap.data, measured=np.zeros((6, 8, 3), bool)))
    found = everything(nothing, np.zeros((3, 8, 3)))
    assert (found["cells"], found["constraints"]) == ([], [])
    assert not any(found["profile"].values())


def plain(value) -> bool:
    """Check that a value consists of JSON types only; NumPy's floats, which are also Python floats, are refused."""
    if type(value) in (dict, list):
        parts = [*value, *value.values()] if isinstance(value, dict) else value
        return all(map(plain, parts))
    return value is None or type(value) in (str, int, float)


def test_results_are_plain_json():
    found = everything(random_gap(4), np.random.default_rng(6).normal(size=(3, 8, 3)))
    assert not plain({"a": [np.float64(1.0)]})
    assert plain(found)
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_constraint_residuals_by_hand():
    """A1 grows by 3 mm per 90 deg in both motions, from 0 and from 10 mm; A2 is 4 mm; the last lacks an angle."""
    elevation, motion = np.array([0.0, 45.0, 90.0, 60.0, 150.0, 90.0]), np.array([0, 0, 0, 1, 1, 1])
    data = observed(np.zeros((6, 6, 1)), elevation, motion)
    data.measured[2, 5] = False
    residuals = np.zeros((3, 6, 1))
    residuals[0, :, 0] = (0.0, 1.5, 3.0, 10.0, 13.0, 999.0)
    residuals[1] = 4.0
    rows = constraint_residuals_mm(data, residuals)
    assert [(row.constraint, row.motion) for row in rows] == [
        (name, motion) for name in ("A1", "A2", "A3") for motion in (None, "abduction", "flexion")
    ]
    overall, abduction, flexion, second, *_ = rows
    assert (overall.postures, abduction.postures, flexion.postures) == (5, 3, 2)
    assert (overall.mean_mm, overall.min_mm, overall.max_mm) == pytest.approx((5.5, 0.0, 13.0))
    assert overall.sd_mm == pytest.approx(np.sqrt((5.5**2 + 4.0**2 + 2.5**2 + 4.5**2 + 7.5**2) / 4.0))
    assert (abduction.mean_mm, abduction.sd_mm, flexion.mean_mm) == pytest.approx((1.5, 1.5, 11.5))
    for row in (overall, abduction, flexion):
        assert row.slope_mm_per_90deg == pytest.approx(3.0)
    assert (second.mean_mm, second.sd_mm, second.slope_mm_per_90deg) == pytest.approx((4.0, 0.0, 0.0))


def test_one_posture_has_neither_spread_nor_slope():
    (row, *_) = constraint_residuals_mm(observed(np.zeros((6, 1, 1)), np.array([30.0])), np.full((3, 1, 1), 2.0))
    assert (row.postures, row.mean_mm, row.sd_mm, row.slope_mm_per_90deg) == (1, 2.0, None, None)
