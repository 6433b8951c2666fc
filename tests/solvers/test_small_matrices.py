"""Linear algebra written out by components, against LAPACK."""

import numpy as np
import pytest

from adapt.solvers.projection.small_matrices import inverse_root, null_basis, symmetric_solve

SAME = 1e-12
"""Rounding of a few numbers of size 1."""

GENERATOR = np.random.default_rng(4)


@pytest.mark.parametrize("first", [1.0, -1.0, 0.0])
def test_a_null_basis_is_orthonormal_and_across_every_row(first):
    """Check every sign of the number that a reflection turns, and 0."""
    G = GENERATOR.standard_normal((3, 6))
    G[:, :2] *= first
    Z = np.asarray(null_basis(G))
    np.testing.assert_allclose(G @ Z, np.zeros((3, 3)), atol=SAME)
    np.testing.assert_allclose(Z.T @ Z, np.eye(3), atol=SAME)


def test_an_inverse_root_and_a_solution_are_lapacks():
    root = GENERATOR.standard_normal((3, 5))
    A, b = root @ root.T, GENERATOR.standard_normal((3, 2))
    np.testing.assert_allclose(inverse_root(A), np.linalg.inv(np.linalg.cholesky(A)), rtol=SAME, atol=SAME)
    solved, _ = symmetric_solve(A, b)
    np.testing.assert_allclose(solved, np.linalg.solve(A, b), rtol=1e3 * SAME)


def test_the_smallest_pivot_tells_a_matrix_that_is_not_positive_definite():
    _, pivot = symmetric_solve(np.diag([2.0, 3.0]), np.ones((2, 1)))
    assert pivot == 2.0
    _, pivot = symmetric_solve(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones((2, 1)))
    assert pivot < 0.0
