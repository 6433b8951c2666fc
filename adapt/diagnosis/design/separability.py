"""Which effects these postures, quantities and noise can tell apart, before any residual is seen.

An effect makes the whitened residuals of all subjects together Gaussian, N(0, C), with C from its derivatives and
typical sizes at the model as it is. The expected log evidence of the right effect i over another j is the
Kullback-Leibler divergence (Eriksson 2013)

    D_ij = 1/2 (tr C_j^-1 C_i - n + log det C_j - log det C_i).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_model import Hypothesis, shared_prior, single_hypotheses
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.misfit import columns_of, free_columns, misfit, prior_sd_of, prior_z
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.result import TOLD_APART, DetectableAmplitude
from models.adapted_parameters import ADAPTED, PRIOR_SD_MM
from models.effects import Effect
from models.girdle import Girdle

_CLOSING_STEPS = 12
"""Projections until postures far from the model as it is have come to rest."""

_SIZES = 2.0 ** np.arange(-4.0, 4.5, 0.5)
"""Shares of an effect's scale tried for the smallest detectable amplitude."""

_MOST_SUBJECTS = 24
"""More subjects are represented by so many: which effects look similar does not change, the size of D does."""


@dataclass(frozen=True)
class ResidualCovariance:
    """What one hypothesis does to the residuals of each subject: C = blockdiag(1 + G G') + common common'.

    All that is needed of C are products with the few columns of G and of the common amplitude:
    (1 + G G')^-1 = 1 - G (1 + G'G)^-1 G', and det(1 + G G') = det(1 + G'G).
    """

    X: Float[np.ndarray, "subjects residuals 6"]
    """Derivatives by the adapted parameters, in prior standard deviations."""
    between: Float[np.ndarray, "subjects residuals amplitudes"]
    """Derivatives by a subject's deviation from the common amplitude, in prior standard deviations."""
    common: Float[np.ndarray, "subjects residuals amplitudes"]
    """Derivatives by the common amplitude, in prior standard deviations."""

    def at(self, size: float) -> "ResidualCovariance":
        """Scale the effect to ``size`` times its own size."""
        return ResidualCovariance(self.X, size * self.between, size * self.common)

    @cached_property
    def G(self) -> Float[np.ndarray, "subjects residuals columns"]:
        """All that each subject has for itself."""
        return np.concatenate([self.X, self.between], axis=2)

    @cached_property
    def information(self) -> Float[np.ndarray, "subjects columns columns"]:
        """1 + G'G."""
        return np.eye(self.G.shape[2]) + np.swapaxes(self.G, 1, 2) @ self.G

    @cached_property
    def covariance(self) -> Float[np.ndarray, "subjects columns columns"]:
        """(1 + G'G)^-1."""
        return np.linalg.inv(self.information)

    @cached_property
    def solved_common(self) -> Float[np.ndarray, "subjects residuals amplitudes"]:
        """(1 + G G')^-1 common."""
        return self.solved(self.common)

    @cached_property
    def core(self) -> Float[np.ndarray, "amplitudes amplitudes"]:
        """1 + common' (1 + G G')^-1 common."""
        return np.eye(self.common.shape[2]) + _pairs(self.common, self.solved_common)

    @cached_property
    def log_det(self) -> float:
        """log det C."""
        return float(np.linalg.slogdet(self.information)[1].sum() + np.linalg.slogdet(self.core)[1])

    def solved(self, right: Float[np.ndarray, "subjects residuals n"]) -> Float[np.ndarray, "subjects residuals n"]:
        """Compute (1 + G G')^-1 right."""
        return right - self.G @ (self.covariance @ (np.swapaxes(self.G, 1, 2) @ right))

    def times(self, right: Float[np.ndarray, "subjects residuals n"]) -> Float[np.ndarray, "subjects residuals n"]:
        """Compute (1 + G G') right."""
        return right + self.G @ (np.swapaxes(self.G, 1, 2) @ right)


def _pairs(left, right):
    """left' right, summed over subjects."""
    return (np.swapaxes(left, 1, 2) @ right).sum(axis=0)


def projected_onto_model(girdle: Girdle, effects: tuple[Effect, ...], data: Observed, noise: Noise) -> Observed:
    """Project the postures to what the model as it is would take: nothing of the residuals is left in them."""
    z = _prior(girdle, effects, data.counted.shape[1])
    nearest = misfit(girdle, effects, data, noise, z, projections=_CLOSING_STEPS).nearest
    return replace(data, values=nearest)


def separation(
    girdle: Girdle, effects: tuple[Effect, ...], hypotheses: Sequence[Hypothesis], data: Observed, noise: Noise
) -> Float[np.ndarray, "hypotheses hypotheses"]:
    """Compute D_ij in nats: how clearly these data would show i and not j if i is at work. ``data`` are
    ``projected_onto_model`` ones."""
    columns = _columns(girdle, effects, hypotheses, data, noise)
    return np.array([[_divergence(i, j) for j in columns] for i in columns])


def indistinguishable_sets(hypotheses: Sequence[Hypothesis], apart: Float[np.ndarray, "n n"]) -> list[list[str]]:
    """Group single effects (two or more) linked by pairs that are not distinguished, either way round."""
    left = [k for k, hypothesis in enumerate(hypotheses) if len(hypothesis) == 1]
    groups = []
    while left:
        group = [left.pop(0)]
        for k in group:
            near = [j for j in left if min(apart[k, j], apart[j, k]) < TOLD_APART]
            group += near
            left = [j for j in left if j not in near]
        if len(group) > 1:
            groups.append([hypotheses[k][0] for k in group])
    return groups


def smallest_detectable(
    girdle: Girdle, effects: tuple[Effect, ...], data: Observed, noise: Noise
) -> dict[str, DetectableAmplitude | None]:
    """Find the amplitude of each effect (all directions together) from which these data would show it, in its unit;
    None where 16 times its typical size would not do."""
    hypotheses = single_hypotheses(effect.name for effect in effects)
    nothing, *columns = _columns(girdle, effects, hypotheses, data, noise)
    found: dict[str, DetectableAmplitude | None] = {}
    for effect, column in zip(effects, columns, strict=True):
        sizes = (size for size in _SIZES if _divergence(column.at(size), nothing) >= TOLD_APART)
        size = next(sizes, None)
        typical = np.linalg.norm(effect.prior.scale[: len(effect.directions)])
        found[effect.name] = None if size is None else DetectableAmplitude(float(size * typical), effect.unit)
    return found


def _prior(girdle: Girdle, effects, problems: int):
    return np.repeat(prior_z(girdle, effects)[:, None], problems, axis=1)


def slopes(
    girdle: Girdle, effects: tuple[Effect, ...], hypotheses: Sequence[Hypothesis], data: Observed, noise: Noise
) -> tuple[Float[np.ndarray, "subjects residuals 6"], list[Float[np.ndarray, "subjects residuals amplitudes"]]]:
    """Differentiate the whitened residuals at the model as it is: by the adapted parameters, in prior standard
    deviations, and by the amplitudes of each hypothesis, in units of its effects. ``data`` are ``projected_onto_model``
    ones; of many subjects, the first ones."""
    subjects = min(data.counted.shape[1], _MOST_SUBJECTS)
    chosen = free_columns(effects, hypotheses)
    at = misfit(
        girdle,
        effects,
        data.select_subjects(np.tile(np.arange(subjects), len(hypotheses))),
        noise,
        _prior(girdle, effects, subjects * len(hypotheses)),
        np.repeat(chosen, subjects, axis=1),
    ).slopes
    each = at.reshape(len(hypotheses), subjects, -1, len(chosen))
    amplitudes = [columns_of(effects, hypothesis) for hypothesis in hypotheses]
    by_amplitudes = [one[..., len(ADAPTED) : len(ADAPTED) + len(k)] for one, k in zip(each, amplitudes, strict=True)]
    return each[0, ..., : len(ADAPTED)] * PRIOR_SD_MM, by_amplitudes


def _columns(
    girdle, effects, hypotheses: Sequence[Hypothesis], data: Observed, noise: Noise
) -> list[ResidualCovariance]:
    X, by_amplitudes = slopes(girdle, effects, hypotheses, data, noise)
    by_name = {effect.name: effect for effect in effects}
    found = []
    for hypothesis, A in zip(hypotheses, by_amplitudes, strict=True):
        prior = shared_prior(prior_sd_of(by_name[name] for name in hypothesis))
        found.append(ResidualCovariance(X, A * prior.between, A * prior.common))
    return found


def _divergence(i: ResidualCovariance, j: ResidualCovariance) -> float:
    """D_ij = (tr C_j^-1 C_i - residuals + log det C_j - log det C_i) / 2, by blocks of subjects."""
    W = j.solved_common
    beyond = np.trace(j.covariance - np.eye(j.G.shape[2]), axis1=1, axis2=2).sum()  # tr (1 + G G')^-1 - residuals
    beyond += sum((columns * j.solved(columns)).sum() for columns in (i.G, i.common))
    overlap = _pairs(W, i.common)
    beyond -= np.trace(np.linalg.solve(j.core, _pairs(W, i.times(W)) + overlap @ overlap.T))
    return 0.5 * float(beyond + j.log_det - i.log_det)
