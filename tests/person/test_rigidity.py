"""Distances between landmarks of one bone: outliers of landmarks are named, sound landmarks are not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from motions.checks.rigidity import check_rigidity
from tests.helpers.thesis_tables import DISSECTION

PALPATOR_MM = 0.96
"""SD of a coordinate; 1.43 mm for the point (thesis 5.2.1, Pronk 1991b)."""


def moving_scapula(postures: int, rng: np.random.Generator, with_aa: bool = True) -> dict[str, np.ndarray]:
    """Simulate the landmarks of Table 4.2 (dissection) on bones that turn at SC and AC."""
    SC, AC, TS, AI = (np.array(DISSECTION[name]) for name in ("SC", "AC", "TS", "AI"))
    share = np.linspace(0.0, 1.0, postures)
    clavicle = Rotation.from_euler("YZX", np.outer(share, [-10.0, 20.0, 20.0]), degrees=True)
    scapula = Rotation.from_euler("YZX", np.outer(share, [5.0, 45.0, 15.0]), degrees=True)
    at = SC + clavicle.apply(AC - SC)
    found = {"SC": np.tile(SC, (postures, 1)), "AC": at}
    found |= {name: at + scapula.apply(p - AC) for name, p in (("TS", TS), ("AI", AI))}
    if with_aa:
        found["AA"] = at + scapula.apply([12.0, -15.0, 30.0])
    return found


def noisy(landmarks: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    return {name: p + PALPATOR_MM * rng.standard_normal(p.shape) for name, p in landmarks.items()}


CASES = 200
"""Number of cases: a share of 95 % is known to 1.5 %."""


def test_sound_landmarks_raise_few_alarms():
    rng = np.random.default_rng(0)
    alarms = [bool(check_rigidity(noisy(moving_scapula(12, rng), rng)).outliers) for _ in range(CASES)]
    assert np.mean(alarms) <= 0.02


def test_a_slip_of_10_mm_toward_or_off_another_landmark_is_named():
    rng = np.random.default_rng(1)
    named = []
    for case in range(CASES):
        landmarks = moving_scapula(12, rng)
        name = ("AC", "TS", "AI", "AA", "SC")[case % 5]
        other = rng.choice(["AC"] if name == "SC" else [n for n in ("AC", "TS", "AI", "AA") if n != name])
        posture = int(rng.integers(12))
        along = landmarks[other][posture] - landmarks[name][posture]
        slipped = noisy(landmarks, rng)
        slipped[name][posture] += rng.choice([-10.0, 10.0]) * along / np.linalg.norm(along)
        named.append((posture, name) in [(s.posture, s.landmark) for s in check_rigidity(slipped).outliers])
    assert np.mean(named) >= 0.95


@pytest.mark.parametrize(("with_aa", "share"), [(True, 0.75), (False, 0.60)])
def test_an_outlier_in_any_direction_is_named_less_often(with_aa, share):
    """Check the shares in docs/person.md: distances show the part of an outlier toward or away from others."""
    rng = np.random.default_rng(1)
    names = ("AC", "TS", "AI", "AA", "SC") if with_aa else ("AC", "TS", "AI", "SC")
    named = []
    for case in range(2 * CASES):
        landmarks, name, posture = moving_scapula(12, rng, with_aa), names[case % len(names)], int(rng.integers(12))
        direction = rng.standard_normal(3)
        slipped = noisy(landmarks, rng)
        slipped[name][posture] += 10.0 * direction / np.linalg.norm(direction)
        named.append((posture, name) in [(s.posture, s.landmark) for s in check_rigidity(slipped).outliers])
    assert np.mean(named) == pytest.approx(share, abs=0.05)


def test_a_slip_in_exact_landmarks_is_named_with_its_size():
    landmarks = moving_scapula(6, np.random.default_rng(2))
    along = landmarks["TS"][4] - landmarks["AI"][4]
    landmarks["AI"][4] += 10.0 * along / np.linalg.norm(along)
    (outlier,) = check_rigidity(landmarks).outliers
    assert (outlier.posture, outlier.landmark) == (4, "AI")
    assert outlier.size_mm == pytest.approx(10.0, abs=1.0)  # the part across its distances is invisible


def test_a_common_rotation_of_the_triad_stays_invisible():
    landmarks = moving_scapula(8, np.random.default_rng(4), with_aa=False)
    turned = Rotation.from_euler("Z", 20.0, degrees=True)
    for name in ("TS", "AI"):
        landmarks[name][3] = landmarks["AC"][3] + turned.apply(landmarks[name][3] - landmarks["AC"][3])
    assert not check_rigidity(landmarks).outliers


def test_three_postures_are_too_few_to_judge():
    found = check_rigidity(moving_scapula(3, np.random.default_rng(5)))
    assert not found.outliers
    assert np.isnan(found.noise_mm)
