"""Frames and angles of the bones from landmarks: by hand, against SciPy, there and back, both sides."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laboratory import THORAX_MM
from scipy.spatial.transform import Rotation

from motions import read_motions
from motions.errors import InputError
from motions.formats.isb import isb_from_thesis, thesis_from_isb
from motions.landmarks.acromion import KOLZ, ac_from_aa_deg, nearest_rotation
from motions.landmarks.frames import (
    clavicle_frame,
    humerus_angles,
    humerus_frame,
    scapula_frame,
    thorax_frame,
)
from motions.landmarks.girdle_angles import estimated_axial_deg, frame_angles
from motions.motion_csv.cells import Side

EXACT = 1e-9
"""Tolerance in mm and degrees of every round trip; the rounding of coordinates of 1000 mm is 1e-13."""

ROUNDED_DEG = 0.002
"""Tolerance: the measured motions are rounded to a thousandth of a degree, in both frames."""

SHAPE_MM = {
    "SC": np.array([20.0, -8.0, 12.0]),
    "clavicle": np.array([158.0, 0.0, 0.0]),
    "TS": np.array([-119.0, 0.0, 0.0]),
    "AI": np.array([-148.0, -109.0, 0.0]),
    "GH": np.array([-10.0, -45.0, -15.0]),
    "elbow": np.array([0.0, -280.0, 0.0]),
    "epicondyle": np.array([35.0, 0.0, 0.0]),
}
"""SC in the thorax, AC in the clavicle, TS, AI and GH in the scapula, elbow and half its width in the humerus frame."""

ANGLES = st.tuples(
    st.floats(-80, 20), st.floats(-30, 60), st.floats(-20, 80), st.floats(-40, 80), st.floats(-60, 60)
).map(np.array)
"""Angles in degrees: clavicle y, z; scapula y, z, x."""
ARM = st.tuples(st.floats(-60, 120), st.floats(5, 170), st.floats(-90, 90)).map(np.array)
TURN = st.tuples(st.floats(-180, 180), st.floats(-89, 89), st.floats(-180, 180)).map(np.array)


def girdle_mm(angles_deg, arm_deg=(0.0, 30.0, 0.0)) -> dict[str, np.ndarray]:
    """Place the landmarks of a right girdle in the thorax frame by SciPy's rotations, from the five angles."""
    clavicle = Rotation.from_euler("YZ", angles_deg[:2], degrees=True)
    scapula = Rotation.from_euler("YZX", angles_deg[2:], degrees=True)
    humerus = Rotation.from_euler("YZY", arm_deg, degrees=True)
    AC = SHAPE_MM["SC"] + clavicle.apply(SHAPE_MM["clavicle"])
    GH = AC + scapula.apply(SHAPE_MM["GH"])
    points = THORAX_MM | {
        "SC": SHAPE_MM["SC"],
        "AC": AC,
        "TS": AC + scapula.apply(SHAPE_MM["TS"]),
        "AI": AC + scapula.apply(SHAPE_MM["AI"]),
        "GH": GH,
        "EM": GH + humerus.apply(SHAPE_MM["elbow"] - SHAPE_MM["epicondyle"]),
        "EL": GH + humerus.apply(SHAPE_MM["elbow"] + SHAPE_MM["epicondyle"]),
    }
    return {name: point[:, None] for name, point in points.items()}


def moved(points: dict[str, np.ndarray], turn_deg, shift=(500.0, -200.0, 900.0)) -> dict[str, np.ndarray]:
    """Move the landmarks to another laboratory frame."""
    rotation = Rotation.from_euler("XYZ", turn_deg, degrees=True).as_matrix()
    return {name: rotation @ xyz + np.array(shift)[:, None] for name, xyz in points.items()}


def mirrored(points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Mirror the landmarks to the other shoulder of the same person, in the thorax frame."""
    return {name: xyz * np.array([-1.0, 1.0, 1.0])[:, None] for name, xyz in points.items()}


def test_the_thorax_frame_by_hand():
    """IJ at the origin, C7 behind and above, PX and T8 below: the axes are right, up and backward."""
    points = {"IJ": (0, 0, 0), "C7": (0, 60, 100), "PX": (0, -200, 10), "T8": (0, -140, 90)}
    R = thorax_frame(*(np.array(points[name], float) for name in ("IJ", "PX", "C7", "T8")))
    np.testing.assert_allclose(R, np.eye(3), rtol=0.0, atol=1e-15)


def test_a_thorax_lying_on_its_back_in_a_z_up_laboratory():
    """Head along +x, face up (+z): cranial is +x, backward -z, and right = cranial x backward is +y."""
    points = {"IJ": (0, 0, 0), "C7": (60, 0, -100), "PX": (-200, 0, -10), "T8": (-140, 0, -90)}
    R = thorax_frame(*(np.array(points[name], float) for name in ("IJ", "PX", "C7", "T8")))
    np.testing.assert_allclose(R.T, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], rtol=0.0, atol=1e-15)


def test_clavicle_scapula_and_humerus_by_hand():
    """A clavicle midway between backward and lateral is retracted by 45 degrees; a frontal scapula is not rotated."""
    y = np.array([0.0, 1.0, 0.0])
    R = clavicle_frame(np.zeros(3), np.array([100.0, 0.0, 100.0]), y)
    np.testing.assert_allclose(R, Rotation.from_euler("Y", -45, degrees=True).as_matrix(), rtol=0.0, atol=1e-15)
    R = scapula_frame(np.array([100.0, 0.0, 0.0]), np.zeros(3), np.array([-20.0, -100.0, 0.0]))
    np.testing.assert_allclose(R, np.eye(3), rtol=0.0, atol=1e-15)
    hanging = humerus_frame(np.zeros(3), np.array([-30.0, -280.0, 0.0]), np.array([30.0, -280.0, 0.0]))
    np.testing.assert_allclose(hanging, np.eye(3), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize(("plane_deg", "elbow"), [(0.0, (280.0, 0.0, 0.0)), (90.0, (0.0, 0.0, -280.0))])
def test_an_arm_raised_to_the_side_and_to_the_front(plane_deg, elbow):
    """Abduction by 90 degrees points the arm to the right, plane 0; forward flexion to the front, plane 90."""
    half = np.array([0.0, 30.0, 0.0])
    R = humerus_frame(np.zeros(3), np.array(elbow) - half, np.array(elbow) + half)
    found = np.degrees(humerus_angles(R))
    np.testing.assert_allclose(found[:2], [plane_deg, 90.0], rtol=0.0, atol=1e-12)


@given(ARM)
def test_humerus_angles_against_scipy(arm_deg):
    R = Rotation.from_euler("YZY", arm_deg, degrees=True).as_matrix()
    np.testing.assert_allclose(np.degrees(humerus_angles(R)), arm_deg, rtol=0.0, atol=EXACT)


@settings(max_examples=50, deadline=None)
@given(ANGLES, ARM, TURN)
def test_positions_to_angles_to_positions(angles_deg, arm_deg, turn_deg):
    """In any laboratory frame the computed angles are SciPy's, and give the same positions again."""
    points = girdle_mm(angles_deg, arm_deg)
    found = frame_angles(moved(points, turn_deg), "right", "file")
    known = found.angles_deg[0, [0, 1, 3, 4, 5]]
    np.testing.assert_allclose(known, angles_deg, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(found.humerus_deg[0], arm_deg, rtol=0.0, atol=EXACT)
    again = girdle_mm(known, found.humerus_deg[0])
    for name, position in found.landmarks_mm.items():
        np.testing.assert_allclose(position[0], points[name][:, 0], rtol=0.0, atol=EXACT)
        np.testing.assert_allclose(again[name][:, 0], points[name][:, 0], rtol=0.0, atol=EXACT)


@settings(max_examples=25, deadline=None)
@given(ANGLES, ARM, TURN)
def test_a_left_shoulder_is_the_mirror_image_of_a_right_one(angles_deg, arm_deg, turn_deg):
    points = girdle_mm(angles_deg, arm_deg)
    right = frame_angles(moved(points, turn_deg), "right", "file")
    left = frame_angles(moved(mirrored(points), turn_deg), "left", "file")
    np.testing.assert_allclose(left.angles_deg, right.angles_deg, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(left.humerus_deg, right.humerus_deg, rtol=0.0, atol=EXACT)


@settings(max_examples=25, deadline=None)
@given(ANGLES, st.floats(0.001, 1000.0))
def test_the_unit_of_the_positions_does_not_matter(angles_deg, factor):
    points = girdle_mm(angles_deg)
    scaled = {name: factor * xyz for name, xyz in points.items()}
    np.testing.assert_allclose(
        frame_angles(scaled, "right", "file").angles_deg,
        frame_angles(points, "right", "file").angles_deg,
        rtol=0.0,
        atol=EXACT,
    )


def test_the_other_shoulder_or_left_handed_axes_are_found_out():
    points = girdle_mm(np.array([-30.0, 10.0, 30.0, 10.0, -10.0]))
    cases: list[tuple[dict[str, np.ndarray], Side]] = [(mirrored(points), "right"), (points, "left")]
    for wrong, side in cases:
        with pytest.raises(InputError, match="acromion lies on the") as caught:
            frame_angles(wrong, side, "file")
        assert "--side" in caught.value.remedy
        assert "left-handed" in caught.value.remedy


def test_a_gap_takes_away_only_what_depends_on_it():
    points = {name: np.repeat(xyz, 3, axis=1) for name, xyz in girdle_mm(np.array([-30.0, 10, 30, 10, -10])).items()}
    points["SC"][:, 1] = np.nan
    points["T8"][:, 2] = np.nan
    angles = frame_angles(points, "right", "file").angles_deg
    assert np.isfinite(angles[0, [0, 1, 3, 4, 5]]).all()
    assert np.isnan(angles[1, :3]).all()
    assert np.isfinite(angles[1, 3:]).all()
    assert np.isnan(angles[2]).all()


@given(st.lists(st.floats(-180, 180), min_size=6, max_size=6).map(np.array))
def test_isb_angles_are_the_same_rotation_in_isbs_axes(angles_deg):
    """R_isb = Ry(alpha) Rx(beta) Rz(gamma) is the thesis's R with rows and columns renamed: (x, y, z) = (-z, y, x)."""
    isb = isb_from_thesis(angles_deg)
    np.testing.assert_array_equal(thesis_from_isb(isb), angles_deg)
    Q = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]], float)
    for bone in (slice(3), slice(3, 6)):
        ours = Rotation.from_euler("YZX", angles_deg[bone], degrees=True).as_matrix()
        theirs = Rotation.from_euler("YXZ", isb[bone], degrees=True).as_matrix()
        np.testing.assert_allclose(theirs, Q @ ours @ Q.T, rtol=0.0, atol=1e-14)


def aa_from_ac_deg(scapula_ac_deg: np.ndarray) -> np.ndarray:
    """Compute R_thorax_AA = R_thorax_AC R_AC_AA, by SciPy."""
    R_thorax_ac = Rotation.from_euler("YZX", scapula_ac_deg, degrees=True)
    return (R_thorax_ac * Rotation.from_matrix(KOLZ.R_ac_aa)).as_euler("YZX", degrees=True)


@pytest.mark.parametrize("seed", range(6))
def test_the_nearest_rotation_is_scipys_and_no_reflection(seed):
    matrix = np.random.default_rng(seed).standard_normal((3, 3)) * [[(-1.0) ** seed], [1.0], [1.0]]
    expected = Rotation.align_vectors(matrix.T, np.eye(3))[0].as_matrix()
    np.testing.assert_allclose(nearest_rotation(matrix), expected, rtol=0.0, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(-60, 80), st.floats(-60, 60), st.floats(-60, 60)), min_size=1, max_size=3))
def test_aa_to_ac_and_back(scapula):
    through_ac = np.array(scapula)
    back = ac_from_aa_deg(aa_from_ac_deg(through_ac), KOLZ)
    np.testing.assert_allclose(back, through_ac, rtol=0.0, atol=EXACT)


def test_aa_reads_as_less_protracted_and_less_laterally_rotated():
    """Ludewig 2010: 11.6 degrees less internal rotation, and at full elevation 12.4 less upward rotation and 6.1 more
    posterior tilt. One constant rotation from other scapulae gives these signs, within both uncertainties."""
    raised = np.array([[40.0, 54.4, 0.0]])
    difference = (aa_from_ac_deg(raised) - raised)[0]
    assert (np.sign(difference) == [-1, -1, 1]).all()
    at_rest = np.array([[35.0, 10.0, -10.0]])
    assert (aa_from_ac_deg(at_rest) - at_rest)[0, 0] == pytest.approx(-11.6, abs=2 * KOLZ.uncertainty_deg)


def test_aa_to_ac_of_the_measured_shoulders(measured_files):
    """The same six shoulders in both frames, converted by others: direction and size of the rotation agree."""
    checked = 0
    for path in measured_files:
        other = path.parent.with_name("motions_aa") / path.name
        if not other.exists():
            continue
        ac, aa = read_motions(path), read_motions(other)
        rows = {key: k for k, key in enumerate(zip(ac.motion.tolist(), ac.posture.tolist(), strict=True))}
        keys = list(zip(aa.motion.tolist(), aa.posture.tolist(), strict=True))
        pairs = [(rows[key], k) for k, key in enumerate(keys) if key in rows]
        mine, others = np.array(pairs).T
        found = ac_from_aa_deg(aa.angles_deg[others, 3:], KOLZ)
        np.testing.assert_allclose(found, ac.angles_deg[mine, 3:], rtol=0.0, atol=ROUNDED_DEG)
        checked += len(pairs)
    assert checked > 200


def test_the_estimate_of_a_girdle_at_rest_is_zero_and_of_a_joint_turn_its_half():
    """The scapula rotates by 40 degrees about a clavicle that does not move: each joint takes 20."""
    rest = np.array([-30.0, 10.0, np.nan, 30.0, 10.0, -10.0])
    axis = Rotation.from_euler("YZ", rest[:2], degrees=True).apply([1.0, 0.0, 0.0])
    scapula = Rotation.from_rotvec(np.radians(40.0) * axis) * Rotation.from_euler("YZX", rest[3:], degrees=True)
    turned = np.concatenate([rest[:3], scapula.as_euler("YZX", degrees=True)])
    np.testing.assert_allclose(estimated_axial_deg(np.stack([rest, turned]), rest), [0.0, 20.0], rtol=0.0, atol=EXACT)
