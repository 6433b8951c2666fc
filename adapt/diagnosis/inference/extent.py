"""Extent of a cause over the measured postures: its largest strength, its main directions, and the quantity that it
follows."""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.result import ELEVATION, Extent
from models.effects import Effect
from models.effects.basis import Varying
from models.effects.by_posture import ByPosture
from motions.table import ANGLES, Motions

_MOST = 0.5
"""Smallest share of the sum of squares that the main directions have together, and that the quantity explains which a
cause is said to follow."""

Strength = Float[np.ndarray, "components postures"]


def extent(effect: Effect, strength: Strength, motions: Motions) -> Extent:
    """Compute the extent of a strength over the postures, from which a varying basis has taken each subject's mean.

    The main directions are the fewest that have at least half of the sum of squares over all postures. Their signs are
    those of a line over the followed quantity; without one, those in the posture with the largest strength.
    """
    norm = np.linalg.norm(strength, axis=0)
    follows, slope = _follows(effect, strength, motions)
    signs = slope if follows else strength[:, norm.argmax()]
    squares = (strength**2).sum(axis=1)
    names = list(dict.fromkeys(direction.partition(" by ")[0] for direction in effect.directions))
    main: dict[str, float] = {}
    if len(names) == len(strength) and squares.any():
        share = squares / squares.sum()
        for k in np.argsort(-share):
            if sum(map(abs, main.values())) < _MOST:
                main[names[k]] = float(np.copysign(share[k], signs[k]))
    return Extent(float(norm.max()), main, follows)


def _follows(effect: Effect, strength: Strength, motions: Motions) -> tuple[str, Float[np.ndarray, " components"]]:
    """Find the quantity of the basis over which a line explains most of the strength, and the slopes; an empty name if
    it explains less than half of the squares, or the effect is constant."""
    best, explained = ("", np.zeros(len(strength))), _MOST * (strength**2).sum()
    for name, values in _quantities(effect, motions).items():
        centred = np.array(values, float)
        for rows in motions.rows_by_subject():
            centred[rows] -= np.nanmean(centred[rows]) if np.isfinite(centred[rows]).any() else 0.0
        centred = np.nan_to_num(centred)
        if not centred.any():
            continue
        slope = strength @ centred / (centred @ centred)
        squares = float((slope**2).sum() * (centred @ centred))
        if squares >= explained and squares > 0.0:
            best, explained = (name, slope), squares
    return best


def _quantities(effect: Effect, motions: Motions) -> dict[str, np.ndarray]:
    if isinstance(effect.basis, ByPosture):
        return {angle: motions.angles_deg[:, ANGLES.index(angle)] for angle in effect.basis.angles}
    return {ELEVATION: motions.humerus_elevation_deg} if isinstance(effect.basis, Varying) else {}
