"""The published lines: their frames, their sources, and their place on the bones of every set."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from thesis_tables import DISSECTION

from models import load_model
from models.muscles.das3_frames import clavicle_in_thorax, scapula_in_thorax
from models.muscles.muscle_lines import SERRATUS, TABLE, muscle_lines, muscle_lines_of
from models.person.family import PersonalSets
from motions.errors import InputError
from motions.landmarks.acromion import KOLZ

SETS = ("R2", "R4", "R6", "breteler_dissection", "breteler_mri")

DOCUMENT = tomllib.loads(TABLE.read_text(encoding="utf-8"))
CADAVER, DAS3 = DOCUMENT["cadaver"], DOCUMENT["das3"]

LANDMARK_MM = 3.0
"""Two lists of landmarks of one cadaver differ by up to 1.5 mm (AI)."""

PRINTED_MM = 1e-6
"""Digits of TS and AI in the set's file."""


def test_gh_lies_in_das3s_scapula_frame_where_the_cadaver_has_it():
    """No frame is made from GH: its coordinates in DAS3, brought to the thorax, are those of Table 4.2."""
    GH = scapula_in_thorax(DAS3, "aa").outward(np.array([[2.0, -23.0, -43.9]]).T)[:, 0]
    assert np.linalg.norm(GH - CADAVER["gh_mm"]) < LANDMARK_MM


def test_das3s_clavicle_ends_in_aa():
    end = clavicle_in_thorax(DAS3, "joint_sc").outward(np.array([[207.7, -0.1, 28.2]]).T)[:, 0]
    assert np.linalg.norm(end - DAS3["aa_mm"]) < 0.1


def test_the_frame_through_aa_is_turned_as_in_other_scapulae():
    R_ac_aa = scapula_in_thorax(CADAVER).R.T @ scapula_in_thorax(DAS3, "aa").R
    apart = Rotation.from_matrix(R_ac_aa @ np.asarray(KOLZ.R_ac_aa).T).magnitude()
    assert np.degrees(apart) < KOLZ.uncertainty_deg


def test_the_clavicular_trapezius_ends_at_the_lateral_clavicle():
    """On the last third of the clavicle, within 20 mm of its axis."""
    lines = muscle_lines(load_model("breteler_dissection"))
    ends = lines.bone_mm[:, lines.of("trapezius_clavicular")]
    assert np.all(ends[0] > 160.0 * 2.0 / 3.0)
    assert np.linalg.norm(ends[1:], axis=0).max() < 20.0


def test_on_the_cadavers_own_bones_nothing_moves():
    model = load_model("breteler_dissection")
    lines = muscle_lines(model)
    rows = [row for part in DOCUMENT["muscle"].values() for row in part["lines"]]
    printed = np.array([row.get("ribs_mm", row.get("spine_mm")) for row in rows]).T
    np.testing.assert_allclose(lines.thorax_mm, printed, atol=1e-9)
    on_scapula = scapula_in_thorax(CADAVER).outward(lines.bone_mm[:, lines.on_scapula])
    given = np.array([row["scapula_mm"] for row in rows if "scapula_mm" in row]).T
    np.testing.assert_allclose(on_scapula, scapula_in_thorax(DAS3, "aa").outward(given), atol=PRINTED_MM)


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


def test_there_are_all_five_muscles():
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
    serratus = lines.only(SERRATUS)
    assert serratus.name == tuple(f"serr_ant_{k}" for k in range(1, 13))


def kinds_of_numbers() -> set[str]:
    """Keys of all numbers, without the names of muscles and lines."""
    assert set(DOCUMENT) == {"name", "source", "cadaver", "das3", "muscle"}
    keys = {f"{part}.{name}" for part in ("cadaver", "das3") for name in DOCUMENT[part]}
    for muscle in DOCUMENT["muscle"].values():
        keys |= {f"muscle.{name}" for name in muscle if name != "lines"}
        keys |= {f"muscle.lines.{name}" for line in muscle["lines"] for name in line if name != "name"}
    return keys


def test_every_number_has_one_source_and_every_source_a_number():
    assert kinds_of_numbers() == set(DOCUMENT["source"])
    for key, said in DOCUMENT["source"].items():
        assert said.startswith(("Table 4.", "published: ")), key
        if key.startswith("muscle."):
            assert "das3.osim" in said


def test_the_numbers_of_the_cadaver_are_those_of_the_tables_their_sources_name():
    sc, gh = (DISSECTION[name] for name in ("SC", "GH"))
    assert (CADAVER["sc_mm"], CADAVER["gh_mm"]) == (list(sc), list(gh))
    for name in ("AC", "TS", "AI"):
        assert CADAVER[f"{name.lower()}_mm"] == list(DISSECTION[name])
    girdle = load_model("breteler_dissection").girdle
    np.testing.assert_array_equal(CADAVER["centre_mm"], girdle.centre_mm)
    np.testing.assert_array_equal(CADAVER["semi_axes_mm"], girdle.semi_axes_mm)


def test_the_lines_of_subjects_with_sets_of_their_own_are_those_of_each_set():
    own = PersonalSets("mine", {"a": load_model("R2"), "b": load_model("R6")})
    found = muscle_lines_of(own, ["b", "a", "b"])
    for k, name in enumerate(("R6", "R2", "R6")):
        one = muscle_lines(load_model(name))
        np.testing.assert_array_equal(found.bone_mm[..., k], one.bone_mm)
        np.testing.assert_array_equal(found.gh_mm[..., k], one.gh_mm)


def test_a_set_without_landmarks_is_refused_by_name():
    with pytest.raises(InputError, match=r"das3.*landmarks in the frame AC-TS-AI"):
        muscle_lines(load_model("das3"))
