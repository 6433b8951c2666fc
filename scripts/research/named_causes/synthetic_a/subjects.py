"""Simulated subjects: their postures, their wished-for motion, and their parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scripts.research.named_causes.synthetic_a.chain import Chain
from scripts.research.named_causes.synthetic_a.conventions import (
    PEOPLE_STREAM,
    PLANES_DEG,
    SUBJECT_STREAM,
    Array,
    Index,
)

REST_DEG = np.array([-28.57, 11.68, 7.48, 32.05, 10.67, -10.32])
REST_SD_DEG = np.array([5.0, 4.0, 4.0, 5.0, 4.0, 4.5])
SLOPE_SD = 0.12
PARAMETER_SD_MM = np.array([15.0, 5.0, 3.0, 15.0, 8.0, 1.5])
OTHER_SPREAD = 2.0
"""Largest factor on PARAMETER_SD_MM in a world; its inverse is the smallest. Each parameter has its own factor."""
SIZE_SD = 0.05
"""Largest SD, in a world, of the size of the whole thorax, as a share of the sizes THORAX_MM:"""
THORAX_MM = np.array([0.0, 0.0, 130.0, 250.0, 110.0, 0.0])


@dataclass(frozen=True)
class Postures:
    """Subject, motion and elevation of each of the n postures, in the order of the table."""

    subjects: int
    motions: tuple[str, ...]
    subject: Index
    motion: Index
    number: Index
    """Number of the posture within its motion: 1, 2, ..."""
    session: Array
    """Position in the subject's session: 0 is the first posture, 1 the last."""
    elevation_deg: Array
    plane_deg: Array


def lay_out(subjects: int, motions: Sequence[str], elevations_deg: Sequence[float]) -> Postures:
    """Lay out all postures: subjects x motions x elevations."""
    shape = (subjects, len(motions), len(elevations_deg))
    subject, motion, posture = (i.ravel() for i in np.indices(shape))
    order = motion * shape[2] + posture
    return Postures(
        subjects=subjects,
        motions=tuple(motions),
        subject=subject,
        motion=motion,
        number=posture + 1,
        session=order / max(shape[1] * shape[2] - 1, 1),
        elevation_deg=np.asarray(elevations_deg, dtype=np.float64)[posture],
        plane_deg=np.array([PLANES_DEG[m] for m in motions])[motion],
    )


@dataclass(frozen=True)
class Subjects:
    """Random properties of s subjects, one row each."""

    parameter_mm: Array
    """Offsets of PARAMETERS from the parameter set (s, 6)."""
    rest_deg: Array
    slope: Array
    """Factors on the ten slopes of the rhythm (s, 10)."""
    axial_deg: Array
    """Axial rotation of the clavicle between hanging and 120 deg (s,)."""


def draw_people(seed: int) -> tuple[Array, float]:
    """Draw how people differ in a world: SDs of PARAMETERS, mm, and of the size of the thorax, as a share.

    The draw depends on the seed alone, not on the effect, and a diagnosis cannot know it.
    """
    rng = np.random.default_rng([seed, PEOPLE_STREAM])
    return PARAMETER_SD_MM * OTHER_SPREAD ** rng.uniform(-1.0, 1.0, len(PARAMETER_SD_MM)), rng.uniform(0.0, SIZE_SD)


def draw_subject(seed: int, number: int, attempt: int) -> Subjects:
    """Draw one subject (s = 1), the same for every effect."""
    rng = np.random.default_rng([seed, SUBJECT_STREAM, number, attempt])

    def bell(n: int) -> Array:
        return np.clip(rng.standard_normal((1, n)), -2.2, 2.2)

    sd_mm, size_sd = draw_people(seed)
    return Subjects(
        parameter_mm=sd_mm * bell(6) + size_sd * bell(1) * THORAX_MM,
        rest_deg=REST_DEG + REST_SD_DEG * bell(6),
        slope=1.0 + SLOPE_SD * bell(10),
        axial_deg=rng.uniform(25.0, 35.0, 1),
    )


def join(parts: Sequence[Subjects]) -> Subjects:
    """Concatenate subjects."""
    names = ("parameter_mm", "rest_deg", "slope", "axial_deg")
    return Subjects(**{k: np.concatenate([getattr(p, k) for p in parts]) for k in names})


def rhythm_deg(people: Subjects, postures: Postures) -> Array:
    """Compute the wished-for angles (n, 6) in deg: the regressions of de Groot & Brand 2001, with a separate course of
    the axial rotation.

    The plane of elevation fades in over the first 30 deg, because a hanging arm has none.
    """
    s, Hz = postures.subject, postures.elevation_deg
    Hy = postures.plane_deg * -np.expm1(-((Hz / 15.0) ** 2))
    rest, k = people.rest_deg[s].T, people.slope[s].T
    bent = np.expm1(-1.5 * (Hz / 120.0) ** 1.5) / np.expm1(-1.5)
    columns = (
        -4.983 + 0.120 * k[0] * Hy - 0.242 * k[1] * Hz + 0.851 * rest[0],
        3.917 - 0.046 * k[2] * Hy + 0.123 * k[3] * Hz + 0.493 * rest[1],
        rest[2] + people.axial_deg[s] * bent,
        -1.203 + 0.140 * k[4] * Hy - 0.049 * k[5] * Hz + 0.901 * rest[3],
        3.095 - 0.079 * k[6] * Hy + 0.396 * k[7] * Hz + 0.414 * rest[4],
        0.659 - 0.028 * k[8] * Hy + 0.184 * k[9] * Hz + 0.886 * rest[5],
    )
    return np.stack(columns, -1)


def with_parameters(chain: Chain, people: Subjects, postures: Postures) -> Chain:
    """Return the chain with each subject's own thorax and conoid, mm."""
    d = people.parameter_mm[postures.subject]
    centre, semi, targets = chain.centre.copy(), chain.semi.copy(), chain.targets.copy()
    centre[:, 1:] += d[:, :2]
    semi += d[:, 2:5]
    targets[:, 2] += d[:, 5]
    floor = 0.4 * chain.semi
    return replace(chain, centre=centre, semi=np.maximum(semi, floor), targets=targets)
