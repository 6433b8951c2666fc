"""How probable each set of causes is, averaged over persons and motions that might have been measured.

Weights of the hypotheses are averaged over a Bayesian bootstrap of persons and of folds (BayesBag, Huggins and Miller
2023; pseudo-BMA+, Yao et al. 2018): where every model is somewhat wrong, one data set would make them too sure.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.search import Node, Search

_DRAWS = 400
"""Of the bootstrap: a probability of one half is known to 0.025."""

_SEED = 20260601


@dataclass(frozen=True)
class Weights:
    """The probability of every hypothesis that was fitted."""

    probability: dict[Hypothesis, float]
    """Most probable first; sums to 1."""
    cause: dict[str, str]
    """By name of a candidate, its cause."""

    @cached_property
    def inclusion(self) -> dict[str, float]:
        """Probability of every cause, whatever its course, of being at work; most probable first."""
        found = dict.fromkeys(self.cause.values(), 0.0)
        for hypothesis, probability in self.probability.items():
            for cause in {self.cause[name] for name in hypothesis}:
                found[cause] += probability
        return dict(sorted(found.items(), key=lambda one: -one[1]))


def weigh(search: Search) -> Weights:
    """Weigh all fitted hypotheses."""
    nodes = search.usable
    total = probabilities(search, nodes)
    order = np.argsort(-total)
    return Weights({nodes[k].hypothesis: float(total[k]) for k in order}, search.joint.candidates.causes)


def probabilities(search: Search, nodes: Sequence[Node]) -> Float[np.ndarray, " nodes"]:
    """Average the weights of these hypotheses over the bootstrap; they sum to 1."""
    q = np.array([search.q(node.predicted) for node in nodes])
    prior = np.array([search.log_prior(node.hypothesis, node.fitted.amplitude[0]) for node in nodes])
    person = search.joint.shoulders.person[search.folds.subject]
    total = np.zeros(len(nodes))
    for weights in fold_weights(person, _DRAWS, _SEED):
        log = search.log_likelihood(q, weights) + prior
        weight = np.exp(log - log.max())
        total += weight / weight.sum()
    return total / _DRAWS


def fold_weights(person: np.ndarray, draws: int, seed: int) -> Float[np.ndarray, "draws folds"]:
    """Draw weights of the folds, those of one person together and each on its own; each draw sums to their number."""
    generator = np.random.default_rng(seed)
    count, persons = len(person), int(person.max()) + 1
    weights = generator.dirichlet(np.ones(count), draws)
    if persons > 1:
        weights = weights * generator.dirichlet(np.ones(persons), draws)[:, person]
    return weights / weights.sum(axis=1, keepdims=True) * count
