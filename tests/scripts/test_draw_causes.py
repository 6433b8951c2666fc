"""The figure of the causes: its averages, and that it shows every cause."""

import numpy as np
import pytest

from models import load_model
from models.effects import EFFECTS
from motions.table import ANGLES
from scripts.research.named_causes import draw_causes
from scripts.research.named_causes.draw_causes import ELEVATIONS_DEG, MODEL, NOTHING, gaps_deg
from scripts.rooms import ROOT

ROUNDING_DEG = 1e-9


def test_a_turned_scapula_leaves_more_than_no_cause(monkeypatch):
    monkeypatch.setattr(draw_causes, "SUBJECTS", 2)
    model = load_model(MODEL)
    without, turned = gaps_deg(model, None), gaps_deg(model, EFFECTS["scapula_landmark_bias"])
    assert turned[: len(ANGLES)].mean() > 2.0 * without[: len(ANGLES)].mean()


def test_elevations_weigh_up_to_the_mean_of_the_angles(monkeypatch):
    """Two motions of seven elevations, 0 to 150 degrees in steps of 25: two, two and three of them in the bins."""
    monkeypatch.setattr(draw_causes, "SUBJECTS", 1)
    values = gaps_deg(load_model(MODEL), None)
    by_angle, by_elevation = values[: len(ANGLES)], values[len(ANGLES) :]
    assert len(by_elevation) == len(ELEVATIONS_DEG)
    assert np.average(by_elevation, weights=(2, 2, 3)) == pytest.approx(by_angle.mean(), abs=ROUNDING_DEG)


def test_the_picture_in_the_documents_shows_every_cause():
    text = (ROOT / "docs" / "causes.svg").read_text(encoding="utf-8")
    assert [name for name in (NOTHING, *EFFECTS) if ":" not in name and f">{name}<" not in text] == []
