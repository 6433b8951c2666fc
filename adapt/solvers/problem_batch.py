"""Every subject with every model as one batch of whole-subject problems.

Problem number = model * subjects + subject. The last axis of every array is the problem.
"""

from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import take_problems
from adapt.solvers.objective import fitted_girdle
from adapt.solvers.padded_batch import Batch
from adapt.solvers.reference.posture import objective_weights
from adapt.solvers.reference.subject import Problem
from models.effects import NO_ACTIVE_EFFECTS, ActiveEffects, AnyGirdle
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
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
    batch: Batch, models: list[ParameterSet], active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
) -> ProblemBatch:
    """Pair every subject of the batch with every model.

    ``active_effects``: their strengths are (channels, postures, subjects).
    """
    subjects = batch.angles.shape[-1]
    points = max(model.points_mm.shape[1] for model in models)

    def each_subject(values):
        return np.repeat(np.stack(values, axis=-1), subjects, axis=-1)

    def each_model(values):
        return np.tile(values, [1] * (values.ndim - 1) + [len(models)])

    def padded(model: ParameterSet):
        return np.pad(model.points_mm, ((0, 0), (0, points - model.points_mm.shape[1])), mode="edge")

    def point_weights(model: ParameterSet):
        count = model.points_mm.shape[1]
        return np.where(np.arange(points) < count, 1.0 / count, 0.0)

    girdles = [fitted_girdle(model.girdle, model.points_mm) for model in models]
    return ProblemBatch(
        girdle=jax.tree.map(lambda *x: each_subject(x), *girdles),
        points_mm=each_subject([padded(model) for model in models]),
        point_weights=each_subject([point_weights(model) for model in models]),
        bounds_mm=each_subject([model.bounds_mm for model in models]),
        angles=each_model(batch.angles),
        measured=each_model(batch.measured),
        counted=each_model(batch.counted),
        active_effects=jax.tree.map(each_model, active_effects),
    )


def select_problems(data: ProblemBatch, index: Int[np.ndarray, " chosen"], **changed: np.ndarray) -> ProblemBatch:
    """Take some problems, any of them as often as wanted, with some of their arrays replaced."""
    return replace(ProblemBatch(**{k: take_problems(v, index) for k, v in vars(data).items()}), **changed)


def problem_with_weight(data: ProblemBatch, weight: Float[np.ndarray, " problems"]) -> Problem:
    """Lay out min E = D [mm^2] + weight mean(J) [deg^2] of each problem: W of an angle is weight / postures times that
    in J."""
    postures = xp.sum(data.counted, axis=0)
    weights = objective_weights(data.measured) * (weight / postures)[None, None]
    return Problem(data.angles, weights, data.counted, *data.bounds_mm)
