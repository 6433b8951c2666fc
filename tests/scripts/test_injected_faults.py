"""The faults that injected_faults.py adds to measured motions agree with their definitions."""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from motions import Motions, read_motions
from motions.rhythm import clavicle_axial_rotation
from motions.rotations import DEG, rotation_from_cardan
from scripts.research.named_causes.injected_faults import (
    AXIAL,
    BIAS,
    SKIN,
    Answer,
    counted,
    judged,
    with_cluster_lag,
    with_estimated_axial,
    with_faults,
    with_skin_lag,
)

SHIPPED = Path(__file__).parents[2] / "motions" / "data" / "simulated_subjects.csv"

ROUNDING_DEG = 1e-9
"""Tolerance: rounding of rotations that are composed in another order."""

TURN = Rotation.from_rotvec([-2.0, -15.0, -10.0], degrees=True)
"""Rotation similar to that from the AC frame to the AA frame."""


@pytest.fixture(scope="module")
def motions() -> Motions:
    """Simulate three subjects."""
    every = read_motions(SHIPPED)
    return every.select(np.isin(every.subject, every.subjects[:3]))


def scapula(motions: Motions) -> Rotation:
    """Return the scapula's rotations, by scipy."""
    return Rotation.from_euler("YZX", motions.angles_deg[:, 3:], degrees=True)


def turned(motions: Motions) -> Motions:
    """Return the same bones in a frame rotated by TURN."""
    angles = motions.angles_deg.copy()
    angles[:, 3:] = (scapula(motions) * TURN).as_euler("YZX", degrees=True)
    return replace(motions, angles_deg=angles)


def test_the_estimate_is_the_librarys(motions: Motions) -> None:
    estimated = with_estimated_axial(motions)
    for name in motions.subjects:
        mine = np.flatnonzero(motions.subject == name)
        rest = motions.angles_deg[mine[np.argmin(motions.humerus_elevation_deg[mine])]] / DEG
        R = [jnp.repeat(rotation_from_cardan(rest[bone])[..., None], len(mine), 2) for bone in (slice(3), slice(3, 6))]
        angles = motions.angles_deg[mine].T / DEG
        expected = np.asarray(clavicle_axial_rotation(jnp.asarray(angles[:2]), jnp.asarray(angles[3:]), *R)) * DEG
        assert np.abs(estimated.angles_deg[mine, 2] - expected).max() <= ROUNDING_DEG
    others = [0, 1, 3, 4, 5]
    assert np.array_equal(estimated.angles_deg[:, others], motions.angles_deg[:, others])


def test_the_skin_is_behind_by_the_measured_lag(motions: Motions) -> None:
    seen, bone = scapula(with_skin_lag(motions)), scapula(motions)
    lag = np.degrees((bone.inv() * seen).magnitude())
    sideways = np.char.find(motions.motion.astype(str), "abduction") >= 0
    for elevation, abducted, other in ((25.0, 3.425, 7.0), (50.0, 6.6, 11.0), (100.0, 13.8, 16.0)):
        here = np.abs(motions.humerus_elevation_deg - elevation) < ROUNDING_DEG
        assert here.any()
        expected = np.where(sideways[here], abducted, other)
        assert np.abs(lag[here] - expected).max() <= ROUNDING_DEG


def test_a_cluster_tips_too_much_and_turns_too_little(motions: Motions) -> None:
    """R_true = R_measured exp(lag), with half of the lag at 60 degrees and all of it from 120 on."""
    seen, bone = scapula(with_cluster_lag(motions)), scapula(motions)
    lag = (seen.inv() * bone).as_rotvec(degrees=True)
    elevation = motions.humerus_elevation_deg
    expected = np.outer(np.minimum(elevation / 120.0, 1.0), [-7.2, 0.0, 6.0])
    assert (elevation > 120.0).any()
    assert np.abs(lag - expected).max() <= ROUNDING_DEG


def test_faults_come_together(motions: Motions) -> None:
    other = turned(motions)
    every = with_faults(motions, other, (BIAS, AXIAL, SKIN), with_skin_lag)
    lagging = with_skin_lag(motions)
    apart = (scapula(lagging) * TURN).inv() * scapula(every)
    assert np.degrees(apart.magnitude()).max() <= ROUNDING_DEG
    assert np.array_equal(with_faults(motions, other, (), with_skin_lag).angles_deg, motions.angles_deg)


def test_a_fault_that_was_not_added_counts_where_it_is_not_named_without_any():
    named = [(SKIN, BIAS), (AXIAL,)]
    found = {one.fault: one for one in judged([SKIN, BIAS], named, without=[("conoid_strain",)])}
    assert found[SKIN] == Answer(SKIN, added=True, named=True, first=True)
    assert found[BIAS] == Answer(BIAS, added=True, named=True, first=False)
    assert found[AXIAL] == Answer(AXIAL, added=False, named=True, first=True)
    assert AXIAL not in {one.fault for one in judged([SKIN, BIAS], named, without=[("conoid_strain", AXIAL)])}
    assert counted(list(found.values())).splitlines()[-1] == "| all | 2 of 2 | 1 | 1 of 1 | 1 |"
