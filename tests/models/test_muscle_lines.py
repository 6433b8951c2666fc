"""The published lines: their frames, their sources, and their place on the bones of every set."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models import load_model
from models.muscles.das3_frames import das3_clavicle_in_thorax, das3_scapula_in_thorax, scapula_in_thorax
from models.muscles.muscle_lines import SERRATUS, TABLE, muscle_lines
from motions.errors import InputError
from motions.landmarks.acromion import KOLZ

SETS = ("R2", "R4", "R6", "breteler_dissection", "breteler_mri")

DOCUMENT = tomllib.loads(TABLE.read_text(encoding="utf-8"))
CADAVER, DAS3 = DOCUMENT["cadaver"], DOCUMENT["das3"]

PRINTED_MM = 1e-6
"""Digits of TS and AI in the set's file."""


def test_das3s_scapula_frame_has_the_cadavers_ts_ai_and_gh_where_it_says():
    pose = das3_scapula_in_thorax(CADAVER, DAS3)
    TS, AI, GH = pose.inward(np.array([CADAVER["ts_mm"], CADAVER["ai_mm"], CADAVER["gh_mm"]]).T).T
    np.testing.assert_allclose(TS[1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(AI[2], 0.0, atol=1e-9)
    np.testing.assert_allclose(GH, DAS3["scapula_gh_mm"], atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(pose.R), 1.0)
    assert AI[1] < 0.0


def test_its_origin_is_aa_and_not_ac():
    """Two numbers that the frame was not made from: the length of DAS3's clavicle, and other scapulae's AA to AC."""
    pose = das3_scapula_in_thorax(CADAVER, DAS3)
    length = np.linalg.norm(pose.origin_mm - np.array(DAS3["sc_mm"]))
    assert abs(length - np.linalg.norm(DAS3["clavicle_aa_mm"])) < 0.2  # 209.5 and 209.6
    R_ac_aa = scapula_in_thorax(CADAVER).R.T @ pose.R
    apart = Rotation.from_matrix(R_ac_aa @ np.asarray(KOLZ.R_ac_aa).T).magnitude()
    assert np.degrees(apart) < KOLZ.uncertainty_deg


def test_das3s_clavicle_has_ac_near_its_axis_and_aa_where_it_says():
    pose = das3_clavicle_in_thorax(CADAVER, DAS3)
    AA = das3_scapula_in_thorax(CADAVER, DAS3).origin_mm
    np.testing.assert_allclose(pose.inward(AA[:, None])[:, 0], DAS3["clavicle_aa_mm"], atol=0.2)
    assert np.linalg.norm(pose.inward(np.array([CADAVER["ac_mm"]]).T)[1:]) < 6.0


def test_on_the_cadavers_own_bones_nothing_moves():
    model = load_model("breteler_dissection")
    lines = muscle_lines(model)
    rows = [row for part in DOCUMENT["muscle"].values() for row in part["lines"]]
    printed = np.array([row.get("ribs_mm", row.get("spine_mm")) for row in rows]).T
    np.testing.assert_allclose(lines.thorax_mm, printed, atol=1e-9)
    on_scapula = scapula_in_thorax(CADAVER).outward(lines.bone_mm[:, lines.on_scapula])
    given = np.array([row["scapula_mm"] for row in rows if "scapula_mm" in row]).T
    np.testing.assert_allclose(on_scapula, das3_scapula_in_thorax(CADAVER, DAS3).outward(given), atol=PRINTED_MM)


@pytest.mark.parametrize("name", SETS)
def test_the_serratus_and_the_rhomboids_end_along_the_medial_border(name):
    """Between the root of the spine and AI, within 25 mm of the line TS-AI; the superior angle is above TS."""
    model = load_model(name)
    lines = muscle_lines(model)
    TS, AI = np.asarray(model.girdle.ts_mm), np.asarray(model.girdle.ai_mm)
    border = (AI - TS) / np.linalg.norm(AI - TS)
    for muscle in (SERRATUS, "rhomboids"):
        off = lines.bone_mm[:, lines.of(muscle)] - TS[:, None]
        along = border @ off
        below = along > 0.0
        assert along.max() < 1.05 * np.linalg.norm(AI - TS)
        assert np.linalg.norm(off - border[:, None] * along, axis=0)[below].max() < 25.0


@pytest.mark.parametrize("name", SETS)
def test_attachments_keep_their_side(name):
    lines = muscle_lines(load_model(name))
    on_spine = ~np.isin(np.array(lines.muscle), (SERRATUS, "pectoralis_minor"))
    assert np.all(np.abs(lines.thorax_mm[0, on_spine]) < 40.0)
    assert np.all(lines.thorax_mm[0, ~on_spine] > 40.0)
    assert np.isfinite(lines.thorax_mm).all()
    assert lines.gh_mm[1] < -20.0  # the joint is below AC


def test_there_are_all_five_muscles_and_a_source_of_every_kind_of_number():
    lines = muscle_lines(load_model("R2"))
    assert len(lines.name) == len(set(lines.name)) == 36
    assert lines.muscles == (
        SERRATUS,
        "trapezius_scapular",
        "trapezius_clavicular",
        "levator_scapulae",
        "pectoralis_minor",
        "rhomboids",
    )
    assert set(np.array(lines.muscle)[lines.wraps]) == {SERRATUS}
    assert (lines.strongest_force_N > 0.0).all()
    given = {f"das3.{key}" for key in DAS3} | {"lines", "wraps", "cadaver.thorax"}
    assert set(DOCUMENT["source"]) == given
    serratus = lines.only(SERRATUS)
    assert serratus.name == tuple(f"serr_ant_{k}" for k in range(1, 13))


def test_a_set_without_landmarks_is_refused_by_name():
    with pytest.raises(InputError, match=r"das3.*landmarks in the frame AC-TS-AI"):
        muscle_lines(load_model("das3"))
