"""Effect sizes measured by landmark positions alone, before any angle is used.

Each subject s has the medians over its postures of ``n = (SC, |SC-AC|, TS_x, AI_x, AI_y)``, the last three in the frame
of the scapula (thesis, Appendix A). A candidate that changes the bones by a constant a has, alone,

    a_s = argmin |W (n_s - n - J a)|^2,   J = dn/da,

where n and J are those of the subject's parameter set, and W is one over the SDs of the medians. The prior of an
amplitude that all subjects share has the mean of a_s, and the SD of that mean. Differences between subjects are not
part of this prior: the parameter set of each person (``girdle model``) has them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.shoulders import Shoulders
from models.effects import Effect
from models.effects.basis import CONSTANT
from models.girdle import Girdle
from models.person.positions.landmark_numbers import MEASURED, LandmarkNumbers, numbers_of
from motions.arrays import Array
from motions.landmarks.sampled_postures import measured_places_mm
from motions.table import Motions

_NO_ROTATION = np.eye(3)


class MeasuredSize(NamedTuple):
    """Mean and SD of the amplitudes of one candidate."""

    mean: Float[np.ndarray, " own"]
    sd: Float[np.ndarray, " own"]


def measured_sizes(shoulders: Shoulders, girdle: Girdle, effects: Sequence[Effect]) -> dict[str, MeasuredSize]:
    """Compute every size that landmarks determine, by name of the candidate; ``girdle``: (component, subjects)."""
    subjects = range(len(shoulders.subjects))
    of_subjects = [_numbers_of(shoulders.motions.select(shoulders.subject == s)) for s in subjects]
    found = {}
    if not any(np.isfinite(n).any() for n, _ in of_subjects):
        return found
    for effect in effects:
        if not _resizes(effect, girdle):
            continue
        of_set, slopes = _of_sets(effect, girdle)
        alone = [_alone(n - of_set[s], sd, slopes[s]) for s, (n, sd) in enumerate(of_subjects)]
        measured = [one for one in alone if one is not None]
        if measured:
            a, variance = (np.array(every) for every in zip(*measured, strict=True))
            between = a.var(axis=0, ddof=1) if len(a) > 1 else 0.0
            sd = np.sqrt(np.maximum(between, variance.mean(axis=0)) / len(a))
            found[effect.name] = MeasuredSize(a.mean(axis=0), sd)
    return found


def _numbers_of(motions: Motions) -> LandmarkNumbers:
    """Compute n of one subject and its SDs, NaN where not measured."""
    places = measured_places_mm(motions)
    return numbers_of(places, np.ones(len(motions.posture), bool))


def _resizes(effect: Effect, girdle: Girdle) -> bool:
    """Check whether an effect changes the numbers that landmarks measure, by a constant."""
    if effect.basis is not CONSTANT:
        return False
    rotation = _NO_ROTATION[..., None]
    changed, _ = effect.adjust(girdle, (rotation, rotation), np.zeros((len(effect.directions), 1)))
    return any(getattr(changed, one) is not getattr(girdle, one) for one in MEASURED)


def _of_sets(effect: Effect, girdle: Girdle) -> tuple[np.ndarray, np.ndarray]:
    """Compute n (subjects, 7) of the parameter sets and its derivatives J (subjects, 7, own)."""

    def numbers(a, girdle: Girdle) -> Float[Array, "7"]:
        changed, _ = effect.adjust(girdle, (_NO_ROTATION, _NO_ROTATION), a)
        return jnp.stack([*changed.sc_mm, changed.ac_mm[0], changed.ts_mm[0], *changed.ai_mm[:2]])

    none = jnp.zeros(len(effect.directions))
    both = jax.vmap(lambda one: (numbers(none, one), jax.jacfwd(numbers)(none, one)), in_axes=-1)
    of_set, slopes = jax.jit(both)(girdle)
    return np.asarray(of_set), np.asarray(slopes)


def _alone(more_mm, sd_mm, slopes) -> tuple[np.ndarray, np.ndarray] | None:
    """Compute the amplitudes of one subject and their variances; None where landmarks do not determine them."""
    known = np.isfinite(more_mm)
    J = slopes[known] / sd_mm[known, None]
    if np.linalg.matrix_rank(J, _NOTHING) < J.shape[1]:
        return None
    covariance = np.linalg.inv(J.T @ J)
    return covariance @ J.T @ (more_mm[known] / sd_mm[known]), np.diag(covariance)


_NOTHING = 1e-9
"""Rank tolerance, in SDs of the numbers per unit of amplitude: landmarks do not show an effect that changes the numbers
by less."""
