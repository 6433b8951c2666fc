"""Motions made as arrays: what a motion file could not hold is refused, and other types of numbers are converted."""

import re
from dataclasses import replace

import numpy as np
import pytest

from motions import InputError, read_motions
from motions.motion_csv.typed_motions import check_motions
from motions.rhythm_subjects import DATA_FILE
from motions.table import Motions

READ = read_motions(DATA_FILE)
GOOD = READ.select(np.isin(READ.subject, READ.subjects[:2]))
COUNT = len(GOOD.posture)
AT = np.tile([[100.0, -40.0, 90.0]], (COUNT, 1))


def assert_same(found: Motions, expected: Motions):
    for field in ("subject", "motion", "posture", "humerus_elevation_deg", "angles_deg"):
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))


def test_motions_that_were_read_stay_as_they_are():
    assert_same(check_motions(READ), READ)


def test_other_types_of_numbers_and_names_become_these():
    as_objects = replace(
        GOOD,
        subject=GOOD.subject.astype(object),
        posture=GOOD.posture.astype(float),
        angles_deg=GOOD.angles_deg.astype(object),
    )
    assert_same(check_motions(as_objects), GOOD)
    whole = check_motions(replace(GOOD, angles_deg=GOOD.angles_deg.round().astype(int)))
    assert whole.angles_deg.dtype == float
    landmarks = check_motions(replace(GOOD, landmarks_mm={"TS": AT.astype(int)})).landmarks_mm
    assert landmarks["TS"].dtype == float


def test_masked_and_infinite_angles_are_not_measured():
    hidden = np.zeros_like(GOOD.angles_deg, bool)
    hidden[3, 5] = True
    without = np.where(hidden, np.nan, GOOD.angles_deg)
    under = np.ma.masked_array(np.where(hidden, 160.0, GOOD.angles_deg), hidden)
    for angles in (under, np.where(hidden, np.inf, GOOD.angles_deg)):
        np.testing.assert_array_equal(check_motions(replace(GOOD, angles_deg=angles)).angles_deg, without)


def first(value: object, values: np.ndarray) -> np.ndarray:
    """Return the names with another first one."""
    return np.array([value, *values[1:].tolist()], dtype=object)


MINE = GOOD.subject == GOOD.subjects[1]
WRONG = {
    "radians": ({"angles_deg": np.where(MINE[:, None], np.deg2rad(GOOD.angles_deg), GOOD.angles_deg)},
                f"subject '{GOOD.subjects[1]}': no angle exceeds 3.14, so the angles look like radians"),
    "elevation in radians": ({"humerus_elevation_deg": np.deg2rad(GOOD.humerus_elevation_deg)}, "looks like radians"),
    "turns": ({"angles_deg": GOOD.angles_deg + 360.0}, "more than 180 degrees. Give angles in degrees between"),
    "downward": ({"humerus_elevation_deg": -GOOD.humerus_elevation_deg}, "below 0"),
    "transposed": ({"angles_deg": GOOD.angles_deg.T}, f"has the shape (6, {COUNT}). Give ({COUNT}, 6)"),
    "five": ({"angles_deg": GOOD.angles_deg[:, :5]}, f"has the shape ({COUNT}, 5). Give ({COUNT}, 6)"),
    "texts": ({"angles_deg": GOOD.angles_deg.astype(str)}, "has entries of type <U"),
    "truths": ({"angles_deg": GOOD.angles_deg > 0.0}, "has entries of type bool"),
    "short names": ({"subject": GOOD.subject[:-1]}, f"subject has the shape ({COUNT - 1},). Give ({COUNT},)"),
    "long elevation": ({"humerus_elevation_deg": np.append(GOOD.humerus_elevation_deg, 1.0)}, "has the shape"),
    "nobody": ({"subject": first(None, GOOD.subject)}, "subject is None in row 1"),
    "no motion": ({"motion": first(np.nan, GOOD.motion)}, "motion is nan in row 1"),
    "halves": ({"posture": GOOD.posture + 0.5}, "posture has numbers that are not whole"),
    "short extra": ({"extra": GOOD.extra.iloc[:-4]}, f"extra has {COUNT - 4} rows, and posture has {COUNT}"),
    "no extra": ({"extra": None}, "extra has no rows"),
    "landmark": ({"landmarks_mm": {"ts": AT}}, "landmarks_mm has 'ts', which is no landmark. Did you mean TS?"),
    "landmarks turned": ({"landmarks_mm": {"TS": AT.T}}, f"landmarks_mm['TS'] has the shape (3, {COUNT})"),
    "metres": ({"landmarks_mm": {"TS": AT / 1000.0, "SC": AT / 4000.0}}, "the landmark positions look like metres"),
    "centimetres": ({"landmarks_mm": {"TS": AT / 10.0}}, "the positions of landmark TS look like centimetres"),
    "no dict": ({"landmarks_mm": None}, "landmarks_mm is a NoneType"),
}  # fmt: skip


@pytest.mark.parametrize(("fields", "said"), WRONG.values(), ids=WRONG)
def test_what_no_motion_file_holds_is_refused(fields, said):
    with pytest.raises(InputError, match=re.escape(said)):
        check_motions(replace(GOOD, **fields))


def test_a_posture_that_is_there_twice_is_refused():
    with pytest.raises(InputError, match=f"posture 1 of motion .* of '{GOOD.subjects[0]}' is there twice"):
        check_motions(Motions.concatenate([GOOD, GOOD]))
