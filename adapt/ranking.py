"""All hypotheses weighed on the same data: their evidence, and whether the best one leaves something systematic."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from adapt.discrepancy import discrepancy_gain
from adapt.evidence import Block, Hypothesis, Linear, alike, log_evidence, posterior, statistics, unlike
from adapt.noise import NoiseEstimate
from adapt.observed import Observed
from models.effects import Effect
from models.girdle import ADAPTED

_SIZES = (0.5, 1.0)
"""Shares of an effect's scale that its amplitude is as likely to be of: small ones and large ones."""

_UNLIKE_SHARE = 0.05
"""Prior probability that an effect's sign differs from subject to subject."""

_AGAINST_SHARE = 0.05
"""Prior probability that an effect goes against the sign of its nature."""

_EXAMINED = 3
"""So many of the best hypotheses, and none, are examined for what they leave."""


@dataclass(frozen=True)
class Ranking:
    """Hypotheses, most probable first."""

    fitted: tuple[Linear, ...]
    log_evidence: Float[np.ndarray, " hypotheses"]
    """Less that of the best."""
    unlike: Float[np.ndarray, " hypotheses"]
    """Log evidence that amplitudes differ between subjects, less that they are alike."""
    discrepancy_gain: float
    """log evidence of the best hypothesis with an unlisted discrepancy, less that of the best without."""
    chi_square: float
    freedom: float
    """Of the best hypothesis."""
    excess: float
    """(chi_square / freedom - 1) in standard deviations, that of the noise estimate included."""

    @property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """Names of the effects of each."""
        return tuple(one.hypothesis for one in self.fitted)


def rank(fitted: Sequence[Linear], effects: Sequence[Effect], data: Observed, noise: NoiseEstimate) -> Ranking:
    """Weigh fitted hypotheses; examine the best for what they leave."""
    by_name = {effect.name: effect for effect in effects}
    weighed = [_log_evidence(one, [by_name[name] for name in one.hypothesis]) for one in fitted]
    order = np.argsort([-value for value, _ in weighed], kind="stable")
    best = weighed[order[0]][0]
    examined = [k for rank, k in enumerate(order) if rank < _EXAMINED or not fitted[k].hypothesis]
    gain = max(weighed[k][0] - best + discrepancy_gain(fitted[k], data, _likeliest_prior(fitted[k])) for k in examined)
    top = fitted[order[0]]
    chi_square, freedom = float((top.y**2).sum()), _freedom(top, data)
    deviation = math.sqrt(2.0 / freedom + 2.0 / noise.freedom)
    return Ranking(
        fitted=tuple(fitted[k] for k in order),
        log_evidence=np.array([weighed[k][0] - best for k in order]),
        unlike=np.array([weighed[k][1] for k in order]),
        discrepancy_gain=gain,
        chi_square=chi_square,
        freedom=freedom,
        excess=(chi_square / freedom - 1.0) / deviation,
    )


def _log_evidence(fitted: Linear, effects: Sequence[Effect]) -> tuple[float, float]:
    """Log evidence over all priors of the amplitudes, and how much likelier unlike amplitudes are than alike."""
    of = statistics(fitted)
    if not fitted.hypothesis:
        return log_evidence(of, alike(fitted.scale)), 0.0
    signs = np.array([sign for effect in effects for sign in effect.signs])
    alike_log = np.logaddexp.reduce([_with_sign(fitted, alike(fitted.scale) * size, signs) for size in _SIZES])
    unlike_log = np.logaddexp.reduce([log_evidence(of, unlike(fitted.scale) * size) for size in _SIZES])
    shares = np.log([1.0 - _UNLIKE_SHARE, _UNLIKE_SHARE]) - np.log(len(_SIZES))
    return float(np.logaddexp(alike_log + shares[0], unlike_log + shares[1])), float(unlike_log - alike_log)


def _with_sign(fitted: Linear, prior: Block, signs) -> float:
    """Log evidence of a prior most of whose mass has the signs of the effect's nature."""
    found = posterior(fitted, prior)
    log = found.log_evidence
    for k in np.flatnonzero(signs):
        agreed = _normal_cdf(signs[k] * found.common[k] / math.sqrt(found.covariance[k, k]))
        log += math.log(2.0 * ((1.0 - _AGAINST_SHARE) * agreed + _AGAINST_SHARE * (1.0 - agreed)))
    return log


def _normal_cdf(x: float) -> float:
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def _likeliest_prior(fitted: Linear) -> Block:
    """Of the priors of the amplitudes, the one with the most evidence."""
    of = statistics(fitted)
    priors = [spread(fitted.scale) * size for spread in (alike, unlike) for size in _SIZES]
    return max(priors, key=lambda prior: log_evidence(of, prior))


def _freedom(fitted: Linear, data: Observed) -> float:
    """Expected chi square of y if the hypothesis is right: tr (1 + X X' + A b^2 A')^-1, less the common amplitudes."""
    A = fitted.A * alike(fitted.scale).between
    covariance = np.eye(fitted.y.shape[1]) + fitted.X @ np.swapaxes(fitted.X, 1, 2) + A @ np.swapaxes(A, 1, 2)
    padding = data.informative * int((~data.counted).sum())
    return float(np.trace(np.linalg.inv(covariance), axis1=1, axis2=2).sum()) - padding - len(fitted.scale)


def theta_mm(fitted: Linear) -> Float[np.ndarray, "6 subjects"]:
    """The adapted parameters of each subject."""
    return fitted.z[: len(ADAPTED)]
