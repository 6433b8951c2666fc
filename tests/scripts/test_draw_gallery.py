"""The pictures of the gallery are what the library draws, small, and shown there."""

import re

import pytest

from adapt.output.svg import svg
from models.effects import EFFECTS
from scripts import draw_gallery
from scripts.rooms import ROOT

MOST_BYTES = 60_000
"""Limit for a picture, so that pages load quickly."""


@pytest.mark.parametrize("name", ["positions", "inclusion", "heat_map"])
def test_a_picture_is_small_and_in_the_gallery(name):
    assert (ROOT / "docs" / f"{name}.svg").stat().st_size < MOST_BYTES
    assert f"({name}.svg)" in (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")


def test_positions_are_those_of_the_trial_that_ships():
    drawn = svg(draw_gallery.positions)
    for word in ("TS x, mm", "measured", "adapted", "base"):
        assert f">{word}<" in drawn


def test_inclusion_has_the_effects_that_exist():
    text = (ROOT / "docs" / "inclusion.svg").read_text(encoding="utf-8")
    names = set(re.findall(r">(\w+(?:_\w+)+)<", text))
    assert "skin_artefact" in names <= {effect.cause for effect in EFFECTS.values()}
