"""The smallest change of an ellipsoid that closes a posture: against SLSQP, by hand for the conoid, and for noise."""

import jax
import numpy as np
import pytest
from programs import few_runs
from scipy.optimize import minimize

from adapt import fit_postures
from adapt.trust.questions.posture_ellipsoids import foreseen_square_sd, least_change, smooth_share
from models import load_model
from models.girdle import Girdle
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG

SD_MM = np.array([8.0, 7.0, 2.0, 13.0, 17.0, 2.0])
"""SDs of R6 in Table 6.5."""

CLOSED_MM = 1e-9
"""Constraint tolerance of ``least_change``."""

SLSQP = 1e-6
"""Relative tolerance of |delta / SD|^2."""

SMALL_DEG = 0.02
"""Noise so small that the change is linear in the errors to a hundredth."""

CHANCE = 0.12
"""Relative tolerance, six SDs. A mean square of 400 numbers has an error of at most 7 % where one error dominates; over
14 postures it is less than 2 %."""


@pytest.fixture(scope="module")
def closed() -> tuple[Girdle, np.ndarray]:
    """14 closed postures of one simulated subject with R6, and the girdle of each."""
    model, motions = load_model("R6"), read_motions(DATA_FILE)
    fitted = fit_postures(motions.select(motions.subject == "simulated02"), model).by_model["R6"]
    return model.girdle.repeated(fitted.angles.shape[1]), fitted.angles


def take(girdle: Girdle, k: int) -> Girdle:
    return jax.tree.map(lambda x: x[..., k], girdle)


def test_closed_postures_need_no_change(closed):
    girdle, angles = closed
    found = least_change(girdle, angles, SD_MM)
    assert set(found.status) == {"ok"}
    assert found.size_sd.max() < CLOSED_MM


def test_it_closes_the_chain_with_the_least_change_as_slsqp_finds_it(closed):
    girdle, angles = closed
    measured = angles + np.random.default_rng(5).normal(0.0, 3.0, angles.shape) / DEG
    found = least_change(girdle, measured, SD_MM)
    assert set(found.status) == {"ok"}
    adapted = girdle.with_adapted(girdle.adapted_mm + found.change_mm)
    assert np.abs(adapted.residuals_mm(measured)).max() <= CLOSED_MM

    def closing(z, one, q):
        return one.with_adapted(one.adapted_mm + SD_MM * z).residuals_mm(q)

    open_mm, slopes = few_runs(closing), few_runs(jax.jacfwd(closing))
    for k in range(0, 14, 4):
        given = take(girdle, k), measured[:, k]
        constraint = {"type": "eq", "fun": open_mm, "jac": slopes, "args": given}
        best = minimize(lambda z: z @ z, np.zeros(6), jac=lambda z: 2.0 * z, constraints=constraint, tol=SLSQP**2)
        assert np.abs(open_mm(best.x, *given)).max() <= CLOSED_MM, "it may go on in rounding, if closed"
        np.testing.assert_allclose(found.size_sd[k] ** 2, best.fun, rtol=SLSQP)


def test_the_conoid_takes_the_whole_of_its_own_constraint(closed):
    girdle, angles = closed
    measured = angles + np.random.default_rng(6).normal(0.0, 2.0, angles.shape) / DEG
    found = least_change(girdle, measured, SD_MM)
    np.testing.assert_allclose(found.change_mm[5], girdle.residuals_mm(measured)[2], rtol=0.0, atol=CLOSED_MM)


def test_a_posture_without_numbers_has_no_change_and_a_word_and_leaves_the_others(closed):
    girdle, angles = closed
    measured = angles + 1.0 / DEG
    expected = least_change(girdle, measured, SD_MM)
    measured[:, 3] = np.nan
    found = least_change(girdle, measured, SD_MM)
    assert found.status[3] == "not_converged"
    assert np.isnan(found.change_mm[:, 3]).all()
    others = np.arange(14) != 3
    np.testing.assert_allclose(found.change_mm[:, others], expected.change_mm[:, others], rtol=0.0, atol=CLOSED_MM)


def test_noise_alone_gives_the_foreseen_course(closed):
    """Check the mean square of every parameter in every posture, no correlation of neighbours, and no smooth share."""
    girdle, angles = closed
    foreseen = foreseen_square_sd(girdle, angles, SMALL_DEG, SD_MM)
    errors = SMALL_DEG / DEG * np.random.default_rng(7).standard_normal((400, *angles.shape))
    measured = np.moveaxis(angles + errors, 0, 1).reshape(6, -1)  # one batch of all repeats
    every = jax.tree.map(lambda x: np.tile(x, 400), girdle)
    found = np.moveaxis(least_change(every, measured, SD_MM).in_sd.reshape(6, 400, -1), 1, 0)
    squares = (found**2).mean(axis=0)
    np.testing.assert_allclose(squares.sum(axis=0), foreseen.sum(axis=0), rtol=4.0 * CHANCE)
    np.testing.assert_allclose(squares.mean(axis=1), foreseen.mean(axis=1), rtol=CHANCE)
    together = np.einsum("rkp,rkp->p", found[..., 1:], found[..., :-1]) / len(found)
    scale = np.sqrt(foreseen.sum(axis=0)[1:] * foreseen.sum(axis=0)[:-1])
    assert np.abs(together / scale).max() < 5.0 / np.sqrt(len(found))
    shares = [smooth_share(one / np.sqrt(foreseen), [np.arange(7), np.arange(7, 14)]) for one in found]
    assert abs(np.mean(shares)) < 0.05


def test_a_parabola_is_smooth_and_an_alternating_course_is_not():
    rows, turn = np.arange(40), np.arange(40) / 10.0
    parabola = np.stack([turn**2, 1.0 - turn])
    assert smooth_share(parabola, [rows[:20], rows[20:]]) > 1.0 - 1e-12
    alternating = np.where(rows % 2 == 0, 1.0, -1.0)[None]
    # third differences are 8, squared 64, over 20; the variance of +-1 is 20 / 19
    np.testing.assert_allclose(smooth_share(alternating, [rows[:20]]), 1.0 - 3.2 / (20.0 / 19.0))
    assert np.isnan(smooth_share(alternating, [rows[:4]]))
