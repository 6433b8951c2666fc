"""Summary of the motions, for a person to check before anything is fitted."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from adapt.cli.terminal.print_converted import outliers_in_words
from adapt.diagnosis.fit.shoulders import FEWEST_POSTURES
from motions import Motions
from motions.landmarks.sampled_postures import ESTIMATED, is_yes
from motions.table import ANGLE_NAMES, ANGLES


@dataclass(frozen=True)
class SubjectRead:
    """Line of the table on the page, as text. ``missing``: the angles that were not measured in every posture."""

    subject: str
    motions: str
    postures: int
    elevation: str
    missing: str


def subjects_read(motions: Motions) -> list[SubjectRead]:
    """Describe each subject: its motions with their postures, elevations in degrees, and missing angles."""
    return [_described(name, motions.select(motions.subject == name)) for name in motions.subjects]


def _described(name: str, mine: Motions) -> SubjectRead:
    kinds = {str(kind): int(np.sum(mine.motion == kind)) for kind in dict.fromkeys(mine.motion)}
    return SubjectRead(
        name,
        ", ".join(f"{kind} ({count})" for kind, count in kinds.items()),
        len(mine.posture),
        _range(mine.humerus_elevation_deg),
        "; ".join(_missing(mine)) or "nothing",
    )


def _range(elevation_deg: np.ndarray) -> str:
    known = elevation_deg[np.isfinite(elevation_deg)]
    return f"{known.min():.0f} to {known.max():.0f}" if len(known) else "not measured"


def _missing(mine: Motions) -> Iterator[str]:
    count = len(mine.posture)
    for angle, gaps in zip(ANGLES, np.sum(~np.isfinite(mine.angles_deg), axis=0), strict=True):
        if gaps:
            yield f"{ANGLE_NAMES[angle]}{'' if gaps == count else f' in {gaps} of {count}'}"


def warnings(motions: Motions) -> list[str]:
    """List warnings before the motions are used: subjects left out, estimates, landmark outliers, few postures."""
    found = [f"Left out: {error}" for error in motions.rejected]
    if is_yes(motions, ESTIMATED).any():
        found.append("The axial rotation of the clavicle is an estimate: two landmarks do not determine it.")
    found += [f"{said}. The diagnosis leaves these out." for said in outliers_in_words(motions)]
    for subject in motions.subjects:
        mine = motions.subject == subject
        if np.sum(mine) < FEWEST_POSTURES:
            found.append(f"{subject} has fewer than {FEWEST_POSTURES} postures: the diagnosis leaves it out.")
        elif len(set(motions.motion[mine])) == 1:
            found.append(f"{subject} has one motion only: more kinds of motion tell more.")
    return found
