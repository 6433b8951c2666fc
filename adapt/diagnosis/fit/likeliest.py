"""Beliefs about the unexplained part: hyperparameters with the highest evidence times prior around a posterior mode.

The integral over them makes beliefs with more hyperparameters comparable to those with fewer.
"""

from collections.abc import Callable
from functools import lru_cache
from itertools import combinations

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.discrepancy import (
    LOG_SD,
    NOTHING_OF,
    OF_POSITIONS,
    TYPICAL,
    Belief,
    Discrepancy,
    common_curves,
    whitening,
)
from adapt.diagnosis.fit.evidence import Evidence
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.positions.position_evidence import Grams, position_grams
from adapt.diagnosis.fit.posterior import Posterior
from models.adapted_parameters import ADAPTED

_WITHIN = 2.5
"""Range of the search about the prior medians, in SDs of the prior."""

_ENOUGH = 0.3
"""Convergence tolerance: gain of a step in nats. Beliefs are weighed with about this accuracy."""

_SEARCH = {"eps": 1e-2, "maxiter": 25, "maxls": 6}
"""Options of L-BFGS-B, with gradients from differences of a hundredth of an SD. The evidence is smooth except where
curves appear or vanish; a longer line search there fails."""

_APART = 0.3
"""Step of second differences, in SDs: large enough for the small jumps of the evidence where curves appear."""

_OF_COMMON_CURVES = ("common_motion_deg", "common_deg", "length_deg")
_OF_Y = ("noise_deg", "of_motion_deg", "of_shoulder_deg", *_OF_COMMON_CURVES)
_OF_PLACES = ("noise_deg", "length_deg", *OF_POSITIONS)
"""Hyperparameters on which the common curves, the evidence of y and the evidence of the positions depend."""


def likeliest(joint: JointFit, at: Posterior, left: str = "common", start: Discrepancy = TYPICAL) -> Belief:
    """Find the hyperparameters of a belief with the highest evidence times prior, in the linear model around a mode.

    ``left``: key of ``NOTHING_OF``.
    """
    from scipy.optimize import minimize  # takes 0.4 s to load, and not every command needs it

    where, evidence = joint.candidates.where(at.hypothesis), _evidence_at(joint, at)
    mean, scale, own = joint.candidates.mean[where], joint.candidates.scale[where], np.arange(len(where))
    none = NOTHING_OF[left]
    free = ~np.isin(Discrepancy._fields, (*none, *(() if joint.positions else OF_POSITIONS)))

    def of(z: Float[np.ndarray, " numbers"]) -> Discrepancy:
        """Return the hyperparameters at ``z``, in SDs of their logarithms about the prior medians."""
        logs = np.zeros(len(TYPICAL))
        logs[free] = z
        return Discrepancy(*np.exp(np.log(TYPICAL) + LOG_SD * logs).tolist())._replace(**dict.fromkeys(none, 0.0))

    def cost(z: Float[np.ndarray, " numbers"]) -> float:
        given = evidence(of(z)).given(own, at.amplitude, mean, scale)
        return 0.5 * float((z**2).sum()) - given.log_evidence

    begin = np.log(np.array(start)[free] / np.array(TYPICAL)[free]) / LOG_SD[free]
    options = _SEARCH | {"ftol": _ENOUGH / max(1.0, abs(cost(begin)))}  # relative to the cost
    bounds = [(-_WITHIN, _WITHIN)] * len(begin)
    z = minimize(cost, begin, method="L-BFGS-B", bounds=bounds, options=options).x
    return Belief(left, of(z), log_volume(cost, z))


def log_volume(cost: Callable[[np.ndarray], float], z: Float[np.ndarray, " n"]) -> float:
    """Integrate likelihood times prior over n numbers with the prior N(0, 1), relative to the likelihood at the mode z.

    The logarithm is -|z|^2 / 2 - log |C| / 2 (Laplace's method), with C the curvature of ``cost``, which is minus the
    log likelihood plus |z|^2 / 2. No direction counts as wider than its prior: the search may end on a slope.
    """
    steps, here = _APART * np.eye(len(z)), cost(z)
    up, down = (np.array([cost(z + sign * one) for one in steps]) for sign in (1.0, -1.0))
    curvature = np.diag(up + down - 2.0 * here)
    for i, j in combinations(range(len(z)), 2):
        curvature[i, j] = curvature[j, i] = cost(z + steps[i] + steps[j]) - up[i] - up[j] + here
    widths = np.maximum(np.linalg.eigvalsh(curvature / _APART**2), 1.0)
    return float(-0.5 * (z**2).sum() - 0.5 * np.log(widths).sum())


def _evidence_at(joint: JointFit, at: Posterior) -> Callable[[Discrepancy], Evidence]:
    """Return the evidence around a mode as a function of the hyperparameters.

    Each finite difference of a gradient changes one hyperparameter, so a cache keeps the parts of the evidence that do
    not depend on the changed hyperparameter.
    """
    shoulders, where = joint.shoulders, joint.candidates.where(at.hypothesis)
    Z, own = at.Z[..., np.concatenate([np.arange(len(ADAPTED)), len(ADAPTED) + where])], np.arange(len(where))
    rows = joint.positions.amplitudes(where) if joint.positions else None
    kept = lru_cache(maxsize=len(TYPICAL) + 1)

    @kept
    def curves(discrepancy: Discrepancy) -> Float[np.ndarray, "rows curves"]:
        return common_curves(shoulders, discrepancy)

    @kept
    def of_y(discrepancy: Discrepancy) -> Evidence:
        white = whitening(shoulders, discrepancy, curves(discrepancy.only(_OF_COMMON_CURVES)))
        return Likelihood(joint.model, white, 0.0, None).evidence(at.theta_mm, at.y, Z, own, at.amplitude)

    @lru_cache(maxsize=2)  # the matrices are large
    def grams(noise_deg: float, length_deg: float) -> Grams:
        assert rows is not None
        return position_grams(rows, shoulders, noise_deg, length_deg)

    @kept
    def of_positions(discrepancy: Discrepancy) -> Evidence:
        return grams(discrepancy.noise_deg, discrepancy.length_deg).evidence(discrepancy)

    def of(discrepancy: Discrepancy) -> Evidence:
        found = of_y(discrepancy.only(_OF_Y))._replace(between=discrepancy.between_shoulders)
        if rows is None:
            return found
        return found.with_positions(of_positions(discrepancy.only(_OF_PLACES)), at.amplitude)

    return of
