"""Detection of a computed axial rotation, by whatever rule, and no detection of a measured one."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from adapt.diagnosis.fit.shoulders import shoulders_of
from adapt.diagnosis.inference.computed_axial_rotation import axial_is_computed
from models.effects import EFFECTS
from motions import Motions, read_motions
from motions.landmarks.girdle_angles import estimated_axial_deg
from motions.rhythm import REST_DEG
from motions.rhythm_subjects import simulate_subjects

SHARED = sorted(Path("../shared/motions").glob("bonepin*.csv"))
NOISE_DEG = 1.5
SUBJECTS = 8
WORLDS = 100

Rule = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Function of (postures, 6) angles and the angles at rest that returns the axial rotation, deg."""


def measured(seed: int = 0, axial_noise: float = 1.0, subjects: int = SUBJECTS) -> Motions:
    """Simulate noise in all angles; in the axial rotation it is ``axial_noise`` times that of the others."""
    clean = simulate_subjects(subjects, seed=seed, noise_deg=0.0)
    sd = NOISE_DEG * np.array([1.0, 1.0, axial_noise, 1.0, 1.0, 1.0])
    noise = sd * np.random.default_rng(seed).standard_normal(clean.angles_deg.shape)
    return replace(clean, angles_deg=clean.angles_deg + noise)


def computed(motions: Motions, rule: Rule) -> Motions:
    """Replace the axial rotation by a computed one; rest is each subject's lowest posture."""
    angles_deg = motions.angles_deg.copy()
    for rows in motions.rows_by_subject():
        at_rest = angles_deg[rows[np.argmin(np.nan_to_num(motions.humerus_elevation_deg[rows]))]]
        angles_deg[rows, 2] = rule(angles_deg[rows], at_rest)
    return replace(motions, angles_deg=angles_deg)


def of_both_joints(angles_deg, at_rest) -> np.ndarray:
    """Apply the library's rule, with another zero."""
    return estimated_axial_deg(angles_deg, at_rest) + 35.0


def of_the_ac_joint(angles_deg, _) -> np.ndarray:
    """Search the rotation that turns the AC joint least, from the published angles at rest of other people."""
    return np.array([_least_turned(one) for one in angles_deg])


def _least_turned(one: np.ndarray) -> float:
    def turned(c: float) -> float:
        return float((_joint(REST_DEG).inv() * _joint(np.array([*one[:2], c, *one[3:]]))).magnitude())

    found: Any = minimize_scalar(turned, method="bounded", bounds=(-60.0, 90.0), options={"xatol": 1e-6})
    return found.x


def _joint(angles_deg: np.ndarray) -> Rotation:
    """Compute R_clavicle_scapula."""
    clavicle, scapula = (Rotation.from_euler("YZX", part, degrees=True) for part in np.split(angles_deg, 2))
    return clavicle.inv() * scapula


def regression(angles_deg, _) -> np.ndarray:
    """Compute the rotation by a regression on the angles of the scapula, as rhythms are published."""
    return 5.0 + angles_deg[:, 3:] @ [0.1, 0.7, 0.3]


def none(angles_deg, _) -> np.ndarray:
    """Return zeros."""
    return np.zeros(len(angles_deg))


RULES = {"both joints": of_both_joints, "AC joint": of_the_ac_joint, "regression": regression, "zero": none}


@pytest.mark.parametrize("rule", RULES)
def test_a_rotation_that_was_computed_from_noisy_angles_is_seen(rule):
    motions = measured()
    assert not axial_is_computed(shoulders_of(motions))
    assert axial_is_computed(shoulders_of(computed(motions, RULES[rule])))


@pytest.mark.parametrize("rule", ["both joints", "AC joint"])
def test_a_lag_of_the_scapula_beside_it_does_not_hide_it(rule):
    """Check a skin lag of the scapula in the angles from which the rotation was computed."""
    motions = measured(seed=3)
    lag = EFFECTS["skin_artefact"].strengths(np.array([1.0]), motions)
    true = Rotation.from_euler("YZX", motions.angles_deg[:, 3:], degrees=True)
    skin = (true * Rotation.from_rotvec(lag.T, degrees=True).inv()).as_euler("YZX", degrees=True)
    lagged = replace(motions, angles_deg=np.hstack([motions.angles_deg[:, :3], skin]))
    assert not axial_is_computed(shoulders_of(lagged))
    assert axial_is_computed(shoulders_of(computed(lagged, RULES[rule])))


def bone_pins() -> Motions:
    if not SHARED:
        pytest.skip("the measured motions of ../shared are not here")
    return Motions.concatenate([read_motions(file) for file in SHARED])


@pytest.mark.parametrize("rule", ["both joints", "AC joint", "regression"])
def test_in_motions_of_bone_pins_it_is_seen_where_it_was_computed(rule):
    assert axial_is_computed(shoulders_of(computed(bone_pins(), RULES[rule])))


def test_bone_pins_measure_it():
    motions = bone_pins()
    alone = [motions.select(motions.subject == name) for name in motions.subjects]
    assert [axial_is_computed(shoulders_of(one)) for one in (motions, *alone)] == [False] * (1 + len(alone))


def test_a_measured_rotation_with_a_third_of_the_noise_is_taken_for_a_computed_one_in_one_of_a_hundred():
    """Check that at most one in a hundred is detected: with that rate, 5 or more of 100 occur once in 300 times."""
    seen = [axial_is_computed(shoulders_of(measured(seed, axial_noise=1.0 / 3.0))) for seed in range(WORLDS)]
    assert sum(seen) < 5
    assert not any(axial_is_computed(shoulders_of(measured(seed))) for seed in range(WORLDS))


def test_what_it_cannot_see():
    """Check cases beyond detection: few postures, noise added after the rotation was computed."""
    assert not axial_is_computed(shoulders_of(computed(measured(subjects=1), of_both_joints)))
    clean = computed(simulate_subjects(SUBJECTS, seed=0, noise_deg=0.0), of_both_joints)
    noise = NOISE_DEG * np.random.default_rng(1).standard_normal(clean.angles_deg.shape)
    assert not axial_is_computed(shoulders_of(replace(clean, angles_deg=clean.angles_deg + noise)))
