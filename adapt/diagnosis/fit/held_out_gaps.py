"""How large the gap is, on the postures a model was fitted to and on postures and motions it has not seen."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis.fit.linear_evidence import Hypothesis, LinearisedFit
from adapt.diagnosis.fit.map_fit import fit_hypotheses
from adapt.diagnosis.fit.misfit import Misfit, misfit
from adapt.diagnosis.fit.observations import Noise, Observed
from adapt.engine.batching import in_threads
from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from models.effects import Effect
from models.girdle import Girdle
from motions.rotations import DEG

BONES = {"all": slice(0, 6), "clavicle": slice(0, 3), "scapula": slice(3, 6)}

_PARTS = 3
"""Every third posture is held out in turn."""

_RESAMPLES = 2000
_SEED = 20260101
"""Of the bootstrap over subjects, fixed: the same data give the same interval."""

_INTERVAL_PERCENT = (2.5, 97.5)


@dataclass(frozen=True)
class Gap:
    """Mean absolute difference of the angles, degrees, with its 95 % interval over subjects."""

    value: float
    low: float
    high: float


Gaps = dict[str, Gap]
"""By bone: all, clavicle, scapula."""

Postures = Bool[np.ndarray, "postures subjects"]
"""Which are held out."""


@dataclass(frozen=True)
class HeldOut:
    """Gaps of the model as it is, adapted, and adapted with the effects; each has the same keys."""

    in_sample: dict[str, Gaps]
    unseen: dict[str, Gaps]
    """Of every third posture in turn, after the others. Of simulated subjects it tells better than a motion held out,
    which leaves half of the data to fit to, how far the gap shrinks on a new motion after all of these."""
    other_motion: dict[str, Gaps] | None
    """Of each motion in turn, after the others; None where there is but one."""


def gaps(
    girdle: Girdle,
    effects: tuple[Effect, ...],
    data: Observed,
    noise: Noise,
    fitted: Sequence[LinearisedFit],
    progress: Callable[[str], None] = lambda _: None,
) -> HeldOut:
    """Gaps of ``adapted`` (first of ``fitted``) and ``with_effect`` (last), beside ``base`` and the noise floor.

    The noise floor is the gap that a model without fault would have. Held out are postures, and motions: adapted
    parameters and amplitudes are then fitted without them.
    """
    hypotheses = [one.hypothesis for one in fitted]
    base = _as_it_is(girdle, data)
    seen = _looked(girdle, effects, data, noise, fitted, base, data.counted)

    def unseen(held: Postures) -> _Looked:
        found = _fit(girdle, effects, hypotheses, data.without(held), noise)
        return _looked(girdle, effects, data, noise, found, base, held)

    thirds, motions = _thirds(data), _motions(data)
    progress("held-out postures and motions")
    looked = in_threads(unseen, [*thirds, *motions])
    by_motion = _summarised(looked[len(thirds) :]) if motions else None
    return HeldOut(_summarised([seen]), _summarised(looked[: len(thirds)]), by_motion)


def _fit(girdle, effects, hypotheses: list[Hypothesis], data, noise) -> list[LinearisedFit]:
    """Each hypothesis once, in the given order."""
    distinct = list(dict.fromkeys(hypotheses))
    found = dict(zip(distinct, fit_hypotheses(girdle, effects, distinct, data, noise), strict=True))
    return [found[hypothesis] for hypothesis in hypotheses]


def _thirds(data: Observed) -> list[Postures]:
    order = np.cumsum(data.counted, axis=0) % _PARTS
    parts = [data.counted & (order == k) for k in range(_PARTS)]
    return [part for part in parts if part.any()]


def _motions(data: Observed) -> list[Postures]:
    """None where a subject would be left without any."""
    parts = [data.counted & (data.motion == m) for m in range(len(data.motions))]
    parts = [part for part in parts if part.any()]
    return parts if all((data.counted & ~part).any(axis=0).all() for part in parts) else []


@dataclass(frozen=True)
class _Looked:
    """Absolute differences and their expectation from noise, where ``of`` says."""

    of: Bool[np.ndarray, "6 postures subjects"]
    differences_deg: dict[str, Float[np.ndarray, "6 postures subjects"]]


def _looked(girdle, effects, data: Observed, noise, fitted: Sequence[LinearisedFit], base, held) -> _Looked:
    def apart(found: Misfit):
        return np.abs(data.values - found.nearest)[:6] * DEG

    adapted, with_effect = (misfit(girdle, effects, data, noise, one.z) for one in (fitted[0], fitted[-1]))
    floor = np.sqrt(2.0 / np.pi * with_effect.noise_variance[:6]) * DEG
    differences = {
        "noise_floor": floor,
        "base": base,
        "adapted": apart(adapted),
        "with_effect": apart(with_effect),
    }
    return _Looked(held[None] & data.measured[:6], {k: np.asarray(v) for k, v in differences.items()})


def _as_it_is(girdle: Girdle, data: Observed) -> Float[np.ndarray, "6 postures subjects"]:
    """Differences from the model as it is, too far for the misfit's few steps: posture fits; NaN where one failed."""
    postures, subjects = data.counted.shape
    repeated = jax.tree.map(lambda x: jnp.repeat(x[..., None], postures * subjects, axis=-1), girdle)
    angles, measured = (np.asarray(x[:6]).reshape(6, -1) for x in (data.values, data.measured))
    fitted = fit_batch(repeated, angles, measured)
    apart = np.where(fitted.status == status.OK, np.abs(fitted.angles - angles) * DEG, np.nan)
    return apart.reshape(6, postures, subjects)


def _summarised(parts: list[_Looked]) -> dict[str, Gaps]:
    return {
        kind: {bone: _gap([(p.of[rows], p.differences_deg[kind][rows]) for p in parts]) for bone, rows in BONES.items()}
        for kind in parts[0].differences_deg
    }


def _gap(parts) -> Gap:
    """Mean over subjects of each subject's mean; the interval resamples subjects, or postures where there is one."""
    parts = [(of & np.isfinite(difference), difference) for of, difference in parts]
    count = np.sum([of.sum(axis=0) for of, _ in parts], axis=0)
    total = np.sum([np.where(of, difference, 0.0).sum(axis=0) for of, difference in parts], axis=0)
    if count.shape[1] > 1:
        count, total = count.sum(axis=0), total.sum(axis=0)
    else:
        count, total = count[:, 0], total[:, 0]
    each = (total / np.maximum(count, 1))[count > 0]
    if not len(each):
        return Gap(float("nan"), float("nan"), float("nan"))
    chosen = np.random.default_rng(_SEED).integers(len(each), size=(_RESAMPLES, len(each)))
    low, high = np.percentile(each[chosen].mean(axis=1), _INTERVAL_PERCENT)
    return Gap(float(each.mean()), float(low), float(high))
