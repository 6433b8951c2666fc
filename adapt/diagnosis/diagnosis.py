"""The diagnosis: where the gap lies, which unmodelled effect causes it, how far it shrinks, what to measure next."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from threadpoolctl import threadpool_limits

from adapt.diagnosis.declared_effects import declared_effects
from adapt.diagnosis.design.next_measurement import propose
from adapt.diagnosis.design.predicted_power import predict_power
from adapt.diagnosis.design.separability import (
    indistinguishable_sets,
    projected_onto_model,
    separation,
    smallest_detectable,
)
from adapt.diagnosis.fit.linear_model import Hypothesis, LinearisedFit, single_hypotheses
from adapt.diagnosis.fit.map_fit import fit_hypotheses
from adapt.diagnosis.fit.measurement_noise import NoiseEstimate
from adapt.diagnosis.fit.misfit import misfit
from adapt.diagnosis.fit.noise import estimate_noise
from adapt.diagnosis.fit.observations import Observed, observe
from adapt.diagnosis.gap_location import AngleGaps, cells, constraint_residuals_mm, profile
from adapt.diagnosis.gap_rotations import variance_fractions
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.held_out_gaps import measure_gaps
from adapt.diagnosis.inference.ranking import Ranking, rank
from adapt.diagnosis.inference.verdict import judge
from adapt.diagnosis.result import NONE, UNKNOWN, Diagnosis, EffectAmplitude, ParameterMeans, UnknownTests, Verdict
from adapt.solvers.posture_fits import FEWEST_ANGLES
from models.adapted_parameters import ADAPTED
from models.effects import EFFECTS, Effect
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from motions.errors import InputError
from motions.rotations import DEG
from motions.table import Motions

Progress = Callable[[str], None]

FEWEST_POSTURES = 4
"""A subject with fewer says less than its six adapted parameters take up."""

_PAIRED = 3
"""So many of the best effects are tried together with every other one."""

_MORE_THAN_NONE, _NOT_ENOUGH = 3.0, 0.2
"""Log evidence of an effect over none, or probability of unknown, from which pairs are tried."""

_OTHER_NOISES = (0.67, 1.5)
"""Factors of the noise at which the verdict is looked at again."""

_CANDIDATES = 3
"""At most so many candidates are to be separated by the next measurement."""


@dataclass(frozen=True)
class RankedDiagnosis(Diagnosis):
    """A diagnosis with the ranking of hypotheses that it follows from."""

    ranking: Ranking


def diagnose(
    motions: Motions,
    models: ParameterSet | Sequence[ParameterSet],
    noise_deg: float | None = None,
    effects: Sequence[Effect] = tuple(EFFECTS.values()),
    progress: Progress = lambda _: None,
) -> dict[str, RankedDiagnosis]:
    """Diagnose the gap of all subjects together, with every model on its own; by name of the model.

    ``noise_deg`` is the SD of one measured angle; without it, it is estimated. Raises InputError where no subject has
    enough postures.
    """
    models = [models] if isinstance(models, ParameterSet) else list(models)
    data, left_out = _usable(observe(motions))
    declared = declared_effects(motions)
    with threadpool_limits(1, "blas"):  # of a hundred columns, more threads wait for each other longer than they work
        return {
            model.name: _diagnose(
                model,
                tuple(effects),
                data,
                left_out,
                declared,
                noise_deg,
                lambda stage, name=model.name: progress(f"{name}: {stage}"),
            )
            for model in models
        }


def _usable(data: Observed) -> tuple[Observed, dict[str, str]]:
    """The postures that say something of the model, of the subjects that have enough of them."""
    data = replace(data, counted=data.counted & (data.measured[:6].sum(axis=0) > FEWEST_ANGLES))
    count = data.counted.sum(axis=0)
    left_out = {
        name: f"{n} postures with more than {FEWEST_ANGLES} angles, fewer than {FEWEST_POSTURES}"
        for name, n in zip(data.subjects, count, strict=True)
        if n < FEWEST_POSTURES
    }
    enough = np.flatnonzero(count >= FEWEST_POSTURES)
    if not len(enough):
        cause = f"no subject has {FEWEST_POSTURES} postures with more than {FEWEST_ANGLES} measured angles"
        raise InputError(
            "the motions", None, cause, "Give subjects with more postures, or more angles measured in each"
        )
    return data.select_subjects(enough), left_out


def _without_noisy(data: Observed, estimate: NoiseEstimate) -> tuple[Observed, dict[str, str]]:
    """The subjects but for the noisy ones, which would be explained before all others."""
    others = f"those of the others by {estimate.noise.angle_deg:.1f}"
    noisy = estimate.noisy_deg.items()
    why = {data.subjects[s]: f"its postures scatter by {deg:.1f} deg, {others}" for s, deg in noisy}
    kept = [s for s in range(len(data.subjects)) if s not in estimate.noisy_deg]
    return data.select_subjects(np.array(kept)), why


def _diagnose(
    model: ParameterSet,
    effects: tuple[Effect, ...],
    data: Observed,
    left_out: dict[str, str],
    declared: tuple[str, ...],
    noise_deg: float | None,
    progress: Progress,
) -> RankedDiagnosis:
    girdle = model.girdle
    names = [effect.name for effect in effects]
    progress("noise")
    estimate = estimate_noise(girdle, effects, data, noise_deg)
    noise = estimate.noise
    data, noisy = _without_noisy(data, estimate)
    progress("what can be told apart")
    hypotheses = single_hypotheses(names)
    postures = projected_onto_model(girdle, effects, data, noise)
    apart = separation(girdle, effects, hypotheses, postures, noise)
    predicted_power = predict_power(girdle, effects, postures, noise)
    progress("every effect")
    ranking = rank(fit_hypotheses(girdle, effects, hypotheses, data, noise), effects, data, estimate)
    verdict = judge(ranking, names, declared)
    if len(effects) > 1 and _worth_pairs(ranking, verdict):
        progress("pairs of effects")
        ranking = _with_pairs(girdle, effects, data, estimate, ranking)
    none = next(one for one in ranking.fitted if not one.hypothesis)
    concluded = conclude(ranking, effects, data, declared)
    explained = concluded.explained
    adapted = misfit(girdle, effects, data, noise, none.z)
    angle_gaps = AngleGaps(data, adapted.nearest[:6], adapted.noise_variance[:6] * float(DEG) ** 2)
    gaps = measure_gaps(girdle, effects, data, noise, [none, explained], progress)
    progress("next measurement")
    return RankedDiagnosis(
        model=model.name,
        subjects=data.subjects,
        left_out=left_out | noisy,
        postures=int(data.counted.sum()),
        highest_elevation_deg=data.highest_deg,
        noise=estimate,
        declared_effects=declared,
        verdict=concluded.verdict,
        at_other_noise=_at_other_noise(ranking, effects, data, estimate, declared),
        tests=UnknownTests(ranking.discrepancy_gain, ranking.excess, ranking.amplitude_excess),
        amplitude=concluded.amplitude,
        best=explained.hypothesis,
        gaps=gaps,
        parameters=_changes(none, explained),
        cells=cells(angle_gaps),
        profile=profile(angle_gaps),
        variance_fractions=variance_fractions(angle_gaps),
        constraints=constraint_residuals_mm(data, _at_measured(girdle, data, none)),
        indistinguishable=indistinguishable_sets(hypotheses, apart),
        smallest_detectable=smallest_detectable(girdle, effects, postures, noise),
        predicted_power=predicted_power,
        next_measurement=propose(girdle, effects, _candidates(ranking, concluded.verdict), data, noise),
        ranking=ranking,
    )


@dataclass(frozen=True)
class Conclusion:
    """What follows from a ranking."""

    verdict: Verdict
    explained: LinearisedFit
    """What the gap is compared with."""
    amplitude: dict[str, EffectAmplitude]
    """As in Diagnosis."""


def conclude(ranking: Ranking, effects: tuple[Effect, ...], data: Observed, declared: tuple[str, ...]) -> Conclusion:
    """Judge a ranking, and estimate the sizes of the effects in the verdict."""
    verdict = judge(ranking, [effect.name for effect in effects], declared)
    explained = _explanation(ranking, verdict)
    named = verdict.effects or (explained.hypothesis if verdict.answer == UNKNOWN else ())
    together = len(explained.hypothesis)
    return Conclusion(verdict, explained, amplitudes(ranking, effects, data, named, together))


def _worth_pairs(ranking: Ranking, verdict: Verdict) -> bool:
    """Whether any effect says more than none, or something is left that none explains."""
    over_none = -ranking.log_evidence[ranking.hypotheses.index(())]
    return over_none > _MORE_THAN_NONE or verdict.probability[UNKNOWN] >= _NOT_ENOUGH


def _with_pairs(girdle: Girdle, effects, data: Observed, noise: NoiseEstimate, ranking: Ranking) -> Ranking:
    """The ranking with pairs of the best effects and all others."""
    best = [h[0] for h in ranking.hypotheses if h][:_PAIRED]
    order = [effect.name for effect in effects]
    pairs = {tuple(sorted((one, other), key=order.index)) for one in best for other in order if other != one}
    fitted = fit_hypotheses(girdle, effects, sorted(pairs), data, noise.noise)
    return rank([*ranking.fitted, *fitted], effects, data, noise)


def _explanation(ranking: Ranking, verdict: Verdict) -> LinearisedFit:
    """What the gap is compared with: nothing if nothing is blamed, else the most probable effect or pair."""
    by_hypothesis = {one.hypothesis: one for one in ranking.fitted}
    if verdict.answer == NONE:
        return by_hypothesis[()]
    if verdict.effects:
        return by_hypothesis[verdict.effects[: 2 if verdict.together else 1]]
    return next(one for one in ranking.fitted if one.hypothesis)


def _at_measured(girdle: Girdle, data: Observed, fitted: LinearisedFit) -> Float[np.ndarray, "3 postures subjects"]:
    """A1-A3 of each subject's adapted girdle at the measured angles, mm."""
    theta = jnp.asarray(fitted.z[: len(ADAPTED), None])
    adapted = girdle.over_axes(2).with_adapted(theta)
    return np.asarray(adapted.residuals_mm(jnp.asarray(data.values[:6])))


def _at_other_noise(
    ranking: Ranking, effects, data: Observed, noise: NoiseEstimate, declared: tuple[str, ...]
) -> dict[float, Verdict]:
    names = [effect.name for effect in effects]
    found = {}
    for factor in _OTHER_NOISES:
        fitted = [one.with_noise(factor) for one in ranking.fitted]
        found[factor * noise.noise.angle_deg] = judge(rank(fitted, effects, data, noise), names, declared)
    return found


def _changes(none: LinearisedFit, explained: LinearisedFit) -> dict[str, ParameterMeans]:
    values = zip(ADAPTED, none.z.mean(axis=1), explained.z.mean(axis=1), strict=False)
    return {name: ParameterMeans(float(a), float(b)) for name, a, b in values}


def _candidates(ranking: Ranking, verdict: Verdict) -> list[Hypothesis]:
    """The hypotheses still to be distinguished: those of the verdict, and the next ones of the ranking."""
    if verdict.together:
        return [h for h in ranking.hypotheses if len(h) > 1][:2]
    named: list[Hypothesis] = [(name,) for name in verdict.effects]
    rest = [h for h in ranking.hypotheses if h not in named and len(h) <= 1]
    return [*named, *rest][: max(2, min(_CANDIDATES, len(named)))]
