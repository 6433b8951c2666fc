"""Landmark positions as a check of fits: constants against another solver, known gaps, and the marks of files."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command import girdle
from diagnoses import CHECKED, ONE, json_of
from oracles import bones
from scipy.spatial.transform import Rotation

from adapt import adapt_subjects
from adapt.api import simulated_positions
from adapt.diagnosis.position_findings import LEAST_MM, PositionTask, position_noise_mm
from adapt.evaluation.person_constants import constants_of, distances_mm, prior_of, root_mean_square_mm
from adapt.evaluation.position_check import (
    Judge,
    adapted_to_all,
    adapted_to_folds,
    as_they_are,
    in_folds,
    of_motions,
)
from adapt.report.position_figures import drawings
from adapt.solvers.rows import posture_rows
from models import load_model
from models.person.positions.landmark_positions import POSITIONS
from models.person.positions.measured_movement import POSITION_SD_MM
from motions import Motions, write_motions
from motions.landmarks.sampled_postures import ANGLES_FROM_LANDMARKS
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

MODEL = load_model("R2")
SUBJECTS = 2

SAME_MM = 1e-6
"""Tolerance between two solutions of 15 normal equations, whose priors span three powers of ten."""

CLOSE_MM = 0.5
"""The prior pulls constants of 5 mm by a few percent to the set's."""

OWN_MM = {
    "SC": (4.0, -3.0, 5.0),
    "AC": (6.0, 2.0, -2.0),
    "TS": (-5.0, 3.0, 2.0),
    "AI": (2.0, -6.0, 3.0),
    "AA": (-12.0, -18.0, 40.0),
}
"""Constants of every person: displacement from R2, and for AA its place."""


def rotations_of(motions: Motions) -> tuple[np.ndarray, np.ndarray]:
    """Compute R_C and R_S (postures, 3, 3), by SciPy."""
    clavicle, scapula = motions.angles_deg[:, :3], motions.angles_deg[:, 3:]
    found = (Rotation.from_euler("YZX", one, degrees=True).as_matrix() for one in (clavicle, scapula))
    return tuple(found)  # pyright: ignore[reportReturnType]


def places_by_hand(motions: Motions, own=OWN_MM) -> dict[str, np.ndarray]:
    """Compute positions (postures, 3) at the angles of the motions, for a girdle with displaced places."""
    R_C, R_S = rotations_of(motions)
    base, moved = bones(MODEL.girdle), {name: np.array(one) for name, one in own.items()}
    SC = np.tile(base.sc_mm + moved["SC"], (len(R_C), 1))
    AC = SC + R_C @ (base.ac_mm + moved["AC"])
    carried = {"TS": base.ts_mm + moved["TS"], "AI": base.ai_mm + moved["AI"], "AA": moved["AA"]}
    return {"SC": SC, "AC": AC, **{name: AC + R_S @ place for name, place in carried.items()}}


def closed(seed: int = 0) -> Motions:
    """Simulate postures that R2 takes exactly, in two kinds of motion."""
    motions = simulate_subjects(SUBJECTS, seed=seed)
    fitted = adapt_subjects(motions, MODEL, held_out=()).before["R2"]
    assert (fitted.status == "ok").all()
    return replace(motions, angles_deg=fitted.angles.T * DEG, landmarks_mm={})


@pytest.fixture(scope="module")
def measured() -> Motions:
    """Closed postures with the positions of persons who have constants of their own."""
    motions = closed()
    return replace(motions, landmarks_mm=places_by_hand(motions))


def of_landmarks(motions: Motions, *names: str) -> Motions:
    return replace(motions, landmarks_mm={name: motions.landmarks_mm[name] for name in names})


def base_of(motions: Motions):
    """Return the judge of these positions, and unadapted R2 at its fitted angles."""
    rows = posture_rows(motions)
    fitted = adapt_subjects(motions, MODEL, held_out=()).before["R2"]
    return Judge.of(MODEL, rows), as_they_are(MODEL, rows, fitted)


def by_stacked_rows(motions: Motions, subject: int) -> np.ndarray:
    """Compute one subject's constants by least squares on its whitened rows, stacked with those of the prior."""
    R_C, R_S = rotations_of(motions)
    nothing = places_by_hand(motions, dict.fromkeys(OWN_MM, (0.0, 0.0, 0.0)))
    prior = prior_of(MODEL, motions.subjects)[..., subject]
    rows, wanted = [np.linalg.inv(np.linalg.cholesky(prior))], [np.zeros(len(prior))]
    for posture in np.flatnonzero(motions.subject_number == subject):
        for k, name in enumerate(POSITIONS):
            place = motions.landmarks_mm.get(name, np.full((len(R_C), 3), np.nan))[posture]
            if np.isfinite(place).all():
                H = np.zeros((3, 15))
                H[:, :3] = np.eye(3)
                if k:
                    H[:, 3:6] = R_C[posture]
                if k > 1:
                    H[:, 3 * k : 3 * k + 3] = R_S[posture]
                rows.append(H / POSITION_SD_MM)
                wanted.append((place - nothing[name][posture]) / POSITION_SD_MM)
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(wanted), rcond=None)[0]


def with_holes(motions: Motions) -> Motions:
    """Remove a fifth of the cells of every landmark."""
    random = np.random.default_rng(1)
    holed = {
        name: np.where(random.random(len(place)) < 0.2, np.nan, place.T).T
        for name, place in motions.landmarks_mm.items()
    }
    return replace(motions, landmarks_mm=holed)


@pytest.mark.parametrize("names", [POSITIONS, ("SC", "AA"), ("AA",)], ids="+".join)
@pytest.mark.parametrize("holed", [False, True])
def test_constants_are_those_of_another_engine(measured, names, holed):
    motions = of_landmarks(with_holes(measured) if holed else measured, *names)
    judge, base = base_of(motions)
    found = constants_of(base, judge.measured_mm, judge.prior).mean_mm
    for subject in range(SUBJECTS):
        np.testing.assert_allclose(found[:, subject], by_stacked_rows(motions, subject), atol=SAME_MM)


def test_a_rigid_chain_with_constants_of_its_own_agrees(measured):
    judge, base = base_of(measured)
    assert judge.gap_mm(base) < CLOSE_MM
    found = judge.simulated_mm(base)
    for name, place in places_by_hand(measured).items():
        np.testing.assert_allclose(found[name], place.T, atol=3.0 * CLOSE_MM)
    assert judge.not_told(base) == ()


def test_a_landmark_off_in_one_posture_is_that_far_away(measured):
    """Check one landmark off by 20 mm: in N cells it leaves 20 / sqrt(N), less the part that the constants take up."""
    places = {name: place.copy() for name, place in measured.landmarks_mm.items()}
    places["TS"][3] += [0.0, 20.0, 0.0]
    judge, base = base_of(replace(measured, landmarks_mm=places))
    cells = len(POSITIONS) * len(measured.posture)
    assert judge.gap_mm(base) == pytest.approx(20.0 / np.sqrt(cells), rel=0.15)
    away = distances_mm(base, judge.measured_mm, judge.prior)
    assert int(np.argmax(away["TS"])) == 3
    assert root_mean_square_mm({"TS": np.array([3.0, 4.0, np.nan])}) == pytest.approx(np.sqrt(12.5))


def test_what_positions_cannot_tell_is_named(measured):
    judge, base = base_of(of_landmarks(measured, "AA"))
    assert {"SC", "AC"} <= set(judge.not_told(base))
    judge, base = base_of(of_landmarks(measured, "SC", "AC"))
    assert judge.not_told(base) == ()


def test_nobody_is_judged_without_positions(measured):
    judge, base = base_of(replace(measured, landmarks_mm={}))
    assert np.isnan(judge.gap_mm(base))
    assert set(judge.simulated_mm(base)) == set(POSITIONS)
    assert np.isnan(judge.simulated_mm(base)["AA"]).all()


def two_kinds(motions: Motions) -> Motions:
    """Assign every second posture of each subject to another kind of motion."""
    kinds = np.where(motions.posture % 2 == 0, "abduction", "flexion")
    return replace(motions, motion=kinds, posture=np.arange(len(kinds)))


def test_constants_of_held_out_motions_have_not_seen_them(measured):
    """Check AA at one place in the scapula in one motion and at another in the other.

    In sample, its constant is the mean place; held out, the place in the other motion, so that the distance doubles.
    """
    motions = two_kinds(of_landmarks(measured, "AA"))
    other = motions.motion == "flexion"
    _, R_S = rotations_of(motions)
    place = motions.landmarks_mm["AA"] + np.where(other, 4.0, -4.0)[:, None] * R_S[..., 0]
    motions = replace(motions, landmarks_mm={"AA": place})
    result = adapt_subjects(motions, MODEL)
    found = result.of("R2")
    judge, base = Judge.of(MODEL, found.rows), as_they_are(MODEL, found.rows, result.before["R2"])
    folds = of_motions(found.held_out).folds
    assert len(folds) == 2 * SUBJECTS
    in_sample, held_out = judge.gap_mm(base), judge.gap_mm(in_folds(base, folds), folds)
    assert in_sample == pytest.approx(4.0, rel=0.25)
    assert held_out == pytest.approx(8.0, rel=0.25)
    adapted = judge.gap_mm(adapted_to_folds(found.rows, of_motions(found.held_out)), folds)
    assert adapted == pytest.approx(held_out, rel=0.1)  # R2 takes these postures, so that adapting changes nothing
    for angles, gaps, fold in zip(found.held_out.angles, found.held_out.gaps_deg, found.held_out.folds, strict=True):
        np.testing.assert_allclose(np.abs(angles * DEG - motions.angles_deg[fold.tested].T), gaps, atol=1e-9)


def test_joints_that_are_put_in_as_measured_take_the_distance_away(measured):
    """Check SC that moves between postures: the adapted chain misses it, and with the measured movement meets it."""
    motions = of_landmarks(measured, "SC")
    place = motions.landmarks_mm["SC"] + 4.0 * np.random.default_rng(3).standard_normal((len(motions.posture), 3))
    motions = replace(motions, landmarks_mm={"SC": place})
    gaps = []
    for effects in ({}, {"sc_translation": "measured"}):
        found = adapt_subjects(motions, MODEL, held_out=(), effects=effects).of("R2")
        gaps.append(Judge.of(MODEL, found.rows).gap_mm(adapted_to_all(found)))
    assert gaps[0] == pytest.approx(4.0 * np.sqrt(3.0), rel=0.25)
    assert gaps[1] < CLOSE_MM


def test_the_noise_of_positions_is_what_no_smooth_path_has():
    motions = simulate_subjects(10, seed=2)
    count = len(motions.posture)
    noise = 2.0 * np.random.default_rng(0).standard_normal((count, 3))
    parabola = np.stack([motions.posture, 0.3 * motions.posture**2, np.ones(count)], axis=1)
    motions = replace(motions, landmarks_mm={"SC": parabola + noise})
    assert position_noise_mm(motions) == pytest.approx(2.0, rel=0.15)
    few = motions.select(motions.posture <= 3)
    assert np.isnan(position_noise_mm(few))


def test_places_that_never_change_have_the_least_noise():
    """Check a model's SC, equal in every posture to the last digit: noise of 0 would have no covariance."""
    motions = simulate_subjects(3, seed=2)
    still = replace(motions, landmarks_mm={"SC": np.tile([25.0, 5.0, -10.0], (len(motions.posture), 1))})
    assert position_noise_mm(still) == LEAST_MM


def test_what_the_search_sees_of_positions(measured):
    assert PositionTask.of(measured, "use", None).seen.landmarks_mm
    for way in ("check", "ignore"):
        assert not PositionTask.of(measured, way, None).seen.landmarks_mm
    assert PositionTask.of(measured, "check", None).motions.landmarks_mm
    assert not PositionTask.of(measured, "ignore", None).motions.landmarks_mm


def test_angles_of_the_same_landmarks_are_said_to_be():
    motions = closed()
    motions = replace(motions, landmarks_mm=places_by_hand(motions))
    marked = replace(motions, extra=pd.DataFrame({ANGLES_FROM_LANDMARKS: ["yes"] * len(motions.posture)}))
    assert "computed from these landmarks" in PositionTask.of(marked, "use", None).note
    assert PositionTask.of(marked, "check", None).note == PositionTask.of(motions, "use", None).note == ""


def test_the_json_has_the_contract():
    found, nothing = json_of(CHECKED)["positions"], json_of(ONE)["positions"]
    assert found["used"] is False
    assert found["noise_mm"] == 0.3
    assert found["gap_mm"]["other_motion"] == {"base": 4.8, "adapted": 3.2, "with_causes": 6.1}
    states = dict.fromkeys(("base", "adapted", "with_causes"))
    assert nothing["gap_mm"] == dict.fromkeys(("in_sample", "other_motion", "other_person"), states)


def test_paths_are_drawn_of_what_was_measured():
    drawn = drawings(CHECKED)
    assert list(drawn) == list(CHECKED.positions.motions.subjects[:3])
    first = next(iter(drawn.values()))
    assert [one.title for one in first] == ["SC, lateral", "SC, up", "SC, backward", "SC, distance"]
    assert (first[0].low_mm, first[0].high_mm) == (0.0, 1.0)
    assert first[3].high_mm == pytest.approx(np.sqrt(3.0))
    assert list(first[0].lines) == ["base", "adapted", "with_causes"]
    assert drawings(ONE) == {}


@pytest.mark.parametrize("chunk", [1, 2])
def test_adapt_writes_where_landmarks_are_of_whom_some_were_measured(measured, tmp_path, chunk):
    """Check three subjects, one without positions: the file is the same for every chunk, and as from Python."""
    lone = replace(simulate_subjects(3, seed=5), landmarks_mm={})
    lone = lone.select(lone.subject == lone.subjects[2])
    motions, file, out = Motions.concatenate([measured, lone]), tmp_path / "motions.csv", tmp_path / "out"
    write_motions(motions, file)
    ended = girdle("adapt", file, "--model", "R2", "--chunk", chunk, "--out", out)
    assert ended.status == 0, ended.err
    found = pd.read_csv(out / "positions.csv")
    assert set(found["subject"]) == set(measured.subjects)
    assert list(found["state"].unique()) == ["base", "adapted"]
    expected = simulated_positions(adapt_subjects(motions, MODEL, held_out=()), motions, MODEL)
    expected = expected[expected["subject"].isin(measured.subjects)]
    order = ["state", "subject", "motion", "posture"]
    one, other = (table.set_index(order).sort_index() for table in (found, expected))
    pd.testing.assert_frame_equal(one, other, check_exact=False, atol=1e-6)
    np.testing.assert_allclose(
        found.loc[found["state"] == "base", "AA_y_measured_mm"], measured.landmarks_mm["AA"][:, 1], atol=1e-9
    )

    write_motions(lone, file)
    assert girdle("adapt", file, "--model", "R2", "--out", out).status == 0
    assert not (out / "positions.csv").exists()
