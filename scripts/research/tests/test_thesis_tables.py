"""The scores against hand computation, and each choice of the study against its description."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles import ellipsoid_distance
from typer.testing import CliRunner

from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.problems import problems_of
from adapt.solvers.rows import posture_rows
from adapt.trust.thesis import printed
from models import load_model
from models.girdle import landmarks
from motions import Motions, read_motions
from motions.landmarks.girdle_angles import CLAVICLE_X
from motions.motion_csv.writing import write_motions
from scripts.research.thesis import scores, study_objective
from scripts.research.thesis.outcomes import ABDUCTION, FLEXION, Outcome, Study, outcomes, prepare
from scripts.research.thesis.variants import (
    AXIAL,
    BOUNDS,
    LEFT_OUT,
    POINTS,
    Variant,
    azimuth_deg,
    on_sides,
    with_bounds,
    with_points,
)
from scripts.rooms import ROOT

SAME = 1e-12


@pytest.fixture(scope="module")
def motions() -> Motions:
    """Return three shipped (simulated) subjects, with their motions renamed as in the study."""
    every = read_motions(ROOT / "motions" / "data" / "simulated_subjects.csv")
    names = {"abduction": ABDUCTION, "forward_flexion": FLEXION}
    every = replace(every, motion=np.array([names[name] for name in every.motion.tolist()]))
    return every.select(np.isin(every.subject, every.subjects[:3]))


@pytest.fixture(scope="module")
def study(motions) -> Study:
    return prepare(motions, printed.SETS)


# --- scores --------------------------------------------------------------------------------------------------------


def as_published(k: int) -> Outcome:
    """Make an outcome of ten subjects with the printed gaps and the printed means and SDs of the parameters."""
    unit = np.linspace(-1.0, 1.0, 10)
    unit = (unit - unit.mean()) / unit.std(ddof=1)
    theta = printed.adapted_mm()[k][:, None] + printed.sd_mm()[k][:, None] * unit
    return Outcome(
        own_mm=np.repeat(printed.own_mm()[k][:, None], 10, axis=1),
        theta_mm=theta,
        before_deg=printed.gaps_deg(adapted=False)[k],
        after_deg=printed.gaps_deg(adapted=True)[k],
        E=np.zeros(10),
        at_bound=np.zeros((6, 10), bool),
        ok=np.ones(10, bool),
    )


PUBLISHED = {name: as_published(k) for k, name in enumerate(printed.SETS)}


def changed(**fields) -> dict[str, Outcome]:
    """Return the published outcome with fields of each set changed by functions."""
    return {
        name: replace(one, **{k: change(getattr(one, k)) for k, change in fields.items()})
        for name, one in PUBLISHED.items()
    }


def test_the_thesis_scores_nothing():
    np.testing.assert_allclose(scores.scores(PUBLISHED), 0.0, rtol=0.0, atol=SAME)


def test_scores_by_hand():
    """SDs twice as large; means one SD off; gaps a tenth of before; a range of A_z of 12 mm; no gap shrinks."""
    about = {name: one.theta_mm.mean(axis=1, keepdims=True) for name, one in PUBLISHED.items()}
    wide = {name: replace(one, theta_mm=2.0 * one.theta_mm - about[name]) for name, one in PUBLISHED.items()}
    assert scores.scores(wide) == pytest.approx([np.log(2.0), 0.0, 0.0, 0.0, 0.0], abs=SAME)
    moved = {
        name: replace(one, theta_mm=one.theta_mm + printed.sd_mm()[k][:, None])
        for k, (name, one) in enumerate(PUBLISHED.items())
    }
    assert scores.scores(moved)[:3] == pytest.approx([0.0, 1.0, 0.0], abs=SAME)
    conoid = {name: replace(one, theta_mm=one.theta_mm + 9.0 * np.eye(6)[:, [5]]) for name, one in PUBLISHED.items()}
    assert scores.scores(conoid)[1] > 1.0
    assert scores.scores(conoid, scores.WITHOUT_CONOID) == pytest.approx([0.0] * 5, abs=SAME)
    smaller = scores.scores(changed(before_deg=lambda x: 10.0 * x))
    assert smaller[[2, 4]] == pytest.approx([np.log(10.0), 0.3])
    a_z = np.eye(6)[:, [4]]
    apart = {name: replace(one, theta_mm=one.theta_mm + shift * a_z) for one, name, shift in _apart()}
    assert scores.scores(apart)[3] == pytest.approx(np.log(2.0))
    assert scores.scores(changed(after_deg=lambda x: x + 99.0))[4] == pytest.approx(0.7)


def _apart():
    """Yield the sets with a shift of A_z: R2's moves 6 mm further from R6's, which was 6 mm away."""
    return zip(PUBLISHED.values(), PUBLISHED, (6.0, 0.0, 0.0), strict=True)


def test_a_reading_beats_what_is_worse_in_everybody_and_not_itself():
    worse = changed(after_deg=lambda x: 3.0 * x)
    assert (scores.beats(PUBLISHED, worse), scores.beats(worse, PUBLISHED)) == (1.0, 0.0)
    assert scores.beats(PUBLISHED, PUBLISHED) == 0.0


def test_who_failed_with_one_set_is_left_out_of_all():
    failed = dict(PUBLISHED) | {"R4": replace(PUBLISHED["R4"], ok=np.arange(10) != 3)}
    kept = scores.complete(failed)
    assert {one.theta_mm.shape[1] for one in kept.values()} == {9}
    np.testing.assert_array_equal(kept["R2"].theta_mm, np.delete(PUBLISHED["R2"].theta_mm, 3, axis=1))


# --- choices -------------------------------------------------------------------------------------------------------


def test_blank_axial_angles_are_the_five_angle_j(motions):
    """Leaving the angle out gives the theta and E of blank angles; one subject, because five angles take longer."""
    motions = motions.select(motions.subject == motions.subjects[0])
    blank = motions.angles_deg.copy()
    blank[:, CLAVICLE_X] = np.nan
    expected = adapt_batch(problems_of(posture_rows(replace(motions, angles_deg=blank)), [load_model("R6")]))
    found = outcomes(prepare(motions, ("R6",)), Variant(axial=LEFT_OUT))["R6"]
    np.testing.assert_allclose(found.theta_mm, expected.theta_mm, rtol=SAME, atol=0.0)
    np.testing.assert_allclose(found.E, expected.E, rtol=SAME, atol=0.0)


def test_an_estimated_axial_rotation_starts_where_it_says(study):
    """In the lowest arm posture the estimates are 0 and the set's own closing value; they differ by a constant."""
    measured, estimated, from_set, *_ = (study.axial[name] for name in AXIAL)
    lowest = np.where(study.data.counted, 0.0, np.nan)
    lowest[0] = 1.0  # the first posture of the shipped subjects has the lowest arm
    assert np.abs(estimated[lowest == 1.0]).max() < SAME
    apart = from_set - estimated
    np.testing.assert_allclose(apart, np.broadcast_to(apart[0], apart.shape), rtol=0.0, atol=SAME)
    assert np.abs(measured - estimated).max() > 0.01


def test_points_and_bounds_are_those_named(study):
    data = study.data
    for name, columns in POINTS.items():
        weights = np.asarray(with_points(data, name).point_weights)
        np.testing.assert_allclose(weights.sum(axis=0), 1.0, rtol=SAME)
        near = np.abs(azimuth_deg(data)[..., None] - np.array(columns)).min(axis=-1) < 1e-6
        np.testing.assert_array_equal(weights > 0.0, near)
    own, bounds = np.asarray(data.girdle.adapted_mm), np.asarray(data.bounds_mm)
    np.testing.assert_allclose(with_bounds(data, BOUNDS["as shipped"]).bounds_mm, bounds, rtol=SAME)
    np.testing.assert_allclose(with_bounds(data, 0.5).bounds_mm, 0.5 * (own + bounds), rtol=SAME)
    assert (with_bounds(data, BOUNDS["none"]).bounds_mm[0, 2:] > 0.0).all()


def test_unsigned_distances_let_a_bone_be_on_either_side(study):
    """R2 with TS and AI inside its ellipsoid. E is the lowest of four choices, which include the set's own."""
    data = on_sides(study.data, -1.0, -1.0)
    np.testing.assert_array_equal(data.girdle.ts_distance_mm, -np.abs(study.data.girdle.ts_distance_mm))
    girdle = load_model("R2").girdle
    found = adapt_batch(data)
    theta, angles = found.theta_mm[:, 0], found.angles[:, 0, 0]
    adapted_girdle = girdle.with_adapted(theta)
    at = landmarks(adapted_girdle, angles)
    centre, axes = np.asarray(adapted_girdle.centre_mm), np.asarray(adapted_girdle.semi_axes_mm)
    for place, distance in ((at.TS, girdle.ts_distance_mm), (at.AI, girdle.ai_distance_mm)):
        assert distance > 0.0
        assert ellipsoid_distance(np.asarray(place) - centre, axes)[0] == pytest.approx(-float(distance), abs=1e-6)
    signed, unsigned = (outcomes(study, Variant(distances=name)) for name in ("signed", "unsigned"))
    for name in printed.SETS:
        assert (unsigned[name].E <= signed[name].E + 1e-9).all()


def test_without_a_weight_nothing_moves(study):
    for one in outcomes(study, Variant(weight=0.0)).values():
        np.testing.assert_array_equal(one.theta_mm, one.own_mm)
        np.testing.assert_array_equal(one.after_deg, one.before_deg)


# --- what is printed -----------------------------------------------------------------------------------------------


def test_the_study_prints_its_table(motions, tmp_path: Path, monkeypatch):
    path = tmp_path / "motions.csv"
    write_motions(motions, path)
    few = {"weight": {"w = 0": Variant(weight=0.0), "w = 10": Variant()}}
    monkeypatch.setattr(study_objective, "choices", lambda: few)
    result = CliRunner().invoke(study_objective.app, [str(path)], catch_exceptions=False)
    assert result.exit_code == 0
    *_, thesis, shipped, nothing = result.stdout.strip().splitlines()
    assert thesis.startswith("| thesis |")
    assert "115, 112, 109" in thesis
    assert shipped.startswith("| as shipped |")
    assert "| 130, 130, 111 | +0, +0, +0 | 0 | 0 |" in nothing
