"""Parts of `girdle trust` against hand computation, without a solver or with a single posture fit."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from handmade import adaptations, motions_of, rising

from adapt.cli.terminal.console import PlainConsole
from adapt.cli.terminal.print_trust import print_weights
from adapt.evaluation.covariance import NORMAL_95
from adapt.evaluation.held_out import gaps_deg, sample
from adapt.tables.folds import (
    MOTION,
    PERSON,
    POSTURES,
    motions_and_persons,
    motions_and_thirds,
    motions_or_thirds,
)
from adapt.tables.held_out import NOTHING, by_model, by_subject, fewest_folds
from adapt.trust.assessment import improvement_blocked_by_points, jump_free_share
from adapt.trust.thorax_plausibility import PASS, WARNING, checks, region_distances_mm
from adapt.trust.usable_results import trust_sentences
from models import load_model, model_names
from motions import Motions
from scripts import reporting

ROUNDING = 1e-12

ON_SURFACE_MM = 1e-6
"""Tolerance: the shipped thorax points are on the ellipsoid to 1e-9 mm in each coordinate."""


def two_motions() -> Motions:
    """Make s1 with abduction and flexion, six postures each, and s2 with abduction alone."""
    abduction, flexion = motions_of(rising(2, 6)), motions_of(rising(1, 6), motion="flexion")
    return Motions.concatenate([abduction, flexion])


# --- folds ---------------------------------------------------------------------------------------------------------


def test_each_motion_of_who_has_several_and_every_third_posture_is_held_out_once():
    motions = two_motions()
    found = motions_and_thirds(motions)
    kinds = [(fold.subject, fold.kind, fold.held_out, len(fold.tested)) for fold in found]
    thirds = ("third 1", "third 2", "third 3")
    assert kinds == [
        *((0, MOTION, name, 6) for name in ("abduction", "flexion")),
        *((0, POSTURES, name, 4) for name in thirds),
        *((1, POSTURES, name, 2) for name in thirds),
    ]
    rows = {0: [*range(6), *range(12, 18)], 1: list(range(6, 12))}
    for fold in found:
        assert sorted([*fold.fitted, *fold.tested]) == rows[fold.subject]
    for subject in (0, 1):
        tested = [fold.tested for fold in found if (fold.subject, fold.kind) == (subject, POSTURES)]
        assert [rows[subject].index(one[0]) for one in tested] == [2, 0, 1]
        assert sorted(np.concatenate(tested)) == rows[subject]


def test_the_fewest_folds_leave_out_postures_only_of_who_has_one_motion():
    found = motions_or_thirds(two_motions())
    assert [(fold.subject, fold.kind) for fold in found] == [*[(0, MOTION)] * 2, *[(1, POSTURES)] * 3]


def test_the_fewest_folds_of_a_table_are_those_of_the_fewest_folds():
    """The table is like that of `girdle diagnose`, which has more kinds of folds."""
    motions = two_motions()
    every, fewest = (
        pd.DataFrame([(motions.subjects[fold.subject], fold.kind, fold.held_out) for fold in folds(motions)])
        for folds in (motions_and_thirds, motions_or_thirds)
    )
    names = {0: "subject", 1: "kind", 2: "held_out"}
    kept = fewest_folds(every.rename(columns=names), motions.subjects)
    pd.testing.assert_frame_equal(kept, fewest.rename(columns=names))
    assert fewest_folds(every.rename(columns=names), ["s2"])["subject"].tolist() == ["s2"] * 3
    assert fewest_folds(NOTHING, motions.subjects).empty


def test_of_very_many_subjects_every_so_manieth_has_something_held_out():
    names = [f"s{k}" for k in range(1000)]
    assert sample(names[:400]) == set(names[:400])
    assert sample(names[:401]) == set(names[:401:2])
    assert sample(names) == set(names[::3])


def test_who_has_a_single_posture_has_nothing_to_hold_out():
    motions = motions_of(rising(1, 1))
    assert motions_and_thirds(motions) == []
    assert len(by_model(NOTHING)) == 0


def test_gaps_are_those_of_the_fits():
    """Every angle is 6 degrees off before and 2 after; blank angles and failed fits have NaN."""
    angles_deg = rising(2, 4)
    angles_deg[0, 1, 3] = np.nan
    motions = motions_of(angles_deg)
    made = adaptations(motions, [load_model("R2")], failed=["s2"])
    for fitted, gap_deg in ((made.before["R2"], 6.0), (made.by_model["R2"], 2.0)):
        gaps = gaps_deg(motions, fitted)
        assert np.argwhere(np.isnan(gaps[:, :4])).tolist() == [[3, 1]]
        np.testing.assert_allclose(gaps[:, :4][np.isfinite(gaps[:, :4])], gap_deg)
        assert np.isnan(gaps[:, 4:]).all() == (gap_deg == 2.0)


def test_of_a_single_kind_of_motion_thirds_are_held_out_with_persons():
    """Four shoulders of three persons: s1 and s4 belong to one person and are held out together."""
    motions = motions_of(rising(4, 6))
    folds, label = motions_and_persons(motions, np.array([0, 1, 2, 0]))
    order = [(kind, s, third) for kind in (MOTION, PERSON) for s in range(4) for third in (2, 3, 1)]
    assert [(fold.kind, fold.subject, fold.held_out) for fold in folds] == [(k, s, f"third {n}") for k, s, n in order]
    for fold in folds:
        assert set(label[fold.tested]) == {fold.held_out}
        assert fold.held_out_subjects == (
            () if fold.kind == MOTION else (0, 3) if fold.subject in (0, 3) else (fold.subject,)
        )


def test_the_gap_of_a_subject_counts_each_fold_by_its_postures():
    """Two postures with a gap of 1 and four with a gap of 4 degrees give 3; a failed fold does not count."""
    rows = [("s1", 2, 1.0), ("s1", 4, 4.0), ("s1", 9, float("nan")), ("s2", 5, 2.0)]
    table = pd.DataFrame(
        [{"model": "R2", "subject": s, "kind": MOTION, "postures": n, "gap_unseen_deg": gap} for s, n, gap in rows]
    )
    assert by_subject(table)["gap_unseen_deg"].tolist() == [3.0, 2.0]


# --- jumps ---------------------------------------------------------------------------------------------------------


def test_a_jump_is_counted_among_the_steps_along_motions():
    """s1 has two motions of six postures, ten steps, one with a jump; the first posture of a motion has no step."""
    motions = two_motions()
    fits = pd.DataFrame({"jump": np.zeros(len(motions.posture), int)})
    assert jump_free_share(motions, fits) == {"s1": 1.0, "s2": 1.0}
    fits.loc[2, "jump"] = 1
    assert jump_free_share(motions, fits) == pytest.approx({"s1": 0.9, "s2": 1.0})


def test_a_single_posture_is_no_step():
    motions = motions_of(rising(1, 1))
    assert np.isnan(jump_free_share(motions, pd.DataFrame({"jump": [0]}))["s1"])


# --- thorax points ---------------------------------------------------------------------------------------------------


def test_what_the_points_forbid_by_hand():
    """From 100 to 30 with points, to 20 without: 10 of 80. NaN where nothing decreases, or "without" exceeds "with"."""
    assert improvement_blocked_by_points(100.0, 30.0, 20.0) == 0.125
    assert improvement_blocked_by_points(100.0, 20.0, 20.0) == 0.0
    unknown = [(100.0, 15.0, 20.0), (20.0, 20.0, 20.0), (100.0, 30.0, np.nan), (100.0, np.nan, 20.0)]
    assert np.isnan([improvement_blocked_by_points(*J) for J in unknown]).all()


# --- plausibility --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", model_names())
def test_no_published_ellipsoid_is_warned_of(name):
    model = load_model(name)
    found = checks(model, np.asarray(model.girdle.adapted_mm))
    assert {check.verdict for check in found} == {PASS}
    assert all(check.reason for check in found)
    on_surface = region_distances_mm(model, np.asarray(model.girdle.adapted_mm))
    assert set(on_surface) == {"front", "side", "back"}
    assert max(on_surface.values()) <= ON_SURFACE_MM


def test_the_numbers_of_an_ellipsoid_by_hand():
    """R2: 4/3 pi 0.153 0.404 0.130 m^3 = 33.66 l; an ellipsoid 260 mm deep over a chest 197 mm deep."""
    model = load_model("R2")
    found = {check.name: check.value for check in checks(model, np.asarray(model.girdle.adapted_mm))}
    assert found["volume"] == pytest.approx(33.66, abs=0.01)
    assert (found["depth"], found["width"]) == (260.0, 306.0)
    assert found["depth over chest depth"] == pytest.approx(260.0 / 197.0)


def test_a_thorax_moved_backward_leaves_its_points_at_the_front_and_back():
    """Shift of 30 mm along z: a point with normal n is then 30 n_z away, to first order; at the side n_z is small."""
    model = load_model("R6")
    theta = np.asarray(model.girdle.adapted_mm).copy()
    theta[1] += 30.0
    left = region_distances_mm(model, theta)
    assert left["side"] < 15.0 < left["front"] < 30.0
    assert 15.0 < left["back"] < 30.0
    warned = {check.name for check in checks(model, theta) if check.verdict == WARNING}
    assert warned == {"thorax points, front", "thorax points, back"}


def test_a_thorax_that_is_none_is_warned_of():
    model = load_model("R2")
    own = np.asarray(model.girdle.adapted_mm)
    for k, factor, name in ((4, 1.2, "depth"), (2, 0.5, "width"), (3, 2.0, "volume"), (5, 2.0, "conoid")):
        theta = own.copy()
        theta[k] *= factor
        assert name in {check.name for check in checks(model, theta) if check.verdict == WARNING}
    nothing = checks(model, np.full(6, np.nan))
    of_the_set = {"distance of TS", "distance of AI"}  # independent of the adapted parameters
    assert {check.name for check in nothing if check.verdict != WARNING} == of_the_set


@pytest.mark.parametrize(
    ("ts_mm", "ai_mm", "warned"), [(0.0, 0.0, []), (-11.5, 30.0, ["TS"]), (60.0, -36.9, ["TS", "AI"])]
)
def test_a_scapula_inside_the_thorax_is_warned_of(ts_mm, ai_mm, warned):
    R2 = load_model("R2")
    model = replace(R2, girdle=replace(R2.girdle, ts_distance_mm=np.asarray(ts_mm), ai_distance_mm=np.asarray(ai_mm)))
    found = checks(model, np.asarray(model.girdle.adapted_mm))
    named = [check.name for check in found if check.name.startswith("distance of") and check.verdict == WARNING]
    assert named == [f"distance of {name}" for name in warned]


@pytest.mark.parametrize(("best", "chosen"), [(10.0, True), (1.0, False), (100.0, False)])
def test_a_weight_at_the_end_of_those_tried_is_not_called_chosen(best, chosen, capsys):
    rows = [
        {"model": "R2", "weight": weight, "subjects_ok": 1, "thorax_points_rms_mm": 1.0, "j_rms_deg": 1.0}
        | {"at_bound": 0, "gap_in_sample_deg": 1.0, "gap_unseen_deg": 1.0, "best": int(weight == best)}
        for weight in (1.0, 10.0, 100.0)
    ]
    print_weights(PlainConsole(), pd.DataFrame(rows))
    out = capsys.readouterr().out
    assert f"{best:g}*" in out
    assert ("these motions choose none" not in out) == chosen


def trust_rows(**columns: list) -> pd.DataFrame:
    rows = {"gap_before_deg": [5.0, 6.0, 4.0], "gap_unseen_motion_deg": [3.0, 4.0, 5.0]}
    rows |= {
        "gap_unseen_postures_deg": [2.0, 3.0, 4.0],
        "at_bound": ["", "A_y", ""],
        "flat": ["", "", "M_y loose: 20 mm"],
    }
    return pd.DataFrame(rows | {"plausibility": ["pass", "pass", "warning"]} | columns)


@pytest.mark.parametrize(
    ("columns", "place", "said"),
    [
        (
            {},
            0,
            "the gap on held-out motions goes from 5.0 before adaptation to 4.0 deg, smaller in 2 of 3 subjects.",
        ),
        (
            {"gap_unseen_motion_deg": [9.0, 9.0, 3.0]},
            0,
            "use the model as it is; the gap on held-out motions goes from 5.0",
        ),
        ({"gap_unseen_motion_deg": [np.nan] * 3}, 0, "held-out postures goes from 5.0 before adaptation to 3.0 deg"),
        ({"gap_unseen_motion_deg": [np.nan] * 3, "gap_unseen_postures_deg": [np.nan] * 3}, 0, "nothing was held out"),
        ({}, 1, "do not read M_y (1 of 3), A_y (1 of 3): at a bound, or only together with another."),
        ({"at_bound": [""] * 3, "flat": [""] * 3}, 1, "all are determined"),
        ({}, 2, "look before you use it; outside the limits in 1 of 3 subjects."),
        ({"plausibility": ["pass"] * 3}, 2, "within all limits"),
    ],
)
def test_what_may_be_used_is_said_in_three_sentences(columns, place, said):
    assert said in trust_sentences(trust_rows(**columns))[place]


# --- studies -------------------------------------------------------------------------------------------------------


def test_the_interval_of_a_share_by_the_published_example():
    """Ten of ten: Wilson's lower limit is n / (n + z^2) = 10 / 13.84."""
    low, high = reporting.wilson(10, 10, NORMAL_95)
    assert low == pytest.approx(10.0 / (10.0 + 1.959964**2))
    assert high == pytest.approx(1.0)
