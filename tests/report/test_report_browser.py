"""The report in a real browser, as a user operates it: steps, rotation, selections, on a desktop and on a phone."""

import json
from dataclasses import replace
from functools import cache
from io import BytesIO

import numpy as np
import pytest
from browsing import EYE, PHONE, TABLET, WIDE, Seen, column, needs_browser, numbers_of
from diagnoses import NOTHING, TWO, gap_of
from handmade import MOVED_MM, adaptations, motions_of, rising
from pages import EVIL, MODELS, R2, simulated
from PIL import Image
from playwright.sync_api import TimeoutError as PlaywrightTimeout
from playwright.sync_api import expect
from reaching import A4_INSIDE, contrast, grave_faults, on_paper, too_small_for_a_finger, unreached_by_tab

from adapt.diagnosis.result import Diagnoses
from adapt.diagnosis.texts.wording import sentence
from adapt.report import report_html
from adapt.report.bone_positions import POINTS
from models.effects import EFFECTS
from motions import InputError, Motions
from scripts.picture_report import main, picture

pytestmark = needs_browser

DRAWN_MM = 0.051
"""Tolerance: the page has tenths of a mm."""

DRAWN_SHARE = 2e-3
"""Twice that rounding as a share of a semi-axis of 100 mm."""

LARGEST_PICTURE_BYTES = 250_000

HEAT = "document.querySelector('#heat-maps .figure').data[0]"

TURNED = f"(before) => ['x', 'y', 'z'].some((axis) => Math.abs({EYE}[axis] - before[axis]) > 0.1)"

DRAGS = 20

DRAG_MS = 1_000
"""Time until a drag is visible."""

LEAST_CONTRAST = 4.5
"""Least contrast of text, WCAG 2 AA."""

WHITE = 235
"""Brightness (of 255) above which a pixel counts as white: shadows are darker."""

MOST_INK = 0.1
"""Largest share of dark pixels of a printed page: text and lines have less, a dark background has more."""


def two_motions(subjects: int = 2) -> Motions:
    parts = [motions_of(rising(subjects, 5), motion="abduction"), motions_of(rising(subjects, 4), motion="flexion")]
    return Motions.concatenate(parts)


M_X_MM = 7.0
GIRDLE = replace(R2[0].girdle, centre_mm=np.array([M_X_MM, *R2[0].girdle.centre_mm[1:]]))
SETS = [replace(R2[0], girdle=GIRDLE), MODELS[1]]
"""Sets with M_x moved, as a user's own file may have it."""


@cache
def adapted() -> str:
    """Make the report of two subjects with two motions and two parameter sets."""
    motions = two_motions()
    return report_html(motions, SETS, adaptations(motions, SETS))


STILL = replace(NOTHING, model="R4", gaps=replace(gap_of(3.0, 3.0), other_person=None))
"""A diagnosis without a cause, whose gap leaves the verdict to the other model."""


@cache
def diagnosed() -> str:
    """Make the report of a diagnosis: two causes with R2, none with R4."""
    motions = two_motions(10)
    return report_html(motions, MODELS, adaptations(motions, MODELS), {}, Diagnoses({"R2": TWO, "R4": STILL}))


def drawn_scapula(seen: Seen, name: str) -> np.ndarray:
    """Return AC, TS, AI and AC again as drawn, (lateral, up, backward) in the thorax frame."""
    (line,) = [one for one in seen.traces() if one.get("name") == f"{name}: scapula"]
    return np.array([line["x"], line["z"], [-y for y in line["y"]]])


def landmarks_of(columns: list[list[float]], names: list[str], row: int) -> np.ndarray:
    at = [POINTS.index(name) for name in names]
    return np.array([[columns[3 * k + axis][row] for k in at] for axis in range(3)])


TRIANGLE = ["AC", "TS", "AI", "AC"]


def test_model_subject_motion_and_state_can_be_chosen(look):
    seen = look(adapted())
    page, data = seen.page, seen.data()
    page.select_option("#model", label="R4")
    page.select_option("#subject", label="s2")
    page.select_option("#motion", label="flexion")
    page.click("#show-before")
    page.fill("#posture", "2")
    row = data["subjects"][1]["motions"][1]["rows"][0] + 2
    model = next(one for one in data["models"] if one["name"] == "R4")
    simulated_mm = landmarks_of(model["states"]["before"]["simulated_points_mm"], TRIANGLE, row)
    np.testing.assert_allclose(drawn_scapula(seen, "model as it is"), simulated_mm, rtol=0.0, atol=DRAWN_MM)
    headings = page.locator("h2 [data-name]").all_inner_texts()
    assert {"R4", "s2", "flexion"} <= set(headings)
    (dots,) = [
        one
        for one in json.loads(page.evaluate("JSON.stringify(document.querySelector('#angles .figure').data)"))
        if one["mode"] == "markers"
    ]
    assert dots["y"] == data["measured_deg"][0][slice(*data["subjects"][1]["motions"][1]["rows"])]
    page.click("#subject-table tbody tr:first-child")
    assert page.input_value("#subject") == "0"
    page.select_option("#heat-motion", label="flexion")
    page.click("#play")
    # polled within the page every 10 ms: a busy machine would miss the posture between two requests from here
    page.wait_for_function("() => document.getElementById('posture').value === '3'", polling=10)
    page.click("#play")
    seen.assert_quiet()


def test_the_ellipsoid_is_that_of_the_subject_and_state(look):
    """Every drawn point of the surface lies on the ellipsoid."""
    seen = look(adapted())
    for state, moved_mm in (("before", 0.0 * MOVED_MM), ("after", MOVED_MM)):
        seen.page.click(f"#show-{state}")
        (surface,) = [one for one in seen.traces() if one["type"] == "surface"]
        x, forward, up = (np.array(surface[axis]) for axis in "xyz")
        M_y, M_z, A_x, A_y, A_z, _ = np.asarray(GIRDLE.adapted_mm) + moved_mm
        squares = ((x - M_X_MM) / A_x) ** 2 + ((up - M_y) / A_y) ** 2 + ((-forward - M_z) / A_z) ** 2
        np.testing.assert_allclose(squares, 1.0, rtol=0.0, atol=DRAWN_SHARE)
    seen.assert_quiet()


def test_the_page_opens_where_adaptation_changes_most(look):
    seen = look(adapted())
    data, at = seen.data(), seen.chosen
    states, motions = data["models"][at["model"]]["states"], data["subjects"][0]["motions"]
    falls = np.subtract(states["before"]["rms_deg"], states["after"]["rms_deg"])
    mine = falls[motions[0]["rows"][0] : motions[-1]["rows"][1]]
    assert falls[motions[at["motion"]]["rows"][0] + at["posture"]] == mine.max()


def test_every_choice_can_be_made_by_keys(look):
    seen = look(adapted())
    page = seen.page

    def press(where: str, key: str) -> None:
        page.locator(where).first.focus()
        page.keyboard.press(key)

    press("#model", "ArrowUp" if page.input_value("#model") == "1" else "ArrowDown")
    assert page.input_value("#model") != str(seen.chosen["model"])
    assert page.inner_text("#parameters [data-name=model]") == page.inner_text("#model option:checked")
    press("#posture", "ArrowRight")
    press("#next", "Enter")
    assert page.inner_text("#readout").startswith("Posture 3 of 5")
    press("#show-before", "Space")
    assert page.get_attribute("#show-before", "aria-pressed") == "true"
    press("[data-view=front]", "Enter")
    page.wait_for_function(f"() => {EYE}.y > 1.0")
    press("#subject-table tr:nth-child(2) .person", "Enter")
    assert page.input_value("#subject") == "1"
    assert page.evaluate("document.activeElement.id") == "subject", "where the eyes are taken, the keys go"
    press("[data-of=heat] summary", "Enter")
    expect(page.locator("[data-of=heat] table")).to_be_visible()
    seen.assert_quiet()


def test_the_numbers_of_every_chart_are_in_its_table(look):
    seen = look(adapted())
    seen.page.select_option("#subject", label="s2")
    words = {"measured": "measured", "model as it is": "as it is", "adapted": "adapted"}
    for place, unit in (("angles", "°"), ("constraints", "mm")):
        table = numbers_of(seen, place)
        for figure in seen.page.locator(f"#{place} .figure").all():
            title, traces = json.loads(figure.evaluate("one => JSON.stringify([one.layout.title.text, one.data])"))
            for trace in traces:
                assert column(table, f"{title}, {words[trace['name']]}, {unit}") == trace["y"]
                assert column(table, "humerus elevation, °") == trace["x"]
    maps = seen.page.evaluate("[...document.querySelectorAll('#heat-maps .figure')].map((one) => one.data[0].z)")
    assert [[float(cell) for cell in row[2:]] for row in numbers_of(seen, "heat")[1:]] == [*maps[0], *maps[1]]
    data = seen.data()
    first_mm = landmarks_of(data["models"][seen.chosen["model"]]["measured_points_mm"], ["TS"], 9)
    (ts,) = [row for row in numbers_of(seen, "view") if row[0] == "TS"]
    assert [float(cell) for cell in ts[1:4]] == first_mm.ravel().tolist()
    seen.page.select_option("#subject", label="s1")
    measured = column(numbers_of(seen, "angles"), f"{data['angles'][0]['name']}, measured, °")
    assert measured == data["measured_deg"][0][:5], "an open table follows the choice"
    seen.assert_quiet()


def test_a_table_goes_to_the_clipboard_as_a_spreadsheet_takes_it(look, started):
    started.grant_permissions(["clipboard-read", "clipboard-write"])
    seen = look(adapted())
    table = numbers_of(seen, "angles")
    seen.page.click(".numbers[data-of=angles] button")
    expect(seen.page.locator(".numbers[data-of=angles] [role=status]")).to_have_text("copied")
    copied = seen.page.evaluate("navigator.clipboard.readText()")
    assert [line.split("\t") for line in copied.split("\n")] == table
    seen.assert_quiet()


def test_on_a_desk_an_adaptation_has_no_grave_fault(look):
    seen = look(adapted())
    numbers_of(seen, "angles")
    assert grave_faults(seen) == []
    seen.assert_quiet()


def test_the_numbers_in_a_heat_map_can_be_read_on_every_colour(look):
    seen = look(adapted())
    text, scale = seen.page.evaluate(f"[{HEAT}.textfont.color, {HEAT}.colorscale]")
    assert min(contrast(text, colour) for _, colour in scale) >= LEAST_CONTRAST
    drawn = seen.page.locator("#heat-maps .heatmap-label text").first
    assert drawn.evaluate("one => getComputedStyle(one).fill") == "rgb(17, 17, 17)"


def drag_until_turned(seen: Seen, before: dict[str, float]) -> None:
    """Drag the view as a user does, repeating drags without an effect, and release when it has turned.

    A busy machine drops moves, shows them late, and loses a press that comes while the view is redrawn. From
    straight above only an upward drag turns the view, so the drags alternate between down and up.
    """
    page = seen.page
    page.locator("#readout").evaluate("one => one.scrollIntoView()")
    for drag in range(DRAGS):
        box = page.locator("#view").bounding_box()
        assert box
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + 0.95 * box["width"], box["y"] + (0.55, 0.3)[drag % 2] * box["height"], steps=5)
        try:
            page.wait_for_function(TURNED, arg=before, timeout=DRAG_MS)
            seen.settled_eye()
        except PlaywrightTimeout:
            continue
        finally:
            page.mouse.up()
        return
    pytest.fail(f"{DRAGS} drags did not turn the view")


@pytest.mark.parametrize("window", [WIDE, PHONE], ids=["desk", "phone"])
def test_the_view_steps_through_the_postures_and_turns(look, window):
    """The drawn girdle is that of the slider's posture, with the measured one in black and the adapted one in blue."""
    seen = look(adapted(), window)
    page, data = seen.page, seen.data()
    model = data["models"][data["first_model"]]
    for step in range(3):
        assert page.inner_text("#readout").startswith(f"Posture {step + 1} of 5")
        measured = landmarks_of(model["measured_points_mm"], TRIANGLE, step)
        np.testing.assert_allclose(drawn_scapula(seen, "measured"), measured, rtol=0.0, atol=DRAWN_MM)
        after = landmarks_of(model["states"]["after"]["simulated_points_mm"], TRIANGLE, step)
        np.testing.assert_allclose(drawn_scapula(seen, "adapted"), after, rtol=0.0, atol=DRAWN_MM)
        page.click("#next")
    assert page.input_value("#posture") == "3"
    before = seen.settled_eye()
    drag_until_turned(seen, before)
    turned = seen.settled_eye()
    assert max(abs(turned[axis] - before[axis]) for axis in "xyz") > 0.1
    page.click("#next")
    assert max(abs(seen.settled_eye()[axis] - turned[axis]) for axis in "xyz") < 1e-6, "stepping does not turn it back"
    page.click("[data-view=front]")
    page.wait_for_function(f"() => {EYE}.y > 1.0")
    page.click("#previous")
    assert seen.settled_eye()["y"] > 1.0, "stepping keeps the view that was asked for"
    seen.assert_quiet()


def test_on_a_phone_an_adaptation_has_no_grave_fault(look):
    seen = look(adapted(), PHONE)
    numbers_of(seen, "angles")
    assert grave_faults(seen) == []
    assert too_small_for_a_finger(seen) == []
    seen.assert_quiet()
    seen.page.set_viewport_size(TABLET)
    seen.assert_quiet()


def test_on_a_phone_a_table_has_a_shadow_where_it_goes_on(look):
    table = look(adapted(), PHONE).page.locator("#before-after .scroll")
    edges = []
    for place in ("0", "it.scrollWidth"):
        table.evaluate(f"it => {{ it.scrollLeft = {place} }}")
        grey = np.asarray(Image.open(BytesIO(table.screenshot())).convert("L"))
        edges.append((np.median(grey[:, 4]) > WHITE, np.median(grey[:, -5]) > WHITE))
    assert edges == [(True, False), (False, True)]


ODD = [EVIL, "no elevation", "failed", "one elevation", "one posture"]
"""Subjects with missing data; the first one lacks the scapula."""


@cache
def odd() -> str:
    angles_deg = rising(4, 4)
    angles_deg[0, :, 3:] = np.nan
    motions = motions_of(angles_deg, names=ODD[:4], motion=EVIL)
    motions.humerus_elevation_deg[4:8] = np.nan
    motions.humerus_elevation_deg[12:] = 30.0
    motions = Motions.concatenate([motions, motions_of(rising(1, 1), names=ODD[4:])])
    motions = simulated(motions, len(ODD))
    why = {EVIL: "adaptation not_converged", "failed": "failed"}
    return report_html(motions, R2, adaptations(motions, R2, failed=["failed"]), why)


def test_a_name_that_would_run_is_shown_as_text(look):
    seen = look(odd())
    assert seen.page.locator("#subject option").first.text_content() == EVIL
    assert seen.page.locator("#motion option").first.text_content() == EVIL
    assert seen.page.locator("#subject-table tbody th").first.text_content() == EVIL
    assert EVIL in (seen.page.text_content("#failed") or "")
    assert "All subjects are simulated" in seen.page.inner_text(".badge")
    seen.assert_quiet()


def test_odd_subjects_are_drawn_without_an_error(look):
    seen = look(odd())
    page = seen.page
    for k, name in enumerate(ODD):
        page.select_option("#subject", label=name)
        page.click("#next")
        page.click("#show-before" if k % 2 == 0 else "#show-after")
        assert page.inner_text("#readout").startswith("Posture ")
    seen.assert_quiet()


def test_a_motion_at_one_elevation_is_drawn_posture_by_posture(look):
    seen = look(odd())
    seen.page.select_option("#subject", label="one elevation")
    first = seen.page.locator("#angles .figure").first
    drawn = "one => [one.data[0].x, one.layout.xaxis.title.text]"
    assert first.evaluate(drawn) == [[1, 2, 3, 4], "posture"]
    seen.assert_quiet()


def test_a_failed_subject_says_so_and_has_no_adapted_ellipsoid(look):
    seen = look(odd())
    seen.page.select_option("#subject", label="failed")
    assert "adaptation not_converged · fit adapted: not_converged" in seen.page.inner_text("#readout")
    assert not [one for one in seen.traces() if one["type"] == "surface"]
    seen.page.click("#show-before")
    assert [one for one in seen.traces() if one["type"] == "surface"]


def test_one_posture_of_one_subject_that_failed_is_drawn_without_an_error(look):
    motions = motions_of(rising(1, 1))
    seen = look(report_html(motions, R2, adaptations(motions, R2, failed=["s1"]), {"s1": "failed"}))
    page = seen.page
    page.click("#next")
    assert page.inner_text("#readout").startswith("Posture 1 of 1")
    page.click("#show-before")
    assert drawn_scapula(seen, "model as it is").shape == (3, 4)
    assert page.evaluate(f"{HEAT}.z[0].length") == 1
    seen.assert_quiet()


def test_on_a_phone_a_diagnosis_has_no_grave_fault(look):
    seen = look(diagnosed(), PHONE)
    numbers_of(seen, "ranking")
    assert grave_faults(seen) == []
    assert too_small_for_a_finger(seen) == []
    seen.assert_quiet()


@pytest.mark.parametrize("window", [PHONE, WIDE], ids=["phone", "desk"])
def test_a_diagnosis_is_in_the_page(look, window):
    seen = look(diagnosed(), window)
    page = seen.page
    assert page.inner_text("h1") == sentence(TWO)
    steps = [name.split("\n")[0] for name in page.locator("#gap-budget [data-model=R2] .name").all_inner_texts()]
    causes = ["+ AC joint moves ac_translation", "+ scapula lifts off the thorax scapulothoracic_gap"]
    assert steps == ["model as it is", "adapted", "+ own bones", *causes, "noise alone"]
    hovered = page.locator("#gap-budget [data-model=R2] abbr").first.get_attribute("title")
    assert hovered == EFFECTS["ac_translation:posture"].what
    widths = [
        box["width"] for one in page.locator("#gap-budget [data-model=R2] .bar").all() if (box := one.bounding_box())
    ]
    np.testing.assert_allclose(np.divide(widths, widths[0]), np.divide([4.1, 2.8, 2.0, 1.4, 0.9, 0.3], 4.1), atol=0.01)
    words = " ".join(page.inner_text("#why").split())
    assert "conoid_strain and clavicle_axial_estimate" in words, "cannot be told apart"
    assert TWO.next_measurement[0].what in words
    assert "4.0 [3.9, 4.1] mm" in words
    named = page.locator("#why .answer.named .name code").all_inner_texts()
    assert named == ["scapulothoracic_gap", "ac_translation", "conoid_strain"]
    assert "2.80 [2.70, 2.90]" in " ".join(page.inner_text("#gap").split())
    (both, *_) = page.locator("#gaps .figure").all()
    held_out, in_sample = json.loads(both.evaluate("one => JSON.stringify(one.data)"))
    assert (held_out["name"], in_sample["name"]) == ("held-out motions", "in sample")
    assert held_out["x"] == [4.1, 2.8, 2.0, 0.9, 0.3]
    assert in_sample["x"] == pytest.approx([4.0, 2.4, 1.6, 0.5, 0.2])
    (band,) = [
        one
        for one in json.loads(page.evaluate("JSON.stringify(document.querySelector('#angles .figure').data)"))
        if one.get("fill")
    ]
    measured = seen.data()["measured_deg"][0][:5]
    np.testing.assert_allclose(np.subtract(band["y"], measured), 1.96 * TWO.noise.angle_deg, rtol=0.0, atol=1e-9)
    seen.assert_quiet()


def test_on_a_desk_a_diagnosis_has_no_grave_fault(look):
    seen = look(diagnosed())
    numbers_of(seen, "ranking")
    assert grave_faults(seen) == []
    seen.assert_quiet()


def test_without_an_effect_there_is_no_gap_with_it(look):
    seen = look(diagnosed())
    seen.page.select_option("#model", label="R4")
    held_out, _ = json.loads(seen.page.evaluate("JSON.stringify(document.querySelector('#gaps .figure').data)"))
    assert held_out["x"] == [4.1, 2.9, 2.9, 0.3]
    assert "with" not in seen.page.inner_text("#gap [data-model=R4] tbody")
    seen.assert_quiet()


def test_bars_and_held_out_gaps_have_their_tables(look):
    seen = look(diagnosed())
    assert column(numbers_of(seen, "budget"), "gap, °") == [4.1, 2.8, 2.0, 1.4, 0.9, 0.3]
    assert column(numbers_of(seen, "budget"), "high") == [4.2, 2.9, 2.1, 1.5, 1.0, 0.4]
    assert numbers_of(seen, "ranking")[1] == ["scapula lifts off the thorax scapulothoracic_gap", "0.88"]
    held_out, in_sample = seen.page.evaluate("document.querySelector('#gaps .figure').data.map((one) => one.x)")
    gaps = numbers_of(seen, "gaps")
    both = [gaps[0], *(row for row in gaps if row[0] == "both bones")]
    assert column(both, "held-out motions, °") == held_out
    assert column(both, "in sample, °") == pytest.approx(in_sample)
    seen.assert_quiet()


def test_every_control_and_explanation_is_reached_by_tab_and_seen(look):
    seen = look(diagnosed())
    count, unreached, unseen = unreached_by_tab(seen, "h1 abbr")
    assert count > 60
    assert unreached == []
    assert unseen == []
    seen.page.focus("#gap-budget abbr")
    seen.page.keyboard.press("Escape")
    assert seen.page.evaluate("document.activeElement === document.body")
    seen.assert_quiet()


def test_on_paper_nothing_is_cut_and_no_control_is_left(look):
    seen = look(diagnosed())
    width = "document.querySelector('#angles .main-svg').clientWidth"
    before = seen.page.evaluate(width)
    pdf = seen.page.pdf(format="A4")
    assert pdf.count(b"/Subtype /Image") >= 1, "the 3-D view"
    assert seen.page.evaluate(width) == before, "and back on the screen as it was"
    seen.page.emulate_media(media="print")
    closed = seen.page.locator("details:not([open]) > summary").all()
    assert closed
    assert not any(one.is_visible() for one in closed), "what is closed leaves no heading"
    seen.page.emulate_media(media="screen")
    found, dark = on_paper(seen)
    assert {key: found[key] for key in ("cut", "other_width", "controls", "headings_alone") if found[key]} == {}
    assert found["pictures"] == [True]
    assert found["budget_ends"] < A4_INSIDE["height"], "verdict and budget are on the first page"
    assert dark < MOST_INK


def test_the_picture_of_a_report_is_small(started, tmp_path):
    report, out = tmp_path / "report.html", tmp_path / "report.png"
    report.write_text(adapted(), encoding="utf-8")
    picture(started, report, 3, {"width": 1240, "height": 1310}).save(out, optimize=True)
    assert out.stat().st_size < LARGEST_PICTURE_BYTES
    with Image.open(out) as drawn:
        assert len(drawn.convert("RGB").getcolors(1 << 20) or []) > 20, "something is drawn"


def test_a_report_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        main(tmp_path / "report.html", tmp_path / "report.png")
