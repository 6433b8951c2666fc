"""Derivatives of the posture fit: finite differences, forward and reverse mode, the envelope theorem."""

from dataclasses import fields
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import bones, constraints
from programs import few_runs

from adapt import fit_postures
from adapt.differentiable import fit_posture
from models import load_model
from models.girdle import Girdle, constraint_residuals_mm
from motions import InputError, read_motions
from motions.rhythm_subjects import DATA_FILE, simulate_subjects
from motions.rotations import DEG

FD_TOLERANCE = 1e-6
"""Relative to the largest entry, for central differences of step 1e-3 mm or 1e-4 rad. The solver stops at |g| and
|dL/dq| of 1e-9, mostly far below, which divided by the step leaves 1e-7; the rest is truncation."""

FOLD_STEP_RAD = 1e-5
"""Smaller step at a fold, where the derivatives of the angles change faster."""

EXACT = 1e-9
"""Relative tolerance between forward and reverse mode: the same 9 x 9 system, with condition number 1e4, solved from
the left and from the right."""

ENVELOPE = 1e-7
"""Relative, of dJ/dtheta = lambda . dg/dtheta: exact at the optimum, which is known to a stationarity of 1e-9."""

GIRDLE = load_model("R2").girdle
SUBJECT = jnp.asarray(simulate_subjects(1, seed=3, noise_deg=3.0).angles_deg.T / DEG)
ONE = SUBJECT[:, 4]
ALL = jnp.ones(6, bool)
FIELDS = tuple(field.name for field in fields(Girdle))


def test_angles_by_posture_are_named_as_such():
    with pytest.raises(InputError, match=r"their shape is \(7, 6\)\. Give \(6, postures\) in rad"):
        fit_posture(GIRDLE, jnp.ones((7, 6)))


def quantities(girdle: Girdle, angles, known=ALL):
    """Return angles (rad), multipliers and J of one posture as one vector, to compile everything once."""
    fit = fit_posture(girdle, angles, known)
    return jnp.concatenate([fit.angles, fit.multipliers, fit.j_deg2[None]])


def _twice(*arguments):
    found = quantities(*arguments)
    return found, found


_forward = few_runs(jax.jacfwd(_twice, argnums=(0, 1), has_aux=True))
"""Derivatives and values, in one program."""
_reverse = few_runs(jax.jacrev(quantities, argnums=(0, 1)))


def value(girdle, angles, known=ALL):
    return _forward(girdle, angles, known)[1]


def forward(girdle, angles, known=ALL):
    return _forward(girdle, angles, known)[0]


@cache
def in_reverse():
    """Compute the derivatives at ``ONE`` once for all tests."""
    return _reverse(GIRDLE, ONE, ALL)


def assert_close(found, expected, tolerance: float) -> None:
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("field", FIELDS)
def test_fit_multipliers_and_j_along_every_number_of_the_girdle(field):
    number = getattr(GIRDLE, field)
    slope = np.asarray(getattr(forward(GIRDLE, ONE)[0], field)).reshape(10, -1)
    others = {f: getattr(GIRDLE, f) for f in FIELDS}
    for k in range(number.size):
        step = 1e-3 * jnp.eye(number.size)[k].reshape(number.shape)
        ends = [value(Girdle(**(others | {field: number + s * step})), ONE) for s in (1.0, -1.0)]
        assert_close(slope[:, k], (ends[0] - ends[1]) / 2e-3, FD_TOLERANCE)
    assert_close(np.asarray(getattr(in_reverse()[0], field)).reshape(10, -1), slope, EXACT)


def test_fit_multipliers_and_j_along_every_measured_angle():
    slope = np.asarray(forward(GIRDLE, ONE)[1])
    for k in range(6):
        step = 1e-4 * jnp.eye(6)[k]
        assert_close(slope[:, k], (value(GIRDLE, ONE + step) - value(GIRDLE, ONE - step)) / 2e-4, FD_TOLERANCE)
    assert_close(in_reverse()[1], slope, EXACT)
    gap = np.asarray(value(GIRDLE, ONE)[:6] - ONE)
    assert_close(slope[9], -gap * DEG**2 / 3.0, ENVELOPE)  # dJ/ds = -W (q - s), without dq/ds


def test_the_fitted_posture_stays_on_the_constraints():
    """Check G dq/ds = 0, and that dq/ds is symmetric (a projection where the surface is flat) and has rank three."""
    fitted = value(GIRDLE, ONE)
    dq = np.asarray(forward(GIRDLE, ONE)[1])[:6]
    _, G = constraints(bones(GIRDLE), np.asarray(fitted[:6]) * DEG)
    assert np.abs(G @ dq).max() <= EXACT * np.abs(G).max()
    assert_close(dq, dq.T, EXACT)
    assert np.linalg.matrix_rank(dq, tol=1e-8) == 3


def test_the_slope_of_j_is_the_multipliers_times_the_slope_of_the_constraints():
    """dJ/dtheta = lambda . dg/dtheta (envelope theorem), for every number of the girdle."""
    fitted = value(GIRDLE, ONE)
    T = few_runs(jax.jacfwd(constraint_residuals_mm))(GIRDLE, fitted[:6])
    slope = forward(GIRDLE, ONE)[0]
    for field in FIELDS:
        expected = np.tensordot(np.asarray(fitted[6:9]), np.asarray(getattr(T, field)), axes=1)
        assert_close(np.asarray(getattr(slope, field))[9], expected, ENVELOPE)
    assert float(slope.ts_distance_mm[9]) == pytest.approx(-float(fitted[6]), rel=ENVELOPE)


def test_a_missing_angle_has_no_slope_and_takes_no_part():
    known = jnp.array([True, True, False, True, True, True])
    slope = _reverse(GIRDLE, ONE, known)[1][:6]
    assert np.abs(slope[:, 2]).max() == 0.0
    assert np.abs(slope[:, 0]).max() > 0.1


def test_a_posture_that_fails_is_nan_alone_and_padding_is_zero():
    """R2 with a conoid far too short for one of three postures, and one posture without any measured angle: no wrong
    number, and no NaN in the others."""
    girdle = jax.tree.map(lambda x: jnp.stack([x, x, x], axis=-1), GIRDLE)
    short = Girdle(**(vars(girdle) | {"conoid_length_mm": girdle.conoid_length_mm.at[1].set(1.0)}))
    three = jnp.stack([ONE, ONE, jnp.full(6, jnp.nan)], axis=-1)
    measured = jnp.isfinite(three)

    def total(girdle, s):
        fit = fit_posture(girdle, s, measured)
        return jnp.nansum(fit.j_deg2), fit

    (j, fit), (of_girdle, slope) = few_runs(jax.value_and_grad(total, (0, 1), has_aux=True))(short, three)
    expected = value(GIRDLE, ONE)
    assert_close(fit.angles[:, 0], expected[:6], EXACT)
    assert np.isnan(np.asarray(fit.angles)[:, 1]).all()
    assert float(j) == pytest.approx(float(expected[9]), rel=EXACT)
    assert_close(slope[:, 0], in_reverse()[1][9], EXACT)
    assert float(fit.j_deg2[2]) == 0.0
    for one in [slope, *jax.tree.leaves(of_girdle)]:
        assert not np.asarray(one)[..., 2].any()


def test_it_ends_where_fit_postures_ends():
    """Three shipped postures for which two starts end in a higher minimum."""
    model, rows = load_model("R2"), [33, 40, 41]
    motions = read_motions(DATA_FILE)
    fitted = fit_postures(motions, model).by_model["R2"]
    for posture, row in zip(motions.angles_deg[rows] / DEG, rows, strict=True):
        found = value(model.girdle, jnp.asarray(posture))
        np.testing.assert_allclose(found[9], fitted.j_deg2[row], rtol=SAME_J)
        np.testing.assert_allclose(found[:6], fitted.angles[:, row], rtol=0.0, atol=SAME_J)


SAME_J = 1e-9
"""Tolerance, relative for J and in rad for angles: both fits end at a stationarity of 1e-9."""


@cache
def at_a_fold() -> tuple[jnp.ndarray, jnp.ndarray]:
    """A posture with an unmeasured clavicle, where no chain has the measured angles of the scapula."""
    angles = jnp.asarray(simulate_subjects(10, seed=1).angles_deg[44] / DEG)
    return angles, jnp.arange(6) >= 3


@pytest.mark.parametrize("angle", range(3, 6))
def test_slopes_where_three_missing_angles_are_at_a_fold(angle):
    angles, known = at_a_fold()
    assert value(GIRDLE, angles, known)[-1] > 1.0  # J: three of six angles can be met exactly, except at a fold
    step = FOLD_STEP_RAD * jnp.eye(6)[angle]
    up, down = (value(GIRDLE, angles + sign * step, known) for sign in (1.0, -1.0))
    assert_close(forward(GIRDLE, angles, known)[1][:, angle], (up - down) / (2.0 * FOLD_STEP_RAD), FD_TOLERANCE)
