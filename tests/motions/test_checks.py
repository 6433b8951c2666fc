"""Checks of landmarks and angles: impossible bones, lost markers, outliers, swaps and signs are always reported."""

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import girdle
from laboratory import simulated_trial, up_and_down

from models import load_model
from models.girdle import bone_rotations, chain_landmarks
from motions import ANGLES, InputError, Motions, read_motions, write_motions
from motions.checks.at_rest import MOST_NAMED, warn_of_subjects
from motions.checks.corner import looks_like_corner
from motions.checks.distances import RANGES, blamed
from motions.checks.misfits import likely_unit, misfit
from motions.checks.never_seen import never_seen
from motions.checks.outliers import find_outliers
from motions.checks.trial import frames_of, sound_landmarks
from motions.errors import InputWarning
from motions.landmarks.sampled_postures import Labels, postures_from_landmarks
from motions.rhythm_subjects import DATA_FILE
from tests.helpers.thesis_tables import DISSECTION, MRI

FRAMES = 120


@pytest.fixture(scope="module")
def lab() -> dict[str, np.ndarray]:
    """Return a trial in a laboratory in which the trunk sways by 40 mm, with 0.5 mm of noise."""
    thorax = simulated_trial(up_and_down()[:: 600 // FRAMES], closed=True).thorax_mm
    rng = np.random.default_rng(0)
    sway = 40.0 * np.sin(np.linspace(0.0, 5.0, FRAMES)) * np.ones((3, 1)) + np.array([[300.0], [-500.0], [1200.0]])
    return {name: xyz + sway + 0.5 * rng.standard_normal(xyz.shape) for name, xyz in thorax.items()}


def changed(lab, name: str, frames: slice, place) -> dict[str, np.ndarray]:
    """Return the trial with a landmark at another place in some frames."""
    new = lab[name].copy()
    new[:, frames] = place
    return lab | {name: new}


def said_of(lab) -> tuple[list[str], dict[str, np.ndarray]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = sound_landmarks(lab, "P, m", "t.trc")
    return [str(one.message) for one in caught], found


ALL = slice(0, FRAMES)


def test_a_sound_trial_is_left_alone(lab):
    said, found = said_of(lab)
    assert not said
    for name, place in lab.items():
        np.testing.assert_array_equal(found[name], place)


@pytest.mark.parametrize("measured", [DISSECTION, MRI], ids=["dissection", "mri"])
def test_the_measured_cadaver_is_a_person_at_any_size_from_child_to_giant(measured):
    at = {name: np.array(xyz)[:, None] for name, xyz in measured.items() if name != "AC-J"}
    for size in (0.55, 0.7, 0.86, 1.0, 1.13):
        assert misfit({name: size * xyz for name, xyz in at.items()}) is None
    assert likely_unit({name: xyz / 10.0 for name, xyz in at.items()}, {"mm": 1.0, "cm": 10.0, "m": 1000.0}) == "cm"
    assert likely_unit(at, {"cm": 10.0}) is None


def test_every_range_has_a_source_and_the_cadaver_in_it():
    for (a, b), one in RANGES.items():
        assert one.source
        if a in DISSECTION and b in DISSECTION:
            for measured in (DISSECTION, MRI):
                mm = np.linalg.norm(np.subtract(measured[a], measured[b]))
                assert one.low_mm < mm < one.high_mm, (a, b)


def test_the_blame_is_on_the_fewest_landmarks_by_hand():
    ac_ts, ac_ai, ts_ai = (frozenset(pair) for pair in (("AC", "TS"), ("AC", "AI"), ("TS", "AI")))
    assert blamed([ac_ts, ts_ai], {("AC", "TS"): 9.0, ("TS", "AI"): 9.0, ("AC", "AI"): 0.0}) == [("TS",)]
    off = {("AC", "TS"): 9.0, ("TS", "AI"): 0.0, ("AC", "AI"): 4.0}
    assert blamed([ac_ts], off) == [("AC",)]  # AC also explains AC-AI, 4 SD off
    assert blamed([ac_ts], off | {("AC", "AI"): 2.0}) == [("AC",), ("TS",)]  # 2 SD may be chance
    assert blamed([ac_ts, ac_ai, ts_ai], dict.fromkeys([("AC", "TS")], 9.0)) == [
        ("AC", "AI"),
        ("AC", "TS"),
        ("AI", "TS"),
    ]


@pytest.mark.parametrize("value", [0.0, -16512.0, 9999999.0])
def test_a_landmark_that_was_never_seen_is_a_gap(lab, value):
    with pytest.raises(InputError, match="landmark T8 was never seen: it is at "):
        sound_landmarks(changed(lab, "T8", ALL, value), "P, m", "t.trc")
    said, found = said_of(changed(lab, "GH", ALL, value))
    assert "GH was never seen" in said[0]
    assert "It is left out" in said[0]
    assert set(lab) - set(found) == {"GH"}
    said, found = said_of(changed(lab, "AI", slice(10, 20), value))
    assert np.isnan(found["AI"][:, 10:20]).all()
    assert np.isfinite(found["AI"][:, 20:]).all()
    assert said == [] if value == 0.0 else "AI is at" in said[0]  # zeros are the usual gaps and need no message


def test_a_landmark_that_stands_still_while_its_bone_moves_is_a_gap(lab):
    said, found = said_of(changed(lab, "TS", slice(30, 60), lab["TS"][:, 29:30]))
    assert "landmark TS is at" in said[0]
    assert "frames 30-60" in said[0]
    assert np.isnan(found["TS"][:, 29:60]).all()
    with pytest.raises(InputError, match="landmark AI was never seen"):
        sound_landmarks(changed(lab, "AI", ALL, lab["AI"][:, :1]), "P, m", "t.trc")


@pytest.mark.parametrize("frame", ["laboratory", "thorax"])
@pytest.mark.parametrize("lost", [("AC", "TS", "AI"), ("SC", "AC", "TS", "AI", "GH"), ("EM", "EL"), ("TS", "AI")])
def test_landmarks_that_stand_still_together_while_the_thorax_moves_are_gaps(lab, lost, frame):
    """A lost cluster holds its last place, and with it all landmarks that it carries."""
    lab = {name: xyz - lab["IJ"] for name, xyz in lab.items()} if frame == "thorax" else lab
    held = dict(lab)
    for name in lost:
        held = changed(held, name, slice(30, 60), held[name][:, 29:30])
    if frame == "thorax":  # SC may be placed from IJ there
        lost = tuple(name for name in lost if name != "SC")
    found = {name: np.flatnonzero(unseen).tolist() for name, unseen in never_seen(held).items() if unseen.any()}
    assert found == {name: list(range(29, 60)) for name in lost}
    with_thorax = never_seen(changed(held, "IJ", slice(30, 60), held["IJ"][:, 29:30]))  # the body stands still
    if frame == "laboratory":
        assert not any(with_thorax[name].any() for name in lost)


def test_positions_in_whole_centimetres_are_no_gaps_at_rest():
    """Some landmarks then step by 10 mm while others show nothing."""
    moving = ("IJ", "PX", "C7", "T8", "SC", "GH", "EM")
    flicker = {name: np.full((3, 20), 90.0 * k + 20.0) + 10.0 * (np.arange(20) % 2) for k, name in enumerate(moving)}
    still = {name: np.full((3, 20), 950.0 + 100.0 * k) for k, name in enumerate(("AC", "TS", "AI"))}
    assert not any(unseen.any() for unseen in never_seen(flicker | still).values())


def test_the_origin_and_a_body_at_rest_are_no_gaps():
    thorax = simulated_trial(np.linspace(0.0, 120.0, 30)).thorax_mm  # IJ is (0, 0, 0), the thorax is at rest
    assert not any(unseen.any() for unseen in never_seen(thorax).values())
    at_rest = {name: np.repeat(xyz[:, :1], 30, axis=1) for name, xyz in thorax.items()}
    assert not any(unseen.any() for unseen in never_seen(at_rest).values())


def test_in_the_thorax_frame_the_thorax_stands_still_and_the_scapula_does_not(lab):
    """IJ is (0, 0, 0) throughout; PX, C7, T8 and SC move by the noise of the skin."""
    thorax = {name: xyz - lab["IJ"] for name, xyz in lab.items()}
    assert not any(unseen.any() for unseen in never_seen(thorax).values())
    placed = changed(thorax, "SC", ALL, thorax["SC"][:, :1])  # SC placed from IJ
    assert not any(unseen.any() for unseen in never_seen(placed).values())
    held = never_seen(changed(thorax, "AI", slice(30, 60), thorax["AI"][:, 29:30]))
    assert [name for name, unseen in held.items() if unseen.any()] == ["AI"]
    assert np.flatnonzero(held["AI"]).tolist() == list(range(29, 60))


def test_a_body_at_rest_in_a_file_of_few_digits_is_seen():
    """With positions rounded to mm, some landmarks stay equal for frames while all others change by one digit."""
    rng = np.random.default_rng(0)
    places = {name: rng.uniform(-500.0, 500.0, (3, 1)) for name in ("IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI")}
    rounded = {name: np.round(place + 0.3 * rng.standard_normal((3, 300))) for name, place in places.items()}
    rounded["TS"][:, 100:104] = rounded["TS"][:, 100:101]
    assert not any(unseen.any() for unseen in never_seen(rounded).values())


SIDEWAYS = np.array([[250.0], [100.0], [-200.0]])


@pytest.mark.parametrize("name", ["IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI", "AA", "GH", "EM", "EL"])
def test_an_outlier_of_every_landmark_is_named_with_its_frames(lab, name):
    moved = changed(lab, name, slice(50, 55), lab[name][:, 50:55] + SIDEWAYS)
    (one,) = find_outliers(moved)
    assert (one.landmarks, one.frames.tolist(), one.swapped) == ((name,), [50, 51, 52, 53, 54], False)
    said, found = said_of(moved)
    assert f"{name} is not in its place in frames 51-55" in said[0]
    assert np.isnan(found[name][:, 50:55]).all()
    kept = {other: np.isfinite(place).all() for other, place in found.items()}
    assert kept == {other: other != name for other in lab}


@pytest.mark.parametrize("pair", [("TS", "AI"), ("IJ", "C7"), ("AC", "GH"), ("GH", "EM"), ("SC", "AC"), ("IJ", "SC")])
@pytest.mark.parametrize("last", [45, FRAMES])
def test_a_swap_in_mid_trial_is_named_as_that(lab, pair, last):
    frames = slice(last - 25, last)
    a, b = pair
    (one,) = find_outliers(changed(changed(lab, a, frames, lab[b][:, frames]), b, frames, lab[a][:, frames]))
    assert set(one.landmarks) == {a, b}
    assert one.swapped
    assert one.frames.tolist() == list(range(last - 25, last))


def test_skin_that_moves_slowly_is_no_outlier(lab):
    """AI is up to 40 mm off at the top of the motion, and moves there and back slowly, like skin."""
    bump = 40.0 * np.exp(-((np.linspace(-4.0, 4.0, FRAMES)) ** 2))
    along = (lab["AI"] - lab["AC"]) / np.linalg.norm(lab["AI"] - lab["AC"], axis=0)
    assert not find_outliers(lab | {"AI": lab["AI"] + bump * along})


@pytest.mark.parametrize("name", ["IJ", "C7", "T8", "SC", "AC", "TS", "AI", "GH"])
def test_a_landmark_whose_frames_are_those_of_another_time_is_named(lab, name):
    """The landmark's frames are reversed in time: it moves slowly, so no frame is an outlier; the trunk sways a lot."""
    far = {other: xyz + 60.0 * np.linspace(-1.0, 1.0, FRAMES) for other, xyz in lab.items()}
    said, found = said_of(far | {name: far[name][:, ::-1]})
    assert any(re.search(rf"between (\w+ and )?{name} .*changes by .* Is a marker on another", text) for text in said)
    assert set(found) == set(lab)


def test_a_landmark_of_the_other_shoulder_is_refused(lab):
    with pytest.raises(InputError, match=r"TS cannot be right: TS is \d+ mm from AC, in people 80 to 170"):
        sound_landmarks(changed(lab, "TS", ALL, lab["TS"] - np.array([[120.0], [0.0], [0.0]])), "P, m", "t.trc")
    said, found = said_of(changed(lab, "GH", ALL, lab["GH"] - np.array([[300.0], [0.0], [0.0]])))
    assert "GH cannot be right" in said[0]
    assert "GH" not in found


def test_a_thorax_out_of_its_plane_is_refused(lab):
    away = lab["T8"] + np.array([[110.0], [0.0], [0.0]])
    with pytest.raises(InputError, match=r"not in one plane.* beside the midline"):
        sound_landmarks(changed(lab, "T8", ALL, away), "P, m", "t.trc")


def test_ij_and_sc_exchanged_are_not_taken_for_a_wrong_sc(lab):
    """SC is then at the other shoulder's SC; if SC were just left out, the thorax would be rotated by 17 degrees."""
    with pytest.raises(InputError, match=r"SC or IJ cannot be right: .*SC is .* beyond the midline") as caught:
        sound_landmarks(lab | {"SC": lab["IJ"], "IJ": lab["SC"]}, "P, m", "t.trc")
    assert caught.value.remedy.endswith("Or are IJ and SC swapped?")
    assert str(caught.value).endswith("swapped?")
    without_ac = {name: xyz for name, xyz in lab.items() if name != "AC"}
    with pytest.raises(InputError, match="SC or IJ cannot be right"):
        sound_landmarks(without_ac | {"SC": lab["IJ"], "IJ": lab["SC"]}, "P, m", "t.trc")


def test_both_landmarks_of_the_acromion_exchanged_are_named(lab):
    with pytest.raises(InputError, match=r"AA is .* nearer to IJ than AC") as caught:
        sound_landmarks(lab | {"AC": lab["AA"], "AA": lab["AC"]}, "P, m", "t.trc")
    assert "Are AC and AA swapped?" in caught.value.remedy


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_the_corner_of_the_acromion_under_the_name_of_ac(lab, mirror):
    """Right and left shoulder; measured by hand, GH is 8 and -4 mm in front of the cadaver's scapula."""
    corner = {name: mirror * xyz for name, xyz in lab.items() if name != "AA"} | {"AC": mirror * lab["AA"]}
    said, _ = said_of(corner)
    assert "before the plane of AC, TS and AI, in people up to 26: AC looks like AA" in said[0]
    assert "--aa-to-ac kolz2020" in said[0]
    assert looks_like_corner({name: xyz for name, xyz in lab.items() if name != "AA"}) is None
    for measured in (DISSECTION, MRI):
        assert looks_like_corner({name: np.array(xyz)[:, None] for name, xyz in measured.items()}) is None


def test_a_middle_of_px_and_t8_is_checked_as_that(lab):
    middle = (lab["PX"] + lab["T8"]) / 2.0
    assert said_of(lab | {"PX": middle, "T8": middle})[0] == []
    with pytest.raises(InputError, match="PX_T8 cannot be right"):
        sound_landmarks(lab | {"PX": middle + 1000.0, "T8": middle + 1000.0}, "P, m", "t.trc")


def test_runs_of_frames_end_with_the_number_left_out():
    assert frames_of(np.array([4])) == "frame 5"
    assert frames_of(np.array([20, 21, 22, 40])) == "frames 21-23, 41"
    assert frames_of(np.arange(0, 40, 2)) == "frames 1, 3, 5, 7, 9, 11, 13, 15 and 12 more"


ELEVATION = np.linspace(10.0, 120.0, 12)


def course(**changes: float) -> Motions:
    """Make a motion from de Groot's rest posture and Ludewig's changes; a change of -1 reverses an angle's sign."""
    at_10, by_60 = np.array([-28.0, 12.0, 0.0, 38.0, 9.0, -10.0]), np.array([-12.0, 8.0, 13.0, -2.0, 21.0, 5.0])
    angles = (at_10 + np.outer((ELEVATION - 10.0) / 60.0, by_60)) * [changes.get(angle, 1.0) for angle in ANGLES]
    count = len(ELEVATION)
    names = {"subject": np.array(["P"] * count), "motion": np.array(["m"] * count), "posture": np.arange(1, count + 1)}
    empty = pd.DataFrame(index=pd.RangeIndex(count))
    return Motions(**names, humerus_elevation_deg=ELEVATION, angles_deg=angles, landmarks_mm={}, extra=empty)


def with_angle(angle: str, values, rows: int | slice = slice(None)) -> Motions:
    """Return ``course`` with other values of an angle."""
    angles = course().angles_deg.copy()
    angles[rows, ANGLES.index(angle)] = values
    return replace(course(), angles_deg=angles)


def angle_of_course(angle: str) -> np.ndarray:
    return course().angles_deg[:, ANGLES.index(angle)]


def warned(motions: Motions) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_of_subjects(motions, "m.csv")
    return [str(one.message) for one in caught]


@pytest.mark.parametrize("angle", ANGLES)
def test_a_sign_turned_round_is_named_alone(angle):
    said = [text for text in warned(course(**{angle: -1.0})) if "people" in text]
    assert len(said) == 1
    assert f"{angle}_deg (" in said[0]
    assert not [other for other in ANGLES if other != angle and f"{other}_deg (" in said[0]]
    assert not warned(course())


def test_of_a_scapula_that_hardly_tips_no_more_is_said_than_is_known():
    (said,) = warned(with_angle("scapula_x", 4.0 + 0.1 * np.arange(len(ELEVATION))))
    assert said.endswith("check which angle it is. A scapula that hardly tips looks alike.")
    (said,) = warned(course(scapula_x=-1.0))
    assert "looks alike" not in said


def test_no_sign_is_to_be_turned_where_that_mends_nothing():
    turned = with_angle("clavicle_y", angle_of_course("clavicle_y") + 180.0)  # from an axis in the opposite direction
    (said,) = [text for text in warned(turned) if "people:" in text]
    assert said.endswith(
        "With the other sign clavicle_y_deg is no person's either: check its frame and zero (docs/frames.md)."
    )


def test_isb_is_recognised_and_a_small_motion_says_nothing():
    (said,) = warned(course(clavicle_z=-1.0, scapula_z=-1.0))
    assert "falls by 21 degrees over 60 degrees of elevation" in said
    assert "It looks like ISB's beta: z = -beta; turn the sign of clavicle_z_deg and scapula_z_deg round" in said
    small = course(clavicle_x=-1.0).select(ELEVATION < 65.0)
    assert not warned(small)


@pytest.mark.parametrize(
    ("a", "b"), [("scapula_y", "scapula_z"), ("scapula_z", "scapula_x"), ("clavicle_y", "clavicle_z")]
)
def test_two_angles_whose_columns_are_exchanged_are_named(a, b):
    turned = course().angles_deg.copy()
    places = [ANGLES.index(a), ANGLES.index(b)]
    turned[:, places] = turned[:, places[::-1]]
    assert any(f"{one}_deg" in text for text in warned(replace(course(), angles_deg=turned)) for one in (a, b))
    if a == "scapula_y":
        (said,) = warned(replace(course(), angles_deg=turned))
        assert "scapula_y_deg is as scapula_z_deg is in people, and the other way round. Are the two columns" in said


@pytest.mark.parametrize("order", [(1, 2, 0), (2, 0, 1)])
def test_three_columns_in_the_order_of_another_sequence_are_named(order):
    """X, Y, Z under the names of Y, Z, X: the message names the order and no sign."""
    turned = course().angles_deg.copy()
    turned[:, 3:] = turned[:, [3 + k for k in order]]
    (said,) = warned(replace(course(), angles_deg=turned))
    for k, place in enumerate(order):
        assert f"{ANGLES[3 + place]}_deg is as {ANGLES[3 + k]}_deg here" in said
    assert "Are the three columns exchanged" in said


def test_exchanged_columns_of_the_clavicle_are_no_two_wrong_signs():
    turned = course().angles_deg.copy()
    turned[:, :2] = turned[:, 1::-1]
    (said,) = warned(replace(course(), angles_deg=turned))
    assert "clavicle_y_deg is as clavicle_z_deg is in people, and the other way round" in said


@pytest.mark.parametrize("overhead", [130.0, 180.0])
def test_an_elevation_from_overhead_is_no_wrong_sign(overhead):
    backward = replace(course(), humerus_elevation_deg=overhead - ELEVATION)
    (said,) = warned(backward)
    assert "All angles go the other way: is humerus_elevation_deg measured from overhead?" in said
    assert "ISB" not in said
    assert "turn the sign" not in said.lower()


def test_an_angle_that_is_zero_or_in_radians_throughout_is_named():
    """An angle that was not measured must be empty; radians read as degrees vary less than measurement noise."""
    (said,) = warned(with_angle("clavicle_x", 0.0))
    assert "clavicle_x_deg is 0 in every posture. Empty its cells" in said
    (said,) = warned(with_angle("scapula_x", np.radians(angle_of_course("scapula_x"))))
    assert "scapula_x_deg never exceeds 1 while the arm moves: it looks like radians" in said


def test_of_many_subjects_the_first_are_named_and_the_others_counted():
    turned = course(scapula_z=-1.0)
    parts = [
        replace(turned, subject=np.array([f"P{k}"] * 12), angles_deg=turned.angles_deg + 0.01 * k)
        for k in range(MOST_NAMED + 3)
    ]
    said = warned(Motions.concatenate(parts))
    assert len(said) == MOST_NAMED + 1
    assert "3 more subjects are like this" in said[-1]


def test_measured_and_shipped_motions_pass_without_a_word(measured_files):
    for path in (*measured_files, DATA_FILE):
        read_motions(path)  # a warning would be an error


@pytest.fixture(scope="module")
def cases() -> Path:
    folder = Path(__file__).parents[3] / "shared" / "cases"
    if not folder.exists():
        pytest.skip("the cases of the shared folder are not here")
    return folder


@pytest.mark.parametrize(
    ("name", "status", "said"),
    [
        ("c08_zero_all_AI.trc", 2, "landmark AI was never seen: it is at (0, 0, 0) in every frame"),
        ("c08_zero_all_T8.trc", 2, "landmark T8 was never seen"),
        ("c08_zero_all_GH.trc", 0, "landmark GH was never seen"),
        ("spike_T8.trc", 0, "T8 is not in its place in frames 31-35"),
        ("mid_TSAI.trc", 0, "the labels of TS and AI are exchanged in frames 21-30"),
        ("mixTS.trc", 2, "TS is 229 mm from AC, in people 80 to 170"),
        ("isb_unsigned.csv", 0, "It looks like ISB's beta: z = -beta"),
        ("neg_elev90.csv", 2, "Elevation is the angle of the humerus with the vertical, 0 to 180 degrees"),
        ("base.trc", 0, ""),
    ],
)
def test_the_cases_say_what_is_wrong_and_the_rest_is_right(cases, tmp_path, name, status, said):
    options = ["--subject", "P01", "--motion", "abd"] if name.endswith(".trc") else []
    ran = girdle("convert", cases / name, tmp_path / "out.csv", *options)
    assert ran.status == status
    assert said in ran.err if said else not ran.err
    if status or name.endswith(".csv"):
        return
    by_hand = pd.read_csv(cases / "base_angles.csv").set_index("frame")
    found = pd.read_csv(tmp_path / "out.csv").set_index("posture")
    angles = [column for column in by_hand if "GH" not in name or not column.startswith("humerus")]
    without_noise = name in ("spike_T8.trc", "mid_TSAI.trc")  # the angles by hand have noise of 0.3 mm
    atol = 1.0 if without_noise else 0.01
    np.testing.assert_allclose(found[angles], by_hand.loc[found.index, angles], rtol=0.0, atol=atol)


def test_refused_trials_make_no_person_either(cases, tmp_path):
    ran = girdle("model", cases / "mixTS.trc", "--out", tmp_path / "p.toml", "--subject", "P01")
    assert ran.status == 2
    assert "TS is 229 mm from AC" in ran.err


def test_negative_elevation_is_refused_in_a_table_of_angles_too(tmp_path):
    lines = ["trial", "nRows=2", "nColumns=3", "inDegrees=yes", "endheader", "time\thumerus_elevation\tscapula_y"]
    path = tmp_path / "t.mot"
    path.write_text("\n".join([*lines, "0\t10\t30", "1\t-20\t31"]) + "\n")
    ran = girdle("convert", path, tmp_path / "out.csv")
    assert ran.status == 2
    assert "humerus_elevation is -20, below 0" in ran.err


def test_postures_without_a_landmark_say_which(lab):
    with pytest.warns(InputWarning, match=r"3 of 120 postures are left out.*They have gaps in T8"):
        postures_from_landmarks(changed(lab, "T8", slice(0, 3), np.nan), Labels("P", "m"), "t.trc")


def test_reading_says_it_once_for_the_api_and_the_commands(tmp_path):
    write_motions(course(clavicle_z=-1.0, scapula_z=-1.0), tmp_path / "m.csv")
    with pytest.warns(InputWarning, match="It looks like ISB's beta") as caught:
        read_motions(tmp_path / "m.csv")
    assert len(caught) == 1
    for command in (("convert", "m.csv", "out.csv"), ("fit", "m.csv", "--model", "R2", "--out", "results")):
        ran = girdle(*(tmp_path / word if word in ("m.csv", "out.csv", "results") else word for word in command))
        assert ran.err.count("It looks like ISB's beta") == 1


def test_positions_in_a_motion_file_are_a_persons_too(tmp_path):
    girdle_mm = placed(course())
    write_motions(replace(course(), landmarks_mm=girdle_mm), tmp_path / "m.csv")
    read_motions(tmp_path / "m.csv")  # SC is still in the thorax frame; a warning would be an error
    wrong = girdle_mm | {"TS": girdle_mm["TS"] - np.array([150.0, 0.0, 0.0])}
    write_motions(replace(course(), landmarks_mm=wrong), tmp_path / "m.csv")
    with pytest.warns(InputWarning, match=r"P: TS cannot be right: TS is \d+ mm from AC"):
        read_motions(tmp_path / "m.csv")


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (lambda mm: mm * [-1.0, 1.0, 1.0], "degrees away from where the angles put the clavicle"),  # left shoulder
        (lambda mm: mm[:, [0, 2, 1]] * [1.0, 1.0, -1.0], "degrees away from where the angles put the"),  # z up
        (lambda mm: mm + np.array([400.0, 900.0, -300.0]), "mm from IJ, in people 5 to 60"),  # laboratory frame
    ],
)
def test_positions_of_a_motion_file_in_another_frame_are_named(frame, said):
    """Diagnosis and own bones use the positions; in another frame they would count as movement of the joints."""
    sound = replace(course(), landmarks_mm=placed(course()))
    assert not warned(sound)
    text = " ".join(warned(replace(sound, landmarks_mm={name: frame(mm) for name, mm in placed(sound).items()})))
    assert said in text
    assert "Positions are in mm in the thorax frame" in text


@pytest.mark.parametrize(
    ("place", "said"),
    [([-24.0, -1.0, 6.0], "SC is at x = -24 mm, on the other side"), ([2.4, -0.1, 0.6], "SC is 2.48 mm from IJ")],
)
def test_sc_alone_is_the_persons_too(place, said):
    (text,) = warned(replace(course(), landmarks_mm={"SC": np.tile(place, (12, 1))}))
    assert said in text


def test_an_angle_that_stands_still_or_a_posture_out_of_line_is_named():
    (text,) = warned(with_angle("clavicle_x", 7.3))
    assert "clavicle_x_deg is the same in every posture while the arm moves. Was a cell copied down?" in text
    (text,) = warned(with_angle("clavicle_y", -angle_of_course("clavicle_y")[6], rows=6))
    assert "clavicle_y_deg is 40 in posture 7 of 'm', -38 before and -42 after it. Look at its sign" in text


def placed(motions: Motions) -> dict[str, np.ndarray]:
    """Return landmarks of R2 with its bones at these angles."""
    girdle, (clavicle, scapula) = load_model("R2").girdle, bone_rotations(np.radians(motions.angles_deg.T))
    at = chain_landmarks(girdle.over_axes(1), clavicle, scapula)
    sc_mm = np.tile(girdle.sc_mm, (len(motions.posture), 1))
    return {"SC": sc_mm, "AC": at.AC.T, "TS": at.TS.T, "AI": at.AI.T}
