"""Postures of one or many subjects as typed arrays."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int, Shaped

from motions.errors import InputError, warn_input

ANGLES = ("clavicle_y", "clavicle_z", "clavicle_x", "scapula_y", "scapula_z", "scapula_x")
"""Cardan angles Y-Z'-X'' of clavicle and scapula, in the order of every array of six angles."""

BONES = {"clavicle": slice(0, 3), "scapula": slice(3, 6)}
"""Bones, and the slice of ANGLES that belongs to each."""

ANGLE_NAMES = {
    "clavicle_y": "clavicle protraction",
    "clavicle_z": "clavicle elevation",
    "clavicle_x": "clavicle axial rotation",
    "scapula_y": "scapula protraction",
    "scapula_z": "scapula lateral rotation",
    "scapula_x": "scapula tipping",
}
"""Anatomical names of the angles; each angle grows as its name says, tipping and axial rotation backward."""

FEWEST_ANGLES = 3
"""Minimum number of angles per posture: the girdle has three degrees of freedom (thesis 6.2.3)."""

LANDMARKS = ("SC", "AC", "TS", "AI", "AA", "GH", "EM", "EL")
"""Bony landmarks whose positions a motion file may hold (thesis, Appendix A)."""


_SIDE = re.compile(r"[ _\-.]*(left|right|l|r)$", re.IGNORECASE)
"""Ending of a shoulder's name that follows the name of the person."""

_LEADING_ZEROS = re.compile(r"(?<![\d.,])0+(?=\d)")

_PER_POSTURE = ("subject", "motion", "posture", "humerus_elevation_deg", "angles_deg")
"""Fields of ``Motions`` with one entry per posture, besides landmarks and extra columns."""


def counted(number: int, noun: str) -> str:
    """Write a number of things: '1 subject', '10 subjects'."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


@dataclass(frozen=True, eq=False, repr=False)
class Motions:
    """N postures in the order of the files, all as a right shoulder; NaN means 'not measured'.

    - ``humerus_elevation_deg``: angle between humerus and vertical, degrees.
    - ``angles_deg``: the six ANGLES relative to the thorax, degrees.
    - ``landmarks_mm``: positions in the thorax frame (x right, y up, z backward, origin IJ), mm; a landmark without
      columns in the files has no entry.
    - ``extra``: the columns that are not interpreted, as text, one row per posture, in the order of the files.
    - ``rejected``: one error per subject or file that was left out, with its reason.
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
        postures, subjects = counted(len(self.posture), "posture"), counted(len(self.subjects), "subject")
        return f"Motions({postures} of {subjects}, {counted(len(set(self.motion.tolist())), 'motion')})"

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of the subjects, each once, in the order of their first rows."""
        return tuple(dict.fromkeys(self.subject.tolist()))

    @property
    def subject_number(self) -> Int[np.ndarray, " postures"]:
        """Index into ``subjects`` for each posture."""
        number = {name: k for k, name in enumerate(self.subjects)}
        return np.array([number[name] for name in self.subject.tolist()], int)

    def rows_by_subject(self) -> list[Int[np.ndarray, " own"]]:
        """Return the rows of each subject, in the order of ``subjects``."""
        number = self.subject_number
        return np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))[:-1])

    def previous_rows(self) -> Int[np.ndarray, " postures"]:
        """Return, for each posture, the row of the previous one of its motion and subject; -1 for the first."""
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
        """Select postures by their row numbers, in the order of these numbers."""
        return replace(
            self,
            **{field: getattr(self, field)[rows] for field in _PER_POSTURE},
            landmarks_mm={name: position[rows] for name, position in self.landmarks_mm.items()},
            extra=self.extra.iloc[rows].reset_index(drop=True),
        )

    @staticmethod
    def concatenate(parts: Sequence[Motions]) -> Motions:
        """Concatenate the postures of all parts, one part after the other.

        A landmark that only some parts have is NaN in the other parts; an extra column is empty text there.
        """
        names = [name for name in LANDMARKS if any(name in part.landmarks_mm for part in parts)]
        extra = pd.concat([part.extra for part in parts], ignore_index=True).fillna("")
        return Motions(
            **{field: np.concatenate([getattr(part, field) for part in parts]) for field in _PER_POSTURE},
            landmarks_mm={name: np.concatenate([_landmark(part, name) for part in parts]) for name in names},
            extra=extra,
            # Parts selected from the same table share its errors: each is kept once.
            rejected=tuple(dict.fromkeys(error for part in parts for error in part.rejected)),
        )


def warn_of_alike_motions(motions: Motions, file: str) -> None:
    """Warn of motions or subjects with nearly the same name, which count as different.

    The names differ only in case, leading zeros (a spreadsheet turns 01 into 1) or characters that look alike. Names of
    motions may also differ in blanks and underscores. In names of subjects, a blank equals an underscore, but P1_1 and
    P11 are two subjects.
    """
    for column, what, between in ((motions.motion, "kinds of motion", ""), (motions.subject, "subjects", "_")):
        alike: dict[str, list[str]] = {}
        for name in sorted(set(column.tolist())):
            short = _LEADING_ZEROS.sub("", _as_it_looks(name).casefold()).replace(" ", between).replace("_", between)
            alike.setdefault(short, []).append(name)
        for names in alike.values():
            if len(names) > 1:
                looks = {_as_it_looks(name) for name in names}
                written = map(repr if len(looks) == len(names) else ascii, names)  # ascii shows what looks alike
                cause = f"{' and '.join(written)} count as {len(names)} {what}"
                warn_input(InputError(file, None, cause, "Give them one name if they are one"))


_LOOKS = {"Zs": " ", "Pd": "-", "Cf": ""}
"""Character that looks like those of a Unicode category: blanks, dashes, and characters without width."""


def _as_it_looks(name: str) -> str:
    """Return a name with composed accents, plain blanks and hyphens, and nothing that has no width."""
    composed = unicodedata.normalize("NFC", name.replace("\N{MINUS SIGN}", "-"))
    return "".join(_LOOKS.get(unicodedata.category(c), c) for c in composed).strip()


def _landmark(part: Motions, name: str) -> Float[np.ndarray, "postures 3"]:
    """Return the positions of one landmark in mm, all NaN if the part has none."""
    return part.landmarks_mm.get(name, np.full((len(part.posture), 3), np.nan))


def person_of(subject: str) -> str:
    """Return the name of the person: the name of the shoulder without its side."""
    return _SIDE.sub("", subject) or subject
