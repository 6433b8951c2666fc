"""The published muscle lines: their frames, their sources, and their places on the bones of every set."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from thesis_tables import DISSECTION

from models import load_model
from models.muscles.das3_frames import clavicle_in_thorax, scapula_in_thorax
from models.muscles.muscle_lines import HUMERUS, SCAPULA, SERRATUS, TABLE, THORAX, muscle_lines, muscle_lines_of
from models.person.family import PersonalSets
from motions.errors import InputError
from motions.landmarks.acromion import KOLZ
from motions.landmarks.frames import humerus_frame

SETS = ("R2", "R4", "R6", "breteler_dissection", "breteler_mri")

DOCUMENT = tomllib.loads(TABLE.read_text(encoding="utf-8"))
CADAVER, DAS3 = DOCUMENT["cadaver"], DOCUMENT["das3"]

LANDMARK_MM = 3.0
"""Tolerance: two lists of landmarks of one cadaver differ by up to 1.5 mm (AI)."""

PRINTED_MM = 1e-6
"""Rounding of TS and AI in the set's file."""


def test_gh_lies_in_das3s_scapula_frame_where_the_cadaver_has_it():
    """Check GH of DAS3, transformed to the thorax, against Table 4.2: no frame is built from GH."""
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
    """Check for the last third of the clavicle, within 20 mm of its axis."""
    lines = muscle_lines(load_model("breteler_dissection"))
    ends = lines.end_mm[:, lines.of("trapezius_clavicular")]
    assert np.all(ends[0] > 160.0 * 2.0 / 3.0)
    assert np.linalg.norm(ends[1:], axis=0).max() < 20.0


def test_on_the_cadavers_own_bones_nothing_moves():
    model = load_model("breteler_dissection")
    lines = muscle_lines(model)
    rows = [row for part in DOCUMENT["muscle"].values() for row in part["lines"]]
    printed = {on: np.array([row[f"{on}_mm"] for row in rows if f"{on}_mm" in row]).T for on in ("scapula", "humerus")}
    trunk = np.array([row.get("ribs_mm", row.get("spine_mm")) for row in rows if {"ribs_mm", "spine_mm"} & set(row)]).T
    np.testing.assert_allclose(lines.start_mm[:, lines.start == THORAX], trunk, atol=1e-9)
    ends = np.where(lines.end == SCAPULA, lines.end_mm, lines.start_mm)[
        :, (lines.end == SCAPULA) | (lines.start == SCAPULA)
    ]
    given = scapula_in_thorax(DAS3, "aa").outward(printed["scapula"])
    np.testing.assert_allclose(scapula_in_thorax(CADAVER).outward(ends), given, atol=PRINTED_MM)
    on_humerus = np.array(["humerus_mm" in row for row in rows])
    np.testing.assert_allclose(lines.end_mm[:, on_humerus], printed["humerus"], atol=1e-5)


MEASURED_CM = {
    "delt_scap_7": ((18.64, 0.82, 9.37), (19.40, -14.96, 7.27)),
    "delt_clav_2": ((11.61, 2.46, 5.40), (18.47, -13.85, 5.74)),
    "infra_2": ((8.76, -10.31, 16.17), (18.93, -0.25, 6.11)),
    "ter_min_3": ((14.95, -4.16, 10.72), (19.79, -2.52, 6.09)),
    "ter_maj_1": ((11.87, -11.08, 13.29), (16.44, -8.54, 6.56)),
    "supra_4": ((9.62, 1.25, 9.94), (17.37, -0.13, 4.60)),
    "coracobr_3": ((14.22, -1.03, 3.47), (17.26, -19.29, 7.73)),
    "lat_dorsi_6": ((10.42, -29.78, 8.51), (16.65, -6.51, 5.31)),
    "pect_maj_t_1": ((6.12, -15.74, -3.21), (17.46, -8.36, 5.05)),
    "pect_maj_c_1": ((6.45, 0.24, 1.04), (17.81, -10.89, 5.33)),
}
"""Both ends of a line of each muscle, thorax frame, as measured in the cadaver: from the input file of the Delft model,
which public code quotes. No number of the project comes from these."""

ORIGIN_MM, INSERTION_MM = 1.1, 0.1
"""Tolerances: the input file rounds landmarks to 1 mm, and DAS3's frame of the humerus is nearer to the measurement
than its frames of the scapula."""


def test_the_lines_of_the_humerus_lie_where_the_cadaver_was_measured():
    """Check that DAS3's frame of the humerus is that of Appendix A.

    One pose about GH transforms all insertions to the thorax, and agrees with GH, EM and EL in Table 4.2 to a third of
    a degree.
    """
    rows = {row["name"]: row for part in DOCUMENT["muscle"].values() for row in part["lines"]}
    poses = {"scapula": scapula_in_thorax(DAS3, "aa"), "clavicle": clavicle_in_thorax(DAS3, "joint_sc")}
    for name, (origin_cm, _) in MEASURED_CM.items():
        (on,) = {"ribs", "spine", "clavicle", "scapula"} & {key[:-3] for key in rows[name]}
        point = np.array(rows[name][f"{on}_mm"])[:, None]
        there = poses[on].outward(point) if on in poses else point
        assert np.linalg.norm(there[:, 0] - 10.0 * np.array(origin_cm)) < ORIGIN_MM, name
    printed = np.array([rows[name]["humerus_mm"] for name in MEASURED_CM])
    measured = 10.0 * np.array([insertion for _, insertion in MEASURED_CM.values()])
    turn, *_ = Rotation.align_vectors(measured - DAS3["gh_mm"], printed)
    assert np.abs(turn.apply(printed) + DAS3["gh_mm"] - measured).max() < INSERTION_MM
    by_landmarks = humerus_frame(*(np.array(CADAVER[f"{name}_mm"]) for name in ("gh", "em", "el")))
    assert np.degrees((Rotation.from_matrix(by_landmarks).inv() * turn).magnitude()) < 0.5
    for name in ("bic_b_1", "tric_long_1"):
        forearm = turn.apply(rows[name]["forearm_mm"]) + DAS3["gh_mm"]
        expected = {"bic_b_1": (19.77, -36.03, 6.84), "tric_long_1": (18.48, -32.30, 11.13)}[name]
        assert np.abs(forearm - 10.0 * np.array(expected)).max() < INSERTION_MM


def test_the_contours_of_the_humerus_are_those_of_the_thesis():
    """Tables 4.3 and 4.4, dissection: the ball through the tubercles, under the deltoid, has a radius of 27.2 mm and a
    centre 3.5 mm from GH; the shaft has a radius of 9.0 mm, and in DAS3 1 mm more."""
    contours = DOCUMENT["contour"]
    assert contours["deltoid"]["radius_mm"] == 27.2
    assert np.linalg.norm(contours["deltoid"]["centre_mm"]) == pytest.approx(3.5, abs=0.6)
    assert contours["shaft"]["radius_mm"] == pytest.approx(9.0, abs=1.0)
    points = [contours[name]["centre_mm"] for name in ("infraspinatus", "shaft")]
    along = np.subtract(points[1], points[0])
    np.testing.assert_allclose(
        contours["shaft"]["axis"], along / np.linalg.norm(along), atol=2e-3
    )  # one axis, two points


@pytest.mark.parametrize("name", SETS)
def test_the_serratus_and_the_rhomboids_end_along_the_medial_border(name):
    """Check ends between the root of the spine and AI, within 25 mm of TS-AI; the superior angle is above TS."""
    model = load_model(name)
    lines = muscle_lines(model)
    TS, AI = np.asarray(model.girdle.ts_mm), np.asarray(model.girdle.ai_mm)
    border = (AI - TS) / np.linalg.norm(AI - TS)
    for muscle in (SERRATUS, "rhomboids"):
        off = lines.end_mm[:, lines.of(muscle)] - TS[:, None]
        along = border @ off
        below = along > 0.0
        assert along.max() < 1.05 * np.linalg.norm(AI - TS)
        assert np.linalg.norm(off - border[:, None] * along, axis=0)[below].max() < 25.0


@pytest.mark.parametrize("name", SETS)
def test_attachments_keep_their_side(name):
    lines = muscle_lines(load_model(name))
    of_girdle = (lines.start == THORAX) & (lines.end < HUMERUS)
    on_spine = ~np.isin(np.array(lines.muscle), (SERRATUS, "pectoralis_minor"))
    assert np.all(np.abs(lines.start_mm[0, of_girdle & on_spine]) < 40.0)
    assert np.all(lines.start_mm[0, of_girdle & ~on_spine] > 40.0)
    assert np.all(lines.start_mm[2, lines.of("latissimus_dorsi")] > 80.0)  # on the back
    assert np.all(lines.start_mm[2, lines.of("pectoralis_major_thoracic")] < 10.0)  # on the front
    assert np.isfinite(lines.start_mm).all()
    assert np.isfinite(lines.end_mm).all()
    assert lines.gh_mm[1] < -20.0  # the joint is below AC


def test_there_are_all_muscles_of_the_girdle_and_of_the_humerus():
    lines = muscle_lines(load_model("R2"))
    assert len(lines.name) == len(set(lines.name)) == 103
    assert lines.muscles == (
        SERRATUS,
        "trapezius_scapular",
        "trapezius_clavicular",
        "levator_scapulae",
        "pectoralis_minor",
        "rhomboids",
        "deltoid_scapular",
        "deltoid_clavicular",
        "supraspinatus",
        "infraspinatus",
        "teres_minor",
        "subscapularis",
        "teres_major",
        "coracobrachialis",
        "biceps_long_head",
        "biceps_short_head",
        "triceps_long_head",
        "latissimus_dorsi",
        "pectoralis_major_thoracic",
        "pectoralis_major_clavicular",
    )
    assert {muscle for muscle, contour in zip(lines.muscle, lines.contour, strict=True) if contour == "thorax"} == {
        SERRATUS
    }
    straight = {muscle for muscle, contour in zip(lines.muscle, lines.contour, strict=True) if not contour}
    assert straight & set(lines.muscles[6:]) == {"coracobrachialis", "biceps_short_head", "triceps_long_head"}
    assert set(lines.end[np.array([lines.muscles.index(muscle) >= 6 for muscle in lines.muscle])]) == {HUMERUS}
    assert (lines.start < lines.end).all()
    assert (lines.strongest_force_N > 0.0).all()
    serratus = lines.only(SERRATUS)
    assert serratus.name == tuple(f"serr_ant_{k}" for k in range(1, 13))


def kinds_of_numbers() -> set[str]:
    """List the keys of all numbers, without the names of muscles and lines."""
    assert set(DOCUMENT) == {"name", "source", "cadaver", "das3", "glenoid", "contour", "muscle"}
    keys = {f"{part}.{name}" for part in ("cadaver", "das3", "glenoid") for name in DOCUMENT[part]}
    keys |= {f"contour.{name}" for contour in DOCUMENT["contour"].values() for name in contour}
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
    for name in ("AC", "TS", "AI", "EM", "EL"):
        assert CADAVER[f"{name.lower()}_mm"] == list(DISSECTION[name])
    girdle = load_model("breteler_dissection").girdle
    np.testing.assert_array_equal(CADAVER["centre_mm"], girdle.centre_mm)
    np.testing.assert_array_equal(CADAVER["semi_axes_mm"], girdle.semi_axes_mm)


def test_the_lines_of_subjects_with_sets_of_their_own_are_those_of_each_set():
    own = PersonalSets("mine", {"a": load_model("R2"), "b": load_model("R6")})
    found = muscle_lines_of(own, ["b", "a", "b"])
    for k, name in enumerate(("R6", "R2", "R6")):
        one = muscle_lines(load_model(name))
        np.testing.assert_array_equal(found.end_mm[..., k], one.end_mm)
        assert found.humerus_size[k] == one.humerus_size
        np.testing.assert_array_equal(found.gh_mm[..., k], one.gh_mm)


def test_a_set_without_landmarks_is_refused_by_name():
    with pytest.raises(InputError, match=r"das3.*landmarks in the frame AC-TS-AI"):
        muscle_lines(load_model("das3"))
