"""The girdle's geometry against cases solved by hand, and the derivatives of the constraints."""

from dataclasses import fields, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import bones, constraints
from programs import few_runs, one_run

from models import load_model, model_names
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle, constraint_residuals_mm, landmarks
from motions.rhythm import REST_DEG
from motions.rotations import DEG

ROUNDING_MM = 1e-11
"""A few rounding errors of sums of 100s of mm; the distance to the ellipsoid is as accurate."""

FD_TOLERANCE = 2e-7
"""Tolerance for central differences, 1e-6 rad or 1e-3 mm: the rounding of the residuals, 1e-13 mm, over the step, and
the square of the step times third derivatives of 100s of mm per cubic radian."""

EXACT = 1e-10
"""Tolerance between forward and reverse mode: the same sums in another order, 100s of mm per radian."""

SC = np.array([20.0, -8.0, 12.0])
L, WIDTH, HEIGHT = 150.0, 110.0, 100.0
RADIUS = 140.0

HAND = Girdle(
    centre_mm=np.array([0.0, -150.0, 60.0]),
    semi_axes_mm=np.full(3, RADIUS),
    sc_mm=np.asarray(SC),
    ac_mm=np.array([L, 0.0, 0.0]),
    clavicle_conoid_mm=np.array([120.0, 10.0, 0.0]),
    ts_mm=np.array([-WIDTH, 0.0, 0.0]),
    ai_mm=np.array([-WIDTH, -HEIGHT, 0.0]),
    scapula_conoid_mm=np.array([-20.0, 0.0, -30.0]),
    ts_distance_mm=np.array(5.0),
    ai_distance_mm=np.array(-3.0),
    conoid_length_mm=np.array(16.0),
)
"""Girdle with round numbers and a sphere as thorax."""

residuals = few_runs(constraint_residuals_mm)


def radians(*angles_deg: float) -> np.ndarray:
    return np.array(angles_deg) / DEG


def to_sphere(point) -> float:
    return float(np.linalg.norm(np.asarray(point) - np.asarray(HAND.centre_mm)) - RADIUS)


def test_unturned_bones_lie_along_the_thorax_axes():
    at = landmarks(HAND, np.zeros(6))
    AC = SC + np.array([L, 0.0, 0.0])
    np.testing.assert_allclose(at.AC, AC, rtol=0.0, atol=ROUNDING_MM)
    np.testing.assert_allclose(at.TS, AC - [WIDTH, 0.0, 0.0], rtol=0.0, atol=ROUNDING_MM)
    np.testing.assert_allclose(at.AI, AC - [WIDTH, HEIGHT, 0.0], rtol=0.0, atol=ROUNDING_MM)
    np.testing.assert_allclose(at.clavicle_conoid, SC + np.array([120.0, 10.0, 0.0]), rtol=0.0, atol=ROUNDING_MM)
    np.testing.assert_allclose(at.scapula_conoid, AC + np.array([-20.0, 0.0, -30.0]), rtol=0.0, atol=ROUNDING_MM)
    # The conoid is AC + (-20, 0, -30) - SC - (120, 10, 0) = (10, -10, -30).
    expected = [to_sphere(at.TS) - 5.0, to_sphere(at.AI) + 3.0, np.sqrt(1100.0) - 16.0]
    np.testing.assert_allclose(residuals(HAND, np.zeros(6)), expected, rtol=0.0, atol=ROUNDING_MM)


def test_a_quarter_turn_about_each_axis_of_the_clavicle():
    """Protraction swings AC to the front (-z), elevation up; axial rotation moves only the conoid's attachment."""
    for angles, AC, conoid in (
        ((90.0, 0.0, 0.0), [0.0, 0.0, -L], [0.0, 10.0, -120.0]),
        ((0.0, 90.0, 0.0), [0.0, L, 0.0], [-10.0, 120.0, 0.0]),
        ((0.0, 0.0, 90.0), [L, 0.0, 0.0], [120.0, 0.0, 10.0]),
    ):
        at = landmarks(HAND, radians(*angles, 0.0, 0.0, 0.0))
        np.testing.assert_allclose(at.AC, SC + AC, rtol=0.0, atol=ROUNDING_MM)
        np.testing.assert_allclose(at.clavicle_conoid, SC + conoid, rtol=0.0, atol=ROUNDING_MM)


def test_a_girdle_in_the_sagittal_plane():
    """Check both bones protracted by 90 degrees and SC in the plane: all landmarks have x = 0, A1 and A2 are plane
    distances.

    The bones' x is then -z of the thorax. A rotation in the plane (b) moves no landmark out of it. The constraints of
    the sphere have slopes of 0 along a, which moves landmarks out of the plane.
    """
    girdle = replace(HAND, sc_mm=np.array([0.0, -8.0, 12.0]), scapula_conoid_mm=np.array([-20.0, -30.0, 0.0]))
    angles = radians(90.0, 0.0, 0.0, 90.0, 0.0, 0.0)
    at = landmarks(girdle, angles)
    for point in (at.AC, at.TS, at.AI, at.clavicle_conoid, at.scapula_conoid):
        assert abs(float(point[0])) <= ROUNDING_MM
    np.testing.assert_allclose(at.TS, [0.0, -8.0, 12.0 - L + WIDTH], rtol=0.0, atol=ROUNDING_MM)
    np.testing.assert_allclose(at.AI, [0.0, -8.0 - HEIGHT, 12.0 - L + WIDTH], rtol=0.0, atol=ROUNDING_MM)
    ts = np.hypot(-8.0 + 150.0, -28.0 - 60.0) - RADIUS - 5.0
    ai = np.hypot(-108.0 + 150.0, -28.0 - 60.0) - RADIUS + 3.0
    conoid = np.hypot(-30.0 - 10.0, 130.0 - 120.0) - 16.0  # y, z of AC + R (-20, -30, 0) - SC - R (120, 10, 0)
    np.testing.assert_allclose(residuals(girdle, angles), [ts, ai, conoid], rtol=0.0, atol=ROUNDING_MM)
    G = BY_ANGLE(girdle, angles)
    np.testing.assert_allclose(np.asarray(G)[:2, [0, 3]], 0.0, rtol=0.0, atol=EXACT)
    assert abs(float(G[0, 1])) > 1.0


@pytest.mark.parametrize("const1", [-20.0, 0.0, 7.0])
def test_the_scapula_that_puts_ts_on_a_sphere(const1):
    """Check the cosine rule, with the centre m medial of AC and TS at ``WIDTH`` from AC.

    TS is at r + const1 where cos a = (m^2 + WIDTH^2 - (r + const1)^2) / (2 m WIDTH).
    """
    m = 160.0
    AC = SC + np.array([L, 0.0, 0.0])
    girdle = replace(HAND, centre_mm=jnp.asarray(AC - [m, 0.0, 0.0]), ts_distance_mm=jnp.array(const1))
    a = np.arccos((m**2 + WIDTH**2 - (RADIUS + const1) ** 2) / (2.0 * m * WIDTH))
    for sign in (1.0, -1.0):
        A1 = residuals(girdle, jnp.array([0.0, 0.0, 0.0, sign * a, 0.0, 0.0]))[0]
        assert abs(float(A1)) <= ROUNDING_MM


def test_the_constants_are_subtracted_and_the_conoid_is_a_length():
    base = np.asarray(residuals(HAND, radians(*REST_DEG)))
    moved = replace(
        HAND,
        ts_distance_mm=jnp.array(6.0),
        ai_distance_mm=jnp.array(-1.0),
        conoid_length_mm=jnp.array(19.0),
    )
    np.testing.assert_allclose(residuals(moved, radians(*REST_DEG)), base - [1.0, 2.0, 3.0], rtol=0.0, atol=ROUNDING_MM)


def test_adapted_parameters_go_in_and_out_in_their_order():
    values = jnp.arange(1.0, 7.0) * 10.0
    girdle = HAND.with_adapted(values)
    assert ADAPTED == ("M_y", "M_z", "A_x", "A_y", "A_z", "conoid_length")
    np.testing.assert_array_equal(girdle.adapted_mm, values)
    np.testing.assert_array_equal(girdle.centre_mm, [0.0, 10.0, 20.0])
    np.testing.assert_array_equal(girdle.semi_axes_mm, [30.0, 40.0, 50.0])
    assert float(girdle.conoid_length_mm) == 60.0


@pytest.mark.parametrize("name", model_names())
def test_shipped_sets_have_the_residuals_of_the_other_engine(name):
    girdle = load_model(name).girdle
    generator = np.random.default_rng(1)
    target = REST_DEG + generator.uniform(-40.0, 40.0, (50, 6))
    found = residuals(girdle.repeated(50), target.T / DEG)
    for q, g in zip(target, np.asarray(found).T, strict=True):
        np.testing.assert_allclose(g, constraints(bones(girdle), q)[0], rtol=0.0, atol=ROUNDING_MM)


# --- derivatives ----------------------------------------------------------------------------------

FIELDS = tuple(field.name for field in fields(Girdle))
BY_ANGLE = few_runs(jax.jacfwd(constraint_residuals_mm, argnums=1))
BY_GIRDLE = few_runs(jax.jacfwd(constraint_residuals_mm))
IN_REVERSE = few_runs(jax.jacrev(constraint_residuals_mm, argnums=(0, 1)))
REST = jnp.asarray(REST_DEG / DEG)


@pytest.mark.parametrize("name", ["R2", "das3"])
def test_slopes_along_the_angles(name):
    girdle = load_model(name).girdle
    G = np.asarray(BY_ANGLE(girdle, REST))
    for k in range(6):
        step = 1e-6 * jnp.eye(6)[k]
        difference = (residuals(girdle, REST + step) - residuals(girdle, REST - step)) / 2e-6
        np.testing.assert_allclose(G[:, k], difference, rtol=0.0, atol=FD_TOLERANCE)
    np.testing.assert_allclose(IN_REVERSE(girdle, REST)[1], G, rtol=0.0, atol=EXACT)
    np.testing.assert_allclose(G / DEG, constraints(bones(girdle), REST_DEG)[1], rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("field", FIELDS)
@pytest.mark.parametrize("name", ["R2", "das3"])
def test_slopes_along_every_number_of_the_girdle(name, field):
    girdle = load_model(name).girdle
    slope = np.asarray(getattr(BY_GIRDLE(girdle, REST), field)).reshape(3, -1)
    value = getattr(girdle, field)
    for k in range(value.size):
        step = 1e-3 * jnp.eye(value.size)[k].reshape(value.shape)
        ends = [residuals(replace(girdle, **{field: value + s * step}), REST) for s in (1.0, -1.0)]
        np.testing.assert_allclose(slope[:, k], (ends[0] - ends[1]) / 2e-3, rtol=0.0, atol=FD_TOLERANCE)
    reverse = np.asarray(getattr(IN_REVERSE(girdle, REST)[0], field)).reshape(3, -1)
    np.testing.assert_allclose(reverse, slope, rtol=0.0, atol=EXACT)


def test_where_the_attachments_coincide_the_slope_is_finite():
    girdle = replace(HAND, clavicle_conoid_mm=HAND.ac_mm, scapula_conoid_mm=jnp.zeros(3))
    assert float(residuals(girdle, REST)[2]) == pytest.approx(-16.0, abs=ROUNDING_MM)
    assert np.isfinite(BY_ANGLE(girdle, REST)).all()


def test_a_conoid_shorter_than_a_millimetre_has_its_own_slope():
    girdle = replace(HAND, clavicle_conoid_mm=HAND.ac_mm, scapula_conoid_mm=jnp.array([0.2, 0.3, -0.1]))
    by_length = BY_GIRDLE(girdle, REST).scapula_conoid_mm[2]
    assert float(jnp.linalg.norm(by_length)) == pytest.approx(1.0, abs=EXACT)


def test_a_batch_is_its_members():
    generator = np.random.default_rng(2)
    angles = generator.uniform(-0.5, 0.5, (6, 3, 4))
    spread = jax.tree.map(lambda x: np.broadcast_to(x.reshape(*x.shape, 1, 1), (*x.shape, 3, 4)), HAND)
    found = np.asarray(residuals(spread, angles))
    each = one_run(jax.vmap(jax.vmap(lambda q: constraint_residuals_mm(HAND, q), -1, -1), -1, -1))(angles)
    np.testing.assert_allclose(each, found, rtol=0.0, atol=ROUNDING_MM)
    np.testing.assert_allclose(residuals(HAND.over_axes(2), angles), found, rtol=0.0, atol=ROUNDING_MM)
    over_postures = HAND.repeated(4).over_postures()
    np.testing.assert_allclose(residuals(over_postures, angles), found, rtol=0.0, atol=ROUNDING_MM)


def test_numpy_finds_what_jax_finds():
    """Check NumPy's result: the code is JAX's, except for the conoid's length and the root of the distance."""
    generator = np.random.default_rng(4)
    angles = generator.uniform(-0.5, 0.5, (6, 5))
    found = constraint_residuals_mm(HAND.repeated(5), angles)
    assert isinstance(found, np.ndarray)
    expected = one_run(jax.vmap(lambda q: constraint_residuals_mm(HAND, q), -1, -1))(angles)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUNDING_MM)


def test_one_girdle_takes_any_batch_of_angles():
    girdle, angles = load_model("R2").girdle, np.linspace(-0.4, 0.4, 6 * 2 * 3).reshape(6, 2, 3)
    found = np.asarray(girdle.residuals_mm(angles))
    for place in np.ndindex(2, 3):
        one = girdle.residuals_mm(angles[(slice(None), *place)])
        np.testing.assert_allclose(found[(slice(None), *place)], one, rtol=0.0, atol=1e-12)


def test_degrees_are_refused():
    with pytest.raises(ValueError, match=r"in radians: give np.deg2rad"):
        load_model("R2").girdle.residuals_mm(np.full(6, 30.0))
