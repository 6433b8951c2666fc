"""Figures of a diagnosis: every kind of answer can be drawn, reproducibly, and shows its numbers."""

from dataclasses import replace
from functools import cache
from xml.etree import ElementTree

import pytest
from diagnoses import BY_KIND, CAUSES, ONE

from adapt.output.diagnosis_figures import FIGURES, figures


def words(svg: str) -> list[str]:
    return [node.text or "" for node in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


@cache
def drawn_once(kind: str) -> dict[str, str]:
    """Draw once for all tests, because drawing takes half a second."""
    return figures(BY_KIND[kind])


@pytest.mark.parametrize("kind", BY_KIND)
def test_figures_are_valid_xml(kind):
    drawn = drawn_once(kind)
    assert tuple(drawn) == FIGURES
    assert all(words(svg) for svg in drawn.values())


@pytest.mark.parametrize("kind", ["many", "nothing"])
def test_figures_are_the_same_bytes_on_a_second_draw(kind):
    """With and without causes: the marks that are drawn do not change how the file is written."""
    assert drawn_once(kind) == figures(BY_KIND[kind])


def test_figures_say_their_numbers():
    drawn = {name: set(words(svg)) for name, svg in drawn_once("two").items()}
    assert next(iter(drawn)) == "budget.svg"
    steps = {"model as it is", "adapted", "+ ac_translation", "+ scapulothoracic_gap", "noise alone"}
    assert steps | {"4.10", "2.80", "1.40", "0.90", "0.30"} <= drawn["budget.svg"]
    assert {*CAUSES, "0.88", "0.62", "0.31"} <= drawn["inclusion.svg"]
    assert {"1.8", "1.2", "0.5", "0-30", "30-60", "abduction"} <= drawn["gap_heatmap.svg"]
    assert {"noise alone", "model as it is", "adapted", "with the causes"} <= drawn["gaps.svg"]
    assert "with the causes" not in words(drawn_once("nothing")["gaps.svg"]), "there is none to add"


def test_bars_of_named_causes_are_dark():
    light = [drawn_once(kind)["inclusion.svg"].count("fill: #b9cfe0") for kind in ("nothing", "two")]
    assert light == [len(CAUSES), len(CAUSES) - 3]


def test_names_from_files_are_drawn_as_they_are():
    names = [f"{name} {k}" for k in range(15) for name in ("$x^2$ & <b>", "horizontal_flexion")]
    motions = [replace(one, motion=name) for one, name in zip(10 * ONE.where.cells, names, strict=False)]
    drawn = words(figures(replace(ONE, where=replace(ONE.where, cells=motions)))["gap_heatmap.svg"])
    assert {"$x^2$ & <b> 14", "horizontal_flexion 14"} <= {*drawn}
