"""The postures of one or many subjects as typed arrays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int, Shaped

from motions.errors import InputError, warn_input

ANGLES = ("clavicle_y", "clavicle_z", "clavicle_x", "scapula_y", "scapula_z", "scapula_x")
"""Cardan angles Y-Z'-X'' of the clavicle and the scapula, the order of every array of six angles."""

BONES = {"clavicle": slice(0, 3), "scapula": slice(3, 6)}
"""The bones, and which of ANGLES are theirs."""

ANGLE_NAMES = {
    "clavicle_y": "clavicle protraction",
    "clavicle_z": "clavicle elevation",
    "clavicle_x": "clavicle axial rotation",
    "scapula_y": "scapula protraction",
    "scapula_z": "scapula lateral rotation",
    "scapula_x": "scapula tipping",
}
"""What a person calls them; each grows in the direction that its name says, tipping and axial rotation backward."""

FEWEST_ANGLES = 3
"""The girdle has three degrees of freedom (thesis 6.2.3): with fewer angles its posture is not determined."""

LANDMARKS = ("SC", "AC", "TS", "AI", "AA", "GH", "EM", "EL")
"""Bony landmarks whose positions a motion file may hold (thesis, Appendix A)."""


_SIDE = re.compile(r"[ _\-.]*(left|right|l|r)$", re.IGNORECASE)
"""What a name of a shoulder ends with beyond the person's."""

_LEADING_ZEROS = re.compile(r"(?<![\d.,])0+(?=\d)")

_PER_POSTURE = ("subject", "motion", "posture", "humerus_elevation_deg", "angles_deg")
"""Fields of ``Motions`` with an entry for each posture, but for landmarks and extra columns."""


@dataclass(frozen=True, eq=False, repr=False)
class Motions:
    """N postures in the order of the files, all as a right shoulder; NaN means 'not measured'.

    humerus_elevation_deg: angle of the humerus with the vertical, degrees.
    angles_deg: the six ANGLES relative to the thorax, degrees.
    landmarks_mm: positions in the thorax frame (x right, y up, z backward, origin IJ), mm; a landmark
    without columns in the files has no entry.
    extra: the columns that mean nothing here, as text, one row a posture, in the order of the files.
    rejected: the subjects and files that were left out, each with its reason.
    """

    subject: Shaped[np.ndarray, " postures"]
    motion: Shaped[np.ndarray, " postures"]
    posture: Int[np.ndarray, " postures"]
    humerus_elevation_deg: Float[np.ndarray, " postures"]
    angles_deg: Float[np.ndarray, "postures 6"]
    landmarks_mm: dict[str, Float[np.ndarray, "postures 3"]]
    extra: pd.DataFrame
    rejected: tuple[InputError, ...] = ()

    def __repr__(self) -> str:
        kinds = ", ".join(dict.fromkeys(self.motion.tolist()))
        return f"Motions({len(self.posture)} postures of {len(self.subjects)} subjects: {kinds})"

    @property
    def subjects(self) -> tuple[str, ...]:
        """The names of the subjects, each once, in the order in which they first appear."""
        return tuple(dict.fromkeys(self.subject.tolist()))

    @property
    def subject_number(self) -> Int[np.ndarray, " postures"]:
        """The place of each posture's subject among ``subjects``."""
        number = {name: k for k, name in enumerate(self.subjects)}
        return np.array([number[name] for name in self.subject.tolist()], int)

    def rows_by_subject(self) -> list[Int[np.ndarray, " own"]]:
        """Give the rows of each subject, in the order of the subjects."""
        number = self.subject_number
        return np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))[:-1])

    def previous_rows(self) -> Int[np.ndarray, " postures"]:
        """Give the row of the posture before, in the same motion of the same subject; -1 for the first."""
        previous = np.full(len(self.posture), -1)
        order = np.lexsort((self.posture, self.motion, self.subject))
        after, before = order[1:], order[:-1]
        same = (self.subject[after] == self.subject[before]) & (self.motion[after] == self.motion[before])
        previous[after[same]] = before[same]
        return previous

    def select(self, mask: Bool[np.ndarray, " postures"]) -> Motions:
        """Select the postures where the mask is true, in the same order."""
        return self.take(np.flatnonzero(mask))

    def take(self, rows: Int[np.ndarray, " chosen"]) -> Motions:
        """Take postures by their rows, in this order."""
        return replace(
            self,
            **{field: getattr(self, field)[rows] for field in _PER_POSTURE},
            landmarks_mm={name: position[rows] for name, position in self.landmarks_mm.items()},
            extra=self.extra.iloc[rows].reset_index(drop=True),
        )

    @staticmethod
    def concatenate(parts: Sequence[Motions]) -> Motions:
        """Concatenate all postures of the parts, one part after the other.

        A landmark that only some parts have is NaN in the others; an extra column is empty text there.
        """
        names = [name for name in LANDMARKS if any(name in part.landmarks_mm for part in parts)]
        extra = pd.concat([part.extra for part in parts], ignore_index=True).fillna("")
        return Motions(
            **{field: np.concatenate([getattr(part, field) for part in parts]) for field in _PER_POSTURE},
            landmarks_mm={name: np.concatenate([_landmark(part, name) for part in parts]) for name in names},
            extra=extra,
            # A part selected twice from one table carries the same errors: each is named once.
            rejected=tuple(dict.fromkeys(error for part in parts for error in part.rejected)),
        )


def check_motions(motions: object) -> None:
    """Refuse what is no Motions, and Motions without a posture: InputError."""
    if not isinstance(motions, Motions):
        cause = f"this is a {type(motions).__name__}, not Motions"
        raise InputError("motions", None, cause, "Read a motion file: motions.read_motions(file)")
    if not len(motions.posture):
        raise InputError("motions", None, "there is no posture in them", "Select one at least")


def warn_of_alike_motions(motions: Motions, file: str) -> None:
    """Warn of motions or subjects whose names differ in case, blanks, underscores or leading zeros alone.

    They count as two. A spreadsheet makes 1 of 01. P1_1 and P11 are two subjects: of these, what stands between is no
    more than another sign.
    """
    for column, what, between in ((motions.motion, "kinds of motion", ""), (motions.subject, "subjects", "_")):
        alike: dict[str, list[str]] = {}
        for name in sorted(set(column.tolist())):
            short = _LEADING_ZEROS.sub("", name.casefold()).replace(" ", between).replace("_", between)
            alike.setdefault(short, []).append(name)
        for names in alike.values():
            if len(names) > 1:
                cause = f"{' and '.join(map(repr, names))} count as {len(names)} {what}"
                warn_input(InputError(file, None, cause, "Give them one name if they are one"))


def _landmark(part: Motions, name: str) -> Float[np.ndarray, "postures 3"]:
    """The positions of one landmark in mm, NaN throughout if the part has none."""
    return part.landmarks_mm.get(name, np.full((len(part.posture), 3), np.nan))


def person_of(subject: str) -> str:
    """Give the name of the person: what is left of a shoulder's without its side."""
    return _SIDE.sub("", subject) or subject
