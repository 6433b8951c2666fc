"""A gap that no effect of the list explains, as columns of the linear model: what A1-A3 would have to be off by.

Whatever acts, acts on the constraints: their targets are off by some function of elevation, another one in each motion.
A hypothesis that leaves something systematic becomes more probable when this is added to it; a true one does not.
"""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.evidence import Block, Linear, alike, log_evidence, statistics, unlike
from adapt.diagnosis.observed import Observed
from models.girdle import CONSTRAINTS

SMOOTH, FINE = 3, 6
"""Terms over elevation in each motion: a constant, a slope and a bend; or nearly any course of seven postures."""

_SCALES_MM = (1.0, 3.0)
"""Prior SD of each term: bone pins left 3-5 mm of TS and AI, 2-4 mm of the conoid; a third of that for a small one."""

_FULL_ELEVATION_DEG = 150.0


def discrepancy_columns(fitted: Linear, data: Observed, terms: int) -> Float[np.ndarray, "subjects residuals more"]:
    """Derivatives of y by the terms (Legendre polynomials of elevation), for each constraint and motion."""
    x = np.clip(2.0 * data.elevation_deg / _FULL_ELEVATION_DEG - 1.0, -1.0, 1.3).T
    over = np.polynomial.legendre.legvander(x, terms - 1)
    in_motion = data.motion.T[..., None] == np.arange(len(data.motions))
    root = fitted.root[..., : len(CONSTRAINTS)]
    columns = root[..., None, None] * (over[..., None] * in_motion[..., None, :])[:, :, None, None]
    return columns.reshape(*fitted.y.shape, -1)


def discrepancy_gain(fitted: Linear, data: Observed, prior: Block) -> float:
    """log evidence of the hypothesis with a discrepancy beside it, less that without: the most over its priors.

    Smooth or fine, of either size, common to the subjects or each subject's own.
    """
    without = log_evidence(statistics(fitted), prior)
    gains = []
    for terms, spreads in ((SMOOTH, (alike, unlike)), (FINE, (alike,))):
        columns = discrepancy_columns(fitted, data, terms)
        with_more = statistics(fitted, columns)
        one = np.ones(columns.shape[2])
        gains += [log_evidence(with_more, prior + spread(one * s)) - without for spread in spreads for s in _SCALES_MM]
    return float(np.max(gains))
