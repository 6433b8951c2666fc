"""Positions of landmarks: a girdle by hand, and effects that move landmarks or only their frames."""

import numpy as np
import pytest
from oracles import bones
from scipy.spatial.transform import Rotation

from models import load_model
from models.effects import EFFECTS, NO_ACTIVE_EFFECTS, ActiveEffects, ExtendedGirdle
from models.person.positions.landmark_positions import POSITIONS, bone_poses, positions_mm
from motions.rotations import cardan_from_rotation

BASE = load_model("R2").girdle
AA_MM = np.array([-12.0, -18.0, 40.0])[:, None]

SAME_MM = 1e-9
"""Tolerance between two computations of one geometry: rounding of coordinates of 200 mm."""

CLAVICLE, SCAPULA = (
    Rotation.from_euler("YZX", turns, degrees=True).as_matrix()
    for turns in ([[-28.0, 12.0, 8.0], [-40.0, 25.0, 30.0]], [[32.0, 10.0, -10.0], [45.0, 40.0, 5.0]])
)
"""Rotations of two postures, intrinsic Y-Z'-X''."""


def angles_of(clavicle: np.ndarray, scapula: np.ndarray) -> np.ndarray:
    return np.concatenate([cardan_from_rotation(np.moveaxis(R, 0, -1)) for R in (clavicle, scapula)])


ANGLES = angles_of(CLAVICLE, SCAPULA)


def places(*active: tuple[str, tuple[float, ...]], angles: np.ndarray = ANGLES) -> dict[str, np.ndarray]:
    strengths = tuple(np.repeat(np.array(a)[:, None], 2, axis=1) for _, a in active)
    effects = ActiveEffects(strengths, tuple(EFFECTS[name] for name, _ in active))
    girdle = ExtendedGirdle(BASE.repeated(2), effects) if active else BASE.repeated(2)
    return positions_mm(bone_poses(girdle, angles), {"AA": AA_MM})


def by_hand(clavicle: np.ndarray = CLAVICLE, scapula: np.ndarray = SCAPULA) -> dict[str, np.ndarray]:
    """Compute AC = SC + R_C ac, and the other landmarks from AC, posture by posture."""
    own = bones(BASE)
    AC = [own.sc_mm + R @ own.ac_mm for R in clavicle]
    found = {"SC": [own.sc_mm] * 2, "AC": AC}
    for name, place in {"TS": own.ts_mm, "AI": own.ai_mm, "AA": AA_MM[:, 0]}.items():
        found[name] = [at + R @ place for at, R in zip(AC, scapula, strict=True)]
    return {name: np.array(at).T for name, at in found.items()}


def check(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    assert set(found) == set(POSITIONS)
    for name, place in expected.items():
        np.testing.assert_allclose(found[name], place, atol=SAME_MM, err_msg=name)


def test_landmarks_of_a_plain_girdle():
    check(places(), by_hand())
    check(positions_mm(bone_poses(NO_ACTIVE_EFFECTS.on(BASE.repeated(2)), ANGLES), {"AA": AA_MM}), by_hand())


def test_places_of_the_person_are_added_in_their_own_frames():
    own = {"SC": (1.0, 2.0, 3.0), "AC": (4.0, 0.0, 0.0), "TS": (0.0, 5.0, 0.0), "AA": (0.0, 0.0, 6.0)}
    own = {name: np.array(one)[:, None] for name, one in own.items()}
    found, expected = positions_mm(bone_poses(BASE.repeated(2), ANGLES), own), by_hand()
    SC = own["SC"] + np.zeros(2)
    AC = SC + np.einsum("pij,j->ip", CLAVICLE, own["AC"][:, 0])
    TS = AC + np.einsum("pij,j->ip", SCAPULA, own["TS"][:, 0])
    AA = AC + np.einsum("pij,j->ip", SCAPULA, (own["AA"] - AA_MM)[:, 0])
    moved = {"SC": SC, "AC": AC, "TS": TS, "AI": AC, "AA": AA}
    check(found, {name: expected[name] + moved[name] for name in expected})


@pytest.mark.parametrize("name", ["clavicle_frame_bias", "scapula_landmark_bias"])
def test_a_frame_that_is_off_moves_no_bone(name):
    """Check the same bones with angles measured in a frame that is turned by hand."""
    turned = Rotation.from_rotvec([0.1, -0.2, 0.05]).as_matrix()
    bone = "clavicle" if name.startswith("clavicle") else "scapula"
    measured = {"clavicle": CLAVICLE, "scapula": SCAPULA}
    measured[bone] = measured[bone] @ (turned.T if bone == "clavicle" else turned)
    amplitude = tuple(np.rad2deg([0.1, -0.2, 0.05]))
    check(places((name, amplitude), angles=angles_of(**measured)), by_hand())


def test_a_thorax_that_turns_carries_what_is_measured_in_it():
    """Check that bones and positions turn about IJ together; a lag of the scapula's frame does not affect positions."""
    E = Rotation.from_rotvec([0.1, 0.02, -0.03]).as_matrix()
    lag = Rotation.from_rotvec([0.0, 0.08, 0.04]).as_matrix()
    extension = ("thorax_extension", tuple(np.rad2deg([0.1, 0.02, -0.03])))
    bias = ("scapula_landmark_bias", tuple(np.rad2deg([0.0, 0.08, 0.04])))
    found = places(extension, bias, angles=angles_of(E @ CLAVICLE, E @ SCAPULA @ lag))
    check(found, {name: E @ place for name, place in by_hand().items()})


def test_a_tilted_ellipsoid_moves_no_landmark():
    check(places(("thorax_tilt", (6.0, -3.0, 4.0))), by_hand())


def test_a_joint_that_moves_carries_what_hangs_on_it():
    found, still = places(("sc_translation", (3.0, 0.0, 0.0)), ("ac_translation", (0.0, 2.0, 0.0))), by_hand()
    along = np.array([3.0, 0.0, 0.0])[:, None]
    up = np.einsum("pij,j->ip", CLAVICLE, [0.0, 2.0, 0.0])
    check(found, {name: place + along + (up if name != "SC" else 0.0) for name, place in still.items()})
