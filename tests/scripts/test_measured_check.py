"""The check on measured shoulders says '-' where data hold nothing that was not fitted."""

from pathlib import Path

import numpy as np
import pytest

from models import load_model
from motions import read_motions
from scripts.measured_check import named_without

SHIPPED = Path(__file__).parents[2] / "motions" / "data" / "simulated_subjects.csv"


@pytest.mark.parametrize("column", ["subject", "motion"])
def test_with_one_person_or_one_motion_there_is_nothing_to_predict(column):
    every = read_motions(SHIPPED)
    values = getattr(every, column)
    found = named_without(every.select(values == values[0]), load_model("R2"))
    assert set(found) == {"scapula", "clavicle"}
    assert np.isnan(list(found.values())).all()
