"""Refusal of unusable user-defined effects, with the reason in one line."""

from dataclasses import replace

import jax.numpy as jnp
import pytest

from adapt import diagnose, simulate_model_subjects
from models import load_model
from models.effects import EFFECTS, Effect, EffectPrior
from models.effects.own_effects import check_own_effects, is_user_defined

MODEL = load_model("R2")


def shorter_conoid(girdle, rotations, percent):
    """Shorten the conoid by a percentage."""
    return replace(girdle, conoid_length_mm=girdle.conoid_length_mm * (1.0 - percent[0] / 100.0)), rotations


def effect(adjust) -> Effect:
    """Return an effect with this ``adjust``, otherwise sound."""
    return Effect("own", "an example", "%", ("of the length",), adjust, EffectPrior((10.0,), source="assumed, a test"))


def at_zero_too(girdle, rotations, percent):
    return shorter_conoid(girdle, rotations, percent + 5.0)


def not_finite(girdle, rotations, percent):
    return shorter_conoid(girdle, rotations, jnp.log(percent))


def nothing(girdle, rotations, percent):
    return girdle, rotations


def girdle_alone(girdle, rotations, percent):
    return girdle


def three_rotations(girdle, rotations, percent):
    return girdle, (*rotations, rotations[0])


def test_a_sound_one_passes_and_is_simulated():
    check_own_effects([effect(shorter_conoid)], MODEL.girdle)
    assert len(simulate_model_subjects(MODEL, effect(shorter_conoid), 1, 0.5, seed=0).truth) == 1


@pytest.mark.parametrize(
    ("adjust", "words"),
    [
        (at_zero_too, "changes A1-A3 at strength 0"),
        (not_finite, "A1-A3"),
        (nothing, "changes nothing at its scale"),
        (girdle_alone, "adjust fails.*It returns"),
        (three_rotations, "adjust fails.*It returns"),
    ],
)
def test_a_useless_one_is_refused(adjust, words):
    with pytest.raises(ValueError, match=f"effect 'own': .*{words}"):
        check_own_effects([effect(adjust)], MODEL.girdle)


def test_whoever_takes_effects_refuses_it():
    with pytest.raises(ValueError, match="changes nothing"):
        simulate_model_subjects(MODEL, effect(nothing), 1, 0.5, seed=0)
    motions = simulate_model_subjects(MODEL, None, 2, 0.5, seed=0).motions
    with pytest.raises(ValueError, match="changes nothing"):
        diagnose(motions, MODEL, effects=[effect(nothing)])


def test_what_is_listed_is_nobodys_own():
    assert not any(map(is_user_defined, EFFECTS.values()))
    assert is_user_defined(effect(shorter_conoid))
    assert is_user_defined(replace(EFFECTS["conoid_strain"], adjust=shorter_conoid))


def test_those_that_are_listed_would_pass():
    for one in EFFECTS.values():
        check_own_effects([replace(one, name="own")], MODEL.girdle)
