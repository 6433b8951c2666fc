"""Measured postures of all subjects as flat rows, with the subject and the kind of motion of each row."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.solvers.rows import posture_rows
from motions.errors import InputError
from motions.table import FEWEST_ANGLES, Motions, person_of

FEWEST_POSTURES = 4
"""Smallest number of postures of a subject: fewer hold less information than its six adapted parameters take up."""

_STEP_DEG = 10.0
"""Step in elevation equal to one posture number: the postures of most files are as far apart."""

_LEAST_RANGE_DEG = 20.0
"""Smallest range of elevation along a motion at which elevation locates a posture."""

MOST_POSTURES = 20
"""Largest number of postures of one motion of a shoulder, some 7 degrees of elevation apart. The unexplained part is
alike within 40 degrees, so that more postures are redundant, and neighbouring frames have the same noise."""


@dataclass(frozen=True)
class Shoulders:
    """N postures of S subjects, in the order of ``motions``."""

    motions: Motions
    angles: Float[np.ndarray, "6 rows"]
    """Measured angles, rad; the published mean at rest where not measured."""
    measured: Bool[np.ndarray, "6 rows"]
    subject: Int[np.ndarray, " rows"]
    motion: Int[np.ndarray, " rows"]
    """Number of the kind of motion."""
    subjects: tuple[str, ...]
    kinds: tuple[str, ...]
    """Names of the kinds of motion, sorted."""
    person: Int[np.ndarray, " subjects"]
    """Person number of each subject; left and right of one person have the same number."""

    @property
    def weights(self) -> Float[np.ndarray, " rows"]:
        """Weights of ``|y|^2`` in J_p (deg^2): 1 over the number of measured angles of each posture."""
        return 1.0 / self.measured.sum(axis=0)

    @property
    def persons(self) -> int:
        """Number of persons."""
        return int(self.person.max()) + 1

    def rows_of(self, subject: int, motion: int | None = None) -> Int[np.ndarray, " chosen"]:
        """Find the rows of a subject, in all kinds of motion or in one."""
        return np.flatnonzero((self.subject == subject) & (True if motion is None else self.motion == motion))

    @cached_property
    def coordinates_deg(self) -> Float[np.ndarray, "2 rows"]:
        """Coordinates of each posture along its motion: elevation of the arm, and 10 times the number of the posture in
        kinds of motion that hardly change elevation or have none (0 in others)."""
        elevation = self.motions.humerus_elevation_deg
        along = np.zeros(len(elevation))
        for motion in range(len(self.kinds)):
            every = [elevation[self.rows_of(subject, motion)] for subject in range(len(self.subjects))]
            ranges = [np.ptp(one) for one in every if len(one)]
            if not np.median(ranges) >= _LEAST_RANGE_DEG:  # also where the median is NaN
                rows = self.motion == motion
                along[rows] = _STEP_DEG * self.motions.posture[rows]
        return np.stack([np.nan_to_num(elevation), along])

    def sequences(self) -> Iterator[Int[np.ndarray, " chosen"]]:
        """Yield the rows of each motion of each subject in the order of its postures."""
        for subject in range(len(self.subjects)):
            for motion in range(len(self.kinds)):
                rows = self.rows_of(subject, motion)
                yield rows[np.argsort(self.motions.posture[rows], kind="stable")]


def usable(motions: Motions) -> tuple[Shoulders, dict[str, str]]:
    """Lay out the postures with enough measured angles, of the subjects with enough such postures.

    Return also the reason for each subject that is left out. InputError where no subject has enough postures.
    """
    says = np.isfinite(motions.angles_deg).sum(axis=1) > FEWEST_ANGLES
    counts = {name: int(says[motions.subject == name].sum()) for name in motions.subjects}
    left_out = {
        name: f"{n} postures with more than {FEWEST_ANGLES} angles, fewer than {FEWEST_POSTURES}"
        for name, n in counts.items()
        if n < FEWEST_POSTURES
    }
    if len(left_out) == len(counts):
        cause = f"no subject has {FEWEST_POSTURES} postures with more than {FEWEST_ANGLES} measured angles"
        raise InputError(
            "the motions", None, cause, "Give subjects with more postures, or more angles measured in each"
        )
    enough = ~np.isin(motions.subject, list(left_out))
    return shoulders_of(motions.select(says & enough)), left_out


def shoulders_of(motions: Motions) -> Shoulders:
    """Lay out all postures of the motions."""
    rows = posture_rows(motions)
    kinds = tuple(sorted(set(motions.motion.tolist())))
    persons = [person_of(name) for name in rows.subjects]
    different = list(dict.fromkeys(persons))
    return Shoulders(
        motions=motions,
        angles=rows.angles,
        measured=rows.measured,
        subject=rows.subject,
        motion=np.array([kinds.index(name) for name in motions.motion.tolist()]),
        subjects=rows.subjects,
        kinds=kinds,
        person=np.array([different.index(name) for name in persons]),
    )


def sampled(every: Shoulders) -> tuple[Shoulders, Int[np.ndarray, " rows"]]:
    """Take at most ``MOST_POSTURES`` of each motion of each shoulder, evenly spaced and renumbered.

    Return also, for every posture, the index of the nearest posture among those taken.
    """
    count = len(every.subject)
    nearest, posture = np.arange(count), every.motions.posture.copy()
    for rows in every.sequences():
        if len(rows) > MOST_POSTURES:
            taken = np.linspace(0, len(rows) - 1, MOST_POSTURES).round().astype(int)
            nearest[rows] = rows[taken][np.abs(taken[:, None] - np.arange(len(rows))).argmin(axis=0)]
            posture[rows[taken]] = np.arange(1, MOST_POSTURES + 1)
    kept = nearest == np.arange(count)
    if kept.all():
        return every, nearest
    return shoulders_of(replace(every.motions, posture=posture).select(kept)), (np.cumsum(kept) - 1)[nearest]
