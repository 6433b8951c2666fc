"""The study of the misfit with own bones: people as they are expected to be, and a noise that is told too small."""

from dataclasses import replace

import numpy as np

from models import load_model
from scripts.research.person.own_bone_worlds import WORLDS, simulate_people
from scripts.research.person.study_misfit import is_rejected


def test_own_bones_are_rejected_where_the_noise_is_larger_than_it_is_said_to_be():
    model = load_model("R2")
    people = simulate_people(model, WORLDS["as the prior"](model), 3, 1.5, 2)
    assert not is_rejected(people, np.random.default_rng(0))
    assert is_rejected(replace(people, noise_deg=0.3), np.random.default_rng(0))
