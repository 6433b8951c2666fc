"""Amplitudes of a set of causes that have not seen what a fold holds out: where their posterior without it is highest,
in the linear model around a mode (``fit.evidence``)."""

from collections.abc import Callable, Collection

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.positions.position_evidence import shown_sizes
from adapt.diagnosis.fit.posterior import Posterior
from adapt.diagnosis.fit.unseen_folds import Folds
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)


def unseen_amplitudes(
    folds: Folds,
    candidates: Candidates,
    hypothesis: Hypothesis,
    at: Posterior,
    likelihood_without: Callable[[str], Likelihood],
    seen: Collection[str] = (),
) -> Float[np.ndarray, "folds own"]:
    """Give the amplitudes of a hypothesis for every fold, in the linear model around the mode of one within it; of the
    causes that were ``seen``, those that positions show."""
    where, here = candidates.where(hypothesis), candidates.among_all(at.hypothesis, at.amplitude)
    Z, own = at.Z[..., np.concatenate([np.arange(_N), _N + where])], np.arange(len(where))
    of_motion = {
        motion: likelihood_without(motion).evidence(at.theta_mm, at.y, Z, where, here[where])
        for motion in dict.fromkeys(fold.held_out for fold in folds.each)
    }
    subjects = np.arange(len(at.theta_mm))
    found: dict[tuple[str, tuple[int, ...]], np.ndarray] = {}
    for fold in folds.each:
        if (held_out := (fold.held_out, fold.unseen)) not in found:
            others = ~np.isin(subjects, fold.unseen)
            evidence = of_motion[fold.held_out].of(others)
            given = evidence.given(own, here[where], candidates.mean[where], candidates.scale[where])
            positions = likelihood_without(fold.held_out).positions
            shown = shown_sizes(positions and positions.of(others), candidates, hypothesis, seen)
            found[held_out] = given.amplitude
            if shown:
                found[held_out][shown.where] = shown.given.amplitude
    return np.array([found[fold.held_out, fold.unseen] for fold in folds.each])
