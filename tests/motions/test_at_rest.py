"""Frames with the lowest arm: the start of the clavicle's axial estimate, and angles that no person has at rest."""

import warnings
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from laboratory import simulated_trial, trc_lines, up_and_down

from motions import read_motions
from motions.checks.at_rest import HIGHEST_REST_DEG, lowest_frames, unlike_rest
from motions.errors import InputError, InputWarning
from motions.formats.any_file import read_any
from motions.landmarks.mapping import Mapping
from motions.landmarks.sampled_postures import ESTIMATE_ZERO, Labels, postures_from_landmarks
from motions.motion_csv.writing import write_motions
from motions.rhythm import REST_DEG
from motions.rhythm_subjects import DATA_FILE
from motions.table import ANGLES

EXACT = 1e-9
"""Tolerance in degrees."""

X = ANGLES.index("clavicle_x")


@pytest.fixture(scope="module")
def lab():
    """Return the landmarks of a trial of 600 frames, without AA."""
    return {name: xyz for name, xyz in simulated_trial(up_and_down(), closed=True).thorax_mm.items() if name != "AA"}


def postures(lab, *at_deg: float):
    return postures_from_landmarks(lab, Labels("P01", "abduction", at_deg=at_deg), "trial.trc")


def exchanged(lab, a, b):
    return lab | {a: lab[b], b: lab[a]}


def test_the_lowest_frames_by_hand():
    angles = np.arange(30.0).reshape(5, 6)
    found = lowest_frames(angles, np.array([9.0, 3.0, 4.5, 5.5, np.nan]))
    assert found.rows.tolist() == [1, 2]
    np.testing.assert_array_equal(found.angles_deg, [9, 10, 11, 12, 13, 14])
    assert found.elevation_deg == 3.75
    angles[1, 3] = np.nan
    assert lowest_frames(angles, np.array([9.0, 3.0, 4.5, 5.5, np.nan])).rows.tolist() == [2, 3]
    nowhere = lowest_frames(angles, np.full(5, np.nan))
    assert nowhere.rows.tolist() == [0]
    assert np.isnan(nowhere.elevation_deg)


def test_the_estimate_at_an_elevation_does_not_depend_on_the_others(lab):
    found = [postures(lab, *at_deg) for at_deg in ((60.0,), (40.0, 60.0, 120.0), (5.0, 60.0))]
    at_60 = [one.angles_deg[one.humerus_elevation_deg == 60.0, X].item() for one in found]
    every = postures(lab)
    near = np.abs(every.humerus_elevation_deg - 60.0) < 0.5
    bend_deg = 0.05  # error of averaging the curved estimate within the window
    assert at_60 == pytest.approx([every.angles_deg[near, X].mean()] * 3, abs=bend_deg)
    assert at_60 == pytest.approx([at_60[0]] * 3, abs=EXACT)
    assert at_60[0] > 5.0
    assert {zero for one in (*found, every) for zero in one.extra[ESTIMATE_ZERO]} == {"0.5"}, (
        "near its lowest the arm is t^2: in half of the time below 2 degrees it is below a quarter of them"
    )


def test_one_noisy_frame_does_not_decide_the_zero(lab):
    """The scapula is rotated in the lowest frame, and in one frame the elbow is lower than in any other."""
    noisy = {name: xyz.copy() for name, xyz in lab.items()}
    noisy["AI"][:, 0] += [0.0, 0.0, 40.0]
    for name in ("GH", "EM", "EL", "TS"):
        noisy[name][:, 300] = lab[name][:, 0]
    with pytest.warns(InputWarning, match=r"not in its place in frame"):
        found = postures(noisy, 60.0).angles_deg[0, X]
    expected = postures(lab, 60.0).angles_deg[0, X]
    assert found == pytest.approx(expected, abs=0.05)


def test_measured_and_simulated_motions_are_like_a_person_at_rest(measured_files):
    for path in (*measured_files, DATA_FILE):
        motions = read_any(path, Mapping(), Labels("", ""))  # a warning would be an error here
        for motion in dict.fromkeys(motions.motion):
            mine = motions.select(motions.motion == motion)
            rest = lowest_frames(mine.angles_deg, mine.humerus_elevation_deg)
            assert not unlike_rest(rest, {})


def test_what_is_unlike_rest_by_hand():
    at = np.repeat(REST_DEG[:, None], 2, axis=1).T
    low, high = np.array([10.0, 20.0]), np.array([HIGHEST_REST_DEG + 1.0, HIGHEST_REST_DEG + 2.0])
    assert not unlike_rest(lowest_frames(at, low), {})
    turned = at + np.array([0.0, 0.0, 90.0, 0.0, 0.0, -170.0])
    said = ["scapula_x_deg is -180, at rest a person's is -40 to 20"]
    assert unlike_rest(lowest_frames(turned, low), {}) == said
    assert not unlike_rest(lowest_frames(turned, high), {})
    landmarks = {"TS": np.array([[60.0, -90.0, 100.0]] * 2), "AI": np.array([[70.0, 20.0, 100.0]] * 2)}
    assert unlike_rest(lowest_frames(at, high), landmarks) == ["TS lies below AI"]


def short_scapula(lab):
    """Shorten the scapula, so that TS and AI can be swapped without an impossible distance; the scapula then turns."""
    return lab | {"AI": lab["AC"] + 0.8 * (lab["AI"] - lab["AC"])}


def test_two_swapped_landmarks_are_named_where_distances_do_not_show_it(lab):
    with pytest.warns(InputWarning) as caught:
        postures(exchanged(short_scapula(lab), "TS", "AI"), 60.0)
    (said,) = (str(one.message) for one in caught)
    assert said.startswith("trial.trc: P01, abduction: with the arm at ")
    assert "Are TS and AI swapped?" in said


HARDLY_SEEN = {("PX", "T8"), ("EM", "EL")}
"""Pairs whose exchange changes no distance of a bone and hardly any angle."""


def test_no_swap_is_named_wrongly(lab):
    """Every pair swapped in a whole trial: a message names one of the two, and never asks about another pair."""
    named = 0
    for pair in combinations(lab, 2):
        said = []
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                postures(exchanged(lab, *pair))
            except InputError as error:
                said.append(str(error))
        said += [str(one.message) for one in caught]
        if pair in HARDLY_SEEN:
            assert not said
            continue
        assert any(name in text for name in pair for text in said), pair
        swaps = [text for text in said if "swapped?" in text]
        named += bool(swaps)
        ways = [f"Are {a} and {b} swapped?" for a, b in (pair, pair[::-1])]
        assert all(any(way in text for way in ways) for text in swaps)
    assert named > 35


def test_a_motion_file_with_a_sign_turned_round_is_read_with_a_warning(tmp_path):
    motions = read_motions(DATA_FILE)
    motions = motions.select(motions.subject == motions.subjects[0])
    wrong = motions.angles_deg * np.where(np.arange(6) == X + 1, -1.0, 1.0)
    write_motions(replace(motions, angles_deg=wrong), tmp_path / "m.csv")
    said = r"simulated01: scapula_y_deg .* is -.* with the arm low.*Turn the sign of scapula_y_deg.*frames\.md"
    with pytest.warns(InputWarning, match=said) as caught:
        read_any(tmp_path / "m.csv", Mapping(), Labels("", ""))
    assert len(caught) == 1  # the message about the rest posture is not repeated


def test_a_trial_without_humerus_is_checked_in_its_first_posture(lab, tmp_path):
    every = exchanged(short_scapula(lab), "TS", "AI")
    swapped = {name: xyz[:, :3] for name, xyz in every.items() if name not in ("GH", "EM", "EL")}
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(swapped)) + "\n")
    with pytest.warns(InputWarning, match=r"in the first posture .* Are TS and AI swapped"):
        read_any(tmp_path / "t.trc", Mapping(), Labels("P", "m"))
