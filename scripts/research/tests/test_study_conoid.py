"""Own attachments of the conoid are taken out, however far they are off, and a strain is left."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scripts.research.named_causes.study_conoid import beside_own_bones, course_of_others
from scripts.research.thesis.scores import rms

CLAVICLE_MM, SCAPULA_MM = np.array([10.0, -12.0, 3.0]), np.array([-5.0, 2.0, 8.0])
OFF_MM = np.array([12.0, -8.0, 5.0, -6.0, 9.0, 7.0])
TURNS = Rotation.from_rotvec(np.random.default_rng(4).normal(0.0, 0.35, (60, 3)))


def conoid_mm(shift_mm: np.ndarray) -> np.ndarray:
    """Return the length of a conoid between two bones that turn against each other."""
    return np.linalg.norm(TURNS.apply(SCAPULA_MM + shift_mm[3:]) - CLAVICLE_MM - shift_mm[:3], axis=1)


def test_attachments_a_centimetre_off_leave_less_than_the_noise():
    of_the_person = conoid_mm(OFF_MM)
    assert rms(of_the_person - conoid_mm(np.zeros(6))) > 3.0
    left, _ = beside_own_bones(lambda shift_mm: of_the_person - conoid_mm(shift_mm))
    assert rms(left) < 0.1


def test_a_strain_that_attachments_cannot_make_is_left():
    strain = 1.5 * np.sign(np.sin(np.arange(60.0)))
    left, slopes = beside_own_bones(lambda shift_mm: strain + conoid_mm(OFF_MM) - conoid_mm(shift_mm))
    assert slopes.shape == (60, 7)
    assert np.corrcoef(left, strain)[0, 1] > 0.9


def test_a_course_that_persons_share_is_foretold_by_the_others():
    generator = np.random.default_rng(5)
    courses = [generator.normal(size=(40, 6)) for _ in range(4)]
    left = [one @ np.array([0.5, -1.0, 0.0, 0.3, 0.0, 0.0]) for one in courses]
    person = np.array(["a", "a", "b", "c"])
    assert course_of_others(left, courses, person, 0) == pytest.approx(left[0], abs=0.02)
