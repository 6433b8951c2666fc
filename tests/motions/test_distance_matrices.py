"""The distances of two measurements of one bone: the thesis's printed matrices."""

import numpy as np

from motions.checks.distance_matrices import (
    difference_matrix,
    distance_matrix,
    largest_consistent,
    mean_difference,
)
from tests.helpers.thesis_tables import DISSECTION, MISPRINTED, MRI, TABLE_4_1, TABLE_4_2_DIST, TABLE_5_1

PRINTED_4_1_MM = 0.15
"""Both tables are rounded to 0.1 mm: a distance of rounded coordinates is off by up to about 0.09, in each table."""


def test_table_4_1_is_the_difference_of_the_distances_of_table_4_2():
    mri, dissection = (np.array(list(points.values())).T for points in (MRI, DISSECTION))
    found = difference_matrix(distance_matrix(mri), distance_matrix(dissection))
    names = list(MRI)
    off = {
        tuple(sorted((names[i], names[j])))
        for i, j in zip(*np.where(np.abs(found - TABLE_4_1) > PRINTED_4_1_MM), strict=True)
    }
    assert off <= MISPRINTED


def test_the_dist_column_of_table_4_2():
    apart = np.array([np.linalg.norm(np.subtract(MRI[name], DISSECTION[name])) for name in MRI])
    np.testing.assert_allclose(apart, TABLE_4_2_DIST, atol=0.1)


def test_table_5_1_flags_the_screws_that_the_thesis_flags():
    kept = largest_consistent(TABLE_5_1)
    assert [k + 1 for k in kept] == [2, 3, 4, 6]
    assert round(mean_difference(TABLE_5_1, kept), 1) == 2.2
