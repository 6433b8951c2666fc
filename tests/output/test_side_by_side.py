"""Parameter sets diagnosed in separate processes give the results of one process."""

import multiprocessing
import os
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from small_worlds import CANDIDATES, simulated

from adapt.api import adapt_with_every_fold
from adapt.diagnosis import diagnose
from adapt.diagnosis.result import Diagnoses
from adapt.diagnosis.texts.json_form import as_json
from adapt.output.large_runs import side_by_side
from adapt.output.large_runs.side_by_side import diagnose_side_by_side
from models import load_model
from models.effects import EFFECTS
from motions import InputError
from motions.table import Motions

pytestmark = pytest.mark.slow


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(side_by_side, "cores", lambda: 2)


def few_postures() -> Motions:
    motions = simulated().motions
    return motions.select(np.isin(motions.subject, motions.subjects[:2]))


def test_processes_find_what_one_finds_and_say_what_they_are_at(two_cores):
    motions, models, said = few_postures(), [load_model("R2"), replace(load_model("R2"), name="again")], []
    options: dict[str, Any] = {"effects": [EFFECTS[name] for name in CANDIDATES]}
    adaptations = adapt_with_every_fold(motions, models)
    found = diagnose_side_by_side(motions, models, said.append, adaptations, **options)
    expected = diagnose(motions, models, adaptations=adaptations, **options)
    assert list(found) == ["R2", "again"]
    assert as_json(Diagnoses(found)) == as_json(Diagnoses(expected))
    assert {stage.partition(":")[0] for stage in said} == {"R2", "again"}


class Dying:
    """A model that ends the process that unpickles it."""

    def __reduce__(self):
        return os._exit, (1,)


def test_a_process_that_the_system_ends_is_named_with_what_to_do(two_cores):
    motions = few_postures()
    with pytest.raises(InputError, match=r"the system ended a process.* one --model at a time"):
        diagnose_side_by_side(motions, [Dying(), Dying()], lambda _: None, None)  # type: ignore[list-item, arg-type]


def test_what_a_process_refuses_is_refused_in_its_words(two_cores):
    motions, models = few_postures(), [load_model("R2"), load_model("R4")]
    adaptations, others = adapt_with_every_fold(motions, models), multiprocessing.active_children()
    with pytest.raises(ValueError, match="effects: give one candidate or more"):
        diagnose_side_by_side(motions, models, lambda _: None, adaptations, effects=())
    assert set(multiprocessing.active_children()) <= set(others), "nobody waits for the other set, and it has ended"
