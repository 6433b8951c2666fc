"""The numbers of a parameter set as effects: the numbers that a set doubts, and their ranges."""

import re

import numpy as np
import pytest

from models import load_model, model_names
from models.effects import EFFECTS
from models.effects.set_numbers import NUMBER_EFFECTS, doubtful_numbers
from models.sets.number_sources import range_mm, unread_range

OF_R2 = {
    "sc_offset": 10.0,
    "clavicle_conoid_offset": 8.0,
    "scapula_conoid_offset": 8.0,
    "ts_offset": 2.0,
    "ai_offset": 2.0,
    "ts_distance_offset": 10.0,
    "ai_distance_offset": 10.0,
}
"""Ranges that the sources of R2 state."""


def test_the_thesis_set_doubts_what_it_assumes_and_derives():
    found = doubtful_numbers(load_model("R2"))
    assert {name: set(effect.prior.scale) for name, effect in found.items()} == {k: {v} for k, v in OF_R2.items()}
    sc = found["sc_offset"]
    assert sc.prior.source == f"the set: {load_model('R2').source['clavicle.sc_mm']}"
    assert "+-10 mm" in sc.prior.source
    assert len(sc.prior.scale) == len(sc.directions) == 3


def test_what_was_published_is_not_doubted():
    """Check DAS3, whose SC was published; its other numbers were transformed to another frame."""
    assert set(doubtful_numbers(load_model("das3"))) == set(OF_R2) - {"sc_offset"}


@pytest.mark.parametrize("name", model_names())
def test_every_shipped_number_that_was_not_measured_states_its_range(name):
    model = load_model(name)
    for key in NUMBER_EFFECTS:
        if model.source[key].startswith(("assumed", "derived")):
            assert re.search(r"\+-[0-9.]+ mm$", model.source[key]), key


@pytest.mark.parametrize(
    ("source", "scale"),
    [
        ("assumed: a guess; +-3.5 mm", 3.5),
        ("derived: that of another; +- 12 mm", 12.0),
        ("assumed: as R4, adapted to 10 +- 1 mm, may have it", 10.0),
        ("assumed: no range", 10.0),
        ("assumed: +-10 deg", 10.0),
        ("Assumed: a guess; ±3.5 mm", 3.5),
        ("derived: that of another; +/- 12 mm.", 12.0),
        ("measured: +-2 mm", None),
        ("Measured: +-2 mm", None),
        ("Table 3.3", None),
    ],
)
def test_the_range_is_that_which_the_source_states(source, scale):
    model = load_model("R2")
    model.source["clavicle.sc_mm"] = source
    found = doubtful_numbers(model).get("sc_offset")
    assert (found.prior.scale if found else None) == ((scale,) * 3 if scale else None)


def test_measured_is_read_in_capitals_too():
    model = load_model("R2")
    model.source["clavicle.length_mm"] = "Measured: MRI; ±1.2 mm"
    assert model.is_measured("clavicle.length_mm")
    assert model.range_mm("clavicle.length_mm") == 1.2


@pytest.mark.parametrize(
    ("source", "unread"),
    [
        ("measured: MRI, +- 1.2 cm", "+- 1.2 cm"),
        ("measured: ±1,2 mm", "±1,2 mm"),
        ("measured: +- -1.2 mm", "+- -1.2 mm"),
        ("measured: +-1.2.3 mm", "+-1.2.3 mm"),
        ("assumed: ±10", "±10"),
        ("measured: ±1.2 mm (one SD)", "±1.2 mm (one SD)"),
        ("measured: ±1.2 mm", ""),
        ("assumed: as R4, adapted to 10 +- 1 mm, may have it", ""),
        ("assumed: of R2, not of the person (derived: that of another; +-8 mm)", ""),
        ("adapted to S01, from R2 (w = 10, thorax_tilt +- 5)", ""),
        ("Table 3.3", ""),
    ],
)
def test_a_range_that_cannot_be_read_is_found(source, unread):
    assert unread_range(source) == unread
    assert not unread or range_mm(source) is None


def test_they_are_the_effects_of_that_name_with_another_prior():
    for name, effect in doubtful_numbers(load_model("R2")).items():
        assert effect.adjust is EFFECTS[name].adjust
        assert effect.basis is EFFECTS[name].basis
        np.testing.assert_array_equal(EFFECTS[name].prior.mean, 0.0)


def test_every_key_is_one_of_the_file():
    assert set(NUMBER_EFFECTS) <= set(load_model("R2").source)
