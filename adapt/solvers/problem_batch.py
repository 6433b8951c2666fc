"""Every subject with every model as one batch of whole-subject problems.

Problem number = model * subjects + subject. The last axis of every array is the problem.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import in_chunks, take_problems, with_problems
from adapt.solvers.objective import fitted_girdle, geometric_fit
from adapt.solvers.padded_batch import Batch
from adapt.solvers.reference.posture import objective_weights
from adapt.solvers.reference.subject import Problem
from models.effects import NO_ACTIVE_EFFECTS, ActiveEffects, AnyGirdle
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.person.family import AnyModel, stacked_girdles, unique_sets
from models.person.thorax_ellipsoid import thorax_sd_mm
from motions.arrays import Array, xp


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ProblemBatch:
    """The data and models of a batch, padding included. All numbers float64; or float32, to iterate in that."""

    girdle: Girdle
    """Each model's girdle after its geometric fit, (component, problems)."""
    points_mm: Float[Array, " 3 points problems"]
    point_weights: Float[Array, "points problems"]
    """1/n for each of n thorax points, 0 for padding."""
    bounds_mm: Float[Array, " 2 adapted problems"]
    person_sd_mm: Float[Array, " adapted problems"]
    """Of the subject's parameters about the set's (``models.person.thorax_ellipsoid.thorax_sd_mm``)."""
    angles: Float[Array, " 6 postures problems"]
    """Measured, rad."""
    measured: Bool[Array, " 6 postures problems"]
    counted: Bool[Array, "postures problems"]
    active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
    """Strengths (channels, postures, problems). They act in the chain; D is that of the ellipsoid without them."""

    def girdles_at(self, theta_mm: Float[Array, " adapted problems"], posture, problem) -> AnyGirdle:
        """Give the girdle at theta, with the active effects, of each of some postures of some problems."""
        return self.active_effects.at(posture, problem).on(take_problems(self.girdle.with_adapted(theta_mm), problem))


def problem_batch(
    batch: Batch, models: Sequence[AnyModel], active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
) -> ProblemBatch:
    """Pair every subject of the batch with every model, or with its own set of it.

    ``active_effects``: their strengths are (channels, postures, subjects).
    """

    def each_model(values):
        return np.tile(values, [1] * (values.ndim - 1) + [len(models)])

    return ProblemBatch(
        **vars(set_arrays(models, batch.subjects)),
        angles=each_model(batch.angles),
        measured=each_model(batch.measured),
        counted=each_model(batch.counted),
        active_effects=jax.tree.map(each_model, active_effects),
    )


@dataclass(frozen=True)
class SetArrays:
    """Parameter sets side by side, as ``ProblemBatch`` has them: problem number = model * subjects + subject."""

    girdle: Girdle
    points_mm: Float[np.ndarray, "3 points problems"]
    point_weights: Float[np.ndarray, "points problems"]
    bounds_mm: Float[np.ndarray, "2 adapted problems"]
    person_sd_mm: Float[np.ndarray, "adapted problems"]


def set_arrays(models: Sequence[AnyModel], subjects: Sequence[str]) -> SetArrays:
    """Lay out the set of every subject with every model, each after its geometric fit."""
    sets, place = unique_sets(models, subjects)
    points = max(one.points_mm.shape[1] for one in sets)

    def each(values):
        return np.stack(values, axis=-1)[..., place]

    def padded(model: ParameterSet):
        return np.pad(model.points_mm, ((0, 0), (0, points - model.points_mm.shape[1])), mode="edge")

    def point_weights(model: ParameterSet):
        count = model.points_mm.shape[1]
        return np.where(np.arange(points) < count, 1.0 / count, 0.0)

    return SetArrays(
        girdle=take_problems(_fitted_girdles(sets), place),
        points_mm=each([padded(one) for one in sets]),
        point_weights=each([point_weights(one) for one in sets]),
        bounds_mm=each([one.bounds_mm for one in sets]),
        person_sd_mm=each([thorax_sd_mm(one) for one in sets]),
    )


_FEW = 8
"""Sets up to which each is fitted on its own: what is compiled for that is the same for all of them."""

_SETS_AT_A_TIME = 64


def _fitted_girdles(sets: Sequence[ParameterSet]) -> Girdle:
    """The girdle of each set after its geometric fit, side by side; those with as many points are fitted together."""
    if len(sets) <= _FEW:
        girdles = [fitted_girdle(one.girdle, one.points_mm) for one in sets]
        return jax.tree.map(lambda *x: np.stack(x, axis=-1), *girdles)
    result = stacked_girdles(sets, np.arange(len(sets)))
    counts = np.array([one.points_mm.shape[1] for one in sets])
    for count in np.unique(counts):
        mine = np.flatnonzero(counts == count)
        points = np.stack([sets[k].points_mm for k in mine.tolist()], axis=-1)
        fitted = in_chunks(_fit_sets, _SETS_AT_A_TIME, take_problems(result, mine), points)
        result = with_problems(result, mine, fitted)
    return result


_fit_sets = jax.jit(jax.vmap(geometric_fit, in_axes=-1, out_axes=-1))


def select_problems(data: ProblemBatch, index: Int[np.ndarray, " chosen"], **changed: np.ndarray) -> ProblemBatch:
    """Take some problems, any of them as often as wanted, with some of their arrays replaced."""
    return replace(ProblemBatch(**{k: take_problems(v, index) for k, v in vars(data).items()}), **changed)


def problem_with_weight(data: ProblemBatch, weight: Float[np.ndarray, " problems"]) -> Problem:
    """Lay out min E = D [mm^2] + weight mean(J) [deg^2] of each problem: W of an angle is weight / postures times that
    in J."""
    postures = xp.sum(data.counted, axis=0)
    weights = objective_weights(data.measured) * (weight / postures)[None, None]
    return Problem(data.angles, weights, data.counted, *data.bounds_mm)
