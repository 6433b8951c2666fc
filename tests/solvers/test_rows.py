"""Padded arrays of subjects with unequal numbers of postures: no posture is lost or counted twice."""

import numpy as np
import pandas as pd
import pytest

from adapt.solvers.rows import PostureRows, posture_rows
from motions import Motions
from motions.rhythm import REST_DEG
from motions.rotations import DEG


def motions_of(subject: list[str]) -> Motions:
    """Make rows of these subjects; the angles of row r are 10 r + (0 ... 5) degrees."""
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
"""Three subjects with 5, 3 and 1 postures, in mixed order."""


@pytest.fixture
def rows() -> PostureRows:
    return posture_rows(motions_of(RAGGED))


def test_shapes_are_rounded_up_and_subjects_keep_their_order(rows):
    """5 postures are padded to 6."""
    assert rows.subjects == ("c", "a", "b")
    assert rows.packed(rows.angles).shape == (6, 6, 3)
    assert rows.counted.shape == rows.place.shape == (6, 3)


def test_a_subjects_postures_are_its_rows_in_their_order(rows):
    assert [rows.place[rows.counted[:, k], k].tolist() for k in range(3)] == [[0, 4, 5, 7, 8], [1, 2, 6], [3]]


@pytest.mark.parametrize("subject", [RAGGED, ["a"], ["a"] * 4, list("abcde") * 3], ids=len)
def test_unpacked_undoes_packed(subject):
    motions = motions_of(subject)
    rows = posture_rows(motions)
    np.testing.assert_allclose(rows.unpacked(rows.packed(rows.angles)).T * DEG, motions.angles_deg, rtol=1e-14)
    np.testing.assert_array_equal(rows.unpacked(rows.place), np.arange(len(subject)))


def test_unpacked_keeps_axes_and_types(rows):
    words = np.where(rows.counted, "ok", "padding")
    assert rows.unpacked(words).tolist() == ["ok"] * len(RAGGED)
    assert rows.unpacked(np.ones((2, 3, 6, 3), bool)).shape == (2, 3, len(RAGGED))
    assert rows.unpacked(np.ones((6, 3), bool)).dtype == bool


def test_padding_is_a_copy_that_does_not_count(rows):
    assert rows.counted.sum(axis=0).tolist() == [5, 3, 1]
    for k, count in enumerate([5, 3, 1]):
        assert set(rows.place[count:, k]) == {rows.place[count - 1, k]}


def test_values_in_the_padding_never_come_back(rows):
    values = np.where(rows.counted, rows.place, np.nan)
    assert np.isnan(values).sum() == 6 * 3 - len(RAGGED)
    assert np.isfinite(rows.unpacked(values)).all()


def test_an_angle_that_was_not_measured_is_that_of_rest_and_marked():
    motions = motions_of(RAGGED)
    motions.angles_deg[4, 2] = np.nan
    rows = posture_rows(motions)
    assert np.argwhere(~rows.measured).tolist() == [[2, 4]]
    assert rows.angles[2, 4] * DEG == pytest.approx(REST_DEG[2], rel=1e-14)


def test_rows_of_several_models_follow_each_other(rows):
    """Check that each model's rows refer to previous rows of the same model."""
    twice = rows.repeated(2, np.float32)
    assert twice.angles.dtype == np.float32
    np.testing.assert_array_equal(twice.subject, np.tile(rows.subject, 2))
    np.testing.assert_array_equal(twice.previous[9:], np.where(rows.previous < 0, -1, rows.previous + 9))
