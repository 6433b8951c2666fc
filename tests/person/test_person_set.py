"""Parameter set of a person: from a known girdle's landmarks, from Table 4.2 (shipped sets), with noise, faults."""

from dataclasses import fields, replace

import numpy as np
import pytest

from models import load_model
from models.adapted_parameters import PERSON_SD_MM
from models.effects import EFFECTS
from models.effects.set_numbers import doubtful_numbers, with_sizes_of
from models.export.toml import parameters_toml
from models.girdle import Girdle, constraint_residuals_mm
from models.parameter_sets import parameter_document, parameter_set
from models.person.attachments import scapular_map, with_carried_conoid
from models.person.person_set import person_set
from models.person.sizes import PALPATOR_LENGTH_MM, PALPATOR_MM
from models.person.thorax_ellipsoid import thorax_sd_mm
from motions.landmarks.frames import clavicle_frame, scapula_frame
from motions.rhythm import REST_DEG
from motions.rotations import DEG, cardan_from_rotation
from scripts.research.person.simulated_persons import sized
from tests.helpers.laboratory import on_constraints, simulated_trial, trial_of
from tests.helpers.thesis_tables import DISSECTION, MRI

PRINTED_MM = 1e-6
"""Rounding of the decimals in a shipped set."""

PRINTED_TWICE_MM = 5e-6
"""Tolerance for const1 and const2, from printed angles: half of 1e-6 degrees at 190 mm is 1.7e-6 mm."""

CADAVERS = {"breteler_dissection": DISSECTION, "breteler_mri": MRI}


def positions(points: dict, names=("SC", "AC", "TS", "AI")) -> dict[str, np.ndarray]:
    return {name: np.array(points[name])[:, None] for name in names}


@pytest.mark.parametrize("name", CADAVERS)
def test_table_4_2_gives_the_shipped_set(name):
    """Check a set from Table 4.2 and points of Table 4.5's ellipsoid, with the conoid carried from the same bone."""
    shipped = load_model(name)
    built = person_set(positions(CADAVERS[name]), load_model("R2"), 0, ("1",), {}, shipped.points_mm)
    own = person_set(positions(CADAVERS[name]), shipped, 0, ("1",), {})
    for field in ("centre_mm", "semi_axes_mm"):
        np.testing.assert_allclose(getattr(built.girdle, field), getattr(shipped.girdle, field), atol=PRINTED_MM)
    for found in (built.girdle, own.girdle):
        for field in ("sc_mm", "ac_mm", "ts_mm", "ai_mm"):
            np.testing.assert_allclose(getattr(found, field), getattr(shipped.girdle, field), atol=PRINTED_MM)
        for field in ("ts_distance_mm", "ai_distance_mm"):
            np.testing.assert_allclose(getattr(found, field), getattr(shipped.girdle, field), atol=PRINTED_TWICE_MM)
    for field in ("clavicle_conoid_mm", "scapula_conoid_mm", "conoid_length_mm"):
        np.testing.assert_allclose(getattr(own.girdle, field), getattr(shipped.girdle, field), atol=PRINTED_MM)


def trial_landmarks(girdle: Girdle, seed: int | None = None, postures: int = 8) -> dict[str, np.ndarray]:
    elevation = np.linspace(0.0, 120.0, postures)
    start = simulated_trial(elevation).angles_deg.T / float(DEG)
    start[:, 0] = REST_DEG / DEG
    at = trial_of(girdle, on_constraints(girdle, start), elevation, 0.0).thorax_mm
    found = {name: np.array(at[name]) for name in ("SC", "AC", "TS", "AI")}
    if seed is not None:
        rng = np.random.default_rng(seed)
        found = {name: p + PALPATOR_MM * rng.standard_normal(p.shape) for name, p in found.items()}
    return found


def person(clavicle: float, scapula: float) -> Girdle:
    many = sized(load_model("R2").girdle, np.array([clavicle]), np.array([scapula]))
    return Girdle(**{field.name: np.asarray(getattr(many, field.name))[..., 0] for field in fields(Girdle)})


NAMES = tuple("12345678")

ROUND_TRIP_MM = 1e-6


@pytest.mark.parametrize("sizes", [(1.0, 1.0), (1.1, 1.1), (0.95, 1.05)])
def test_landmarks_of_a_girdle_give_it_back(sizes):
    truth = person(*sizes)
    built = person_set(trial_landmarks(truth), load_model("R2"), 0, NAMES, {})
    for field in fields(Girdle):
        np.testing.assert_allclose(
            getattr(built.girdle, field.name), getattr(truth, field.name), atol=ROUND_TRIP_MM, err_msg=field.name
        )
    assert not built.notes


def test_noise_moves_the_lengths_as_their_spreads_say():
    truth, z = person(0.95, 1.05), []
    for seed in range(40):
        built = person_set(trial_landmarks(truth, seed), load_model("R2"), 0, NAMES, {})
        for pair, true in ((("SC", "AC"), truth.ac_mm[0]), (("AC", "TS"), -truth.ts_mm[0])):
            size = built.sizes[pair]
            sd_of_median_mm = 1.2533 * size.spread_mm / np.sqrt(8.0)
            z.append((size.value_mm - float(true)) / sd_of_median_mm)
            assert size.sd_mm == max(sd_of_median_mm, PALPATOR_LENGTH_MM)
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.5  # 80 values of SD 1; each SD from 8 postures has an error


def test_a_landmark_palpated_wrong_alike_in_every_posture_is_within_its_sd():
    """Check errors without any spread, as of markers placed beside AC and TS once, along the line between them."""
    truth, z = person(0.95, 1.05), []
    for seed in range(40):
        landmarks, rng = trial_landmarks(truth), np.random.default_rng(seed)
        along = (landmarks["TS"] - landmarks["AC"]) / -float(truth.ts_mm[0])
        for name in ("AC", "TS"):
            landmarks[name] = landmarks[name] + PALPATOR_MM * rng.standard_normal() * along
        size = person_set(landmarks, load_model("R2"), 0, NAMES, {}).sizes["AC", "TS"]
        z.append((size.value_mm + float(truth.ts_mm[0])) / size.sd_mm)
        assert size.spread_mm < ROUND_TRIP_MM
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.3  # 40 values of SD 1: within 2.7 standard errors


def test_the_chain_closes_at_rest_with_measured_angles():
    """Check A1 and A2 in the posture at rest, and A3 for some axial rotation of the clavicle."""
    landmarks = trial_landmarks(person(0.95, 1.05), seed=3)
    girdle = person_set(landmarks, load_model("R2"), 0, NAMES, {}).girdle
    axial = np.linspace(-90.0, 90.0, 721)
    AC, TS, AI = (landmarks[name][:, 0] for name in ("AC", "TS", "AI"))
    y, z, _ = np.asarray(cardan_from_rotation(clavicle_frame(np.asarray(girdle.sc_mm), AC, np.array([0.0, 1.0, 0.0]))))
    scapula = np.asarray(cardan_from_rotation(scapula_frame(AC, TS, AI)))
    angles = np.stack([np.full(721, y), np.full(721, z), axial / DEG, *(np.full(721, s) for s in scapula)])
    residuals = np.asarray(constraint_residuals_mm(girdle.repeated(721), angles))
    np.testing.assert_allclose(residuals[:2], 0.0, atol=1e-9)
    assert np.abs(residuals[2]).min() < 0.2  # mm, on a grid of a quarter of a degree


def test_a_bone_carried_to_itself_is_unchanged():
    girdle = load_model("R4").girdle
    np.testing.assert_allclose(
        scapular_map(girdle.ts_mm, girdle.ai_mm, girdle.ts_mm, girdle.ai_mm), np.eye(3), atol=1e-12
    )
    larger = with_carried_conoid(person(1.2, 1.2), load_model("R2").girdle)
    np.testing.assert_allclose(larger.scapula_conoid_mm, 1.2 * load_model("R2").girdle.scapula_conoid_mm, atol=1e-9)


def test_the_file_is_what_model_takes_and_says_what_is_measured():
    built = person_set(trial_landmarks(person(0.95, 1.05), 1), load_model("R2"), 0, NAMES, {})
    text = parameters_toml("P01", "a person", built.girdle, built.points_mm, built.source)
    found = parameter_set(parameter_document(text, "P01.toml"), "P01.toml")
    assert found.source["clavicle.length_mm"].startswith("measured: median |AC-SC| over 8 postures, spread")
    assert set(doubtful_numbers(found)) == {
        "clavicle_conoid_offset",
        "scapula_conoid_offset",
        "ts_distance_offset",
        "ai_distance_offset",
    }
    assert doubtful_numbers(found)["ts_distance_offset"].prior.scale == (15.0,)
    left = [effect.name for effect in with_sizes_of(found, EFFECTS.values())]
    assert set(EFFECTS) - set(left) == {"clavicle_length", "scapula_size"}


def test_a_size_with_a_stand_in_is_not_measured_and_narrows_the_effect():
    built = person_set(
        trial_landmarks(person(0.95, 1.05), 1),
        load_model("R2"),
        0,
        NAMES,
        {"SC": "from IJ by a stated offset +- 10 mm"},
    )
    assert built.source["clavicle.sc_mm"].endswith("SC from IJ by a stated offset +- 10 mm; +-10.0 mm")
    R2 = load_model("R2")
    found = replace(R2, girdle=built.girdle, source=built.source)
    effects = {effect.name: effect for effect in with_sizes_of(found, EFFECTS.values())}
    assert "scapula_size" not in effects
    assert effects["clavicle_length"].prior.scale[0] == pytest.approx(1000.0 / float(built.girdle.ac_mm[0]))
    assert [effect.name for effect in with_sizes_of(R2, EFFECTS.values())] == list(EFFECTS)


def test_a_slipped_posture_does_not_enter_the_lengths():
    landmarks = trial_landmarks(person(1.0, 1.0))
    along = landmarks["TS"][:, 5] - landmarks["AI"][:, 5]
    landmarks["TS"][:, 5] += 12.0 * along / np.linalg.norm(along)
    built = person_set(landmarks, load_model("R2"), 0, NAMES, {})
    assert "TS slipped by 12 mm in posture 6: left out of the lengths" in built.notes
    assert built.sizes["AC", "TS"].postures == 7


def test_one_posture_is_enough_and_says_what_it_cannot_tell():
    landmarks = {name: p[:, :1] for name, p in trial_landmarks(person(1.1, 1.1)).items()}
    built = person_set(landmarks, load_model("R2"), 0, ("1",), {})
    assert float(built.girdle.ac_mm[0]) == pytest.approx(1.1 * 158.0)
    assert any("fewer than 4 whole postures" in note for note in built.notes)


def test_a_conoid_that_cannot_close_is_as_long_as_it_must_be():
    """Check a generic ligament of 200 mm, longer than the attachments can ever be apart."""
    R2 = load_model("R2")
    long = replace(R2, girdle=replace(R2.girdle, conoid_length_mm=np.asarray(200.0)))
    built = person_set(trial_landmarks(person(1.0, 1.0)), long, 0, NAMES, {})
    assert any("the conoid of 200.0 mm does not close the chain at rest" in note for note in built.notes)
    assert float(built.girdle.conoid_length_mm) < 100.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p | {"TS": np.where(np.arange(8) == 0, np.nan, p["TS"])}, "TS were not measured in posture '1'"),
        (lambda p: p | {"AI": 2.0 * p["TS"] - p["AC"]}, "on a line"),
    ],
)
def test_what_is_no_person(change, said):
    with pytest.raises(ValueError, match=said):
        person_set(change(trial_landmarks(person(1.0, 1.0))), load_model("R2"), 0, NAMES, {})


def test_thorax_points_in_front_of_ij_are_in_another_frame():
    """Check thorax points with z reversed, as in a left-handed frame."""
    mirrored = np.asarray(load_model("breteler_dissection").points_mm) * np.array([[1.0], [1.0], [-1.0]])
    with pytest.raises(ValueError, match="in front of IJ: its points are not in the frame of the landmarks"):
        person_set(trial_landmarks(person(1.0, 1.0)), load_model("R2"), 0, NAMES, {}, mirrored)


def test_trust_knows_how_well_the_persons_own_points_fix_the_thorax():
    points = load_model("breteler_dissection").points_mm
    noisy = points + 2.0 * np.random.default_rng(0).standard_normal(points.shape)
    built = person_set(trial_landmarks(person(1.0, 1.0)), load_model("breteler_dissection"), 0, NAMES, {}, noisy)
    assert built.thorax is not None
    own = replace(load_model("R2"), girdle=built.girdle, points_mm=built.points_mm, source=built.source)
    sd = thorax_sd_mm(own)
    assert sd[2] == pytest.approx(min(PERSON_SD_MM[2], built.thorax.fit.sd[2:].max()), abs=0.05)  # printed to 0.1 mm
    assert (sd <= PERSON_SD_MM).all()
    np.testing.assert_array_equal(thorax_sd_mm(load_model("R2")), PERSON_SD_MM)
