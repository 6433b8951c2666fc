"""How often a diagnosis of such data would name each effect, if it were at work: before any residual is seen.

Linear about the model as it is, what a subject shows of an effect is Gaussian,

    y_s = X_s u_s + A_s a_s + noise,

so that data can be drawn and weighed by thousands: a draw is its inner products with the columns X and A, N(G c, G)
for their Gram matrix G and coefficients c. The evidence is that of the diagnosis, with the noise known and courses as
smooth as the library has them: about the most that any method could tell of such data that knows as little beforehand.
Effects that these data hardly tell apart show as names taken for each other.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy.random import Generator, default_rng

from adapt.diagnosis.design.separability import slopes
from adapt.diagnosis.fit.linear_evidence import InnerProducts
from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS, single_hypotheses
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.misfit import prior_sd_of
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.axial_turn import mean_subject
from adapt.diagnosis.inference.priors import over_priors
from adapt.diagnosis.inference.verdict import NONE_FROM, posterior_probabilities
from adapt.diagnosis.result import PredictedPower
from adapt.engine.batching import in_threads
from models.adapted_parameters import ADAPTED
from models.effects import Effect
from models.effects.prior import COURSE_SD
from models.girdle import Girdle

_DRAWS = 50
"""Of each effect: a share of one half is known to 7 points, the mean over the effects to 2."""

_SEED = 1999
"""The same draws for the same data: nothing else is random in a diagnosis."""

SPREAD, _SPREADS = 0.5, np.outer((0.4, 0.7), np.ones(6))
"""Share of ``PRIOR_SD_MM`` by which the drawn subjects' adapted parameters vary; and those with which draws are
weighed, as if the data had chosen them."""

_NAMED_OFTEN = 0.05
"""A name that an effect is taken for less often than this is not reported."""


def predict_power(
    girdle: Girdle, effects: tuple[Effect, ...], data: Observed, noise: Noise
) -> dict[str, PredictedPower]:
    """Predict, by name of the effect, how often a diagnosis of such data would name it if it were at work.

    ``data`` are ``projected_onto_model`` ones (see ``separability``).
    """
    names = [effect.name for effect in effects]
    hypotheses = single_hypotheses(names)
    gram, own = gram_matrices(girdle, effects, data, noise)
    root, generator = matrix_roots(gram), default_rng(_SEED)
    drawn = (draw(gram, k, effect, _DRAWS, generator) for k, effect in zip(own[1:], effects, strict=True))
    with_data = np.concatenate([simulate_statistics(gram, root, coefficients, generator) for coefficients in drawn])
    alone = [[], *([effect] for effect in effects)]
    logs = np.array(in_threads(lambda k, chosen: _log_evidence(gram, with_data, k, chosen), own, alone))
    posterior = posterior_probabilities(hypotheses, logs, names).reshape(len(hypotheses), len(effects), _DRAWS)
    return {name: _outcomes(k, posterior[:, k], names) for k, name in enumerate(names)}


def gram_matrices(
    girdle: Girdle, effects: tuple[Effect, ...], data: Observed, noise: Noise
) -> tuple[Float[np.ndarray, "subjects columns columns"], list[Int[np.ndarray, " own"]]]:
    """Compute the Gram matrix G of each subject, the mean one of ``axial_turn`` last; and which of its columns are the
    amplitudes of none and of every effect, those of X being the first."""
    hypotheses = single_hypotheses(effect.name for effect in effects)
    X, by_amplitudes = slopes(girdle, effects, hypotheses, data, noise)
    columns = np.concatenate([X, *by_amplitudes], axis=2)
    gram = np.swapaxes(columns, 1, 2) @ columns
    if (mean := mean_subject(effects, data)) is not None:
        row = np.concatenate([np.zeros(len(ADAPTED)), mean.columns[: gram.shape[1] - len(ADAPTED)]])
        gram = np.concatenate([gram, np.outer(row, row)[None]])
    ends = np.cumsum([X.shape[2], *(A.shape[2] for A in by_amplitudes)])
    return gram, [np.arange(*span) for span in pairwise(ends)]


def typical_amplitudes(
    effect: Effect, draws: int, subjects: int, generator: Generator, between: float = BETWEEN_SUBJECTS
) -> Float[np.ndarray, "draws subjects amplitudes"]:
    """Draw amplitudes of the effect's typical size: all directions together as long as their scales, in a direction of
    its nature's signs, and the same in all subjects but for ``between``, the SD of their size; with details."""
    scale, sign, main = np.asarray(effect.prior.scale), np.asarray(effect.channel_signs), len(effect.directions)
    direction = generator.standard_normal((draws, len(scale)))
    if effect.leading is not None:
        direction[:, effect.leading] = np.sign(direction[:, effect.leading])
    direction = np.where(sign == 0, direction, sign * np.abs(direction)) * scale
    direction[:, :main] *= np.linalg.norm(scale[:main]) / np.linalg.norm(direction[:, :main], axis=1, keepdims=True)
    size = np.maximum(1.0 + between * generator.standard_normal((draws, subjects)), 0.0)
    amplitudes = size[..., None] * direction[:, None]
    if not effect.over_elevation:
        return amplitudes
    more = generator.standard_normal((draws, len(COURSE_SD) - 1)) * COURSE_SD[1:]
    course = np.concatenate([np.ones((draws, 1)), more], axis=1)
    return (amplitudes[..., None] * course[:, None, None]).reshape(draws, subjects, -1)


def matrix_roots(gram: Float[np.ndarray, "subjects columns columns"]) -> Float[np.ndarray, "subjects columns columns"]:
    """Factorise G into R with R R' = G, for matrices that may be singular."""
    values, vectors = np.linalg.eigh(gram)
    return vectors * np.sqrt(np.maximum(values, 0.0))[:, None]


def draw(
    gram: Float[np.ndarray, "subjects columns columns"],
    own: Int[np.ndarray, " own"],
    effect: Effect | None,
    draws: int,
    generator: Generator,
    size: float = 1.0,
) -> Float[np.ndarray, "draws subjects columns"]:
    """Draw coefficients of people who differ by ``SPREAD`` and have the effect, ``size`` of its typical size."""
    subjects, columns, _ = gram.shape
    coefficients = np.zeros((draws, subjects, columns))
    coefficients[..., : len(ADAPTED)] = SPREAD * generator.standard_normal((draws, subjects, len(ADAPTED)))
    if effect is not None:
        coefficients[..., own] = size * typical_amplitudes(effect, draws, subjects, generator)
    return coefficients


def simulate_statistics(
    gram: Float[np.ndarray, "subjects columns columns"],
    root: Float[np.ndarray, "subjects columns columns"],
    coefficients: Float[np.ndarray, "draws subjects columns"],
    generator: Generator,
) -> Float[np.ndarray, "draws subjects columns"]:
    """Simulate the inner products of the columns with what subjects with these coefficients show: N(G c, G)."""
    noise = generator.standard_normal(coefficients.shape)
    return np.einsum("sij,dsj->dsi", gram, coefficients) + np.einsum("sij,dsj->dsi", root, noise)


def products_with(
    gram: Float[np.ndarray, "subjects columns columns"],
    with_data: Float[np.ndarray, "draws subjects columns"],
    own: Int[np.ndarray, " own"],
) -> InnerProducts:
    """Select the inner products of X and of the amplitudes ``own``; the square of what was seen is left out."""
    k = np.concatenate([np.arange(len(ADAPTED)), own])
    return InnerProducts(gram[:, k[:, None], k], with_data[..., k], np.zeros(len(with_data)), residuals=0)


def _log_evidence(gram, with_data, own, effects: Sequence[Effect]) -> Float[np.ndarray, " draws"]:
    """But for the sum of squares of what was seen, which all hypotheses share."""
    products = products_with(gram, with_data, own)
    return over_priors(products, prior_sd_of(effects), effects, [(1.0, 1.0)], spreads=_SPREADS).log_evidence


def _outcomes(acting: int, posterior: Float[np.ndarray, "hypotheses draws"], names: Sequence[str]) -> PredictedPower:
    nothing = posterior[0] >= NONE_FROM
    first = np.where(nothing, -1, posterior[1:].argmax(axis=0))
    often = [float((first == k).mean()) for k in range(len(names))]
    others = sorted(
        (-fraction, names[k]) for k, fraction in enumerate(often) if k != acting and fraction >= _NAMED_OFTEN
    )
    return PredictedPower(often[acting], float(nothing.mean()), {name: -fraction for fraction, name in others})
