"""Measured movement of SC and AC: by hand, and as input to a chain whose joints moved so."""

from dataclasses import replace

import numpy as np
import pytest
from command import SHIPPED, girdle, refused

from adapt import fit_postures
from adapt.solvers.posture_fits import fit_batch
from models import load_model
from models.effects import EFFECTS, ActiveEffects
from models.effects.amplitudes import Amplitudes, active_effects, as_option, described, read_amplitudes
from models.person.positions.landmark_positions import bone_poses, positions_mm
from models.person.positions.measured_movement import measured_movement_mm
from motions import InputError, Motions
from motions.errors import InputWarning
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

MODEL = load_model("R2")
JOINTS = ("sc_translation", "ac_translation")
AS_MEASURED: Amplitudes = dict.fromkeys(JOINTS, "measured")
AA_MM = np.array([-12.0, -18.0, 40.0])[:, None]

SAME_MM = 1e-9

SAME_DEG = 1e-6
"""Tolerance for angles of one posture by two fits."""

MOVED_DEG = 0.2
"""A joint that moves by 3 mm turns the girdle by more than this."""

OF_CONSTANTS = np.sqrt(6.0 / 42.0)
"""Share of a random movement that six constants, fitted to 14 postures of three numbers, take up."""


def moved(seed: int = 0) -> tuple[Motions, dict[str, np.ndarray]]:
    """Simulate two subjects of R2 with moving SC and AC and exact angles and positions; return the movements too."""
    still = simulate_subjects(2, seed=seed)
    count = len(still.posture)
    random = np.random.default_rng(seed)
    movement = {name: 3.0 * random.standard_normal((3, count)) for name in JOINTS}
    effects = ActiveEffects(tuple(movement[e.name] for e in active()), active())
    chain = effects.on(MODEL.girdle.repeated(count))
    fitted = fit_batch(chain, still.angles_deg.T / DEG, np.ones((6, count), bool))
    assert fitted.converged.all()
    places = positions_mm(bone_poses(chain, fitted.angles), {"AA": AA_MM})
    angles_deg = fitted.angles.T * DEG
    landmarks = {name: place.T for name, place in places.items()}
    return replace(still, angles_deg=angles_deg, landmarks_mm=landmarks), movement


def active():
    return tuple(EFFECTS[name] for name in EFFECTS if name in JOINTS)


def only(motions: Motions, *names: str) -> Motions:
    return replace(motions, landmarks_mm={name: motions.landmarks_mm[name] for name in names})


def about_mean(motions: Motions, values: np.ndarray) -> np.ndarray:
    """Subtract the mean over the postures of each subject."""
    found = values.copy()
    for rows in motions.rows_by_subject():
        found[:, rows] -= values[:, rows].mean(axis=1, keepdims=True)
    return found


@pytest.mark.parametrize("name", JOINTS)
def test_the_movement_that_positions_show(name):
    motions, movement = moved()
    np.testing.assert_allclose(measured_movement_mm(name, motions), about_mean(motions, movement[name]), atol=SAME_MM)


def test_ac_is_found_from_aa():
    """Check AC from AA, less the part that six constants take up: AA in the scapula, and AC in the clavicle."""
    motions, movement = moved()
    found = measured_movement_mm("ac_translation", only(motions, "SC", "AA"))
    true = about_mean(motions, movement["ac_translation"])
    wrong = found - true
    assert np.sqrt(np.mean(wrong**2)) == pytest.approx(3.0 * OF_CONSTANTS, rel=0.2)
    assert np.corrcoef(found.ravel(), true.ravel())[0, 1] > 0.85  # sqrt(36 / 42) = 0.93 is expected


def test_put_in_as_measured_the_chain_follows_exactly():
    """Check a chain with the measured movement; its mean over the postures goes into the girdle first."""
    motions, movement = moved()
    mean = {name: (movement[name] - about_mean(motions, movement[name]))[:, :1] for name in JOINTS}
    one = motions.select(motions.subject == motions.subjects[0])
    girdle = replace(
        MODEL.girdle,
        sc_mm=MODEL.girdle.sc_mm + mean["sc_translation"][:, 0],
        ac_mm=MODEL.girdle.ac_mm + mean["ac_translation"][:, 0],
    )
    model = replace(MODEL, girdle=girdle)
    fitted = fit_postures(one, model, effects=AS_MEASURED).by_model["R2"]
    np.testing.assert_allclose(fitted.angles.T * DEG, one.angles_deg, atol=SAME_DEG)
    without = fit_postures(one, model).by_model["R2"]
    assert np.abs(without.angles.T * DEG - one.angles_deg).mean() > MOVED_DEG


def test_where_it_was_not_measured_the_joint_does_not_move():
    motions, _ = moved()
    place = motions.landmarks_mm["SC"].copy()
    place[3, 1] = np.nan
    holed = replace(motions, landmarks_mm={"SC": place})
    found = measured_movement_mm("sc_translation", holed)
    assert not found[:, 3].any()
    known = np.arange(len(place)) != 3
    for rows in motions.rows_by_subject():
        np.testing.assert_allclose(found[:, rows[known[rows]]].mean(axis=1), 0.0, atol=SAME_MM)
    with pytest.warns(InputWarning, match=f"sc_translation: SC not measured in 1 of {len(place)} postures"):
        fit_postures(holed, MODEL, effects={"sc_translation": "measured"})


@pytest.mark.parametrize("name", JOINTS)
def test_without_positions_it_is_refused(name):
    with pytest.raises(InputError, match=f"{name}=measured needs positions of SC.*Add the columns SC_x_mm"):
        active_effects({name: "measured"}, simulate_subjects(1, seed=0))


@pytest.mark.parametrize(
    ("amplitudes", "message"),
    [
        ({"conoid_strain": "measured"}, "conoid_strain has no movement 'measured'.*sc_translation and ac_translation"),
        ({"sc_translation": "seen"}, "sc_translation has no movement 'seen'"),
    ],
)
def test_other_words_are_refused(amplitudes, message):
    with pytest.raises(InputError, match=message):
        active_effects(amplitudes, moved()[0])


def test_words_of_the_command_line():
    words = [f"{name}=measured" for name in JOINTS]
    assert read_amplitudes(words) == AS_MEASURED
    assert [as_option(name, "measured") for name in JOINTS] == words
    assert described(AS_MEASURED) == "sc_translation as measured, ac_translation as measured"
    with pytest.raises(
        InputError, match="Give sc_translation=0,0,0 with numbers of your own, or sc_translation=measured"
    ):
        read_amplitudes(["sc_translation=measure"])


def test_the_command_refuses_a_file_without_positions(tmp_path):
    ended = girdle("adapt", SHIPPED, "--effect", "ac_translation=measured", "--out", tmp_path / "out")
    cause = "ac_translation=measured needs positions of SC, and AC or AA"
    refused(ended, "--effect", cause, "Add the columns SC_x_mm")
