"""Own bones of each person or, where they do not predict the person's own motions, the plain adaptation.

A girdle that is far from the set, relative to what its motions determine, may compensate for something that no chain
can represent. Such a person is adapted both ways without each motion (with a single motion, without each third of the
postures). The plain adaptation is kept where it predicts the held-out postures better, or where own bones predict them
far worse than their noise implies. It is also kept where the search for own bones has not converged.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int

from adapt.engine.batching import take_problems, with_problems
from adapt.evaluation.predictions import Places, gaps_of, held_out_angles, predicted
from adapt.own_bones.own_adaptation import (
    DO_NOT_PREDICT,
    NOT_CONVERGED,
    OwnBones,
    adapt_own_bones,
    with_own_noise,
)
from adapt.own_bones.scales import Scales
from adapt.own_bones.unsure import Unsure
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.problems import Problems, select_problems
from models.adapted_parameters import ADAPTED
from models.person.own_bones import Spread

DOUBTFUL_SDS = 2.5
"""Distance from the set, in SDs, beyond which own bones are tested for their predictions; ``far_from_people`` has the
same limit for a single size. Six bone-pin shoulders with six sets, each without each motion, are 138 cases; 38 are
beyond the limit, and all 38 predict better with own bones."""

SURPRISED = 7.0
"""Limit of the root mean square gap on held-out postures, in multiples of the noise of the fold. Beyond it own bones
are rejected, even where the plain adaptation is worse. The 38 cases of ``DOUBTFUL_SDS`` have 1.1 to 6.3."""

_THIRDS = 3


class Persons(NamedTuple):
    """Differences between the persons of some problems: the prior of their adaptations."""

    spread: Spread
    scales: Sequence[Scales]
    own_noise: bool
    """True where only the noise is learnt, from each person alone."""
    motion: Int[np.ndarray, "postures problems"]
    """Number of the motion of each posture."""
    unsure: Unsure
    kin: Int[np.ndarray, " problems"]
    """Number that problems with other postures of the same person share."""

    def at(self, problem: Int[np.ndarray, " some"]) -> "Persons":
        """Select some of the problems, each as often as wanted."""
        scales = [self.scales[k] for k in problem.tolist()]
        spread, unsure = take_problems((self.spread, self.unsure), problem)
        return Persons(spread, scales, self.own_noise, self.motion[:, problem], unsure, self.kin[problem])


def own_or_plain(data: Problems, persons: Persons, weight: float) -> tuple[Problems, Adapted, OwnBones]:
    """Adapt own bones, or keep the plain adaptation; return the problems with their girdles, the adaptations and the
    sizes."""
    own_data, adapted, own = own_bones(data, persons, weight)
    failed = adapted.status == status.NOT_CONVERGED
    doubtful = np.flatnonzero((adapted.status == status.OK) & (own.distance > DOUBTFUL_SDS))
    worse = doubtful[_do_not_predict(take_problems(data, doubtful), persons.at(doubtful), weight)]
    chosen = np.sort(np.append(worse, np.flatnonzero(failed)))
    if not len(chosen):
        return own_data, adapted, own
    some = take_problems(data, chosen)
    plain = adapt_batch(some, weight)
    good = plain.status == status.OK
    kept, some, plain = chosen[good], take_problems(some, good), take_problems(plain, good)
    code = np.where(failed[kept], NOT_CONVERGED, DO_NOT_PREDICT)
    found = with_problems(own, kept, _of_set(some, plain, take_problems(own, kept), code))
    return with_problems(own_data, kept, some), with_problems(adapted, kept, plain), found


def own_bones(data: Problems, persons: Persons, weight: float) -> tuple[Problems, Adapted, OwnBones]:
    """Adapt own bones, with the noise of each person where persons are few."""
    scales = with_own_noise(data, persons.spread) if persons.own_noise else persons.scales
    return adapt_own_bones(data, persons.spread, scales, weight, persons.unsure, persons.kin)


def _of_set(data: Problems, plain: Adapted, own: OwnBones, code) -> OwnBones:
    """Return the set's bones with the six parameters of the plain adaptation; the SDs of all sizes are NaN."""
    sizes = np.zeros_like(own.sizes)
    sizes[: len(ADAPTED)] = plain.theta_mm - np.asarray(data.girdle.adapted_mm)
    none = {"covariance": np.full_like(own.covariance, np.nan), "told": np.full_like(own.told, np.nan)}
    return own._replace(sizes=sizes, code=code, **none)


def _do_not_predict(data: Problems, persons: Persons, weight: float) -> Bool[np.ndarray, " problems"]:
    """Find the problems whose held-out postures own bones predict worse than the plain adaptation, or far worse than
    their noise implies."""
    count = data.counted.shape[1]
    problem, fitted, tested = _folds(np.asarray(data.counted), persons.motion)
    if not len(problem):
        return np.zeros(count, bool)
    of_folds, adapted, own = own_bones(select_problems(data, problem, counted=fitted), persons.at(problem), weight)
    gaps = gaps_of(of_folds, held_out_angles(of_folds, adapted, tested))
    plain, _, angles = predicted(data, problem, fitted, tested, lambda fold, _: (fold, adapt_batch(fold, weight)))
    more = np.nansum(gaps - gaps_of(plain, angles), axis=(0, 1))  # NaN where either adaptation does not predict
    known = np.isfinite(gaps).sum(axis=(0, 1))
    square = np.where(known > 0, np.nansum(gaps**2, axis=(0, 1)) / np.maximum(known, 1) / own.scales[-1] ** 2, np.inf)
    surprise = np.sqrt(np.bincount(problem, square, count) / np.maximum(np.bincount(problem, minlength=count), 1))
    return (np.bincount(problem, more, count) > 0.0) | (surprise > SURPRISED)


def _folds(counted: Places, motion: Int[np.ndarray, "postures problems"]) -> tuple[np.ndarray, Places, Places]:
    """Hold out each motion of each problem in turn, or each third of a single motion; return the problem of each fold,
    the remaining postures and the held-out ones."""
    problem, tested = [], []
    for k, mine in enumerate(counted.T):
        label = motion[:, k]
        if len(np.unique(label[mine])) == 1:
            label = np.cumsum(mine) % _THIRDS
        names = np.unique(label[mine])
        if len(names) > 1:
            tested += [mine & (label == name) for name in names]
            problem += [k] * len(names)
    every = np.array(tested, bool).reshape(-1, len(counted)).T
    which = np.array(problem, int)
    return which, counted[:, which] & ~every, every
