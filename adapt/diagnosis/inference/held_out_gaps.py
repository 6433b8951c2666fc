"""How large the gap is, on the postures a model was fitted to and on postures and motions it has not seen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis.fit.linear_model import Hypothesis, LinearisedFit
from adapt.diagnosis.fit.map_fit import fit_hypotheses
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.misfit import Misfit, misfit
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.result import ALL, GapKind, GapLevels, HeldOutGaps, MeanGap
from adapt.engine.batching import in_threads
from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from adapt.trust.folds import hold_out_motions, hold_out_thirds
from models.effects import Effect
from models.girdle import Girdle
from motions.rotations import DEG
from motions.table import ANGLES, BONES

_ANGLES_OF = {ALL: slice(0, len(ANGLES)), **BONES}

_RESAMPLES = 2000
_SEED = 20260101
"""Of the bootstrap over subjects, fixed: the same data give the same interval."""

_INTERVAL_PERCENT = (2.5, 97.5)


Postures = Bool[np.ndarray, "postures subjects"]
"""Which are held out."""


def measure_gaps(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    data: Observed,
    noise: Noise,
    fitted: Sequence[LinearisedFit],
    progress: Callable[[str], None] = lambda _: None,
) -> HeldOutGaps:
    """Compute gaps: ``adapted`` (first of ``fitted``), ``with_effect`` (last), ``base`` and the noise floor.

    The noise floor is the gap that a model without fault would have. Held out are postures, and motions: adapted
    parameters and amplitudes are then fitted without them.
    """
    hypotheses = [one.hypothesis for one in fitted]
    base = _as_it_is(girdle, data)
    in_sample = _differences(girdle, effects, data, noise, fitted, base, data.counted)

    def unseen(held: Postures) -> _Differences:
        refitted = _fit(girdle, effects, hypotheses, data.without(held), noise)
        return _differences(girdle, effects, data, noise, refitted, base, held)

    thirds, motions = _thirds(data), _motions(data)
    progress("held-out postures and motions")
    parts = in_threads(unseen, [*thirds, *motions])
    by_motion = _levels(parts[len(thirds) :]) if motions else None
    return HeldOutGaps(_levels([in_sample]), _levels(parts[: len(thirds)]), by_motion)


def _fit(girdle, effects, hypotheses: list[Hypothesis], data, noise) -> list[LinearisedFit]:
    """Each hypothesis once, in the given order."""
    distinct = list(dict.fromkeys(hypotheses))
    found = dict(zip(distinct, fit_hypotheses(girdle, effects, distinct, data, noise), strict=True))
    return [found[hypothesis] for hypothesis in hypotheses]


def _thirds(data: Observed) -> list[Postures]:
    return [part for part in hold_out_thirds(data.counted) if part.any()]


def _motions(data: Observed) -> list[Postures]:
    """None where a subject would be left without any."""
    by_motion = hold_out_motions(data.counted, data.motion)
    parts = [by_motion[motion] for motion in sorted(by_motion)]
    return parts if all((data.counted & ~part).any(axis=0).all() for part in parts) else []


@dataclass(frozen=True)
class _Differences:
    """Absolute differences and their expectation from noise, where ``used`` says."""

    used: Bool[np.ndarray, "6 postures subjects"]
    by_kind_deg: dict[GapKind, Float[np.ndarray, "6 postures subjects"]]


def _differences(
    girdle, effects, data: Observed, noise, fitted: Sequence[LinearisedFit], base, held: Postures
) -> _Differences:
    def apart(found: Misfit):
        return np.abs(data.values - found.nearest)[:6] * DEG

    adapted, with_effect = (misfit(girdle, effects, data, noise, one.z) for one in (fitted[0], fitted[-1]))
    floor = np.sqrt(2.0 / np.pi * with_effect.noise_variance[:6]) * DEG
    by_kind: dict[GapKind, np.ndarray] = {
        "noise_floor": floor,
        "base": base,
        "adapted": apart(adapted),
        "with_effect": apart(with_effect),
    }
    return _Differences(held[None] & data.measured[:6], {k: np.asarray(v) for k, v in by_kind.items()})


def _as_it_is(girdle: Girdle, data: Observed) -> Float[np.ndarray, "6 postures subjects"]:
    """Differences from the model as it is, too far for the misfit's few steps: posture fits; NaN where one failed."""
    postures, subjects = data.counted.shape
    repeated = jax.tree.map(lambda x: jnp.repeat(x[..., None], postures * subjects, axis=-1), girdle)
    angles, measured = (np.asarray(x[:6]).reshape(6, -1) for x in (data.values, data.measured))
    fitted = fit_batch(repeated, angles, measured)
    apart = np.where(fitted.status == status.OK, np.abs(fitted.angles - angles) * DEG, np.nan)
    return apart.reshape(6, postures, subjects)


def _levels(parts: list[_Differences]) -> GapLevels:
    return {
        kind: {
            bone: _mean_gap([(part.used[rows], part.by_kind_deg[kind][rows]) for part in parts])
            for bone, rows in _ANGLES_OF.items()
        }
        for kind in parts[0].by_kind_deg
    }


def _mean_gap(parts) -> MeanGap:
    """Mean over subjects of each subject's mean; the interval resamples subjects, or postures where there is one."""
    parts = [(used & np.isfinite(difference), difference) for used, difference in parts]
    count = np.sum([used.sum(axis=0) for used, _ in parts], axis=0)
    total = np.sum([np.where(used, difference, 0.0).sum(axis=0) for used, difference in parts], axis=0)
    if count.shape[1] > 1:
        count, total = count.sum(axis=0), total.sum(axis=0)
    else:
        count, total = count[:, 0], total[:, 0]
    each = (total / np.maximum(count, 1))[count > 0]
    if not len(each):
        return MeanGap(float("nan"), float("nan"), float("nan"))
    chosen = np.random.default_rng(_SEED).integers(len(each), size=(_RESAMPLES, len(each)))
    low, high = np.percentile(each[chosen].mean(axis=1), _INTERVAL_PERCENT)
    return MeanGap(float(each.mean()), float(low), float(high))
