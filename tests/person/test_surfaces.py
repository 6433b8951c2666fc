"""Ellipsoid, sphere and cylinder through points: exact points, noise, against SciPy, and points without a fit."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from models import load_model
from models.person.bony_contours import acromioclavicular_centre_mm
from models.person.round_surfaces import fit_cylinder, fit_sphere
from models.person.thorax_ellipsoid import fit_thorax
from tests.helpers.round_points import cylinder_points, sphere_points

CENTRE, AXES = np.array([0.0, -139.3, 68.0]), np.array([139.1, 198.2, 85.4])
"""Table 4.5, dissection."""


def patch(count: int = 40) -> np.ndarray:
    """Return points of front, side and back, from y = -20 to -200."""
    azimuth, y = np.meshgrid(np.radians(np.linspace(-60.0, 60.0, 5)), np.linspace(-20.0, -200.0, count // 5))
    width = np.sqrt(1.0 - ((y - CENTRE[1]) / AXES[1]) ** 2)
    x, z = AXES[0] * width * np.cos(azimuth), CENTRE[2] + AXES[2] * width * np.sin(azimuth)
    return np.stack([x.ravel(), y.ravel(), z.ravel()])


def test_a_patch_of_exact_points_gives_the_ellipsoid_back():
    found = fit_thorax(patch(), load_model("R2").girdle)
    np.testing.assert_allclose(found.centre_mm, CENTRE, atol=1e-6)
    np.testing.assert_allclose(found.semi_axes_mm, AXES, atol=1e-6)
    assert found.centre_mm[0] == 0.0
    assert not found.loose


def test_noisy_points_give_it_within_its_sd():
    rng, z = np.random.default_rng(0), []
    truth = np.array([*CENTRE[1:], *AXES])
    for _ in range(40):
        fit = fit_thorax(patch() + 2.0 * rng.standard_normal((3, 40)), load_model("breteler_dissection").girdle).fit
        z.append((fit.values - truth) / fit.sd)
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.4  # 200 values of SD 1, correlated within a fit
    assert np.abs(z).max() < 5.0


def test_a_small_patch_is_said_to_leave_the_long_axis_open():
    narrow = patch()[:, :20] + 3.0 * np.random.default_rng(1).standard_normal((3, 20))
    found = fit_thorax(narrow, load_model("breteler_dissection").girdle)
    assert "A_y" in found.loose
    assert abs(found.correlation) > 0.8


def test_too_few_points_on_the_thorax():
    with pytest.raises(ValueError, match="5 points"):
        fit_thorax(patch()[:, :5], load_model("R2").girdle)


def test_the_phantom_sphere_of_the_thesis():
    found = fit_sphere(sphere_points(0.5))
    assert found.radius_mm == pytest.approx(18.5, abs=0.1)
    assert found.volume_cm3 == pytest.approx(26.3, abs=0.5)  # 26.3 is for 18.45 mm (Table 4.8)
    assert fit_sphere(sphere_points(0.0)).volume_cm3 == pytest.approx(4 / 3 * np.pi * 1.85**3, abs=1e-9)


def test_a_cap_of_a_sphere_agrees_with_scipy():
    points = sphere_points(0.3, seed=1, cap=-0.2)
    found = fit_sphere(points)

    def off(v):
        return np.linalg.norm(points - v[:3, None], axis=0) - v[3]

    expected = least_squares(off, [160.0, -10.0, 60.0, 15.0], xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    np.testing.assert_allclose(np.append(found.centre_mm, found.radius_mm), expected, atol=1e-6)


def test_a_cylinder_comes_back():
    found = fit_cylinder(cylinder_points(0.0))
    axis = np.array([-0.09, 0.94, 0.32]) / np.linalg.norm([-0.09, 0.94, 0.32])
    assert found.radius_mm == pytest.approx(7.9, abs=1e-6)
    np.testing.assert_allclose(found.direction, axis, atol=1e-8)
    off = found.point_mm - np.array([162.0, -80.0, 55.4])
    np.testing.assert_allclose(off - axis * (off @ axis), 0.0, atol=1e-6)
    assert fit_cylinder(cylinder_points(0.5)).radius_mm == pytest.approx(7.9, abs=0.3)


def test_points_without_a_sphere_or_cylinder():
    flat = np.random.default_rng(3).standard_normal((3, 10)) * np.array([[1.0], [1.0], [0.0]])
    with pytest.raises(ValueError, match="plane"):
        fit_sphere(flat)
    with pytest.raises(ValueError, match="needs 4"):
        fit_sphere(flat[:, :3])
    with pytest.raises(ValueError, match="line"):
        fit_cylinder(np.outer([1.0, 2.0, 3.0], np.arange(6.0)))
    with pytest.raises(ValueError, match="needs 5"):
        fit_cylinder(flat[:, :4])


def test_the_ac_joint_is_the_middle_of_what_is_within_10_mm():
    clavicle = np.array([[0.0, 6.0, 50.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    scapula = np.array([[12.0, 80.0], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(acromioclavicular_centre_mm(clavicle, scapula), [9.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="10 mm"):
        acromioclavicular_centre_mm(clavicle[:, :1], scapula)
