"""Shared parts of the tests of laboratory files: nine elevations, labels, and the check of a refused file."""

import numpy as np
import pytest

from motions import InputError
from motions.formats.any_file import read_any
from motions.landmarks.mapping import Mapping
from motions.landmarks.sampled_postures import Labels

EXACT = 1e-9
"""Tolerance, in degrees, for angles written to a file and read back; rounding leaves 1e-12."""

ELEVATIONS = np.linspace(5.0, 125.0, 9)
LABELS = Labels("P01", "abduction")


def refused(path, cause, remedy, mapping=None, labels=LABELS):
    with pytest.raises(InputError, match=cause) as caught:
        read_any(path, mapping or Mapping(), labels)
    assert str(path) == caught.value.file
    assert remedy in caught.value.remedy, caught.value.remedy
    return caught.value
