"""The report as text: its contents, escaping of names, file size, and correct numbers."""

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from diagnoses import BLIND, BY_KIND, CHECKED, ONE, TWO, alone, gap_of
from handmade import GAP_DEG, HELD_OUT_DEG, MOVED_MM, adaptations, motions_of, rising
from pages import EVIL, MODELS, R2, data_of, one_line, sentences_of, simulated, words_of

from adapt.diagnosis.result import Diagnoses
from adapt.diagnosis.texts.wording import MOST_WORDS, amplitude_text, sentence, step_text
from adapt.report import drawn_postures as chosen
from adapt.report import report_html
from adapt.report.bone_positions import POINTS, bones_mm
from adapt.report.figure_data import figure_data
from adapt.report.gap_cells import ALL, heat_maps
from adapt.report.headline import closest, headline
from adapt.report.overview import overview, people
from adapt.tables.folds import MOTION, POSTURES
from adapt.tables.results import summary_table
from models import load_model
from motions import ANGLES, Motions
from motions.landmarks.sampled_postures import THORAX_COLUMNS

LARGEST_BYTES = 10_000_000
"""A file larger than this cannot be mailed everywhere."""

MM_TOLERANCE = 1e-9
"""Tolerance: cosines and products of lengths of 100 mm in double precision."""


# --- positions of the bones ----------------------------------------------------------------------------------------


def test_bones_without_rotation_are_where_the_parameter_set_has_them():
    girdle = R2[0].girdle
    points, _ = bones_mm(girdle.repeated(1), np.zeros((6, 1)))
    ac = np.asarray(girdle.sc_mm + girdle.ac_mm)
    offsets = [
        np.zeros(3),
        girdle.ts_mm,
        girdle.ai_mm,
        girdle.clavicle_conoid_mm - girdle.ac_mm,
        girdle.scapula_conoid_mm,
    ]
    expected = [ac + np.asarray(offset) for offset in offsets]
    np.testing.assert_allclose(points[..., 0], expected, rtol=0.0, atol=MM_TOLERANCE)
    assert POINTS[:3] == ("AC", "TS", "AI")


def test_a_bone_whose_angles_were_not_measured_is_nowhere():
    girdle = R2[0].girdle
    only_clavicle = np.array([[-28.0, 11.0, 7.0, np.nan, np.nan, np.nan]]).T
    points, residuals = bones_mm(girdle.repeated(1), only_clavicle)
    known = {name: bool(np.isfinite(point).all()) for name, point in zip(POINTS, points, strict=True)}
    assert known == {"AC": True, "TS": False, "AI": False, "clavicle_conoid": True, "scapula_conoid": False}
    assert not np.isfinite(residuals).any()


def test_residuals_are_those_of_each_rows_own_parameters():
    """A conoid length 3 mm larger decreases A3 by 3 mm and does not change A1 and A2."""
    girdle = R2[0].girdle
    own = np.asarray(girdle.adapted_mm)
    theta_mm = np.stack([own, own + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3.0])], axis=1)
    _, residuals = bones_mm(girdle.repeated(2).with_adapted(theta_mm), np.repeat(rising(1, 1)[0].T, 2, axis=1))
    np.testing.assert_allclose(residuals[:, 0] - residuals[:, 1], [0.0, 0.0, 3.0], rtol=0.0, atol=MM_TOLERANCE)


def test_a_thorax_turned_in_the_laboratory_has_its_table_and_one_that_is_not_known_none():
    motions = motions_of(rising(2, 4))
    made = adaptations(motions, R2)
    assert "Thorax against the global frame" not in words_of(report_html(motions, R2, made))
    columns = dict(zip(THORAX_COLUMNS, ("12.5", "-25.0", ""), strict=True))
    known = replace(motions, extra=motions.extra.assign(**columns))
    said = words_of(report_html(known, R2, made))
    assert "Thorax against the global frame" in said
    assert "backward tilt 12.5" in " ".join(said.split())
    assert "flexion to the left" not in said  # this angle was not measured


# --- the numbers of the figures ------------------------------------------------------------------------------------


def test_figures_get_every_row_once_in_the_order_of_its_motion():
    motions = motions_of(rising(3, 4))
    order = np.random.default_rng(0).permutation(12)
    shuffled = replace(
        motions,
        subject=motions.subject[order],
        posture=motions.posture[order],
        humerus_elevation_deg=motions.humerus_elevation_deg[order],
        angles_deg=motions.angles_deg[order],
    )
    found = figure_data(shuffled, R2, adaptations(shuffled, R2), {})
    assert [one["name"] for one in found["subjects"]] == list(shuffled.subjects)
    for one in found["subjects"]:
        (motion,) = one["motions"]
        rows = slice(*motion["rows"])
        assert found["posture"][rows] == [1, 2, 3, 4]
        expected = motions.angles_deg[motions.subject == one["name"]].T
        np.testing.assert_allclose(np.array(found["measured_deg"])[:, rows], expected, rtol=0.0, atol=0.005)
        for state, gap_deg in zip(("before", "after"), GAP_DEG.values(), strict=True):
            shown = np.array(found["models"][0]["states"][state]["simulated_deg"])[:, rows]
            np.testing.assert_allclose(shown - expected, gap_deg, rtol=0.0, atol=0.005)


def test_each_state_has_its_own_parameters_and_gaps():
    motions = motions_of(rising(2, 4))
    (model,) = figure_data(motions, R2, adaptations(motions, R2), {"R2": 1.5})["models"]
    before, after = (model["states"][state] for state in ("before", "after"))
    np.testing.assert_allclose(np.subtract(after["theta_mm"], before["theta_mm"]), [MOVED_MM] * 2, rtol=0.0, atol=0.06)
    assert (before["gap_deg"], after["gap_deg"]) == ([[GAP_DEG[False]] * 8] * 2, [[GAP_DEG[True]] * 8] * 2)
    assert (set(before["rms_deg"]), set(after["rms_deg"])) == ({GAP_DEG[False]}, {GAP_DEG[True]})
    assert model["noise_deg"] == 1.5


def test_what_failed_or_was_not_measured_is_null():
    angles_deg = rising(2, 4)
    angles_deg[0, 1, 3] = np.nan
    motions = motions_of(angles_deg)
    found = figure_data(motions, R2, adaptations(motions, R2, failed=["s2"]), {})
    (model,) = found["models"]
    after = model["states"]["after"]
    assert found["measured_deg"][3][1] is None
    assert model["measured_points_mm"][POINTS.index("TS") * 3][1] is None
    assert after["simulated_deg"][0][4:] == [None] * 4
    assert after["simulated_points_mm"][0][4:] == [None] * 4
    assert after["theta_mm"][1] == [None] * 6
    assert (model["adaptation"], after["status"][4]) == (["ok", "not_converged"], "not_converged")
    assert model["states"]["before"]["simulated_deg"][0][4] is not None


def test_the_heat_map_is_the_mean_absolute_difference_over_subjects():
    """Elevations 0, 50, 100, 150: bins 0-30, 30-60, 90-120, 150-180. Errors of 1 and 3 degrees; s2 lacks one angle."""
    angles_deg = rising(2, 4)
    angles_deg[1, :, 5] = np.nan
    motions = motions_of(angles_deg)
    result = adaptations(motions, R2, gap_deg={"s1": -1.0, "s2": 3.0})
    found = heat_maps(motions, result.fits, "R2")
    assert found["low_deg"] == [0.0, 30.0, 90.0, 150.0]
    assert [one["motion"] for one in found["maps"]] == [ALL]
    np.testing.assert_allclose(found["maps"][0]["before"], GAP_DEG[False])
    np.testing.assert_allclose(found["maps"][0]["after"], [[2.0] * 4] * 5 + [[1.0] * 4])


def test_the_heat_map_leaves_out_failed_fits_and_shows_each_motion():
    one, other = motions_of(rising(2, 2)), motions_of(rising(2, 3), motion="flexion")
    motions = Motions.concatenate([one, other])
    found = heat_maps(motions, adaptations(motions, R2, failed=["s1", "s2"]).fits, "R2")
    assert [one["motion"] for one in found["maps"]] == [ALL, "abduction", "flexion"]
    assert np.isnan([one["after"] for one in found["maps"]]).all()
    abduction, flexion = found["maps"][1]["before"], found["maps"][2]["before"]
    assert np.isnan(abduction[0]).tolist() == [False, True, False]
    assert np.isfinite(flexion).all()


# --- how much is drawn ---------------------------------------------------------------------------------------------


def test_of_many_subjects_as_many_as_fit_are_drawn_from_the_best_to_the_worst():
    motions = motions_of(rising(1000, 14))
    gap_deg = {name: float(k) for k, name in enumerate(reversed(motions.subjects))}
    names = chosen.chosen_subjects(motions, 3, gap_deg)
    assert len(names) == chosen.MOST_DRAWN // (3 * 14)
    assert {"s1", "s1000"} <= set(names)
    assert list(names) == sorted(names, key=lambda name: int(name[1:])), "in the order of the motions"
    steps = np.diff([int(name[1:]) for name in names])
    assert steps.max() - steps.min() <= 1, "evenly"


def test_a_subject_without_a_gap_counts_as_the_worst():
    motions = motions_of(rising(1000, 14))
    gap_deg = dict.fromkeys(motions.subjects, 1.0) | {"s500": np.nan}
    assert "s500" in chosen.chosen_subjects(motions, 3, gap_deg)


@pytest.mark.parametrize(("models", "drawn"), [(1, 300), (6, 300), (100, 60)])
def test_of_a_long_motion_evenly_chosen_postures_are_drawn(models, drawn):
    motions = motions_of(rising(1, 20_000))
    rows = chosen.chosen_rows(motions, models, motions.subjects)
    assert len(rows) == drawn
    assert (rows[0], rows[-1]) == (0, 19_999)


def test_all_of_a_usual_study_is_drawn():
    motions = motions_of(rising(30, 22))
    assert chosen.chosen_subjects(motions, 6, {}) == motions.subjects
    assert len(chosen.chosen_rows(motions, 6, motions.subjects)) == 30 * 22


def test_two_hundred_subjects_stay_small_and_the_page_says_what_is_left_out():
    motions = motions_of(rising(200, 14))
    models = [*MODELS, load_model("R6")]
    html = report_html(motions, models, adaptations(motions, models, failed=["s7"]), {"s7": "adaptation failed"})
    assert len(html.encode()) < LARGEST_BYTES
    drawn = len(data_of(html)["subjects"])
    assert 100 < drawn < 200
    assert f"Not all is drawn here, to keep this file small: {drawn} of 200 subjects" in words_of(html)
    assert [one for one in sentences_of(html) if len(one.split()) > MOST_WORDS] == []


# --- words ---------------------------------------------------------------------------------------------------------


def test_the_sentence_says_before_and_after():
    motions = motions_of(rising(2, 4))
    summary = summary_table(adaptations(motions, R2).fits)
    assert headline(summary, "2 subjects", ()) == (
        "Adapting R2 to 2 subjects takes the scapula’s gap from 6.0 to 2.0° and the clavicle’s from 6.0 to 2.0°."
    )


def test_the_sentence_says_what_is_left_on_motions_that_were_held_out():
    summary = adaptations(motions_of(rising(2, 4)), R2).summary
    sentence = headline(summary, "2 subjects", {MOTION})
    assert sentence.endswith("from 6.0 to 2.0° (3.0 on held-out motions) and the clavicle’s from 6.0 to 2.0° (3.0).")
    for kinds in ({POSTURES}, {MOTION, POSTURES}):
        thirds = headline(summary, "2 subjects", kinds)
        assert thirds.endswith("(3.0 on held-out postures) and the clavicle’s from 6.0 to 2.0° (3.0).")


def test_the_sentence_names_the_closest_of_several_sets():
    motions = motions_of(rising(2, 4))
    summary = adaptations(motions, MODELS).summary
    better = (summary["model"] == "R4") & (summary["adapted"] == 1)
    summary.loc[better, [f"{angle}_deg" for angle in (*ANGLES, "clavicle", "scapula")]] -= 0.5
    assert closest(summary) == "R4"
    sentence = headline(summary, "2 subjects", {MOTION})
    assert sentence.startswith("Adapting R4, closest of 2 sets, to 2 subjects takes")
    assert "from 6.0 to 1.5° (3.0 on held-out motions)" in sentence


def test_the_sentence_leaves_out_a_bone_that_was_not_measured():
    angles_deg = rising(2, 4)
    angles_deg[..., 3:] = np.nan
    sentence = headline(adaptations(motions_of(angles_deg), R2).summary, "2 subjects", {MOTION})
    assert sentence == (
        "Adapting R2 to 2 subjects takes the clavicle’s gap from 6.0 to 2.0° (3.0 on held-out motions)."
    )


def test_the_sentence_says_when_nothing_could_be_fitted():
    motions = motions_of(rising(1, 4))
    summary = adaptations(motions, R2, failed=["s1"]).summary
    assert headline(summary, "1 subject", {MOTION}) == "No posture of 1 subject could be fitted."


def test_the_sentence_has_at_most_thirty_words_whoever_the_subjects_are():
    summary = adaptations(motions_of(rising(2, 4)), MODELS).summary
    said = [headline(summary, people(20, simulated), {MOTION}) for simulated in (0, 5, 20)]
    assert max(len(one.split()) for one in said) <= MOST_WORDS
    assert ["closest of 2 sets" in one for one in said] == [True, False, True], "no room for it"


@pytest.mark.parametrize(
    ("subjects", "simulated", "said"),
    [(1, 0, "1 subject"), (3, 3, "3 simulated subjects"), (3, 1, "3 subjects (1 simulated)")],
)
def test_simulated_people_are_called_so(subjects, simulated, said):
    assert people(subjects, simulated) == said


@pytest.mark.parametrize(
    ("count", "said"), [(3, "All subjects are simulated"), (1, "1 of the 3 subjects are simulated")]
)
def test_the_page_says_that_data_are_simulated(count, said):
    motions = simulated(motions_of(rising(3, 4)), count)
    assert said in words_of(report_html(motions, R2, adaptations(motions, R2)))


def test_measured_data_are_not_called_simulated():
    motions = motions_of(rising(3, 4))
    assert "Simulated data" not in words_of(report_html(motions, R2, adaptations(motions, R2)))


def test_the_overview_counts_what_was_fitted():
    motions = motions_of(rising(3, 4))
    (row,) = overview(adaptations(motions, R2, failed=["s2"]))
    assert (row.postures, row.postures_ok, row.subjects, row.adapted) == (12, (12, 8), 3, 2)
    assert row.gap_deg["scapula"] == pytest.approx((GAP_DEG[False], GAP_DEG[True]))
    assert row.held_out_deg == {"clavicle": HELD_OUT_DEG, "scapula": HELD_OUT_DEG}


def test_the_gap_held_out_stands_beside_the_one_in_sample_and_says_of_whom():
    motions = motions_of(rising(3, 4))
    made = adaptations(motions, R2)
    heldout = made.heldout.query("subject != 's2'")
    two = replace(made, heldout=heldout)
    said = words_of(report_html(motions, R2, two))
    assert f"{HELD_OUT_DEG}° {HELD_OUT_DEG}° 12 of 12" in said
    assert f" before adaptation to {HELD_OUT_DEG:.1f} deg" in said
    assert "of 2 of the subjects" in said
    assert "of 2 of the subjects" not in words_of(report_html(motions, R2, made))
    (model,) = figure_data(motions, R2, two, {})["models"]
    assert model["held_out_deg"] == [[HELD_OUT_DEG] * 2, [None] * 2, [HELD_OUT_DEG] * 2]


def test_who_was_not_handled_is_named():
    motions = motions_of(rising(3, 4))
    failed = {f"P{k}": "adaptation not_converged" for k in range(70)}
    words = words_of(report_html(motions, R2, adaptations(motions, R2, failed=["s2"]), failed))
    assert "P0: adaptation not_converged" in words
    assert "P60" not in words
    assert "70 left out or failed in part" in words
    assert "And more" in words


# --- the file ------------------------------------------------------------------------------------------------------


def test_the_same_results_give_the_same_page_and_it_needs_no_other_file():
    motions = motions_of(rising(2, 4))
    html = report_html(motions, MODELS, adaptations(motions, MODELS))
    assert html == report_html(motions, MODELS, adaptations(motions, MODELS))
    ours = html.replace(re.findall(r"<script>(.*?)</script>", html, re.DOTALL)[0], "")
    assert not re.search(r"(src|href)=[\"'](?!#)", ours), "nothing but links within the page"
    assert "default-src 'none'" in ours


def test_names_from_files_are_text():
    motions = motions_of(rising(2, 4), names=[EVIL], motion=EVIL)
    html = report_html(motions, R2, adaptations(motions, R2), {EVIL: "adaptation not_converged"})
    assert "alert(1)</script>" not in html
    assert f"{EVIL}: adaptation not_converged" in words_of(html)
    found = data_of(html)
    assert found["subjects"][0]["name"] == EVIL
    assert found["subjects"][0]["motions"][0]["name"] == EVIL


# --- with a diagnosis ----------------------------------------------------------------------------------------------


def bars_of(html: str) -> dict[str, str]:
    """Return name and number of every bar of the page; a cause by its identifier, without its plain name."""
    shown = re.findall(r'<span class="name">(.*?)\n.*?<span class="value">(.*?)</span></div>', html, re.DOTALL)
    plain = re.compile(r"<abbr.*?</abbr> <code>(.*?)</code>", re.DOTALL)
    names = [unescape(re.sub(r"</?code>", "", plain.sub(r"\1", name))).strip() for name, _ in shown]
    return {
        name: " ".join(re.sub(r"<[^>]*>", " ", value).split()) for name, (_, value) in zip(names, shown, strict=True)
    }


@pytest.mark.parametrize("kind", BY_KIND)
def test_every_kind_of_answer_has_its_page(kind):
    """The verdict comes first, then the gap budget; each candidate appears once, with its probability."""
    motions, diagnosis = motions_of(rising(10, 4)), BY_KIND[kind]
    html = report_html(motions, R2, adaptations(motions, R2), {}, alone(diagnosis))
    assert [one_line(one) for one in re.findall(r"<h1>(.*?)</h1>", html, re.DOTALL)] == [sentence(diagnosis)]
    words = words_of(html)
    first = [sentence(diagnosis), "Where the gap goes:", "model as it is", "noise alone", "Before and after adaptation"]
    assert re.search(".*".join(map(re.escape, first)), words)
    bars, inclusion = bars_of(html), diagnosis.verdict.inclusion
    assert set(bars) == {*inclusion, *(step_text(one.step) for one in diagnosis.budget)}
    assert all(bars[name] in (f"{probability:.2f}", "<0.01") for name, probability in inclusion.items())
    for name, size in diagnosis.amplitude.items():
        assert amplitude_text(size) in words
        assert name in words
    assert all(one.what in words for one in diagnosis.next_measurement)
    assert data_of(html)["models"][0]["noise_deg"] == diagnosis.noise.angle_deg
    assert [one for one in sentences_of(html) if len(one.split()) > MOST_WORDS] == []


def test_the_page_says_whether_the_positions_agree():
    motions = motions_of(rising(10, 4))
    html = report_html(motions, R2, adaptations(motions, R2), {}, alone(CHECKED))
    words = words_of(html)
    assert "Do the positions agree?" in words
    assert "on what was fitted 4.2 2.7 6.4 held-out motions 4.8 3.2 6.1" in words
    assert "these positions hardly tell that of AC" in words
    assert "SC, backward: 0 to 1 mm" in words
    assert html.count('class="path-with_causes"') == 3 * 4 * 2  # subjects, three components and a distance, motions
    assert [one for one in sentences_of(html) if len(one.split()) > MOST_WORDS] == []
    assert "Motions: 1 abduction, 2 forward_flexion." in words
    assert re.findall(r"<text[^>]*>(.*?)</text>", html)[:3] == ["1", "2", "1"], "no name runs into the next one"
    without = report_html(motions, R2, adaptations(motions, R2), {}, alone(ONE))
    assert "Do the positions agree?" not in without


def test_causes_stand_in_the_page_with_what_they_take_and_how_to_adapt_with_them():
    motions = motions_of(rising(10, 4))
    html = report_html(motions, R2, adaptations(motions, R2), {}, alone(TWO))
    words, bars = words_of(html), bars_of(html)
    names = "AC joint moves ac_translation or conoid stretches conoid_strain"
    seen = "held-out motions and held-out persons"
    assert f"{names} 0.62 0.31 {seen} 50 % 4.0 [3.9, 4.1] mm 3.0 mm" in words
    gap = "12.0 [11.9, 12.1] mm (!) 5.0 mm"
    assert f"scapula lifts off the thorax scapulothoracic_gap 0.88 {seen} 30 % {gap}" in words
    assert "(!): larger than such an effect is: something that acts like it." in words
    assert "Unexplained beyond noise: 24 %" in words
    off = "at the measured angles TS to the ellipsoid and length of the conoid are 1.2 and 1.1 mm off"
    assert f"With own bones and the named causes: {off}. Noise alone: 0.8 and 0.9 mm." in words
    assert bars["+ ac_translation"] == "1.40 [1.30, 1.50]"
    assert html.count('<div class="answer named">') == 5, "two steps of the gap budget, three names"


def test_a_cause_that_positions_show_takes_no_share_and_is_described_as_it_was_found():
    """Check the named basis, not the first one of the cause, and coefficients with their unit."""
    (first, *_), motions = TWO.verdict.causes, motions_of(rising(10, 4))
    shown = replace(TWO, verdict=replace(TWO.verdict, causes=(replace(first, tested_on=("positions",)),)))
    html = report_html(motions, R2, adaptations(motions, R2), {}, alone(shown))
    words = words_of(html)
    assert "measured positions - 4.0 [3.9, 4.1] mm" in words
    assert 'title="AC centre moves in the clavicle with the posture of the bones">AC joint moves</abbr>' in html
    assert 'title="conoid length changes with elevation or posture">conoid stretches</abbr>' in html
    assert "mm per 30 deg along by scapula_y 4.00" in words
    assert not re.search("other motion, other person|Put FOLDER|FOLDER is", words)


def test_the_page_opens_with_the_model_of_the_verdict_and_has_every_ones_answer():
    motions = motions_of(rising(10, 4))
    diagnoses = Diagnoses({"R2": ONE, "R4": replace(ONE, model="R4", gaps=gap_of(1.2, 1.1))})
    html = report_html(motions, MODELS, adaptations(motions, MODELS), {}, diagnoses)
    data = data_of(html)
    assert diagnoses.closest.model == data["models"][data["first_model"]]["name"] == "R4"
    for diagnosis in diagnoses.by_model.values():
        assert sentence(diagnosis) in words_of(html)


def test_what_a_diagnosis_could_not_tell_is_a_dash():
    motions = motions_of(rising(10, 4))
    words = words_of(report_html(motions, R2, adaptations(motions, R2), {}, alone(BLIND)))
    assert "adapted - [-, -]" in words
    assert "Unexplained" not in words
    assert "Every candidate could be told from every other one" in words
    assert "Gain: a cause can then be tested on held-out persons; not computed" in words
