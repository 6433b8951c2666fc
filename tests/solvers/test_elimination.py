"""Elimination of postures against dense systems: the conditions of a posture hold for any step of the parameters."""

from typing import NamedTuple

import jax
import numpy as np
import pytest

from adapt.solvers.newton.elimination import (
    PENALTY_GROWTH,
    PIVOT_FLOOR,
    RANGE_SPACE_PENALTY,
    Elimination,
    augmented,
    stationarity,
)
from adapt.solvers.unmeasured import UNMEASURED_WEIGHT
from models import load_model
from models.derivatives import ELLIPSOID, ConstraintDerivatives, chain, closest_point_multipliers
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

EXACT = 1e-9
"""Tolerance relative to the largest term of a sum: LDL' of matrices with a condition number of some 1e4."""

LANES = 400

OF_LAMBDA = np.array([0.5, -0.7, 1.3])
"""Directions of the multipliers; their size decides how far a posture is from a minimum."""


class Case(NamedTuple):
    """Postures off the measured angles, with chains a little open; matrices have the problem as first axis."""

    at: ConstraintDerivatives
    weights: np.ndarray
    """Shape (6, problems); one weight is 0 in every third problem."""
    objective_gradient: np.ndarray
    multipliers: np.ndarray
    g: np.ndarray
    G: np.ndarray
    T: np.ndarray
    H: np.ndarray
    """W + d2(lambda'g)/dq2, with W as the elimination uses it."""
    C: np.ndarray
    U: np.ndarray


def symmetric(rows, size: int) -> np.ndarray:
    full = np.zeros((LANES, size, size))
    for i in range(size):
        for j in range(i + 1):
            full[:, i, j] = full[:, j, i] = rows[i][j]
    return full


@pytest.fixture(scope="module")
def case() -> Case:
    generator = np.random.default_rng(3)
    girdle = jax.tree.map(np.asarray, load_model("R2").girdle)
    measured = simulate_subjects(1, seed=5).angles_deg[:14].T[:, np.arange(LANES) % 14] / float(DEG)
    q = measured + generator.normal(size=(6, LANES)) * 0.05
    theta = np.asarray(girdle.adapted_mm)[:, None] + generator.normal(size=(6, LANES))
    weights = 2.0 * float(DEG) ** 2 / 6.0 * generator.uniform(0.5, 2.0, (6, LANES))
    weights[2, ::3] = 0.0
    multipliers = OF_LAMBDA[:, None] * np.geomspace(0.1, 300.0, LANES)
    start = closest_point_multipliers(girdle, list(q), list(theta))
    at = chain(girdle, list(q), list(theta), list(multipliers), start)
    damped = np.maximum(weights, UNMEASURED_WEIGHT * weights.max(axis=0))
    T, C, U = np.zeros((LANES, 3, 6)), np.zeros((LANES, 6, 6)), np.zeros((LANES, 6, 6))
    T[:, :2, : len(ELLIPSOID)], T[:, 2, len(ELLIPSOID)] = np.moveaxis(np.array(at.T), -1, 0), -1.0
    C[..., : len(ELLIPSOID)] = np.moveaxis(np.array(at.qu), -1, 0)
    U[:, : len(ELLIPSOID), : len(ELLIPSOID)] = symmetric(at.uu, len(ELLIPSOID))
    return Case(
        at,
        weights,
        weights * (q - measured),
        multipliers,
        np.array(at.g).T,
        np.moveaxis(np.array(at.G), -1, 0),
        T,
        symmetric(at.qq, 6) + damped.T[:, :, None] * np.eye(6),
        C,
        U,
    )


def eliminated(case: Case, parameters: bool) -> Elimination:
    return Elimination(case.at, list(case.weights), list(case.objective_gradient), parameters)


def assert_sum_to_zero(*terms: np.ndarray) -> None:
    largest = np.max([np.abs(term).max(axis=-1, keepdims=True) for term in terms], axis=0)
    assert (np.abs(sum(terms)) <= EXACT * largest).all()


def times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("lij,lj->li", matrices, vectors)


def stiffened(case: Case, share: float) -> np.ndarray:
    """Compute the smallest eigenvalue of H + G' s G."""
    s = share * case.weights.max(axis=0)[:, None] / np.sum(case.G**2, axis=2)
    return np.linalg.eigvalsh(case.H + np.einsum("lki,lk,lkj->lij", case.G, s, case.G))[:, 0]


def test_a_posture_is_convex_where_its_stiffened_hessian_is_definite(case):
    """Check ``convex`` against eigenvalues with a small penalty, a larger one, or neither; all cases occur."""
    found = eliminated(case, parameters=True)
    little, more = (
        stiffened(case, share) > 0.0 for share in (RANGE_SPACE_PENALTY, RANGE_SPACE_PENALTY * PENALTY_GROWTH)
    )
    np.testing.assert_array_equal(found.convex, little | more)
    assert little.any()
    assert (more & ~little).any()
    assert (~more).any()
    least = RANGE_SPACE_PENALTY * case.weights.max(axis=0) / np.sum(case.G**2, axis=2).T
    tried = np.where(little, least, PENALTY_GROWTH * least)
    np.testing.assert_allclose(found.range_space_penalty, tried, rtol=EXACT)
    np.testing.assert_allclose(found.steps.used, np.where(found.convex, tried, 0.0), rtol=EXACT)


@pytest.mark.parametrize(("share", "convex"), [(2.0 * PIVOT_FLOOR, True), (0.5 * PIVOT_FLOOR, False)])
def test_a_direction_that_is_nearly_flat_is_no_minimum(share, convex):
    """Check the smallest curvature that counts. The constraints hold three angles; one of the others has a curvature of
    ``share`` times W."""
    one, nothing = np.ones(1), np.zeros(1)
    weight = 500.0
    qq = [[nothing] * i + [(share - 1.0) * weight * one if i == 5 else nothing] for i in range(6)]
    held = [[one if i == k else nothing for i in range(6)] for k in range(3)]
    at = ConstraintDerivatives([nothing] * 3, held, [], qq, [], [], [nothing] * 2)
    found = Elimination(at, [weight * one] * 6, [nothing] * 6, parameters=False)
    assert np.asarray(found.convex).tolist() == [convex]


def conditions(case: Case, convex: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return H, C and U; W alone for a posture that is not convex."""
    damped = np.maximum(case.weights, UNMEASURED_WEIGHT * case.weights.max(axis=0)).T
    H = np.where(convex[:, None, None], case.H, damped[:, :, None] * np.eye(6))
    return H, case.C * convex[:, None, None], case.U * convex[:, None, None]


@pytest.mark.parametrize("size_mm", [0.0, 1.0, 30.0])
def test_the_conditions_of_a_posture_hold_for_any_step_of_the_parameters(case, size_mm):
    """H dq + C d + G' lambda = -W (q - s) and G dq + T d = -g."""
    found = eliminated(case, parameters=True)
    H, C, _ = conditions(case, np.asarray(found.convex))
    d = size_mm * np.random.default_rng(4).normal(size=(LANES, 6))
    dq, multipliers = (np.array(x).T for x in found.steps.moved(list(d.T)))
    assert_sum_to_zero(
        times(H, dq), times(C, d), times(np.swapaxes(case.G, 1, 2), multipliers), case.objective_gradient.T
    )
    assert_sum_to_zero(times(case.G, dq), times(case.T, d), case.g)


def test_without_parameters_they_are_those_of_a_posture_fit(case):
    found = eliminated(case, parameters=False)
    H, _, _ = conditions(case, np.asarray(found.convex))
    dq, multipliers = (np.array(x).T for x in found.steps.moved([]))
    assert_sum_to_zero(times(H, dq), times(np.swapaxes(case.G, 1, 2), multipliers), case.objective_gradient.T)
    assert_sum_to_zero(times(case.G, dq), case.g)


def test_what_is_left_for_the_parameters_is_their_own_condition(case):
    """U d + C' dq + T' lambda = slope + curvature d, where dq and lambda follow d."""
    found = eliminated(case, parameters=True)
    _, C, U = conditions(case, np.asarray(found.convex))
    d = np.random.default_rng(5).normal(size=(LANES, 6))
    dq, multipliers = (np.array(x).T for x in found.steps.moved(list(d.T)))
    slope = np.array([found.slope(i) for i in range(6)]).T
    curvature = symmetric([[found.curvature(i, j) for j in range(i + 1)] for i in range(6)], 6)
    left = times(U, d), times(np.swapaxes(C, 1, 2), dq), times(np.swapaxes(case.T, 1, 2), multipliers)
    assert_sum_to_zero(*left, -slope, -times(curvature, d))


def test_merit_and_stationarity_by_hand(case):
    """lambda'g + 1/2 sum s g^2, and the largest component of W (q - s) + G' lambda."""
    s = np.full((3, LANES), 7.0)
    found = augmented(list(case.multipliers), list(s), list(case.g.T))
    np.testing.assert_allclose(found, np.sum((case.multipliers + 3.5 * case.g.T) * case.g.T, axis=0), rtol=EXACT)
    residual = case.objective_gradient.T + times(np.swapaxes(case.G, 1, 2), case.multipliers.T)
    found = stationarity(case.at, list(case.objective_gradient), list(case.multipliers))
    np.testing.assert_allclose(found, np.abs(residual).max(axis=1), rtol=EXACT)
