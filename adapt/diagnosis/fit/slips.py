"""Postures in which a landmark slipped: they are known to be wrong, and are no part of a diagnosis.

A slip turns one bone in one posture. A candidate is judged by what it predicts of motions and persons that it was not
fitted to, and the slip of one posture predicts nothing of another: it can be no candidate. ``girdle convert`` finds it
in the distances between landmarks, which no other cause changes, and marks it.
"""

import numpy as np

from motions.landmarks.sampled_postures import marked_slips
from motions.table import Motions


def without_slips(motions: Motions) -> tuple[Motions, tuple[str, ...]]:
    """Leave out the postures that are marked with a slip; and say which landmark slipped where."""
    slips = marked_slips(motions)
    if not slips:
        return motions, ()
    named = tuple(
        f"{names} slipped in {motions.subject[row]}, {motions.motion[row]} {motions.posture[row]}"
        for row, names in slips.items()
    )
    return motions.select(~np.isin(np.arange(len(motions.posture)), list(slips))), named
