"""The table of rules for the base set against hand computation, and two persons through the whole study."""

import numpy as np
import pandas as pd

from scripts.research.person import study_base_set
from scripts.research.person.study_base_set import row, with_every_base

BASES = ["R2", "breteler_dissection"]
"""Two of the six shipped sets; each costs a run of the command."""


def test_a_row_by_hand():
    """c is the true base and excluded. Nearest outside: A gets b (a is inside), B gets a; smallest gap: A a, B b."""
    gaps_deg = pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, 1.5], "c": [0.1, 0.1]}, index=["A", "B"])
    nearest_mm = pd.DataFrame({"a": [-20.0, 1.0], "b": [30.0, 5.0], "c": [-9.0, 0.0]}, index=["A", "B"])
    assert row(gaps_deg, nearest_mm, "c") == "50 % | 25 % | 1.88 | 2.50 | 1.25"


def test_simulated_persons_have_a_gap_and_a_distance_for_every_base(tmp_path, monkeypatch):
    monkeypatch.setattr(study_base_set, "model_names", lambda: BASES)
    gaps_deg, nearest_mm = with_every_base("R4", 2, 0, tmp_path / "R4")
    assert gaps_deg.shape == nearest_mm.shape == (2, len(BASES))
    assert np.isfinite(gaps_deg.to_numpy()).all()
    assert np.all(nearest_mm["R2"].to_numpy() < nearest_mm["breteler_dissection"].to_numpy())
