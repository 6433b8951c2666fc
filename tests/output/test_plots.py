"""Plots on given axes: they draw the numbers of the tables."""

import numpy as np
import pandas as pd
import pytest
from diagnoses import NOTHING, TWO
from handmade import adaptations, motions_of, rising
from matplotlib.figure import Figure
from pages import R2

from adapt.output.plots import draw_angles, draw_budget, draw_heat_map, draw_inclusion, draw_positions
from motions import InputError

MOTIONS = motions_of(rising(2, 4), motion="abduction")
RESULT = adaptations(MOTIONS, R2)


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


def test_results_are_short_in_a_session_and_a_table_in_a_notebook():
    assert repr(RESULT) == "Adaptations(2 subjects, R2)"
    assert repr(MOTIONS) == "Motions(8 postures of 2 subjects: abduction)"
    assert repr(R2[0]) == "ParameterSet('R2')"
    html = RESULT._repr_html_()
    assert html.startswith("<p>Adaptations(2 subjects, R2)</p><table")
    assert "scapula_held_out_deg" in html
