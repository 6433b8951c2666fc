"""Draws of amplitudes: their gradients against that of E, and against a refit in which one person counts more."""

from dataclasses import replace

import numpy as np
from small_worlds import joint_fit, searched

from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.prediction import linearise
from adapt.diagnosis.inference.amplitude_draws import draws_of, scores_by_motion
from adapt.diagnosis.inference.correlation import Independence
from models.adapted_parameters import ADAPTED

BIAS = "scapula_landmark_bias"
_MORE = 0.05
"""One person counts so much more: a first-order prediction holds to about this share."""

_SETTLED = 1e-10
"""Decrease of E + prior that is nothing beside what this person's weight changes."""


def test_the_gradients_of_a_subjects_motions_sum_to_that_of_its_E():
    search = searched(BIAS)
    node = search.nodes[(BIAS,)]
    where = search.joint.candidates.where((BIAS,))
    every, _ = node.linearised.normal_equations(where)
    for subject, by_motion in enumerate(node.linearised.gradients(where)):
        thorax = np.zeros(every.shape[1])
        thorax[: len(ADAPTED)] = node.linearised.thorax.gradient[subject]
        np.testing.assert_allclose(by_motion.sum(axis=0) + thorax, every[subject], rtol=1e-9, atol=1e-9)


def test_a_person_that_counts_more_moves_the_fit_as_its_gradient_says():
    search, joint = searched(BIAS), joint_fit(BIAS)
    found = search.nodes[(BIAS,)]
    a = joint.fit((BIAS,), found.fitted.theta_mm, found.fitted.amplitude, _SETTLED)
    node = found._replace(fitted=a, linearised=linearise(joint, search.folds, (BIAS,), a))
    parts = (joint.parts[0]._replace(importance=1.0 + _MORE), *joint.parts[1:])
    heavier = JointFit(joint.model, joint.shoulders, joint.candidates, parts)
    moved = heavier.fit((BIAS,), a.theta_mm, a.amplitude, _SETTLED).amplitude[0] - a.amplitude[0]
    hessian, scores, person = scores_by_motion(search, node)
    expected = -_MORE * np.linalg.solve(hessian, scores[person == 0].sum(axis=0))
    np.testing.assert_allclose(moved, expected, rtol=0.15, atol=0.05 * np.abs(expected).max())


def test_draws_spread_about_the_fit_and_less_with_more_independent_postures():
    search = searched(BIAS)
    node = search.nodes[(BIAS,)]
    few = draws_of(replace(search, independence=Independence(3.0)), node)
    many = draws_of(replace(search, independence=Independence(30.0)), node)
    error = few.std(axis=0) / np.sqrt(len(few))
    assert (np.abs(few.mean(axis=0) - node.fitted.amplitude[0]) < 4.0 * error).all()
    assert (many.std(axis=0) < few.std(axis=0)).all()
