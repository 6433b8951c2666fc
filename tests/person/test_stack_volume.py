"""Volumes of stacks of contours: the sphere of Table 4.8, a tilted polygon, and a missing slice."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.person.contours.stack_volume import area_mm2, stack_volume_cm3

RADIUS_MM, PRINTED_CM3 = 18.45, 26.3
"""Sphere of Table 4.8, with the volume from the radius; from contours the thesis has 27.5, 5 % more."""


def test_the_sphere_of_table_4_8_from_slices_5_mm_apart():
    z = np.arange(-20.0, 20.1, 5.0)
    ring = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    circles = {}
    for k, height in enumerate(z):
        if abs(height) < RADIUS_MM:
            r = np.sqrt(RADIUS_MM**2 - height**2)
            circles[k] = np.stack([r * np.cos(ring), r * np.sin(ring), np.full(200, height)])
    volume = stack_volume_cm3({k: area_mm2(circle) for k, circle in circles.items()}, 5.0)
    assert volume == pytest.approx(PRINTED_CM3, rel=0.015)  # midpoint rule over seven slices


def test_a_polygon_has_its_area_however_it_is_turned():
    house = np.array([[0.0, 10.0, 10.0, 5.0, 0.0], [0.0, 0.0, 10.0, 15.0, 10.0], [0.0] * 5])  # 100 and a roof of 25
    turned = Rotation.from_euler("XYZ", [30.0, 50.0, -70.0], degrees=True).as_matrix() @ house + 400.0
    assert area_mm2(turned) == pytest.approx(125.0)


def test_a_slice_without_a_contour_has_what_lies_between():
    """Areas 100, -, 300 mm2, 2 mm apart: 200 in the middle, (100 + 200 + 300) 2 = 1200 mm3."""
    assert stack_volume_cm3({3: 100.0, 5: 300.0}, -2.0) == pytest.approx(1.2)
