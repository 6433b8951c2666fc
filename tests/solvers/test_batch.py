"""Padded arrays of ragged subjects: nothing is lost, nothing is counted twice."""

import numpy as np
import pandas as pd
import pytest

from adapt.solvers.rows import PostureRows, posture_rows
from motions import Motions
from motions.rotations import DEG


def motions_of(subject: list[str]) -> Motions:
    """Rows of these subjects; the angles of row r are 10 r + (0 ... 5) degrees."""
    rows = np.arange(len(subject))
    return Motions(
        subject=np.array(subject),
        motion=np.full(len(rows), "abduction"),
        posture=rows,
        humerus_elevation_deg=np.zeros(len(rows)),
        angles_deg=10.0 * rows[:, None] + np.arange(6.0),
        landmarks_mm={},
        extra=pd.DataFrame(index=pd.RangeIndex(len(rows))),
    )


RAGGED = ["c", "a", "a", "b", "c", "c", "a", "c", "c"]
"""Three subjects of 5, 3 and 1 postures, not in order and taking turns."""


def padding(batch: PostureRows) -> np.ndarray:
    """True where an element is not a real posture."""
    return ~batch.counted


@pytest.fixture
def batch() -> PostureRows:
    return posture_rows(motions_of(RAGGED))


def test_shapes_are_rounded_up_and_subjects_keep_their_order(batch):
    """5 postures to 6."""
    assert batch.subjects == ("c", "a", "b")
    assert batch.angles.shape == batch.measured.shape == (6, 6, 3)
    assert batch.counted.shape == batch.rows.shape == (6, 3)


def test_a_subjects_postures_are_its_rows_in_their_order(batch):
    assert [batch.rows[np.asarray(batch.counted[:, k]), k].tolist() for k in range(3)] == [
        [0, 4, 5, 7, 8],
        [1, 2, 6],
        [3],
    ]


@pytest.mark.parametrize("subject", [RAGGED, ["a"], ["a"] * 4, list("abcde") * 3], ids=len)
def test_unpack_undoes_pack(subject):
    motions = motions_of(subject)
    batch = posture_rows(motions)
    np.testing.assert_allclose(batch.unpack(np.asarray(batch.angles)).T * DEG, motions.angles_deg, rtol=1e-14)
    np.testing.assert_array_equal(batch.unpack(batch.rows), np.arange(len(subject)))


def test_unpack_keeps_axes_and_types(batch):
    words = np.where(np.asarray(batch.counted), "ok", "padding")
    assert batch.unpack(words).tolist() == ["ok"] * len(RAGGED)
    assert batch.unpack(np.ones((2, 3, 6, 3), bool)).shape == (2, 3, len(RAGGED))
    assert batch.unpack(np.ones((6, 3), bool)).dtype == bool


def test_padding_is_a_copy_that_does_not_count(batch):
    counted = np.asarray(batch.counted)
    assert counted.sum(axis=0).tolist() == [5, 3, 1]
    for k, count in enumerate([5, 3, 1]):
        assert set(batch.rows[count:, k]) == {batch.rows[count - 1, k]}


def test_values_in_the_padding_never_come_back(batch):
    values = np.where(padding(batch), np.nan, batch.rows)
    assert padding(batch).sum() == 6 * 3 - len(RAGGED)
    assert np.isfinite(batch.unpack(values)).all()


def test_an_angle_that_was_not_measured_is_zero_and_marked():
    motions = motions_of(RAGGED)
    motions.angles_deg[4, 2] = np.nan
    batch = posture_rows(motions)
    assert np.isfinite(np.asarray(batch.angles)).all()
    measured = batch.unpack(np.asarray(batch.measured))
    assert np.argwhere(~measured).tolist() == [[2, 4]]
    assert batch.unpack(np.asarray(batch.angles))[2, 4] == 0.0
