"""The figures of frames and signs: each angle moves the bones as its words say, by rotations of another library."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models import load_model
from motions.rhythm import REST_DEG
from motions.table import ANGLES, BONES
from scripts.draw_frames import ABOVE, BEHIND, MODEL, RIGHT, SIGNS, TURN_DEG, View, pose
from scripts.rooms import ROOT

FORWARD, BACKWARD = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
OUTWARD, UP = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)

MOVES = {
    "clavicle_y": ("AC", FORWARD),
    "clavicle_z": ("AC", UP),
    "clavicle_x": ("y of the clavicle", BACKWARD),
    "scapula_y": ("TS", BACKWARD),
    "scapula_z": ("AI", OUTWARD),
    "scapula_x": ("AI", FORWARD),
}
"""Point or axis that the words of ``SIGNS`` name, and the direction in which it moves; thorax frame."""

TOLERANCE_MM = 1e-9
"""Tolerance: rounding of positions of a few hundred mm."""


@pytest.mark.parametrize("angle", ANGLES)
def test_an_angle_that_grows_does_what_the_picture_says(angle):
    girdle = load_model(MODEL).girdle
    turned = REST_DEG + TURN_DEG * np.equal(ANGLES, angle)
    places = []
    for angles_deg in (REST_DEG, turned):
        clavicle, scapula = (Rotation.from_euler("YZX", angles_deg[part], degrees=True) for part in BONES.values())
        ac = girdle.sc_mm + clavicle.apply(girdle.ac_mm)
        by_scipy = {"AC": ac, "TS": ac + scapula.apply(girdle.ts_mm), "AI": ac + scapula.apply(girdle.ai_mm)}
        drawn = pose(girdle, angles_deg)
        for name, place in by_scipy.items():
            np.testing.assert_allclose(drawn.points[name], place, rtol=0.0, atol=TOLERANCE_MM)
        places.append(by_scipy | {"y of the clavicle": 50.0 * clavicle.apply(UP)})
    what, where = MOVES[angle]
    assert np.dot(places[1][what] - places[0][what], where) > 5.0


@pytest.mark.parametrize("angle", ANGLES)
def test_the_drawing_shows_every_angle_from_both_sides(angle):
    text = (ROOT / "docs" / "signs.svg").read_text(encoding="utf-8")
    words, views = SIGNS[angle]
    assert words in text
    for view in views:
        assert f'id="{angle} {view.name}"' in text


@pytest.mark.parametrize("view", [ABOVE, BEHIND, RIGHT], ids=lambda view: view.name)
def test_a_view_is_no_mirror_image(view: View):
    towards_the_reader = np.cross(view.across, view.up)
    at = {"from behind": BACKWARD, "from the right": OUTWARD, "from above": UP}[view.name]
    np.testing.assert_array_equal(towards_the_reader, at)
