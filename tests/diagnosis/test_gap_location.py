"""Where the gap lies: cases solved by hand, and what must not matter."""

import json
from dataclasses import asdict, astuple, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapt.diagnosis.location.gap_location import AngleGaps, cells, constraint_residuals_mm, profile
from adapt.diagnosis.location.gap_rotations import GapFractions, variance_fractions
from adapt.diagnosis.location.observations import Observed
from motions.rotations import DEG, cardan_from_rotation, compose, rotation_from_cardan, rotation_from_vector
from motions.table import ANGLES

EXACT = 1e-9
"""Degrees, millimetres and fractions: rounding of rotations (1e-14 deg) with room for sums and square roots."""

BY_CHANCE = 0.03
"""Shares of 560 noisy rotations: three times their spread between seeds (0.01)."""

ARC_DEG = np.arange(0.0, 151.0, 30.0)
"""Six elevations: a cubic leaves two degrees of freedom."""

QUARTERS = np.deg2rad([0.0, 90.0, 180.0, -90.0])


def observed(values: np.ndarray, elevation_deg: np.ndarray, motion: np.ndarray | None = None) -> Observed:
    """All angles measured; elevations (and motions) are those of every subject."""
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
    """Simulated angles 0; measured ones less by the difference, so that differences are simulated less measured."""
    elevation_deg = ARC_DEG if elevation_deg is None else elevation_deg
    data = observed(np.deg2rad(-difference_deg), elevation_deg, motion)
    return AngleGaps(data, np.zeros(difference_deg.shape), np.full(difference_deg.shape, noise_deg2))


def turned_gap(angles: np.ndarray, left_deg: np.ndarray, right_deg: np.ndarray, noise_deg2: float = 0.0) -> AngleGaps:
    """Measured = exp(left) simulated exp(right): angles (6, P, S) and two vectors (3, S) a bone, (2, 3, S)."""

    def bone(k: int) -> np.ndarray:
        at, shape = angles[3 * k : 3 * k + 3], angles[:3].shape
        left, right = (np.broadcast_to(x[k][:, None] / DEG, shape) for x in (left_deg, right_deg))
        R = compose(rotation_from_vector(left), rotation_from_cardan(at))
        return np.asarray(cardan_from_rotation(compose(R, rotation_from_vector(right))))

    elevation_deg = np.linspace(0.0, 150.0, angles.shape[1])
    data = observed(np.concatenate([bone(0), bone(1)]), elevation_deg)
    return AngleGaps(data, angles, np.full(angles.shape, noise_deg2))


def quarter_turns(subjects: int) -> np.ndarray:
    """Both bones at four quarter turns about their x axis (6, 4, S)."""
    angles = np.zeros((6, 4, subjects))
    angles[[2, 5]] = QUARTERS[:, None]
    return angles


def same_for(subjects: int, *vectors: tuple[float, float, float]) -> np.ndarray:
    """The clavicle's and the scapula's vector for every subject (2, 3, S)."""
    return np.repeat(np.array(vectors)[..., None], subjects, axis=2)


NOTHING = (0.0, 0.0, 0.0)


def four(parts: GapFractions | None) -> list[float]:
    """Noise, constant, systematic, left over."""
    assert parts is not None
    return [parts.noise, parts.constant, parts.systematic, parts.left_over]


def noisy(generator: np.random.Generator, constant_deg: float) -> AngleGaps:
    """40 subjects with 14 postures in two motions, 1.5 deg noise; the scapula's y angle is off by a constant."""
    difference = 1.5 * generator.standard_normal((6, 14, 40))
    difference[3] += constant_deg
    return gap_of(difference, 1.5**2, np.tile(np.linspace(0.0, 150.0, 7), 2), np.repeat([0, 1], 7))


def test_noise_alone_is_all_noise():
    """Uncorrected, constant and course would take (4 + 4) / 14 of it."""
    found = variance_fractions(noisy(np.random.default_rng(1), 0.0))
    for parts in (found.all, *found.bones.values()):
        np.testing.assert_allclose(four(parts), [1.0, 0.0, 0.0, 0.0], rtol=0.0, atol=BY_CHANCE)


def test_a_constant_is_found_under_noise():
    """5 deg under 1.5 deg noise: T / n = 25 + 3 * 2.25 on the scapula, 3 * 2.25 on the clavicle."""
    found = variance_fractions(noisy(np.random.default_rng(2), 5.0))
    np.testing.assert_allclose(four(found.bones["clavicle"]), [1.0, 0.0, 0.0, 0.0], rtol=0.0, atol=BY_CHANCE)
    np.testing.assert_allclose(
        four(found.bones["scapula"]), [6.75 / 31.75, 25 / 31.75, 0.0, 0.0], rtol=0.0, atol=BY_CHANCE
    )
    np.testing.assert_allclose(four(found.all), [13.5 / 38.5, 25 / 38.5, 0.0, 0.0], rtol=0.0, atol=BY_CHANCE)


def test_no_gap_at_all_is_noise():
    found = variance_fractions(gap_of(np.zeros((6, 6, 2))))
    assert four(found.all) == [1.0, 0.0, 0.0, 0.0]
    assert [parts.side for parts in found.bones.values()] == ["left", "left"]
    assert found.thorax_sides_apart_deg is None


def test_a_thorax_side_constant_turns_both_bones_alike():
    """(3, 4, 0) deg on the left; four quarter turns about x leave only its x on the right: 9 of 25."""
    found = variance_fractions(
        turned_gap(quarter_turns(2), same_for(2, (3.0, 4.0, 0.0), (3.0, 4.0, 0.0)), np.zeros((2, 3, 2)))
    )
    for parts in (found.all, *found.bones.values()):
        assert parts is not None
        assert (parts.side, parts.rms_deg) == ("left", pytest.approx(5.0, abs=EXACT))
        assert parts.left_explains == pytest.approx(1.0, abs=EXACT)
        assert parts.right_explains == pytest.approx(9 / 25, abs=EXACT)
        np.testing.assert_allclose(four(parts), [0.0, 1.0, 0.0, 0.0], rtol=0.0, atol=EXACT)
    for constant in found.constants.values():
        np.testing.assert_allclose(constant.mean_deg, [3.0, 4.0, 0.0], rtol=0.0, atol=EXACT)
        assert constant.thorax_side_deg == pytest.approx(5.0, abs=EXACT)
    assert found.thorax_sides_apart_deg == pytest.approx(0.0, abs=EXACT)


def test_thorax_sides_that_disagree_are_an_angle_apart():
    left = same_for(1, (0.0, 2.0, 0.0), (0.0, 0.0, 6.0))
    found = variance_fractions(turned_gap(quarter_turns(1), left, np.zeros((2, 3, 1))))
    assert found.thorax_sides_apart_deg == pytest.approx(90.0, abs=EXACT)
    assert [found.constants[bone].thorax_side_deg for bone in ("clavicle", "scapula")] == pytest.approx([2.0, 6.0])
    assert found.constants["scapula"].sd_deg is None


def test_a_bone_side_constant_of_the_scapula():
    """Two subjects, z 8 and 12 deg: mean 10, SD sqrt(8); on the left, only its y of 2 deg (mean) is constant."""
    right = same_for(2, NOTHING, (2.0, 0.0, 10.0))
    right[1, 2] += [-2.0, 2.0]
    found = variance_fractions(turned_gap(quarter_turns(2), np.zeros((2, 3, 2)), right))
    scapula, constant = found.bones["scapula"], found.constants["scapula"]
    assert (scapula.side, constant.side) == ("right", "right")
    np.testing.assert_allclose(constant.mean_deg, [2.0, 0.0, 10.0], rtol=0.0, atol=EXACT)
    assert constant.sd_deg == pytest.approx([0.0, 0.0, np.sqrt(8.0)], abs=EXACT)
    assert constant.thorax_side_deg == pytest.approx(2.0, abs=EXACT)
    assert scapula.right_explains == pytest.approx(1.0, abs=EXACT)
    assert scapula.left_explains == pytest.approx(8.0 / (4.0 + 64.0 + 4.0 + 144.0), abs=EXACT)
    np.testing.assert_allclose(four(scapula), [0.0, 1.0, 0.0, 0.0], rtol=0.0, atol=EXACT)
    assert found.bones["clavicle"].rms_deg == pytest.approx(0.0, abs=EXACT)
    np.testing.assert_allclose(four(found.all), [0.0, 1.0, 0.0, 0.0], rtol=0.0, atol=EXACT)
    assert found.thorax_sides_apart_deg is None


def test_the_rotation_is_compared_not_the_angles():
    """With the scapula at z = 80 deg, 5 deg about its own y axis are 26.7 deg of its y angle."""
    angles = np.zeros((6, 1, 1))
    angles[4] = np.deg2rad(80.0)
    gap = turned_gap(angles, np.zeros((2, 3, 1)), same_for(1, NOTHING, (0.0, 5.0, 0.0)))
    by_hand = np.rad2deg(np.arctan2(np.sin(np.deg2rad(5.0)), np.cos(np.deg2rad(5.0)) * np.cos(np.deg2rad(80.0))))
    assert profile(gap).angle["scapula_y"].mean_absolute_deg == pytest.approx(by_hand, abs=EXACT)
    assert variance_fractions(gap).bones["scapula"].rms_deg == pytest.approx(5.0, abs=EXACT)


def course(values_deg: np.ndarray, angle: int = 4) -> np.ndarray:
    """Differences of one angle over the postures of one subject."""
    difference = np.zeros((6, len(values_deg), 1))
    difference[angle] = values_deg[:, None]
    return difference


def test_a_gap_that_grows_with_elevation_is_systematic():
    """0, 2, ..., 10 deg: sum of squares 220, of which 6 * 5^2 = 150 is the mean."""
    found = variance_fractions(gap_of(course(ARC_DEG / 15.0)))
    np.testing.assert_allclose(four(found.bones["scapula"]), [0.0, 150 / 220, 70 / 220, 0.0], rtol=0.0, atol=EXACT)


def test_what_no_cubic_follows_is_left_over():
    """The orthogonal polynomial of degree four over seven postures."""
    quartic = np.array([3.0, -7.0, 1.0, 6.0, 1.0, -7.0, 3.0])
    found = variance_fractions(gap_of(course(quartic), elevation_deg=np.linspace(0.0, 150.0, 7)))
    np.testing.assert_allclose(four(found.bones["scapula"]), [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=EXACT)


@pytest.mark.parametrize(
    ("postures", "power", "systematic"),
    [(2, 1, 0.0), (3, 1, 0.0), (4, 1, 1.0), (4, 2, 0.0), (5, 2, 1.0), (6, 3, 1.0), (5, 3, None)],
)
def test_short_motions_have_courses_of_lower_degree(postures, power, systematic):
    """Two residual degrees of freedom stay: a line needs four postures, a parabola five. x^3 of five is part line:
    over -2..2 the line explains 34^2 / 10 of 130."""
    x = np.arange(postures) - (postures - 1) / 2
    values = x**power - (x**power).mean()
    found = variance_fractions(gap_of(course(values), elevation_deg=ARC_DEG[:postures]))
    expected = 34.0**2 / 10.0 / 130.0 if systematic is None else systematic
    np.testing.assert_allclose(four(found.bones["scapula"]), [0.0, 0.0, expected, 1.0 - expected], rtol=0.0, atol=EXACT)


def test_another_constant_in_each_motion_is_systematic_even_without_elevation():
    """+3 and -1 deg over three postures each: mean 1, so 1 of 5 is constant; equal elevations tell no slope."""
    motion = np.repeat([0, 1], 3)
    found = variance_fractions(
        gap_of(course(np.where(motion == 0, 3.0, -1.0)), elevation_deg=np.full(6, 60.0), motion=motion)
    )
    np.testing.assert_allclose(four(found.bones["scapula"]), [0.0, 0.2, 0.8, 0.0], rtol=0.0, atol=EXACT)


def test_equal_elevations_tell_no_course():
    """Six postures with the arm at 60 deg: the gap changes between them, but not with elevation."""
    found = variance_fractions(
        gap_of(course(np.array([2.0, -1.0, 1.0, -2.0, 3.0, -3.0])), elevation_deg=np.full(6, 60.0))
    )
    np.testing.assert_allclose(four(found.bones["scapula"]), [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=EXACT)


def test_a_motion_of_two_postures_is_skipped():
    """A line over four postures, T = 20, and two more without a gap; s2 = 0.1: noise 1.8, d = 2 - 4 / 6."""
    gap = gap_of(course(np.array([-3.0, -1.0, 1.0, 3.0, 0.0, 0.0])), 0.1, motion=np.repeat([0, 1], [4, 2]))
    parts = np.array([1.8, 0.0, 20.0 - 3.0 * (2.0 - 4.0 / 6.0) * 0.1, 0.0])
    np.testing.assert_allclose(
        four(variance_fractions(gap).bones["scapula"]), parts / parts.sum(), rtol=0.0, atol=EXACT
    )


def test_noise_is_at_most_the_whole_gap():
    """1 deg in six postures, T = 6; s2 = 0.5 lets expect 9, and 1.5 of the constant's 6."""
    found = variance_fractions(gap_of(course(np.ones(6)), noise_deg2=0.5))
    np.testing.assert_allclose(
        four(found.bones["scapula"]), np.array([6.0, 4.5, 0.0, 0.0]) / 10.5, rtol=0.0, atol=EXACT
    )


def test_chance_is_taken_off_by_degrees_of_freedom():
    """Linear gap as above with s2 = 0.5: noise 3 * 6 * 0.5 = 9, constant 150 - 1.5, cubic 70 - 3 * 3 * 0.5 of 220."""
    found = variance_fractions(gap_of(course(ARC_DEG / 15.0), noise_deg2=0.5))
    parts = np.array([9.0, 148.5, 65.5, 0.0])
    np.testing.assert_allclose(four(found.bones["scapula"]), parts / parts.sum(), rtol=0.0, atol=EXACT)


def test_one_cell_holds_the_whole_gap():
    """Two of six postures, 3 and 5 deg, lie in 60-120 deg of one angle; noise of the others is not negative gap."""
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
    """Differences 6 and -2 deg of the clavicle's y in two postures, each in a motion of its own."""
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
    """1 and 9 deg^2 in one cell: the cell says sqrt(2/pi) of their rms, the profile the mean of both expectations."""
    gap = gap_of(course(np.array([3.0, -4.0])), elevation_deg=np.array([0.0, 10.0]))
    gap.noise_deg2[:, 1] += 9.0
    gap.noise_deg2[:, 0] += 1.0
    assert cells(gap)[0].noise_deg == pytest.approx(np.sqrt(10.0 / np.pi))
    assert profile(gap).angle["scapula_z"].noise_deg == pytest.approx(2.0 * np.sqrt(2.0 / np.pi))


def random_gap(seed: int) -> AngleGaps:
    """Three subjects, eight postures: gaps of a few degrees, some postures and some angles not measured."""
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
def test_fractions_sum_to_one(seed):
    gap = random_gap(seed)
    found = variance_fractions(gap)
    measured = [gap.data.measured[3 * k : 3 * k + 3].all(axis=0).any() for k in range(2)]
    assert [bone in found.bones for bone in ("clavicle", "scapula")] == measured
    for parts in (found.all, *found.bones.values()) if any(measured) else ():
        assert parts is not None
        assert all(0.0 <= share <= 1.0 for share in (*four(parts), parts.left_explains, parts.right_explains))
        assert sum(four(parts)) == pytest.approx(1.0, abs=EXACT)
    by_cell = [cell.share for cell in cells(gap)]
    assert by_cell == sorted(by_cell, reverse=True)
    assert sum(by_cell) == pytest.approx(1.0, abs=EXACT) or not any(by_cell)


def everything(gap: AngleGaps, residuals_mm: np.ndarray) -> dict:
    return {
        "cells": [asdict(cell) for cell in cells(gap)],
        "profile": asdict(profile(gap)),
        "variance_fractions": asdict(variance_fractions(gap)),
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
    assert before["variance_fractions"]["all"] is not None
    assert before["constraints"]
    assert everything(changed, np.where(closed, residuals, np.nan)) == before


def test_every_used_value_has_influence():
    gap = random_gap(4)
    posture, subject = np.argwhere(gap.data.measured.all(axis=0))[0]
    simulated = gap.simulated.copy()
    simulated[:, posture, subject] += 0.1
    before, after = (everything(g, np.zeros((3, 8, 3))) for g in (gap, replace(gap, simulated=simulated)))
    assert [name for name in before if before[name] != after[name]] == ["cells", "profile", "variance_fractions"]


def test_nothing_measured_gives_nothing():
    gap = random_gap(4)
    nothing = replace(gap, data=replace(gap.data, measured=np.zeros((6, 8, 3), bool)))
    found = everything(nothing, np.zeros((3, 8, 3)))
    assert (found["cells"], found["constraints"]) == ([], [])
    assert not any(found["profile"].values())
    assert found["variance_fractions"] == {"all": None, "bones": {}, "constants": {}, "thorax_sides_apart_deg": None}


def plain(value) -> bool:
    """Made of JSON types only; NumPy's floats, which are Python's too, are not."""
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
    """A1 grows by 3 mm in 90 deg in both motions, from 0 and from 10 mm; A2 is 4 mm; the last lacks an angle."""
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
