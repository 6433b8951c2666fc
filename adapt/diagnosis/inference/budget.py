"""The gap budget: how the gap on unseen motions shrinks as one cause after the other is added, by exact refits; and
what each candidate would do alone."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis, without
from adapt.diagnosis.fit.joint_fit import Fitted, JointFit
from adapt.diagnosis.fit.unseen_folds import Folds
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.inference.search import Search
from adapt.diagnosis.result import NONE


class Rung(NamedTuple):
    """One hypothesis, fitted exactly in every fold."""

    added: str
    """The cause that it adds to the one before; empty for the first."""
    hypothesis: Hypothesis
    gaps_deg: Float[np.ndarray, "tests 6"]


def ladder(search: Search, named: Hypothesis) -> list[Rung]:
    """Add the named causes one by one, the one that takes most of the unseen gap first."""
    sets, order = [named], []
    while sets[-1]:
        dropped = min(sets[-1], key=lambda name: unseen_gap_deg(search, without(sets[-1], name)))
        order.append(dropped)
        sets.append(without(sets[-1], dropped))
    added = ["", *reversed(order)]
    return [Rung(name, one, refitted(search, one)) for name, one in zip(added, reversed(sets), strict=True)]


def alone_deg(search: Search) -> dict[str, float]:
    """Predict the gap of unseen postures with no cause, and with each candidate alone, deg, by its better course; the
    smallest first. One that would act the wrong way is left out."""
    candidates, none = search.joint.candidates, search.adaptation(()).linearised
    found = {NONE: unseen_gap_deg(search, ())}
    for effect in candidates.effects:
        predicted = none.predict((effect.name,))
        if candidates.has_the_sign((effect.name,), predicted.amplitude[0]):
            gap = _mean_gap_deg(search.folds, predicted.gaps_deg)
            found[effect.cause] = min(gap, found.get(effect.cause, gap))
    return dict(sorted(found.items(), key=lambda one: one[1]))


def unseen_gap_deg(search: Search, hypothesis: Hypothesis) -> float:
    """Predict the mean gap of unseen postures."""
    return _mean_gap_deg(search.folds, search.adaptation(hypothesis).predicted.gaps_deg)


def _mean_gap_deg(folds: Folds, gaps_deg: Float[np.ndarray, "tests 6"]) -> float:
    return float(folds.by_fold(known_mean(gaps_deg)).mean())


def refitted(search: Search, hypothesis: Hypothesis) -> Float[np.ndarray, "tests 6"]:
    """Fit a hypothesis exactly without each fold, once; give the gaps there."""
    if hypothesis not in search.refits:
        search.refits[hypothesis] = _refitted(search, hypothesis)
    return search.refits[hypothesis]


def _refitted(search: Search, hypothesis: Hypothesis) -> Float[np.ndarray, "tests 6"]:
    folds, joint, start = search.folds, search.joint, search.adaptation(hypothesis).fitted
    every = JointFit(joint.model, joint.shoulders, joint.candidates, folds.parts)
    # from the fit of everything: what is predicted lies nearer, but led into higher valleys
    amplitude = np.repeat(start.amplitude, every.groups, axis=0)
    fitted = every.fit(hypothesis, start.theta_mm[every.arrays.subject], amplitude)
    # the unseen rows of each test, with the parameters of the part that has not seen them
    parts = tuple(
        folds.parts[test.part]._replace(rows=test.rows, group=number) for number, test in enumerate(folds.tests)
    )
    group = np.array([folds.parts[test.part].group for test in folds.tests])
    unseen = JointFit(joint.model, joint.shoulders, joint.candidates, parts)
    there = Fitted(fitted.theta_mm[folds.part], fitted.amplitude[group], fitted.E[folds.part], fitted.converged)
    near = unseen.nearest(hypothesis, there)
    gaps = np.abs(near.angles_deg - joint.shoulders.measured_deg[:, folds.rows]).T
    return folds.measured_means(gaps, joint.shoulders)
