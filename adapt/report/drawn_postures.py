"""Which postures a report draws, so that it stays a file that can be mailed and opens at once."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int

from motions.table import Motions

MOST_DRAWN = 6000
"""Postures times parameter sets. Each takes 0.5 kB, all of them 3 MB beside the 4.8 MB of the library that draws."""

MOST_OF_A_SUBJECT = 300
"""Postures of one subject: a slider with more has no place for each."""


def chosen_subjects(motions: Motions, models: int, gap_deg: Mapping[str, float]) -> tuple[str, ...]:
    """Choose the subjects to draw: all of them, or as many as fit, in the order of the motions.

    As many as fit are taken evenly from the smallest to the largest gap. ``gap_deg`` is what the adapted model leaves;
    subjects without one come after the largest.
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

    Of a subject with very many postures, evenly chosen ones.
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
    """Indices below ``count``, at most so many, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
