"""Reports of five parameter sets in a real browser, with the longest options: in every width, and on A4."""

import re
from dataclasses import replace
from functools import cache

import pytest
from browsing import PHONE, TABLET, WIDE, needs_browser
from diagnoses import MANY, TWO
from handmade import adaptations, motions_of, rising
from playwright.sync_api import expect
from reaching import on_paper

from adapt.diagnosis.result import Diagnoses
from adapt.report import report_html
from adapt.tables.results import Tables
from models import load_model
from models.adapted_parameters import ADAPTED
from motions import Motions

pytestmark = needs_browser

FIVE = [load_model(name) for name in ("R2", "R4", "R6", "breteler_dissection", "breteler_mri")]


OF_LONG_NAME = "abduction in the plane of the scapula, third repetition"
"""Name of a motion as long as names of files."""


@cache
def bounded() -> tuple[Motions, Tables]:
    """Make adaptations of twelve subjects in which every parameter of every set is at a bound."""
    parts = [motions_of(rising(12, 5), motion=OF_LONG_NAME), motions_of(rising(12, 4), motion="flexion")]
    motions = Motions.concatenate(parts)
    made = adaptations(motions, FIVE)
    at_bound = {f"{name}_mm_at_bound": 1 for name in ADAPTED}
    return motions, replace(made, parameters=made.parameters.assign(**at_bound))


@cache
def adapted_sets() -> str:
    """Make a report of the adaptations."""
    motions, made = bounded()
    return report_html(motions, FIVE, made)


@cache
def five_sets() -> str:
    """Make a report of five sets: two causes, one with the posture as basis; as many sets as the page has room for."""
    motions, made = bounded()
    diagnoses = {one.name: replace(MANY if k % 2 else TWO, model=one.name) for k, one in enumerate(FIVE)}
    return report_html(motions, FIVE, made, {}, Diagnoses(diagnoses))


PAGES = {"adaptation": adapted_sets, "diagnosis": five_sets}


@pytest.fixture(scope="module", params=PAGES)
def page(request) -> str:
    """Return each report; pytest runs all tests of one before those of the next, so that each is loaded once."""
    return PAGES[request.param]()


@pytest.mark.parametrize("width", [PHONE["width"], TABLET["width"], WIDE["width"]])
def test_the_longest_page_of_five_sets_fits(look, page, width):
    seen = look(page, {"width": width, "height": 900})
    for number in range(len(FIVE)):
        seen.page.select_option("#model", index=number)
        seen.assert_quiet()


def test_the_longest_page_of_five_sets_fits_on_a4(look, page):
    """Check the columns of every table too: one that falls off the paper is wider than its part of the page."""
    seen = look(page)
    found, _ = on_paper(seen)
    assert {key: found[key] for key in ("cut", "other_width", "controls", "headings_alone") if found[key]} == {}


def test_the_command_to_copy_names_the_folder_of_the_page(look):
    seen = look(five_sets())
    command = seen.page.locator(".command:visible")
    said = command.locator("code").inner_text()
    assert "--model R2 --own-bones --effects-of" in said
    assert "FOLDER" not in said, "the page was opened as a file"
    command.locator("button").click()
    expect(command.locator("[role=status]")).to_have_text(re.compile("copied|selected"))
    seen.assert_quiet()
