"""The candidate effects: zero is the base model, geometry by another engine, landmarks where they would be seen."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import Bones, bones, constraints, ellipsoid_distance
from programs import few_runs
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from models import load_model
from models.effects import EFFECTS, ActiveEffects, Effect, ExtendedGirdle
from models.effects.prior import COURSE_SD
from models.girdle import constraint_residuals_mm
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG, cardan_from_rotation

SAME_MM = 1e-12
"""Amplitude zero adds zero or multiplies by the identity: rounding of coordinates of 200 mm is 3e-14 mm."""

GEOMETRY_MM = 1e-9
"""Two ways to compute one geometry: rounding of 1e-14 mm, and the ellipsoid's Newton stops at 1e-12 mm."""

FELT_MM = 0.1
"""An effect of its prior scale that changes no constraint by this much would change nothing that can be measured."""

FD_STEP = 1e-4
"""Of amplitudes in units of their scale: truncation goes with its square, rounding of 1e-13 mm with its inverse."""

FD_TOLERANCE_MM = 1e-6
"""mm a scale: truncation of second derivatives of at most 10 mm is 1e-7, rounding 1e-13 mm / 1e-4."""

SMALL = 1e-3
"""Size, in scales, at which effects are a change of first order."""

FIRST_ORDER = 2.0 * SMALL
"""What two effects of SMALL size change beyond their sum, or by being taken in the other order, as a share of the
smaller of them: of second order (seen: half of SMALL)."""

SUPERQUADRIC = 1e-4
"""Exponent for which the surface is the moved ellipsoid to first order, and the share by which it then differs."""

CONTRACT = [
    "scapulothoracic_gap",
    "conoid_strain",
    "ac_translation",
    "sc_translation",
    "thorax_tilt",
    "thorax_asymmetry",
    "thorax_shape",
    "clavicle_length",
    "scapula_size",
    "scapula_landmark_bias",
    "clavicle_axial_estimate",
    "skin_artefact",
    "thorax_extension",
]
"""The names that files and commands of other versions know: of ``effects.md``, which is not part of the project."""

GIRDLE = load_model("R2").girdle
BONES = bones(GIRDLE)
_MOTIONS = simulate_subjects(1, seed=4, noise_deg=0.0)
ANGLES = jnp.asarray(_MOTIONS.angles_deg.T / DEG)
POSTURES = ANGLES.shape[1]

each_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)


def chain(*acting: tuple[Effect, np.ndarray]) -> ExtendedGirdle:
    """R2 with effects of given strengths (channels,), the same in all postures."""
    strengths = tuple(jnp.repeat(jnp.asarray(strength, float)[:, None], POSTURES, axis=1) for _, strength in acting)
    return ExtendedGirdle(GIRDLE.over_axes(1), ActiveEffects(strengths, tuple(effect for effect, _ in acting)))


@few_runs
def looked_at(extended: ExtendedGirdle, angles):
    """Residuals and landmarks: compiled once for each tuple of effects."""
    return extended.residuals_mm(angles), extended.landmarks_mm(angles)


def residuals(extended: ExtendedGirdle, angles=ANGLES) -> np.ndarray:
    return np.asarray(looked_at(extended, angles)[0])


def points(extended: ExtendedGirdle, angles=ANGLES) -> np.ndarray:
    return np.asarray(looked_at(extended, angles)[1])


@few_runs
def slope(extended: ExtendedGirdle, direction: ExtendedGirdle):
    """Derivative of the residuals at ANGLES along the strengths of ``direction``."""

    def residuals_at(active_effects):
        return replace(extended, active_effects=active_effects).residuals_mm(ANGLES)

    return jax.jvp(residuals_at, (extended.active_effects,), (direction.active_effects,))[1]


def assert_slope(effect: Effect, at: np.ndarray, direction: np.ndarray) -> None:
    """The derivative is that of central differences."""
    up, down = (residuals(chain((effect, at + sign * FD_STEP * direction))) for sign in (1.0, -1.0))
    close(slope(chain((effect, at)), chain((effect, direction))), (up - down) / (2.0 * FD_STEP), FD_TOLERANCE_MM)


def unequal(effect: Effect) -> np.ndarray:
    """A strength of the size of the scale with another value and sign in each channel."""
    return np.asarray(effect.prior.scale) * np.array([0.8, -0.6, 0.5, -0.7, 0.4, -0.3])[: len(effect.prior.scale)]


def turn(deg: np.ndarray) -> np.ndarray:
    """exp of a vector in degrees, by SciPy."""
    return Rotation.from_rotvec(deg, degrees=True).as_matrix()


def rotations(angles=ANGLES) -> tuple[np.ndarray, np.ndarray]:
    """(postures, 3, 3) of clavicle and scapula, by SciPy."""
    C, S = (Rotation.from_euler("YZX", np.asarray(angles[k : k + 3]).T).as_matrix() for k in (0, 3))
    return C, S


def angles_of(R_clavicle: np.ndarray, R_scapula: np.ndarray) -> jnp.ndarray:
    """Six angles (6, postures) of matrices (postures, 3, 3)."""
    return jnp.concatenate([cardan_from_rotation(jnp.asarray(np.moveaxis(R, 0, -1))) for R in (R_clavicle, R_scapula)])


_residuals = jax.jit(constraint_residuals_mm)


def shown_of(b: Bones, angles=ANGLES) -> np.ndarray:
    """SHOWN of these bones, (3, 4, postures), in NumPy."""
    postures = []
    for C, S in zip(*rotations(angles), strict=True):
        AC = b.sc_mm + C @ b.ac_mm
        postures.append(np.stack([b.sc_mm, AC, AC + S @ b.ts_mm, AC + S @ b.ai_mm], axis=1))
    return np.stack(postures, axis=2)


def base_points(angles=ANGLES) -> np.ndarray:
    """SHOWN of the base chain."""
    return shown_of(BONES, angles)


def base_residuals(angles=ANGLES) -> np.ndarray:
    return np.asarray(_residuals(GIRDLE.over_axes(1), angles))


def close(found, expected, tolerance: float = GEOMETRY_MM) -> None:
    np.testing.assert_allclose(np.asarray(found), np.asarray(expected), rtol=0.0, atol=tolerance)


# --- every effect ---------------------------------------------------------------------------------


def test_names_are_those_of_the_contract():
    assert sorted(EFFECTS) == sorted(CONTRACT)
    assert [name for name, effect in EFFECTS.items() if effect.name != name] == []


@each_effect
def test_amplitude_zero_is_the_base_model(effect):
    at_zero = chain((effect, np.zeros(len(effect.channels))))
    close(residuals(at_zero), base_residuals(), SAME_MM)
    close(points(at_zero), base_points(), SAME_MM)


@each_effect
def test_every_channel_changes_what_is_seen_in_its_own_way(effect):
    """The changes of all postures by each channel are felt and linearly independent: by a direction of the effect those
    of the constraints, by a detail at least those of the landmarks."""

    def changes(strength: np.ndarray) -> list[np.ndarray]:
        changed = chain((effect, strength))
        return [(residuals(changed) - base_residuals()).ravel(), (points(changed) - base_points()).ravel()]

    by_channel = [changes(row) for row in np.diag(effect.prior.scale)]
    of_constraints = [change for change, _ in by_channel[: len(effect.directions)]]
    for each in (of_constraints, [np.concatenate(both) for both in by_channel]):
        assert min(np.abs(change).max() for change in each) > FELT_MM
        assert np.linalg.svd(np.array(each), compute_uv=False)[-1] > FELT_MM


@each_effect
def test_derivative_by_each_channel_is_that_of_differences(effect):
    for direction in np.diag(effect.prior.scale):
        assert_slope(effect, unequal(effect), direction)


@each_effect
def test_derivative_at_zero_is_that_of_differences(effect):
    """Where every fit begins; rotations by a vector have 0/0 there."""
    assert_slope(effect, np.zeros(len(effect.prior.scale)), unequal(effect))


def test_small_effects_add_up_and_their_order_does_not_matter():
    """Every effect alone and every pair, at SMALL size: lanes of one chain of all effects, in both orders."""
    effects = tuple(EFFECTS.values())
    pairs = list(itertools.combinations(range(len(effects)), 2))
    acting = np.array([[k in case for case in [(), *((k,) for k in range(len(effects))), *pairs]]
                       for k in range(len(effects))])  # fmt: skip
    acting = np.repeat(acting, POSTURES, axis=1)
    strengths = tuple(
        jnp.asarray(SMALL * unequal(effect)[:, None] * act) for effect, act in zip(effects, acting, strict=True)
    )
    angles = jnp.tile(ANGLES, (1, acting.shape[1] // POSTURES))
    in_orders = (ActiveEffects(strengths[::way], effects[::way]) for way in (1, -1))
    forth, back = (residuals(ExtendedGirdle(GIRDLE.over_axes(1), order), angles) for order in in_orders)
    close(forth[:, :POSTURES], base_residuals(), GEOMETRY_MM)
    changes = (forth - np.tile(base_residuals(), (1, acting.shape[1] // POSTURES))).reshape(3, -1, POSTURES)
    otherwise = (forth - back).reshape(changes.shape)
    alone = changes[:, 1 : 1 + len(effects)]
    for case, (a, b) in enumerate(pairs, 1 + len(effects)):
        least = min(np.abs(alone[:, k]).max() for k in (a, b))
        beyond = changes[:, case] - alone[:, a] - alone[:, b]
        assert np.abs(beyond).max() <= FIRST_ORDER * least, (effects[a].name, effects[b].name)
        assert np.abs(otherwise[:, case]).max() <= FIRST_ORDER * least, (effects[a].name, effects[b].name)


@each_effect
def test_what_describes_an_effect_fits_together(effect):
    terms = len(COURSE_SD) if effect.over_elevation else 1
    assert effect.amplitudes == len(effect.signs) == len(effect.prior_sd) == terms * len(effect.channels)
    assert len(effect.prior.scale) == len(effect.channels)
    assert effect.channels[: len(effect.directions)] == effect.directions != ()
    assert effect.leading is None or effect.channels[effect.leading] in effect.directions
    assert min(effect.prior.scale) > 0.0
    assert {sign for k, sign in enumerate(effect.signs) if k % terms} <= {0}
    np.testing.assert_allclose(effect.prior_sd[::terms], effect.prior.scale)


@each_effect
def test_a_course_is_zero_with_the_arm_hanging_and_its_first_term_full_at_150_degrees(effect):
    amplitude = np.arange(1.0, effect.amplitudes + 1.0)[:, None] * np.ones(2)
    found = np.asarray(effect.at(jnp.asarray(amplitude), jnp.array([0.0, 150.0])))
    terms = effect.terms
    expected = amplitude[::terms].copy()
    if effect.over_elevation:
        expected[:, 0] = 0.0
    close(found, expected, SAME_MM)


QUARTERS_DEG = jnp.array([37.5, 75.0, 112.5])
"""A quarter, half and three quarters of 150 degrees."""


def test_a_course_is_linear_bent_and_shifted_over_elevation():
    """f, 4 f (1 - f) and 8 f (1 - f) (1 - 2 f)."""
    found = EFFECTS["ac_translation"].course(QUARTERS_DEG)
    close(found, [[0.25, 0.5, 0.75], [0.75, 1.0, 0.75], [0.75, 0.0, -0.75]], SAME_MM)


@pytest.mark.parametrize("name", ["clavicle_axial_estimate", "conoid_strain", "skin_artefact"])
def test_what_comes_late_goes_with_the_square_of_elevation(name):
    """Three quarters of it lie in the upper half; bend and shift are those of all others."""
    found = EFFECTS[name].course(QUARTERS_DEG)
    close(found[0], [0.0625, 0.25, 0.5625], SAME_MM)
    close(found[1:], EFFECTS["ac_translation"].course(QUARTERS_DEG)[1:], SAME_MM)


def test_what_is_constant_has_a_course_of_one():
    close(EFFECTS["thorax_tilt"].course(QUARTERS_DEG), np.ones((1, 3)), SAME_MM)


# --- what they do, by the other engine ------------------------------------------------------------


def longer(b: Bones, strength) -> Bones:
    length, near, thick = 1.0 + np.array([strength[0], *(0.5 * strength[0] + strength[1:])]) / 100.0
    conoid_mm = length * b.ac_mm + np.array([near, thick, thick]) * (b.clavicle_conoid_mm - b.ac_mm)
    return replace(b, ac_mm=length * b.ac_mm, clavicle_conoid_mm=conoid_mm)


def larger(b: Bones, strength) -> Bones:
    width, height = 1.0 + strength[0] / 100.0, 1.0 + (strength[0] + strength[1]) / 100.0
    coracoid, blade = 1.0 + (0.75 * strength[0] + strength[2]) / 100.0, np.array([width, height, width])
    return replace(b, ts_mm=blade * b.ts_mm, ai_mm=blade * b.ai_mm, scapula_conoid_mm=coracoid * b.scapula_conoid_mm)


def apart(b: Bones, strength) -> Bones:
    return replace(b, ts_distance_mm=b.ts_distance_mm + strength[0], ai_distance_mm=b.ai_distance_mm + strength[1])


OTHER_BONES: dict[str, Callable[[Bones, np.ndarray], Bones]] = {
    "scapulothoracic_gap": apart,
    "conoid_strain": lambda b, s: replace(b, conoid_length_mm=b.conoid_length_mm + s[0]),
    "ac_translation": lambda b, s: replace(b, ac_mm=b.ac_mm + s),
    "sc_translation": lambda b, s: replace(b, sc_mm=b.sc_mm + s),
    "thorax_asymmetry": lambda b, s: replace(b, centre_mm=b.centre_mm + np.array([s[0], 0.0, 0.0])),
    "clavicle_length": longer,
    "scapula_size": larger,
}
"""The effects that are a girdle with other numbers."""


@pytest.mark.parametrize("name", OTHER_BONES)
def test_an_effect_on_the_bones_is_a_girdle_with_other_numbers(name):
    strength = unequal(EFFECTS[name])
    changed, other = chain((EFFECTS[name], strength)), OTHER_BONES[name](BONES, strength)
    expected = [constraints(other, q)[0] for q in np.asarray(ANGLES * DEG).T]
    close(residuals(changed), np.transpose(expected))
    close(points(changed), shown_of(other))


def test_a_longer_clavicle_may_keep_the_conoid_at_its_place_near_ac_or_its_share_of_the_length():
    """Only AC and what hangs on it move, and A3 is that of the base model; or all of the clavicle is scaled."""
    near_ac = chain((EFFECTS["clavicle_length"], np.array([8.0, -4.0, -4.0])))
    close(residuals(near_ac)[2], base_residuals()[2])
    scaled = replace(BONES, ac_mm=1.08 * BONES.ac_mm, clavicle_conoid_mm=1.08 * BONES.clavicle_conoid_mm)
    found = residuals(chain((EFFECTS["clavicle_length"], np.array([8.0, 4.0, 4.0]))))
    close(found, np.transpose([constraints(scaled, q)[0] for q in np.asarray(ANGLES * DEG).T]))


@pytest.mark.parametrize(("around", "along"), [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])
def test_thorax_shape_is_the_distance_to_a_superquadric(around, along):
    """Along the normal of the ellipsoid's closest point, to where (|x|^r + |z|^r)^(s / r) + |y|^s = 1 in units of the
    semi-axes, with r the exponent around the long axis and s the one along it."""
    mean, apart = SUPERQUADRIC * (around + along) / 2.0, SUPERQUADRIC * (around - along) / 2.0
    found = residuals(chain((EFFECTS["thorax_shape"], np.array([mean, apart]))))
    r, s = 2.0 + SUPERQUADRIC * np.array([around, along])
    moved = base_residuals() - found
    close(moved[2], np.zeros(POSTURES), SAME_MM)
    for row, k in ((0, 2), (1, 3)):
        for posture, p in enumerate(base_points()[:, k].T):
            relative = p - BONES.centre_mm
            d, n = ellipsoid_distance(relative, BONES.semi_axes_mm)
            foot = relative - d * n

            def outside(t, foot=foot, n=n):
                x, y, z = np.abs((foot + t * n) / BONES.semi_axes_mm)
                return (x**r + z**r) ** (s / r) + y**s - 1.0

            expected: Any = brentq(outside, -1.0, 1.0, xtol=1e-14)
            assert moved[row, posture] == pytest.approx(expected, rel=20.0 * SUPERQUADRIC, abs=GEOMETRY_MM)


# --- what was measured is not what is -------------------------------------------------------------


def test_scapula_landmark_bias_undone_is_the_base_model():
    """Residuals at R_true B are those of the base model at R_true; the landmarks are where the true bones have them."""
    effect = EFFECTS["scapula_landmark_bias"]
    deg = unequal(effect)[:3]
    C, S = rotations()
    changed, measured = chain((effect, np.concatenate([deg, np.zeros(3)]))), angles_of(C, S @ turn(deg))
    close(residuals(changed, measured), base_residuals())
    close(points(changed, measured), base_points())


def test_ts_and_ai_palpated_wrong_are_seen_where_the_measured_frame_has_them():
    """Turned like the frame, all is as the base model has it at R_measured but the closed chain; SC and AC stay."""
    effect = EFFECTS["scapula_landmark_bias"]
    deg = unequal(effect)[:3]
    C, S = rotations()
    changed, measured = chain((effect, np.concatenate([deg, deg]))), angles_of(C, S @ turn(deg))
    close(residuals(changed, measured), base_residuals())
    close(points(changed, measured), points(chain((effect, np.zeros(6))), measured))


def test_skin_artefact_undone_is_the_base_model_and_moves_only_ts_and_ai():
    """The bone is ahead of the skin by exp(lag); TS and AI are seen where the skin has them."""
    effect = EFFECTS["skin_artefact"]
    deg = unequal(effect)
    C, S = rotations()
    changed, measured = chain((effect, deg)), angles_of(C, S @ turn(deg).T)
    close(residuals(changed, measured), base_residuals())
    shown, true = points(changed, measured), base_points()
    close(shown, base_points(measured))
    close(shown[:, :2], true[:, :2])
    assert np.linalg.norm(shown[:, 2:] - true[:, 2:], axis=0).min() > FELT_MM


def test_clavicle_axial_estimate_undone_is_the_base_model():
    """The estimate lags about the clavicle's own axis, on which AC lies: only the conoid feels it."""
    effect = EFFECTS["clavicle_axial_estimate"]
    C, S = rotations()
    changed = chain((effect, np.array([15.0])))
    measured = angles_of(C @ turn(np.array([-15.0, 0.0, 0.0])), S)
    close(residuals(changed, measured), base_residuals())
    close(points(changed, measured), base_points())
    close(residuals(changed)[:2], base_residuals()[:2])


def test_thorax_extension_undone_is_the_base_model_and_turns_all_points_about_ij():
    """Both bones are measured in a frame that lags: all is seen turned by E, from the bones to SC."""
    effect = EFFECTS["thorax_extension"]
    deg = unequal(effect)
    E = turn(deg)
    C, S = rotations()
    changed, measured = chain((effect, deg)), angles_of(E @ C, E @ S)
    close(residuals(changed, measured), base_residuals())
    close(points(changed, measured), np.einsum("ij,jkp->ikp", E, base_points()))


def test_thorax_tilt_leaves_bones_and_landmarks_and_turns_the_ellipsoid():
    """Distances to an ellipsoid with turned axes and another centre; the conoid does not know."""
    effect = EFFECTS["thorax_tilt"]
    *deg, back_mm = unequal(effect)
    centre = BONES.centre_mm + np.array([0.0, 0.0, back_mm])
    changed = chain((effect, unequal(effect)))
    close(points(changed), base_points())
    found = residuals(changed)
    for row, k, const in ((0, 2, BONES.ts_distance_mm), (1, 3, BONES.ai_distance_mm)):
        along = turn(np.array(deg)).T @ (base_points()[:, k] - centre[:, None])
        expected = [ellipsoid_distance(p, BONES.semi_axes_mm)[0] - const for p in along.T]
        close(found[row], expected)
    close(found[2], base_residuals()[2])


def test_two_effects_show_landmarks_through_both():
    """A bias in a turned frame, seen from outside in: the frame's turn comes last."""
    extension, artefact = EFFECTS["thorax_extension"], EFFECTS["skin_artefact"]
    E, L = turn(unequal(extension)), turn(unequal(artefact))
    C, S = rotations()
    both = chain((extension, unequal(extension)), (artefact, unequal(artefact)))
    measured = angles_of(E @ C, E @ S @ L.T)
    close(residuals(both, measured), base_residuals())
    skin = base_points(angles_of(C, S @ L.T))
    close(points(both, measured), np.einsum("ij,jkp->ikp", E, skin))
