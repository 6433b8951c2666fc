"""Scales are learnt only from chains with finite, bounded slopes."""

import numpy as np

from adapt.own_bones.scales import Moments, are_known
from models.person.own_bones import SIZES


def test_a_chain_with_slopes_without_end_is_not_learnt_from():
    n = len(SIZES)
    A = np.repeat(np.eye(n)[..., None], 5, axis=2) * 1e4
    A[0, 0, 1], A[2, 3, 2] = 1e12, np.nan
    c, square, informative = np.ones((n, 5)), np.array([1.0, 1.0, 1.0, np.inf, 1.0]), np.array([9, 9, 9, 9, 0])
    assert are_known(Moments(A, c, square, informative)).tolist() == [True, False, False, False, False]
