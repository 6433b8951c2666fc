"""The first simulated world: closed chains, files without a hint of the effect, and effects that are visible."""

import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from scripts.research.named_causes.synthetic_a import (
    LABELS,
    World,
    catalogue,
    chain,
    conventions,
    courses,
    make_world,
    rotations,
    subjects,
    thorax,
)
from scripts.research.named_causes.synthetic_a.__main__ import main
from scripts.research.named_causes.synthetic_a.catalogue import EFFECTS
from scripts.research.named_causes.synthetic_a.conventions import ANGLES

MODELS = Path(__file__).parents[3] / "models" / "sets"
R2 = MODELS / "R2.toml"
COLUMNS = ["subject", "motion", "posture", "humerus_elevation_deg", *ANGLES]
VISIBLE_MM = 0.3
"""Least mean change of the most changed of A1-A3: a tenth of the change of A1 and A2 by noise of 1.5 deg."""
PAIRS = ("ac_translation+skin_artefact", "conoid_strain+outside_step")
MADE_OF_ANGLES = ("scapula_landmark_bias", "clavicle_axial_estimate", "skin_artefact", "thorax_extension")


@cache
def clean(label: str, size: float = 1.0, seed: int = 5) -> World:
    """Make a world without noise."""
    return make_world(label, R2, noise_deg=0.0, size=size, seed=seed)


def directions(n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw unit vectors (n, 3)."""
    v = rng.standard_normal((n, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


@pytest.mark.parametrize("label", [*LABELS, *PAIRS])
def test_every_label_makes_closed_chains_and_finite_data(label: str) -> None:
    world = clean(label)
    assert np.max(np.abs(world.closure_mm)) < chain.CLOSED_MM
    assert len(world.table) == 140
    assert np.isfinite(world.table[["humerus_elevation_deg", *ANGLES]].to_numpy()).all()
    assert world.truth["labels"] == ([] if label == "none" else label.split("+"))


@pytest.mark.parametrize("label", [*LABELS, *PAIRS])
def test_every_effect_opens_the_chain_that_knows_nothing_of_it(label: str) -> None:
    change = np.mean(np.abs(clean(label).gap_mm), axis=0)
    print(f"{label}: mean |A1|, |A2|, |A3| at the measured angles {np.round(change, 2)} mm")
    if label == "none":
        assert np.max(change) < chain.CLOSED_MM
    else:
        assert np.max(change) > VISIBLE_MM


@pytest.mark.parametrize("label", [*EFFECTS, *PAIRS])
def test_an_effect_of_size_zero_is_none(label: str) -> None:
    np.testing.assert_allclose(clean(label, size=0.0).clean_deg, clean("none").clean_deg, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("label", EFFECTS)
def test_size_scales_the_amplitudes_and_nothing_else(label: str) -> None:
    one, half = (clean(label, size).truth["effects"][label] for size in (1.0, 0.5))
    assert half["parameters"] == one["parameters"]
    for subject, amplitude in one["amplitude"].items():
        assert half["amplitude"][subject] == pytest.approx(0.5 * amplitude)


@pytest.mark.parametrize("label", EFFECTS)
def test_effects_of_the_measurement_leave_the_bones_alone(label: str) -> None:
    world = clean(label)
    moved = np.max(np.abs(world.clean_deg - world.true_deg))
    if label in MADE_OF_ANGLES or (label.startswith("outside_") and label != "outside_breathing"):
        np.testing.assert_allclose(world.true_deg, clean("none").true_deg, rtol=0.0, atol=1e-9)
        assert moved > 2.0
    else:
        assert moved < 1e-12


@pytest.mark.parametrize("label", ["none", "skin_artefact", "ac_translation+thorax_tilt"])
def test_a_seed_makes_one_world(label: str) -> None:
    first, again, other = (make_world(label, R2, subjects=3, seed=seed, landmarks=True) for seed in (7, 7, 8))
    pd.testing.assert_frame_equal(first.table, again.table, check_exact=True)
    assert first.truth == again.truth
    assert not np.allclose(first.table[list(ANGLES)], other.table[list(ANGLES)])


def test_the_table_has_the_columns_of_a_motion_file_and_no_hint() -> None:
    bare, marked = (make_world("thorax_tilt", R2, subjects=2, landmarks=marks).table for marks in (False, True))
    assert list(bare.columns) == COLUMNS
    marks = [f"{point}_{axis}_mm" for point in ("SC", "AC", "TS", "AI") for axis in "xyz"]
    assert list(marked.columns) == COLUMNS + marks
    pd.testing.assert_frame_equal(bare, marked.filter(items=COLUMNS))
    none = make_world("none", R2, subjects=2).table
    pd.testing.assert_frame_equal(bare.filter(items=COLUMNS[:4]), none.filter(items=COLUMNS[:4]))
    assert bare["subject"].str.startswith("simulated").all()


def test_the_noise_has_the_level_asked_for() -> None:
    noisy = make_world("none", R2, subjects=40, noise_deg=1.5, seed=2, landmarks=True)
    noise = noisy.table[list(ANGLES)].to_numpy() - noisy.clean_deg
    # of 3360 numbers the SD has a relative error of 1.2 %, the mean one of 1.7 % of the SD
    assert np.std(noise) == pytest.approx(1.5, rel=0.06)
    assert abs(np.mean(noise)) < 0.12
    length = np.linalg.norm(_point(noisy, "AC") - _point(noisy, "SC"), axis=1)
    # only the noise along the clavicle changes its length: sqrt(2) of 2 mm
    assert np.std(length) == pytest.approx(2.0 * np.sqrt(2.0), rel=0.15)
    assert np.mean(length) == pytest.approx(158.0, abs=0.6)


def _point(world: World, name: str) -> np.ndarray:
    return world.table[[f"{name}_{axis}_mm" for axis in "xyz"]].to_numpy()


def test_signs_are_common_unless_they_are_mixed() -> None:
    for name, effect in EFFECTS.items():
        for mixed in (False, True):
            world = make_world(name, R2, noise_deg=0.0, seed=4, mixed_sign=mixed, elevations=(0.0, 90.0))
            signs = {np.sign(a) for a in world.truth["effects"][name]["amplitude"].values()}
            assert (len(signs) == 2) == (mixed and effect.sign != "one-sided"), name


@pytest.mark.parametrize("name", courses.COURSES)
def test_courses_start_at_zero_reach_one_and_are_no_line(name: str) -> None:
    ranges, course = courses.COURSES[name]
    x = np.linspace(0.0, 1.0, 31)
    for end in (0, 1):
        f = course(x, np.array([np.full(31, r[end]) for r in ranges]))
        assert f[0] == pytest.approx(0.0, abs=1e-12)
        assert f[-1] == pytest.approx(1.0)
        assert np.max(np.abs(f - x)) > 0.05


def test_rotations_are_those_of_another_author() -> None:
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    q = np.random.default_rng(0).uniform(-1.4, 1.4, (50, 3))
    R = rotations.rotation_from_cardan(q)
    np.testing.assert_allclose(R, rotation.from_euler("YZX", q).as_matrix(), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(rotations.cardan_from_rotation(R), q, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(
        rotations.rotation_from_vector(q), rotation.from_rotvec(q).as_matrix(), rtol=0.0, atol=1e-14
    )
    R = rotations.rotation_from_vector(q)
    np.testing.assert_allclose(rotations.vector_from_rotation(R), q, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("exponent", [1.6, 2.0, 2.3, 2.6])
def test_a_foot_lies_on_the_surface_below_its_point(exponent: float) -> None:
    rng = np.random.default_rng(1)
    semi = np.tile([153.0, 404.0, 130.0], (300, 1))
    p = np.full(300, exponent)
    v = directions(300, rng)
    point = v / np.linalg.norm(v / semi, axis=-1, keepdims=True) * rng.uniform(0.9, 1.3, (300, 1))
    distance, normal = thorax.surface_distance(point, semi, p)
    foot = point - distance[:, None] * normal
    np.testing.assert_allclose(np.sum(np.abs(foot / semi) ** exponent, axis=-1), 1.0, rtol=0.0, atol=1e-10)
    # no other point of the surface is nearer
    other = foot + 5.0 * directions(300, rng)
    other /= np.sum(np.abs(other / semi) ** exponent, axis=-1, keepdims=True) ** (1.0 / exponent)
    assert np.all(np.linalg.norm(other - point, axis=-1) >= np.abs(distance) - 1e-9)


def test_the_superquadric_of_exponent_two_is_the_ellipsoid() -> None:
    rng = np.random.default_rng(2)
    semi = np.tile([139.1, 198.2, 85.4], (200, 1))
    point = semi * directions(200, rng) * rng.uniform(0.9, 1.5, (200, 1))
    two = thorax.superquadric_foot(point, semi, np.full(200, 2.0))
    np.testing.assert_allclose(two, thorax.ellipsoid_foot(point, semi), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("shape", ["none", "thorax_shape", "ac_translation"])
def test_the_slope_of_the_gap_is_its_difference_quotient(shape: str) -> None:
    postures = subjects.lay_out(2, ("abduction",), (0.0, 60.0, 120.0))
    _, closed = chain.read_chain(R2, 6)
    for name in catalogue.effects_of(shape):
        closed = catalogue.draw_effect(name, postures, 1.0, 0, False)[0].chain(closed)
    one = subjects.lay_out(1, ("abduction",), (0.0, 60.0, 120.0))
    q = np.tile(subjects.rhythm_deg(subjects.draw_subject(0, 0, 0), one) * conventions.DEG, (2, 1))
    _, slope = closed.gap(q)
    for k, e in enumerate(1e-5 * np.eye(6)):
        quotient = (closed.gap(q + e)[0] - closed.gap(q - e)[0]) / 2e-5
        np.testing.assert_allclose(slope[:, :, k], quotient, rtol=0.0, atol=1e-4)


def test_subjects_differ_as_they_were_drawn() -> None:
    people = make_world("none", R2, subjects=60, seed=3).truth["subjects"].values()
    spread = np.std([[p[k] for k in conventions.PARAMETERS] for p in people], axis=0)
    sd_mm, size_sd = subjects.draw_people(3)
    drawn = np.hypot(sd_mm, size_sd * subjects.THORAX_MM)
    # 60 subjects; subjects whose chains do not close are drawn again
    assert np.all(spread > 0.5 * drawn)
    assert np.all(spread < 1.4 * drawn)


def test_the_people_of_each_world_differ_in_their_own_way() -> None:
    worlds = np.array([np.append(*subjects.draw_people(seed)) for seed in range(200)])
    for sd, least, most in zip(
        worlds.T, [*subjects.PARAMETER_SD_MM / 2.0, 0.0], [*subjects.PARAMETER_SD_MM * 2.0, 0.05], strict=True
    ):
        assert least <= sd.min() < least + 0.1 * most
        assert 0.9 * most < sd.max() <= most


def test_true_postures_follow_each_other_smoothly() -> None:
    world = clean("none")
    frame = world.table[["subject", "motion"]].assign(row=np.arange(len(world.table)))
    for _, rows in frame.groupby(["subject", "motion"])["row"]:
        for before, after in pairwise(rows):
            assert np.max(np.abs(world.true_deg[after] - world.true_deg[before])) < 25.0


def test_wrong_requests_say_what_there_is() -> None:
    with pytest.raises(ValueError, match=r"no effect is called 'flat_feet'\. Take one of none, scapulothoracic_gap"):
        make_world("flat_feet", R2)
    with pytest.raises(ValueError, match="no motion is called 'waving'"):
        make_world("none", R2, motions=("waving",))


def test_the_command_writes_a_motion_file_and_the_truth_apart(tmp_path: Path) -> None:
    out, truth = tmp_path / "a.csv", tmp_path / "a.json"
    arguments = ["conoid_strain+sc_translation", "--model", str(R2), "--out", str(out), "--truth", str(truth)]
    main([*arguments, "--subjects", "2", "--seed", "3", "--size", "0.5", "--mixed-sign"])
    written = pd.read_csv(out)
    world = make_world("conoid_strain+sc_translation", R2, subjects=2, seed=3, size=0.5, mixed_sign=True)
    assert list(written.columns) == COLUMNS
    np.testing.assert_allclose(written[list(ANGLES)], world.table[list(ANGLES)], rtol=0.0, atol=6e-5)
    told = json.loads(truth.read_text(encoding="utf-8"))
    assert told["origin"] == "simulated"
    assert set(told["effects"]) == {"conoid_strain", "sc_translation"}
    assert told["effects"]["sc_translation"]["unit"] == "mm"
    assert "conoid" not in out.read_text(encoding="utf-8")
