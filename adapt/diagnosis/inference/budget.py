"""The gap budget: how the gap on unseen motions shrinks as one cause after the other is added, by exact refits; and
what each candidate would do alone."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.joint_fit import Fitted, JointFit
from adapt.diagnosis.fit.prediction import Predicted
from adapt.diagnosis.fit.unseen_folds import Folds
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.result import NONE


class Rung(NamedTuple):
    """One hypothesis, fitted exactly in every fold."""

    added: str
    """The cause that it adds to the one before; empty for the first."""
    hypothesis: Hypothesis
    gaps_deg: Float[np.ndarray, "tests 6"]


def ladder(search: Search, named: Node) -> list[Rung]:
    """Add the named causes one by one, the one that takes most of the unseen gap first."""
    nodes, order = [named], []
    while nodes[-1].hypothesis:
        dropped, less = without_the_weakest(search, nodes[-1])
        order.append(dropped)
        nodes.append(less)
    added = ["", *reversed(order)]
    return [
        Rung(name, node.hypothesis, refitted(search, node).predicted.gaps_deg)
        for name, node in zip(added, reversed(nodes), strict=True)
    ]


def without_the_weakest(search: Search, node: Node) -> tuple[str, Node]:
    """Find the cause that takes least of the unseen gap beside the others, and fit the set without it."""
    less = {name: search.without(node, name) for name in node.hypothesis}
    name = min(less, key=lambda name: _mean_gap_deg(search.folds, less[name].predicted))
    return name, less[name]


def alone_deg(search: Search) -> dict[str, float]:
    """Predict the gap of unseen postures with no cause, and with each candidate alone, deg, by its better course; the
    smallest first. One that would act the wrong way is left out."""
    candidates, none = search.joint.candidates, search.nodes[()]
    found = {NONE: _mean_gap_deg(search.folds, none.predicted)}
    for effect in candidates.effects:
        node = search.nodes.get((effect.name,))
        predicted = node.predicted if node else search.predicted(none, (effect.name,))
        if candidates.has_the_sign((effect.name,), predicted.amplitude[0]):
            gap = _mean_gap_deg(search.folds, predicted)
            found[effect.cause] = min(gap, found.get(effect.cause, gap))
    return dict(sorted(found.items(), key=lambda one: one[1]))


def _mean_gap_deg(folds: Folds, predicted: Predicted) -> float:
    return float(folds.by_fold(known_mean(predicted.gaps_deg)).mean())


def refitted(search: Search, node: Node) -> Node:
    """Fit a hypothesis exactly without each fold, once; give it with what it then predicts there."""
    if node.hypothesis not in search.refits:
        search.refits[node.hypothesis] = _predicted_exactly(search, node)
    return node._replace(predicted=search.refits[node.hypothesis])


def _predicted_exactly(search: Search, node: Node) -> Predicted:
    folds, joint = search.folds, search.joint
    every = JointFit(joint.model, joint.shoulders, joint.candidates, folds.parts)
    # from the fit of everything: what is predicted lies nearer, but led into higher valleys
    amplitude = np.repeat(node.fitted.amplitude, every.groups, axis=0)
    fitted = every.fit(node.hypothesis, node.fitted.theta_mm[every.arrays.subject], amplitude)
    # the unseen rows of each test, with the parameters of the part that has not seen them
    parts = tuple(
        folds.parts[test.part]._replace(rows=test.rows, group=number) for number, test in enumerate(folds.tests)
    )
    group = np.array([folds.parts[test.part].group for test in folds.tests])
    unseen = JointFit(joint.model, joint.shoulders, joint.candidates, parts)
    there = Fitted(fitted.theta_mm[folds.part], fitted.amplitude[group], fitted.E[folds.part], fitted.converged)
    near = unseen.nearest(node.hypothesis, there)
    gaps = np.abs(near.angles_deg - joint.shoulders.measured_deg[:, folds.rows]).T
    squares = folds.parted(near.y.T)
    return Predicted(fitted.amplitude, fitted.theta_mm, squares, folds.measured_means(gaps, joint.shoulders))
