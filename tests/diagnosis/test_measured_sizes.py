"""Sizes measured by landmarks: exact where positions are exact, and absent without positions; the extent of causes."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from handmade import motions_of

from adapt.diagnosis.fit.candidates import build_design
from adapt.diagnosis.fit.positions.measured_sizes import measured_sizes
from adapt.diagnosis.fit.shoulders import Shoulders, shoulders_of
from adapt.diagnosis.inference.extent import extent
from adapt.diagnosis.result import ELEVATION, Extent
from models import load_model
from models.effects import EFFECTS
from models.girdle import Girdle, bone_rotations, chain_landmarks
from models.person.sizes import PALPATOR_LENGTH_MM
from motions import ANGLES, Motions
from motions.landmarks.sampled_postures import CLAVICLE_PLACED
from motions.rhythm import REST_DEG
from motions.rhythm_subjects import simulate_subjects

SUBJECTS = 3
SIZES = ("clavicle_length", "scapula_size", "sc_offset", "ts_offset", "ai_offset")
BASE = load_model("R2").girdle


def girdles() -> Girdle:
    return BASE.repeated(SUBJECTS)


def shoulders(**amplitudes: tuple[float, ...]) -> Shoulders:
    """Simulate postures of a rhythm with the landmarks of R2, changed by these effects."""
    motions = simulate_subjects(SUBJECTS, seed=1)
    count = len(motions.posture)
    girdle, rotations = BASE.repeated(count), bone_rotations(np.deg2rad(motions.angles_deg.T))
    for name, a in amplitudes.items():
        girdle, _ = EFFECTS[name].adjust(girdle, rotations, np.repeat(np.array(a)[:, None], count, 1))
    at = chain_landmarks(girdle, *rotations)
    points = {"SC": girdle.sc_mm, "AC": at.AC, "TS": at.TS, "AI": at.AI}
    return shoulders_of(replace(motions, landmarks_mm={name: np.asarray(one).T for name, one in points.items()}))


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("clavicle_length", (-7.0,)),
        ("scapula_size", (6.0,)),
        ("sc_offset", (3.0, -4.0, 5.0)),
        ("ai_offset", (2.0, -8.0)),
    ],
)
def test_a_size_that_landmarks_show_is_found_exactly(name, size):
    found = measured_sizes(shoulders(**{name: size}), girdles(), tuple(EFFECTS.values()))
    assert found[name].mean == pytest.approx(size, abs=1e-9)  # the numbers are linear in every size
    assert set(found) == set(SIZES)


def test_the_sd_is_that_of_a_palpated_length_over_the_subjects():
    """Check the SD of identical subjects, which is the palpation error alone."""
    found = measured_sizes(shoulders(), girdles(), (EFFECTS["clavicle_length"],))["clavicle_length"]
    percent_per_mm = 100.0 / float(np.linalg.norm(BASE.ac_mm))
    assert found.sd == pytest.approx(percent_per_mm * PALPATOR_LENGTH_MM / np.sqrt(SUBJECTS))


def test_what_was_placed_or_not_measured_says_nothing():
    of_landmarks = shoulders(clavicle_length=(5.0,))
    motions = of_landmarks.motions
    effects = tuple(EFFECTS.values())
    assert measured_sizes(replace(of_landmarks, motions=replace(motions, landmarks_mm={})), girdles(), effects) == {}
    marks = pd.DataFrame({CLAVICLE_PLACED: ["SC from IJ"] * len(motions.posture)})
    placed = measured_sizes(replace(of_landmarks, motions=replace(motions, extra=marks)), girdles(), effects)
    assert set(placed) == {"scapula_size", "ts_offset", "ai_offset"}


def test_the_diagnosis_starts_from_what_landmarks_say():
    there = shoulders(clavicle_length=(5.0,))
    effects = (EFFECTS["clavicle_length"], EFFECTS["thorax_tilt"])
    sizes = measured_sizes(there, girdles(), effects)
    candidates = build_design(effects, there, sizes)
    own = candidates.places["clavicle_length"]
    assert (candidates.mean[own], candidates.scale[own]) == sizes["clavicle_length"]
    assert (candidates.mean[candidates.places["thorax_tilt"]] == 0.0).all()


# --- extent over the postures --------------------------------------------------------------------------------------


def moved(name: str, amplitude: list[float], motions: Motions) -> Extent:
    effect = EFFECTS[name]
    felt = effect.basis.felt(len(effect.directions), motions)
    return extent(effect, np.einsum("a,acp->cp", amplitude, felt), motions)


def of_one_angle(values_deg: list[float]) -> Motions:
    """Return one subject whose scapular protraction alone changes, with the arm rising evenly."""
    angles_deg = np.tile(REST_DEG, (1, len(values_deg), 1))
    angles_deg[0, :, ANGLES.index("scapula_y")] += values_deg
    return motions_of(angles_deg)


def test_the_extent_is_the_largest_strength_from_the_mean_with_its_main_direction():
    """Check by hand: 0, 30 and 60 deg of protraction move AC by -6, 0, 6 mm backward and a tenth of that upward."""
    motions = of_one_angle([0.0, 30.0, 60.0])
    found = moved("ac_translation:posture", [0.0, 0.0, 0.0, 0.6, 0.0, 0.0, -6.0, 0.0, 0.0], motions)
    assert found.largest == pytest.approx(6.0 * np.hypot(1.0, 0.1))
    assert found.directions == pytest.approx({"back": -1.0 / 1.01})
    assert found.follows == "scapula_y"


def test_where_no_direction_has_half_of_the_squares_the_two_largest_are_named():
    motions = of_one_angle([0.0, 30.0, 60.0])
    found = moved("ac_translation:posture", [3.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.9, 0.0, 0.0], motions)
    assert list(found.directions) == ["along", "back"]


def test_over_elevation_a_movement_that_comes_back_follows_nothing_and_a_line_follows_the_arm():
    """Check a line, and a bend alone, whose sign is that of the posture with the largest strength."""
    motions = of_one_angle([0.0] * 7)
    line = moved("ac_translation", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0], motions)
    assert (line.follows, list(line.directions)) == (ELEVATION, ["back"])
    bend = moved("ac_translation", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0], motions)
    assert bend.follows == ""
    assert bend.directions["back"] == pytest.approx(-1.0)


def test_a_constant_is_as_large_in_every_posture():
    found = moved("scapula_landmark_bias", [3.0, 0.0, -4.0], of_one_angle([0.0, 30.0]))
    assert (found.largest, found.follows) == (pytest.approx(5.0), "")
    assert found.directions == pytest.approx({"about z": -0.64})
