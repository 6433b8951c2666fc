"""What an effect may do beside what its amplitudes say: as more columns of the linear model.

An effect that goes with elevation is fitted with three terms of a course, the same in every motion. Real courses have
corners, and another plane of elevation another strength. A departure d(f) multiplies the course's first term f, so that
its columns are those of the first term times d; in the evidence they are integrated out like the amplitudes. The larger
an effect is, the more its departures show: without them a large effect would be taken for an unknown one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_model import LinearisedFit
from adapt.diagnosis.fit.misfit import spans_of
from adapt.diagnosis.fit.observations import Observed
from models.effects import Effect
from models.effects.effect import FULL_ELEVATION_DEG
from models.effects.prior import COURSE_SD

_FINER_SD = (0.1, 0.1)
"""Prior SD of the next two terms of a course, as shares of the scale: a hinge at half the range, a late smooth step and
a sigmoid have up to 0.15 and 0.08."""


def with_departures(fitted: LinearisedFit, effects: Sequence[Effect], data: Observed) -> LinearisedFit:
    """Add columns for what else ``effects``, the hypothesis's own, may do, behind those of the amplitudes."""
    subjects, postures, m, _ = fitted.root.shape
    columns, scales = [], []
    for effect, own in zip(effects, spans_of(effects), strict=True):
        if effect.over_elevation:
            departures = departures_of(data, effect)
            first = own.start + len(COURSE_SD) * np.arange(len(effect.channels))
            by_posture = fitted.A[..., first].reshape(subjects, postures, m, -1, 1) * departures[:, :, None, None]
            columns.append(by_posture.reshape(subjects, postures * m, -1))
            scales.append(np.repeat(fitted.scale[first], departures.shape[2]))
    if not columns:
        return fitted
    more = np.concatenate(columns, axis=2)
    return replace(
        fitted,
        A=np.concatenate([fitted.A, more], axis=2),
        scale=np.concatenate([fitted.scale, *scales]),
        a=np.concatenate([fitted.a, np.zeros((subjects, more.shape[2]))], axis=1),
    )


def departures_per_channel(data: Observed) -> int:
    """Count the columns of departures that a channel has; those of an effect stand together, channel by channel."""
    return len(_FINER_SD) + (len(data.motions) if len(data.motions) > 1 else 0)


def departures_of(data: Observed, effect: Effect) -> Float[np.ndarray, "subjects postures departures"]:
    """Compute d at each posture, of one prior SD: 8 (1 - f) T_k(1 - 2 f) for the Chebyshev polynomials after the
    course's own, and what sets one motion apart from the others."""
    f = data.elevation_deg.T / FULL_ELEVATION_DEG
    terms = np.polynomial.chebyshev.chebvander(1.0 - 2.0 * f, len(COURSE_SD))[..., 2:] * 8.0 * (1.0 - f[..., None])
    motions = len(data.motions)
    apart = (data.motion.T[..., None] == np.arange(motions)) - 1.0 / motions
    among = apart if motions > 1 else apart[..., :0]
    return np.concatenate([terms * np.asarray(_FINER_SD), among * effect.prior.between_motions], axis=2)
