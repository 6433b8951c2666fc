"""Muscle lines and arms of a report: correct numbers, a small file, and their display in a browser."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from browsing import PHONE, WIDE, column, needs_browser, numbers_of
from handmade import adaptations, motions_of, rising
from pages import MODELS, R2, data_of, sentences_of, words_of

from adapt import Adaptations
from adapt.diagnosis.texts.wording import MOST_WORDS
from adapt.report import muscle_figures as figures
from adapt.report import report_html
from adapt.tables.muscle_tables import JOINTS, MuscleTables, muscle_means, muscle_tables
from models import load_model
from models.muscles.muscle_lines import SERRATUS, THORAX, muscle_lines
from models.person.family import PersonalSets
from motions import Motions

WHOLE_MM = 0.5 + 1e-9
"""Rounding of drawn positions."""

LARGEST_BYTES = 10_000_000
"""A file larger than this cannot be mailed everywhere."""


def looked_at(motions: Motions, models, failed=()) -> tuple[Adaptations, MuscleTables]:
    result = adaptations(motions, models, failed)
    return result, muscle_tables(models, result.fits, result.parameters)


def page(motions: Motions, models, failed=()) -> str:
    result, found = looked_at(motions, models, failed)
    return report_html(motions, models, result, muscles=found)


def points(flat: list[int]) -> np.ndarray:
    return np.array(flat, float).reshape(-1, 3)


@pytest.fixture(scope="module")
def three():
    """Return three subjects, one of whom could not be adapted, with R2 and R4."""
    motions = motions_of(rising(3, 4))
    result, found = looked_at(motions, MODELS, ["s2"])
    return found, report_html(motions, MODELS, result, {"s2": "adaptation failed"}, muscles=found)


def test_lines_end_at_their_bones_and_go_round_the_ellipsoid_of_their_state(three):
    _, html = three
    data = data_of(html)
    for model, muscles in zip(data["models"], data["muscles"], strict=True):
        for state in ("before", "after"):
            paths = muscles["states"][state]["paths"]
            ok = range(12) if state == "before" else (0, 1, 2, 3, 8, 9, 10, 11)
            assert set(paths) == {str(row) for row in ok}
            M_y, M_z, A_x, A_y, A_z, _ = model["states"][state]["theta_mm"][0]
            for line, flat in zip(muscles["lines"], paths["3"], strict=True):
                if not line["wraps"]:
                    assert len(flat) == 6
                    continue
                if line["muscle"] != SERRATUS:
                    assert len(flat) == 3 * len(figures.ROUND_HUMERUS)
                    continue
                assert len(flat) == 3 * (figures.CURVED + 2)
                share = points(flat) / [A_x, A_y, A_z] - np.array([0.0, M_y, M_z]) / [A_x, A_y, A_z]
                assert np.linalg.norm(share, axis=1).min() > 1.0 - 2.0 / min(A_x, A_z)


def test_lines_are_as_long_as_in_the_table(three):
    found, html = three
    rows = found.lines.query("model == 'R4' and subject == 's1' and posture == 2 and state == 'after'")
    muscles = data_of(html)["muscles"][1]
    paths = muscles["states"]["after"]["paths"]["1"]
    drawn = [np.linalg.norm(np.diff(points(flat), axis=0), axis=1).sum() for flat in paths]
    clear = (rows["depth_mm"] == 0.0).to_numpy()  # the other lines have an end that is drawn on the surface
    np.testing.assert_allclose(np.array(drawn)[clear], rows["length_mm"][clear], atol=4.0 * WHOLE_MM)
    assert [one["name"] for one in muscles["lines"]] == rows["line"].tolist()


def test_arms_are_those_of_the_table_and_null_where_a_fit_failed(three):
    found, html = three
    muscles = data_of(html)["muscles"][0]
    for n, joint in enumerate(JOINTS):
        for state in ("before", "after"):
            arms = np.array(muscles["states"][state]["arms_mm"][n], float)
            assert np.isnan(arms[:, 4:8]).all()
            for k, muscle in enumerate(muscles["muscles"]):
                rows = found.muscles[(found.muscles["model"] == "R2") & (found.muscles["muscle"] == muscle)]
                expected = rows[f"about_{joint}_{state}_mm"]
                np.testing.assert_allclose(arms[k, [0, 1, 2, 3, 8, 9, 10, 11]], expected, atol=0.051)


def test_the_page_says_what_adaptation_does_to_the_serratus_and_gives_all_means(three):
    found, html = three
    words = words_of(html)
    row = muscle_means(found).loc[("R2", SERRATUS)]
    assert f"takes the arm of the serratus anterior about SC from {row['about_sc_before_mm']:.0f} to" in words
    assert f"serratus anterior {row['about_sc_before_mm']:.1f} → {row['about_sc_after_mm']:.1f}" in words
    assert [one for one in sentences_of(html) if len(one.split()) > MOST_WORDS] == []
    assert "drawn at 12 of 12 postures. Grey dots" in words
    assert "sets with contact points instead (das3) have none" in words


def test_a_page_without_muscles_names_the_command_that_has_them():
    motions = motions_of(rising(2, 4))
    html = report_html(motions, R2, adaptations(motions, R2))
    assert data_of(html)["muscles"] is None
    assert "girdle muscles draws muscle lines too" in words_of(html)
    assert "Muscle arms" not in words_of(html)


def test_every_person_has_the_lines_of_the_own_bones():
    motions = motions_of(rising(2, 4))
    own = PersonalSets("mine", {"s1": load_model("R2"), "s2": load_model("R6")})
    data = data_of(page(motions, [own]))
    every = {name: muscle_lines(load_model(name)) for name in ("R2", "R6")}
    straight = int(np.flatnonzero((every["R2"].start == THORAX) & ~every["R2"].wraps)[-1])
    starts = [points(data["muscles"][0]["states"]["before"]["paths"][row][straight])[0] for row in ("0", "4")]
    for start, lines in zip(starts, every.values(), strict=True):
        np.testing.assert_allclose(start, lines.start_mm[:, straight], atol=WHOLE_MM)
    bones = [data["muscles"][0]["states"]["before"]["paths"][row][0] for row in ("0", "4")]
    assert bones[0] != bones[1]


def test_two_hundred_subjects_stay_small_and_the_page_says_at_how_many_postures_lines_are():
    """The tables repeat one subject two hundred times, because 200 balances would take ten minutes."""
    models, motions = [*MODELS, load_model("R6")], motions_of(rising(200, 14))
    _, one = looked_at(motions_of(rising(1, 14)), models)
    muscles = pd.concat([one.muscles.assign(subject=name) for name in motions.subjects], ignore_index=True)
    html = report_html(motions, models, adaptations(motions, models), muscles=replace(one, muscles=muscles))
    assert len(html.encode()) < LARGEST_BYTES, len(html.encode())
    data = data_of(html)
    with_lines = len(data["muscles"][0]["states"]["after"]["paths"])
    assert 20 < with_lines < 200
    assert all(len(one["states"]["after"]["paths"]) == with_lines for one in data["muscles"])
    said = f"drawn at {with_lines} of {len(data['posture'])} postures, evenly chosen to keep this file small"
    assert said in words_of(html)


def test_of_a_usual_study_all_postures_have_lines():
    """Ten subjects with two motions of seven postures, three sets; 275 postures of measured shoulders, one set."""
    assert figures.most_with_lines(140, 3) >= 140
    assert figures.most_with_lines(275, 1) >= 275


# --- in a browser --------------------------------------------------------------------------------------------------


def drawn(seen, name: str) -> list[list[float | None]]:
    """Return the points of a muscle's lines in the thorax frame, with None between two lines."""
    found = [one for one in seen.traces() if one.get("name") == name]
    assert len(found) <= 1
    line = found[0] if found else {"x": [], "y": [], "z": []}
    return [[x, z, None if y is None else -y] for x, y, z in zip(line["x"], line["y"], line["z"], strict=True)]


@needs_browser
@pytest.mark.parametrize("window", [PHONE, WIDE], ids=["phone", "desk"])
def test_the_view_has_the_lines_of_the_posture_and_the_state(look, three, window):
    seen = look(three[1], window)
    tab, data = seen.page, seen.data()
    mine = data["muscles"][data["first_model"]]
    for state in ("before", "after"):
        tab.click(f"#show-{state}")
        tab.click("#next")
        row = tab.input_value("#posture")
        expected = [points(flat).tolist() for flat in mine["states"][state]["paths"][row][:12]]
        assert drawn(seen, "serratus anterior") == [point for path in expected for point in [*path, [None] * 3]]
    assert "muscle round thorax or humerus" in tab.inner_text("#legend")
    tab.select_option("#lines", label="rhomboids")
    assert drawn(seen, "serratus anterior") == []
    assert len(drawn(seen, "rhomboids")) == 5 * 3
    tab.select_option("#lines", label="none")
    assert drawn(seen, "rhomboids") == []
    seen.assert_quiet()


@needs_browser
def test_arms_are_drawn_over_elevation_before_and_after(look, three):
    seen = look(three[1])
    tab, data = seen.page, seen.data()
    states = data["muscles"][data["first_model"]]["states"]
    panels = "JSON.stringify([...document.querySelectorAll('#arms .figure')].map(one => one.data))"
    for n, joint in enumerate(("SC", "AC", "GH")):
        tab.select_option("#joint", label=joint)
        shown = json.loads(tab.evaluate(panels))
        over = [k for k, arms in enumerate(states["before"]["arms_mm"][n]) if max(arms[:4]) > 0.0]
        assert len(shown) == len(over) == (8, 9, 14)[n]
        for k, (before, after) in zip(over, shown, strict=True):
            assert before["y"] == states["before"]["arms_mm"][n][k][:4]
            assert after["y"] == states["after"]["arms_mm"][n][k][:4]
            assert after["x"] == [0, 50, 100, 150]
    shown = numbers_of(seen, "arms")
    assert column(shown, "deltoid scapular, adapted, mm") == states["after"]["arms_mm"][2][6][:4]
    tab.select_option("#subject", label="s3")
    assert json.loads(tab.evaluate(panels))[0][0]["y"] == states["before"]["arms_mm"][2][6][8:]
    seen.assert_quiet()


@needs_browser
def test_a_subject_that_failed_has_arms_of_neither_state_and_no_error(look, three):
    seen = look(three[1])
    seen.page.select_option("#subject", label="s2")
    assert "no muscle lines drawn here" in seen.page.inner_text("#readout")
    assert (
        json.loads(seen.page.evaluate("JSON.stringify(document.querySelector('#arms .figure').data[0].y)"))
        == [None] * 4
    )
    seen.page.click("#show-before")
    assert len(drawn(seen, "serratus anterior")) > 0
    seen.assert_quiet()


@needs_browser
def test_a_posture_without_lines_says_so(look, three):
    """Reports with many postures draw lines only in some of them."""
    seen = look(three[1])
    seen.page.evaluate("delete muscles().states.after.paths[1]")
    assert "no muscle lines" not in seen.page.inner_text("#readout")
    seen.page.click("#next")
    assert "no muscle lines drawn here" in seen.page.inner_text("#readout")
    assert drawn(seen, "serratus anterior") == []
    seen.assert_quiet()
