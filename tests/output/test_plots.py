"""Plots on given axes: they draw the numbers of the tables."""

import jax
import numpy as np
import pandas as pd
import pytest
from diagnoses import NOTHING, TWO
from handmade import adaptations, motions_of, rising
from matplotlib.figure import Figure
from pages import R2

from adapt.api import PostureFits
from adapt.differentiable.closest_posture import PostureFit
from adapt.output.plots import draw_angles, draw_budget, draw_heat_map, draw_inclusion, draw_positions
from adapt.trust.assessment import Trust
from motions import InputError

MOTIONS = motions_of(rising(2, 4), motion="abduction")
RESULT = adaptations(MOTIONS, R2)
FITS = PostureFits(RESULT.by_model, RESULT.fits)
TRUST = Trust(
    RESULT,
    pd.DataFrame(
        {
            "model": "R2",
            "subject": ["s1", "s2"],
            "gap_before_deg": 4.26,
            "gap_in_sample_deg": 2.0,
            "gap_unseen_motion_deg": np.nan,
            "gap_unseen_postures_deg": 3.0,
            "at_bound": "",
            "flat": "",
            "plausibility": ["pass", "warning"],
            "warnings": ["", "a < b"],
        }
    ),
    uncertainty=pd.DataFrame(),
    plausibility=pd.DataFrame(),
    contact=pd.DataFrame(),
    weights=None,
)


@pytest.fixture
def axes():
    return Figure().subplots()


def test_the_angles_are_those_of_the_table(axes):
    draw_angles(axes, RESULT, "R2", "s2", "abduction", "scapula_z")
    rows = RESULT.fits.query("subject == 's2' and model == 'R2'")
    drawn = {line.get_label(): line.get_ydata() for line in axes.lines}
    assert list(drawn) == ["model as it is", "adapted", "measured"]
    np.testing.assert_array_equal(drawn["measured"], rows.query("adapted == 0")["scapula_z_measured_deg"])
    np.testing.assert_array_equal(drawn["adapted"], rows.query("adapted == 1")["scapula_z_simulated_deg"])
    assert axes.get_ylabel().endswith("degrees")


def test_a_subject_that_is_not_there_is_refused(axes):
    with pytest.raises(InputError, match="there is no row of R2, nobody, abduction"):
        draw_angles(axes, RESULT, "R2", "nobody", "abduction", "scapula_z")


def test_a_position_is_drawn_in_every_state(axes):
    table = pd.DataFrame(
        {
            "model": "R2",
            "subject": "s1",
            "state": ["base", "base", "adapted", "adapted"],
            "SC_y_simulated_mm": [1.0, 2.0, 3.0, 4.0],
            "SC_y_measured_mm": [5.0, 6.0, 5.0, 6.0],
        }
    )
    draw_positions(axes, table, "R2", "s1", "SC", "y")
    drawn = {line.get_label(): list(line.get_ydata()) for line in axes.lines}
    assert drawn == {"base": [1.0, 2.0], "adapted": [3.0, 4.0], "measured": [5.0, 6.0]}


def test_the_figures_of_a_diagnosis_are_drawn(axes):
    draw_budget(axes, TWO)
    assert [bar.get_width() for bar in axes.patches] == [step.gap_deg.value for step in TWO.budget]
    inclusion = Figure().subplots()
    draw_inclusion(inclusion, TWO)
    assert len(inclusion.patches) == len(TWO.verdict.inclusion)
    heat = Figure().subplots()
    draw_heat_map(heat, TWO, "abduction")
    assert np.nanmax(np.asarray(heat.images[0].get_array())) == max(cell.mean_absolute_deg for cell in TWO.where.cells)
    with pytest.raises(InputError, match="there is no motion 'flexion'"):
        draw_heat_map(heat, NOTHING, "flexion")


@pytest.mark.parametrize(
    ("result", "line"),
    [
        (RESULT, "Adaptations(2 subjects, R2)"),
        (FITS, "PostureFits(2 subjects, R2)"),
        (TRUST, "Trust(2 subjects, R2: 1 of 2 outside the limits)"),
        (TWO, "Diagnosis(R2, 6 subjects: ac_translation (or conoid_strain) and scapulothoracic_gap)"),
        (NOTHING, "Diagnosis(R2, 1 subject: none)"),
        (MOTIONS, "Motions(8 postures of 2 subjects, 1 motion)"),
        (R2[0], "ParameterSet('R2')"),
        (R2[0].girdle, "Girdle(one girdle)"),
        (R2[0].girdle.repeated(10), "Girdle(10 girdles)"),
        (PostureFit(np.zeros((6, 4, 2)), np.zeros((3, 4, 2)), np.zeros((4, 2))), "PostureFit(4 x 2 postures)"),
    ],
    ids=lambda one: one if isinstance(one, str) else "",
)
def test_results_are_short_in_a_session(result, line):
    assert repr(result) == line


def test_a_girdle_of_any_objects_has_a_line():
    """JAX puts tracers, None and objects of its own in the place of the arrays."""
    girdle, said = R2[0].girdle, []
    jax.jit(lambda one: said.append(repr(one)))(girdle)
    for filled in (None, object(), 0):
        said.append(repr(jax.tree.map(lambda _, filled=filled: filled, girdle)))
    assert said == ["Girdle(one girdle)"] * 4


@pytest.mark.parametrize(
    ("result", "line", "cells"),
    [
        (RESULT, "Adaptations(2 subjects, R2)", ["scapula_held_out_deg"]),
        (FITS, "PostureFits(2 subjects, R2)", ["R2", "clavicle_deg"]),
        (TRUST, "Trust(2 subjects, R2: 1 of 2 outside the limits)", ["s2", "4.3", "", "warning", "a &lt; b"]),
        (TWO, "Beyond own bones the gap of 6 shoulders", ["+ ac_translation", "1.40", "noise alone"]),
    ],
    ids=["adaptations", "fits", "trust", "diagnosis"],
)
def test_results_are_a_table_in_a_notebook(result, line, cells):
    html = result._repr_html_()
    assert html.startswith(f"<p>{line}")
    assert all(f"<td>{cell}</td>" in html or f"<th>{cell}</th>" in html for cell in cells)
