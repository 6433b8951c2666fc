"""The points on the thorax as a cause: another person's, they hold the ellipsoid where this person's is not.

No parameter set but one of the person (``girdle model --points``) has points of the person that it is adapted to. The
causes are then searched, sized and predicted with points that count ``RELIEF`` times less, and this one is named beside
them. It says nothing of the chain, so it is no answer by itself.
"""

import numpy as np

from adapt.diagnosis.result import Cause, CauseAmplitude, Interval
from models.effects.amplitudes import THORAX_POINTS, THORAX_POINTS_WHAT


def thorax_cause(adapted_deg: float, relieved_deg: float, noise_deg: float) -> Cause:
    """Describe what it takes away of the adapted gap beyond noise, all on unseen motions."""
    beyond = adapted_deg - noise_deg
    return Cause((THORAX_POINTS,), (1.0,), (adapted_deg - relieved_deg) / beyond if beyond > 0 else np.nan, np.nan)


def thorax_option(relief: float) -> str:
    """Write it as ``girdle adapt --effect`` takes it."""
    return f"{THORAX_POINTS}={relief:g}"


def thorax_amplitude(relief: float) -> CauseAmplitude:
    """Describe its size: how many times less the points count."""
    size = Interval(relief, np.nan, np.nan)
    return CauseAmplitude(THORAX_POINTS_WHAT, "", "1", size, relief, {"k": size}, thorax_option(relief))
