"""What a set of causes predicts of unseen postures.

The amplitudes of a test are where their posterior without all that it holds out is highest, in the linear model around
a mode (``fit.evidence``). About them each shoulder has sizes of its own, adapted to what it has seen, as `girdle adapt
--effect` does.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.evidence import Likelihood
from adapt.diagnosis.fit.joint_fit import JointFit, Part
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
    likelihood_without: Callable[[int], Likelihood],
) -> Float[np.ndarray, "tests own"]:
    """Give the amplitudes of a hypothesis for every test, in the linear model around the mode of one within it."""
    where, here = candidates.where(hypothesis), np.zeros(len(candidates.scale))
    here[candidates.where(at.hypothesis)] = at.amplitude
    Z, own = at.Z[..., np.concatenate([np.arange(_N), _N + where])], np.arange(len(where))
    of_motion = {
        motion: likelihood_without(motion).evidence(at.theta_mm, at.y, Z)
        for motion in {test.motion for test in folds.tests}
    }
    found: dict[tuple[int, bytes], np.ndarray] = {}
    for test in folds.tests:
        if (held_out := (test.motion, test.unseen.tobytes())) not in found:
            evidence = of_motion[test.motion].of(~test.unseen)
            given = evidence.given(own, here[where], candidates.mean[where], candidates.scale[where])
            found[held_out] = given.amplitude
    return np.array([found[test.motion, test.unseen.tobytes()] for test in folds.tests])


def unseen_gaps_deg(
    joint: JointFit,
    folds: Folds,
    hypotheses: Sequence[Hypothesis],
    thetas_mm: Sequence[Float[np.ndarray, "subjects adapted"]],
    amplitudes: Sequence[Float[np.ndarray, "tests own"]],
    between_per_deg: float,
) -> list[Float[np.ndarray, "tests 6"]]:
    """Adapt the shoulder of every test with each hypothesis, from its parameters (``JointFit.adapt``): mean
    |simulated - measured| of its rows, NaN of an angle that was not measured. With ``between_per_deg`` 0 the amplitudes
    stay as they are."""
    tests, shoulders = folds.tests * len(hypotheses), joint.shoulders
    seen = tuple(Part(test.subject, number, test.seen_rows) for number, test in enumerate(tests))
    unseen = tuple(part._replace(rows=test.rows) for part, test in zip(seen, tests, strict=True))
    names = [hypothesis for hypothesis in hypotheses for _ in folds.tests]
    values = [amplitude for of_tests in amplitudes for amplitude in of_tests]
    start_mm = np.concatenate([theta_mm[[test.subject for test in folds.tests]] for theta_mm in thetas_mm])
    end = joint.of(seen).adapt(names, start_mm, values, between_per_deg)
    own = [found[: len(value)] for found, value in zip(end.amplitude.T, values, strict=True)]
    near = joint.of(unseen).nearest(names, end.theta_mm.T, own)
    gaps = DEG * np.abs(near.angles - shoulders.angles[:, np.tile(folds.rows, len(hypotheses))]).T
    return [folds.measured_means(one, shoulders) for one in np.split(gaps, len(hypotheses))]
