"""Choice of the postures that a report draws, so that the file can be mailed and opens at once."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int

from motions.table import Motions

MOST_DRAWN = 6000
"""Largest number of postures times parameter sets: 3 MB at 0.5 kB each, beside 4.8 MB of the plotting library."""

MOST_OF_A_SUBJECT = 300
"""Largest number of postures of one subject; a slider has no room for more."""


def chosen_subjects(motions: Motions, models: int, gap_deg: Mapping[str, float]) -> tuple[str, ...]:
    """Choose the subjects to draw: all of them, or as many as fit, in the order of the motions.

    Where not all fit, subjects are chosen evenly from the smallest to the largest gap. ``gap_deg`` is the gap after
    adaptation; subjects without a gap come after the largest.
    """
    subjects = motions.subjects
    longest = max(int((motions.subject == name).sum()) for name in subjects)
    fit = MOST_DRAWN // (models * min(longest, _most_of_a_subject(models)))
    if fit >= len(subjects):
        return subjects
    by_gap = sorted(subjects, key=lambda name: np.nan_to_num(gap_deg.get(name, np.inf), nan=np.inf))
    chosen = {by_gap[k] for k in evenly(len(subjects), max(1, fit))}
    return tuple(name for name in subjects if name in chosen)


def chosen_rows(motions: Motions, models: int, subjects: tuple[str, ...]) -> Int[np.ndarray, " rows"]:
    """Choose the rows of the motions to draw: by subject, then motion, in the order of the postures.

    Rows of a subject with very many postures are chosen evenly.
    """
    names = {name: number for number, name in enumerate(dict.fromkeys(motions.motion.tolist()))}
    motion = np.array([names[name] for name in motions.motion.tolist()])
    parts = []
    for subject in subjects:
        rows = np.flatnonzero(motions.subject == subject)
        rows = rows[np.lexsort((motions.posture[rows], motion[rows]))]
        parts.append(rows[evenly(len(rows), _most_of_a_subject(models))])
    return np.concatenate(parts)


def _most_of_a_subject(models: int) -> int:
    return max(1, min(MOST_OF_A_SUBJECT, MOST_DRAWN // models))


def evenly(count: int, most: int) -> Int[np.ndarray, " chosen"]:
    """Choose evenly at most ``most`` indices below ``count``, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
