"""How probable each set of causes is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.search import Search

_NEAR = 6.0
"""Sets that are worse than the best by this much in V (odds of 400) are not widened, nor weighed if they were not
fitted: what they add is nothing."""


@dataclass(frozen=True)
class Weights:
    """The probability of every hypothesis that was fitted, and of those with one cause more than a probable one."""

    probability: dict[Hypothesis, float]
    """Most probable first; sums to 1."""
    cause: dict[str, str]
    """By name of a candidate, its cause."""
    unexplained: float
    """Probability that all shoulders do something alike that no cause explains."""

    @cached_property
    def inclusion(self) -> dict[str, float]:
        """Probability of every cause, whatever its course, of being active; most probable first."""
        found = dict.fromkeys(self.cause.values(), 0.0)
        for hypothesis, probability in self.probability.items():
            for cause in dict.fromkeys(self.cause[name] for name in hypothesis):
                found[cause] += probability
        return dict(sorted(found.items(), key=lambda one: -one[1]))

    def beyond(self, probability: float, held: Callable[[str], bool]) -> "Weights":
        """Take the effects that are ``held`` against a null out of every set, but for this probability that they are
        beyond it."""
        found = {hypothesis: probability * p for hypothesis, p in self.probability.items()}
        for hypothesis, p in self.probability.items():
            rest = tuple(name for name in hypothesis if not held(name))
            found[rest] = found.get(rest, 0.0) + (1.0 - probability) * p
        return Weights(dict(sorted(found.items(), key=lambda one: -one[1])), self.cause, self.unexplained)


def weigh(search: Search) -> Weights:
    """Weigh all fitted hypotheses, and what the linear model says of one cause more: one of which the data say nothing
    is as probable as before them."""
    least = search.best.value - _NEAR
    near = [node for node in search.usable if node.value > least]
    widened = sorted(
        (one for node in near for one in search.widened(node) if one.value > least), key=lambda one: one.value
    )
    starts = {hypothesis: start for _, hypothesis, start in widened}  # where it is most probable
    each = {name: search.by_belief(start, name) for name, start in starts.items()}
    each |= {node.hypothesis: node.by_belief[:, 1:] for node in search.usable}
    every = np.array(list(each.values()))
    shares = probabilities([one for of_set in every for one in of_set]).reshape(every.shape[:2])
    found = dict(zip(each, shares.sum(axis=1).tolist(), strict=True))
    unexplained = float(shares[:, [one.left == "common" for one in search.beliefs]].sum())
    return Weights(dict(sorted(found.items(), key=lambda one: -one[1])), search.joint.candidates.causes, unexplained)


def probabilities(values: Sequence[Float[np.ndarray, " draws"]]) -> Float[np.ndarray, " sets"]:
    """Give sets of these V their probabilities among each other: the mean over persons drawn anew."""
    return probabilities_of_draws(values).mean(axis=1)


def probabilities_of_draws(values: Sequence[Float[np.ndarray, " draws"]]) -> Float[np.ndarray, "sets draws"]:
    """Give sets of these V their probabilities among each other, for the persons of each draw."""
    weight = np.exp(np.array(values) - np.max(values, axis=0))
    return weight / weight.sum(axis=0)
