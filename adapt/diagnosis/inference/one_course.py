"""Amplitudes of effects whose channels go together: one course for all, and in each subject one size.

A course for each channel is more than nature needs: what lifts TS lifts AI at the same time. With d the direction over
the channels that the amplitudes have if they are free (an empirical prior: a product of unknowns is not Gaussian),

    a_c0 = a_c,   a_ck = d_c b_k,   b_k ~ N(0, COURSE_SD_k^2)

and likewise for the departures of the course. Subjects differ by a share of d, and little beside it. A true effect
needs no more than that, a false one mimics it with courses that do not go together: fewer unknowns tell them apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.linear_evidence import AmplitudeStatistics
from adapt.diagnosis.fit.linear_model import AmplitudePrior
from adapt.diagnosis.fit.misfit import spans_of
from models.effects import Effect
from models.effects.prior import COURSE_SD

_SIZE_SD = 0.25
"""SD of a subject's size about the common one, as a share of it."""

_BESIDE = 1.0 / 3.0
"""What is left of the deviations that amplitudes have which are free."""


@dataclass(frozen=True)
class OneCourse:
    """The evidence's ingredients (see ``linear_evidence.common_amplitude``) for amplitudes that go together."""

    statistics: AmplitudeStatistics
    prior: AmplitudePrior
    along: Float[np.ndarray, "*draws amplitudes effects"]
    kept: Int[np.ndarray, " kept"]
    """Which of the free amplitudes are the first ones of these."""


def one_course(
    statistics: AmplitudeStatistics,
    prior: AmplitudePrior,
    free: Float[np.ndarray, "*draws amplitudes"],
    effects: Sequence[Effect],
    departures: int,
) -> OneCourse:
    """Restrict the amplitudes of each effect to one course for all its channels, and in each subject one size.

    The columns are the amplitudes of ``effects``, so many ``departures`` of each channel, and what else there is;
    ``free`` is the common amplitude that they have without this prior."""
    firsts, groups = _groups(effects, departures)
    kept = np.setdiff1d(np.arange(len(prior.common)), [k for group in groups for k in group.members])
    T = np.zeros((*free.shape, len(kept) + len(groups)))
    T[..., kept, np.arange(len(kept))] = 1.0
    for column, group in enumerate(groups, start=len(kept)):
        T[..., group.members, column] = free[..., group.firsts]
    along = np.zeros((*free.shape[:-1], T.shape[-1], len(firsts)))
    for effect, first in enumerate(firsts):
        along[..., np.searchsorted(kept, first), effect] = _SIZE_SD * free[..., first]
    sd, none = np.array([group.sd for group in groups]), np.zeros(len(groups))
    together = AmplitudePrior(
        mean=np.concatenate([prior.mean[kept], none]),
        common=np.concatenate([prior.common[kept], sd]),
        between=np.concatenate([_BESIDE * prior.between[kept], none]),
    )
    return OneCourse(statistics.project(T), together, along, kept)


class _Group(NamedTuple):
    """Columns, one a channel, that are what the first amplitudes of their channels are times one factor."""

    firsts: Int[np.ndarray, " channels"]
    members: Int[np.ndarray, " channels"]
    sd: float
    """Prior SD of the factor."""


def _groups(effects: Sequence[Effect], departures: int) -> tuple[list[Int[np.ndarray, " channels"]], list[_Group]]:
    """The first amplitude of every channel, by effect; and what follows them."""
    terms, start = len(COURSE_SD), sum(effect.amplitudes for effect in effects)
    firsts, groups = [], []
    for effect, own in zip(effects, spans_of(effects), strict=True):
        channels = np.arange(len(effect.channels))
        firsts.append(own.start + channels * effect.terms)
        if effect.over_elevation:
            groups += [_Group(firsts[-1], firsts[-1] + k, COURSE_SD[k]) for k in range(1, terms)]
            groups += [_Group(firsts[-1], start + departures * channels + k, 1.0) for k in range(departures)]
            start += departures * len(channels)
    return firsts, groups
