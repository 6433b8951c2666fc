"""What each candidate would do alone to the gap on unseen motions."""

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.unseen_folds import Folds
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.inference.search import Search
from adapt.diagnosis.result import NONE
from adapt.tables.folds import MOTION


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


def _mean_gap_deg(folds: Folds, gaps_deg: Float[np.ndarray, "folds 6"]) -> float:
    return float(folds.by_part(known_mean(gaps_deg)).mean())
