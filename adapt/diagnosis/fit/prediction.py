"""What a set of causes predicts of unseen postures.

The amplitudes of a fold are where their posterior without all that it holds out is highest, in the linear model around
a mode (``fit.evidence``). About them each shoulder has sizes of its own, adapted to what it has seen, as `girdle adapt
--effect` does.
"""

from collections.abc import Callable, Collection, Sequence

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.joint_fit import JointFit, Part
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.positions.position_evidence import shown_sizes
from adapt.diagnosis.fit.posterior import Posterior
from adapt.diagnosis.fit.unseen_folds import Folds
from models.adapted_parameters import ADAPTED
from motions.rotations import DEG

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


def unseen_gaps_deg(
    joint: JointFit,
    folds: Folds,
    hypotheses: Sequence[Hypothesis],
    thetas_mm: Sequence[Float[np.ndarray, "subjects adapted"]],
    amplitudes: Sequence[Float[np.ndarray, "folds own"]],
    between_per_deg: float,
) -> list[Float[np.ndarray, "folds 6"]]:
    """Adapt the shoulder of every fold with each hypothesis, from its parameters (``JointFit.adapt``): mean
    |simulated - measured| of its rows, NaN of an angle that was not measured."""
    every, shoulders = folds.each * len(hypotheses), joint.shoulders
    seen = tuple(Part(fold.subject, number, fold.fitted) for number, fold in enumerate(every))
    unseen = tuple(part._replace(rows=fold.tested) for part, fold in zip(seen, every, strict=True))
    names = [hypothesis for hypothesis in hypotheses for _ in folds.each]
    values = [amplitude for of_folds in amplitudes for amplitude in of_folds]
    start_mm = np.concatenate([theta_mm[[fold.subject for fold in folds.each]] for theta_mm in thetas_mm])
    end = joint.of(seen).adapt(names, start_mm, values, between_per_deg)
    own = [found[: len(value)] for found, value in zip(end.amplitude.T, values, strict=True)]
    near = joint.of(unseen).nearest(names, end.theta_mm.T, own)
    gaps = DEG * np.abs(near.angles - shoulders.angles[:, np.tile(folds.rows, len(hypotheses))]).T
    return [folds.measured_means(one, shoulders) for one in np.split(gaps, len(hypotheses))]
