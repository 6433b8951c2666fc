"""Arguments of the Python functions that cannot be meant: one line each, before anything is compiled or fitted."""

import logging
import re

import numpy as np
import pytest

from adapt import adapt_subjects, fit_postures
from adapt.differentiable import adapt_subject, fit_posture, objective
from models import load_model
from motions import InputError, read_motions
from motions.errors import InputWarning
from motions.rhythm_subjects import DATA_FILE

R2 = load_model("R2")
ALL = read_motions(DATA_FILE)
ONE = ALL.select(ALL.subject == ALL.subjects[0])
NAME = ONE.subjects[0]

ARGUMENTS = {
    "no weight": ({"weight": 0}, "weight: with w = 0 the measured angles have no part in E"),
    "a text": ({"weight": "10"}, "weight: w is '10'. Give one number, as 10"),
    "several": ({"weight": np.array([10.0, 1.0])}, "Give one number, as 10"),
    "down-weighting": (
        {"thorax_downweighting": "30"},
        "thorax_downweighting: the down-weighting of thorax points is 30",
    ),
    "objective": ({"objective": "x"}, "objective: unknown variant 'x'. Use one of mm2_deg2"),
    "effects": ({"effects": ["thorax_tilt"]}, "effects: this is a list. Give amplitudes by name"),
    "nothing": ({"own_bones": None}, "own_bones: this is None. Give True, False, SDs by name"),
    "one": ({"own_bones": 1}, "own_bones: this is 1"),
    "yes": ({"own_bones": "yes"}, "own_bones: this is 'yes'"),
    "a name": ({"held_out": NAME}, f"held_out: '{NAME}' is a text, not a collection of names. Give ['{NAME}']"),
    "somebody": ({"held_out": ["simulated99"]}, "held_out: there is no subject 'simulated99'. Did you mean"),
    "whole numbers": ({"dtype": int}, "dtype: fits cannot be of type int64"),
    "half": ({"dtype": np.float16}, "dtype: fits cannot be of type float16"),
}


@pytest.mark.parametrize(("how", "said"), ARGUMENTS.values(), ids=ARGUMENTS)
def test_an_argument_that_cannot_be_meant_is_refused(how, said):
    with pytest.raises(InputError, match=re.escape(said)):
        adapt_subjects(ONE, R2, **how)


def test_a_girdle_is_no_model():
    with pytest.raises(InputError, match=r"models: a Girdle is no parameter set\. Load it"):
        fit_postures(ONE, R2.girdle)  # type: ignore[arg-type]


def test_subjects_without_the_landmarks_of_the_objective_are_named():
    with pytest.warns(InputWarning, match=f"no positions of TS and AI: {NAME}. They are adapted without them"):
        adapt_subjects(ONE, R2, objective="mm2_deg2_landmarks", held_out=())


def test_another_weight_beside_own_bones_is_said_to_change_little():
    with pytest.warns(InputWarning, match="w = 20 changes no adaptation with own bones"):
        adapt_subjects(ONE, R2, 20.0, own_bones=True, held_out=())


s = np.deg2rad(ONE.angles_deg).T
G, P, B = R2.girdle, R2.points_mm, R2.bounds_mm
COUNT = s.shape[1]
ANY = np.ones_like(s, bool)
DIFFERENTIABLE = {
    "a set": (lambda: fit_posture(R2, s), "girdle: this is a ParameterSet. Give load_model(name).girdle"),  # type: ignore
    "degrees": (lambda: fit_posture(G, ONE.angles_deg.T), "Give radians"),
    "degrees in a list": (lambda: fit_posture(G, ONE.angles_deg.T.tolist()), "Give radians"),  # type: ignore
    "which angles": (lambda: fit_posture(G, s, ANY[:, 0]), f"measured: its shape is (6,). Give (6, {COUNT})"),
    "which postures": (lambda: fit_posture(G, s, ANY[0]), f"measured: its shape is ({COUNT},)"),
    "halves": (lambda: fit_posture(G, s, 0.5 * ANY), "measured: its entries are of type float64, not True or False"),
    "start": (lambda: fit_posture(G, s, start=s[:, 0]), "start: its shape is (6,)"),
    "one posture": (lambda: adapt_subject(G, P, B, s[:, 0]), "angles: their shape is (6,). Give (6, postures) in rad"),
    "two subjects": (lambda: adapt_subject(G, P, B, np.stack([s, s], -1)), "angles: their shape is (6,"),
    "points": (lambda: adapt_subject(G, P.T, B, s), "points_mm: its shape is"),
    "bounds turned": (lambda: adapt_subject(G, P, B.T, s), "bounds_mm: its shape is (6, 2). Give (2, 6)"),
    "bounds exchanged": (lambda: adapt_subject(G, P, B[::-1], s), "bounds_mm: a lower bound is above its upper one"),
    "theta": (lambda: adapt_subject(G, P, B, s, start=np.zeros(3)), "start: its shape is (3,). Give (6,)"),
    "points of E": (lambda: objective(G.adapted_mm, G, P.T, s), "points_mm: its shape is"),
}


@pytest.mark.parametrize(("call", "said"), DIFFERENTIABLE.values(), ids=DIFFERENTIABLE)
def test_an_input_of_another_kind_is_refused_before_anything_compiles(call, said, caplog):
    with caplog.at_level(logging.WARNING), pytest.raises(InputError, match=re.escape(said)):
        call()
    assert not caplog.messages


def test_masked_angles_are_not_measured():
    hidden = np.zeros_like(s, bool)
    hidden[2, :3] = True
    under = np.ma.masked_array(np.where(hidden, 2.5, s), hidden)
    found, expected = fit_posture(G, under), fit_posture(G, s, ~hidden)
    np.testing.assert_array_equal(found.j_deg2, expected.j_deg2)


def test_residuals_want_the_component_first():
    with pytest.raises(ValueError, match=r"component first: angles of shape \(14, 6\) should have shape \(6, \.\.\.\)"):
        G.residuals_mm(s[:, :14].T)
