"""The gap budget: how the gap on unseen motions shrinks as one cause after the other is added, and what each
candidate would do alone."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis, without
from adapt.diagnosis.fit.unseen_folds import Folds
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.inference.search import Search
from adapt.diagnosis.result import NONE
from adapt.tables.folds import MOTION


class Rung(NamedTuple):
    """One hypothesis, in every fold."""

    added: str
    """The cause that it adds to the one before; empty for the first."""
    hypothesis: Hypothesis
    gaps_deg: Float[np.ndarray, "folds 6"]


def ladder(search: Search, named: Hypothesis) -> list[Rung]:
    """Add the named causes one by one, the one that takes most of the unseen gap first."""
    sets, order = [named], []
    while sets[-1]:
        search.predict([without(sets[-1], name) for name in sets[-1]])
        dropped = min(sets[-1], key=lambda name: unseen_gap_deg(search, without(sets[-1], name)))
        order.append(dropped)
        sets.append(without(sets[-1], dropped))
    added = ["", *reversed(order)]
    return [Rung(name, one, search.unseen_gaps_deg(one)) for name, one in zip(added, reversed(sets), strict=True)]


def alone_deg(search: Search) -> dict[str, float]:
    """Predict the gap of unseen motions with no cause, and with each candidate alone, deg, by its better course; the
    smallest first. One that would act the wrong way is left out."""
    candidates, motions, none = search.joint.candidates, search.folds.only(MOTION), search.mode(())
    every = [(effect.name,) for effect in candidates.effects]
    alone = [one for one in every if candidates.has_the_sign(one, search.given(none, one).amplitude)]
    found_deg = search.predicted_gaps_deg(motions, [(), *alone], [none] * (1 + len(alone)))
    found: dict[str, float] = {}
    for name, gaps in zip([(), *alone], found_deg, strict=True):
        cause, gap = candidates.causes[name[0]] if name else NONE, _mean_gap_deg(motions, gaps)
        found[cause] = min(gap, found.get(cause, gap))
    return dict(sorted(found.items(), key=lambda one: one[1]))


def unseen_gap_deg(search: Search, hypothesis: Hypothesis) -> float:
    """Predict the mean gap of unseen postures."""
    return _mean_gap_deg(search.folds, search.unseen_gaps_deg(hypothesis))


def _mean_gap_deg(folds: Folds, gaps_deg: Float[np.ndarray, "folds 6"]) -> float:
    return float(folds.by_part(known_mean(gaps_deg)).mean())
