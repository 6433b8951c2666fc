"""Probabilities of sets of causes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.search import Search

_NEAR = 6.0
"""Difference in V from the best set (odds of 400) beyond which sets are not widened, and not weighed unless they were
fitted, because they contribute nothing."""


@dataclass(frozen=True)
class Weights:
    """Probabilities of all fitted hypotheses, and of hypotheses with one cause more than a probable one."""

    probability: dict[Hypothesis, float]
    """Probability by hypothesis, the most probable first; sums to 1."""
    cause: dict[str, str]
    """Cause by the name of a candidate."""
    unexplained: float
    """Probability that all shoulders have something in common that no cause explains."""

    @cached_property
    def inclusion(self) -> dict[str, float]:
        """Inclusion probability of every cause, with any basis; the most probable first."""
        found = dict.fromkeys(self.cause.values(), 0.0)
        for hypothesis, probability in self.probability.items():
            for cause in dict.fromkeys(self.cause[name] for name in hypothesis):
                found[cause] += probability
        return dict(sorted(found.items(), key=lambda one: -one[1]))

    def beyond(self, probability: float, held: Callable[[str], bool]) -> "Weights":
        """Remove the effects that are ``held`` against a null from every set, except for the ``probability`` that they
        go beyond the null."""
        found = {hypothesis: probability * p for hypothesis, p in self.probability.items()}
        for hypothesis, p in self.probability.items():
            rest = tuple(name for name in hypothesis if not held(name))
            found[rest] = found.get(rest, 0.0) + (1.0 - probability) * p
        return Weights(dict(sorted(found.items(), key=lambda one: -one[1])), self.cause, self.unexplained)


def weigh(search: Search) -> Weights:
    """Compute the probabilities of fitted hypotheses and, by the linear model, of those with one cause more.

    The widened hypotheses let a cause on which the data have no information keep its prior probability.
    """
    least = search.best.value - _NEAR
    near = [node for node in search.usable if node.value > least]
    widened = sorted(
        (one for node in near for one in search.widened(node) if one.value > least), key=lambda one: one.value
    )
    starts = {hypothesis: start for _, hypothesis, start in widened}  # the most probable start is last
    each = {name: search.by_belief(start, name) for name, start in starts.items()}
    each |= {node.hypothesis: search.of_draws(node) for node in search.usable}
    every = np.array(list(each.values()))
    shares = probabilities([one for of_set in every for one in of_set]).reshape(every.shape[:2])
    found = dict(zip(each, shares.sum(axis=1).tolist(), strict=True))
    unexplained = float(shares[:, [one.left == "common" for one in search.beliefs]].sum())
    return Weights(dict(sorted(found.items(), key=lambda one: -one[1])), search.joint.candidates.causes, unexplained)


def probabilities(values: Sequence[Float[np.ndarray, " draws"]]) -> Float[np.ndarray, " sets"]:
    """Compute the relative probabilities of sets with these V, averaged over resampled persons."""
    return probabilities_of_draws(values).mean(axis=1)


def probabilities_of_draws(values: Sequence[Float[np.ndarray, " draws"]]) -> Float[np.ndarray, "sets draws"]:
    """Compute the relative probabilities of sets with these V, for the persons of each draw."""
    weight = np.exp(np.array(values) - np.max(values, axis=0))
    return weight / weight.sum(axis=0)
