"""Other persons that might have been measured: BayesBag.

A model that is somewhat wrong, as every model of a shoulder is, is too sure of which set of causes is the right one. So
probabilities are averaged over persons drawn anew (Huggins & Miller 2023, Reproducible model selection using bagged
posteriors, Bayesian Analysis 18:79-104, doi 10.1214/21-BA1301).
"""

import numpy as np
from jaxtyping import Float, Int

_DRAWS, _SEED = 50, 7
"""A probability of 0.8 is then known to 0.04 or better, and the same data give the same answer."""


def resampled_persons(person: Int[np.ndarray, " subjects"]) -> Float[np.ndarray, "draws subjects"]:
    """Draw as many persons as there are, with replacement: how often each shoulder is there. One person is there once:
    of it there is nothing to draw."""
    persons = int(person.max()) + 1
    if persons == 1:
        return np.ones((1, len(person)))
    drawn = np.random.default_rng(_SEED).multinomial(persons, np.full(persons, 1.0 / persons), _DRAWS)
    return drawn[:, person].astype(float)
