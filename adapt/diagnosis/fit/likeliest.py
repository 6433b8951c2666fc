"""What no cause explains, as the data have it: the discrepancy of the highest evidence times prior around a mode."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.discrepancy import (
    LOG_SD,
    OF_POSITIONS,
    TYPICAL,
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
"""Discrepancies are looked for within so many SDs of their prior."""

_ENOUGH = 0.3
"""Nats that a step gains, at which the search ends: beliefs are weighed to about as much."""

_SEARCH = {"eps": 1e-2, "maxiter": 25, "maxls": 6}
"""For slopes, differences of a hundredth of an SD: the evidence is smooth but for curves that come and go. At those a
longer line search ends in vain."""

_OF_COMMON_CURVES = ("common_motion_deg", "common_deg", "length_deg")
_OF_Y = ("noise_deg", "of_motion_deg", "of_shoulder_deg", *_OF_COMMON_CURVES)
_OF_PLACES = ("noise_deg", "length_deg", *OF_POSITIONS)
"""What each part of the evidence goes by."""


def likeliest(joint: JointFit, at: Posterior, none: Sequence[str] = (), start: Discrepancy = TYPICAL) -> Discrepancy:
    """Find the discrepancy of the highest evidence times prior, in the linear model around a mode; of some of its parts
    there is ``none``."""
    from scipy.optimize import minimize  # 0.4 s to load: not for every command

    where, evidence = joint.candidates.where(at.hypothesis), _evidence_at(joint, at)
    mean, scale, own = joint.candidates.mean[where], joint.candidates.scale[where], np.arange(len(where))
    free = ~np.isin(Discrepancy._fields, (*none, *(() if joint.positions else OF_POSITIONS)))

    def of(z: Float[np.ndarray, " numbers"]) -> Discrepancy:
        """In SDs of the logarithms about their medians."""
        logs = np.zeros(len(TYPICAL))
        logs[free] = z
        return Discrepancy(*np.exp(np.log(TYPICAL) + LOG_SD * logs).tolist())._replace(**dict.fromkeys(none, 0.0))

    def cost(z: Float[np.ndarray, " numbers"]) -> float:
        given = evidence(of(z)).given(own, at.amplitude, mean, scale)
        return 0.5 * float((z**2).sum()) - given.log_evidence

    begin = np.log(np.array(start)[free] / np.array(TYPICAL)[free]) / LOG_SD[free]
    options = _SEARCH | {"ftol": _ENOUGH / max(1.0, abs(cost(begin)))}  # of the value
    bounds = [(-_WITHIN, _WITHIN)] * len(begin)
    return of(minimize(cost, begin, method="L-BFGS-B", bounds=bounds, options=options).x)


def _evidence_at(joint: JointFit, at: Posterior) -> Callable[[Discrepancy], Evidence]:
    """Lay out the evidence around a mode by its parts: differences that make a slope change one number each, and what
    does not go by it is kept."""
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

    @lru_cache(maxsize=2)  # they are large
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
