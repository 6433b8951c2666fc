"""The published rhythm, and the clavicle's axial rotation against a search."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from motions.rhythm import COEFFICIENTS, REST_DEG, clavicle_axial_rotation, girdle_angles_deg
from motions.rotations import rotation_from_cardan
from motions.table import ANGLES

STEP_DEG = 0.01
"""Grid step of the search; the minimum lies between the neighbours of the lowest grid point."""


@pytest.mark.parametrize(("plane", "elevation"), [(0.0, 0.0), (0.0, 90.0), (90.0, 60.0), (45.0, 120.0)])
def test_the_published_equations(plane, elevation):
    c_y, c_z, _, s_y, s_z, s_x = REST_DEG
    expected = {
        "clavicle_y": -4.983 + 0.120 * plane - 0.242 * elevation + 0.851 * c_y,
        "clavicle_z": 3.917 - 0.046 * plane + 0.123 * elevation + 0.493 * c_z,
        "scapula_y": -1.203 + 0.140 * plane - 0.049 * elevation + 0.901 * s_y,
        "scapula_z": 3.095 - 0.079 * plane + 0.396 * elevation + 0.414 * s_z,
        "scapula_x": 0.659 - 0.028 * plane + 0.184 * elevation + 0.886 * s_x,
    }
    found = girdle_angles_deg(REST_DEG, np.array(plane), np.array(elevation), COEFFICIENTS)
    for angle, value in expected.items():
        assert found[ANGLES.index(angle)] == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize("elevation", [0.0, 60.0, 150.0])
@pytest.mark.parametrize("plane", [0.0, 90.0])
def test_the_axial_rotation_turns_the_joints_least(plane, elevation):
    angles = girdle_angles_deg(REST_DEG, np.array(plane), np.array(elevation), COEFFICIENTS)
    grid = np.arange(-180.0, 180.0, STEP_DEG)
    tried = np.repeat(angles[:, None], len(grid), axis=1)
    tried[ANGLES.index("clavicle_x")] = grid
    clavicle = Rotation.from_euler("YZX", tried[:3].T, degrees=True)
    scapula = Rotation.from_euler("YZX", angles[3:], degrees=True)
    rest = [Rotation.from_euler("YZX", part, degrees=True) for part in (REST_DEG[:3], REST_DEG[3:])]
    ac_turn = (clavicle.inv() * scapula * (rest[0].inv() * rest[1]).inv()).magnitude()
    sc_turn = (rest[0].inv() * clavicle).magnitude()
    cosines = np.cos(ac_turn) + np.cos(sc_turn)
    assert angles[ANGLES.index("clavicle_x")] == pytest.approx(grid[np.argmax(cosines)], abs=STEP_DEG)


def test_joints_that_turned_about_the_clavicle_alone_share_the_turn():
    """The clavicle is at rest except for its axis, the scapula rotates by 40 degrees about it: 20 for each joint."""
    clavicle, scapula = (jnp.asarray(part / 180 * np.pi) for part in (REST_DEG[:3], REST_DEG[3:]))
    R_clavicle, R_scapula = rotation_from_cardan(clavicle), rotation_from_cardan(scapula)
    axis = Rotation.from_rotvec(np.radians(40.0) * np.asarray(R_clavicle)[:, 0])
    turned = (axis * Rotation.from_matrix(np.asarray(R_scapula))).as_euler("YZX")
    found = clavicle_axial_rotation(clavicle[:2], jnp.asarray(turned), R_clavicle, R_scapula)
    assert np.degrees(float(found)) == pytest.approx(REST_DEG[2] + 20.0, abs=1e-10)
