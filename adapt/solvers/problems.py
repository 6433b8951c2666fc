"""Adaptation problems: one per pair of subject and model.

Problem number = model * subjects + subject. The last axis of every array is the problem.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import as_type, in_chunks, take_problems, with_problems
from adapt.solvers.newton.subject import SubjectProblem
from adapt.solvers.rows import PostureRows
from adapt.solvers.unmeasured import angle_weights
from models.effects import NO_ACTIVE_EFFECTS, ActiveEffects, AnyGirdle
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.person.family import AnyModel, stacked_girdles, unique_sets
from models.person.thorax_ellipsoid import fitted_girdle, geometric_fit, thorax_sd_mm
from motions.arrays import Array, xp

ON_THE_THORAX = ("TS", "AI")
"""Landmarks whose distance to the ellipsoid the constraints A1 and A2 keep, in this order."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Sets:
    """Batch of parameter sets, one per pair of subject and model."""

    girdle: Girdle
    """Girdle of each problem after its geometric fit, (component, problems)."""
    points_mm: Float[Array, " 3 points problems"]
    point_weights: Float[Array, "points problems"]
    """Weights 1/n for each of n thorax points, 0 for padding."""
    bounds_mm: Float[Array, " 2 adapted problems"]
    person_sd_mm: Float[Array, " adapted problems"]
    """SDs of the subject's adapted parameters about those of the set
    (``models.person.thorax_ellipsoid.thorax_sd_mm``)."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Problems(Sets):
    """Parameter sets and postures of all problems, padded. All numbers are float64, or float32 for iterations in
    float32."""

    angles: Float[Array, " 6 postures problems"]
    """Measured angles, rad."""
    measured: Bool[Array, " 6 postures problems"]
    counted: Bool[Array, "postures problems"]
    active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
    """Effects with strengths (channels, postures, problems) and, where sizes differ between persons, ``own`` (sizes,
    channels, postures, problems). The effects act on the chain; D and L use the ellipsoid without them."""
    landmarks_mm: Float[Array, " 3 2 postures problems"] | None = None
    """Measured TS and AI, thorax frame, NaN where not measured; None where no subject has any."""

    def with_sizes(self, sizes: Float[np.ndarray, "sizes problems"]) -> "Problems":
        """Set the sizes of effects of every person to those that an adaptation has found (``Adapted.sizes``)."""
        return replace(self, active_effects=self.active_effects.with_sizes(sizes))

    def girdles_at(self, theta_mm: Float[Array, " adapted problems"], posture, problem) -> AnyGirdle:
        """Return the girdles at theta, with the active effects, one per pair of ``posture`` and ``problem``."""
        return self.active_effects.at(posture, problem).on(take_problems(self.girdle.with_adapted(theta_mm), problem))


def problems_of(rows: PostureRows, models: Sequence[AnyModel]) -> Problems:
    """Pair every subject with every model; a model may have one parameter set per subject."""

    def each_model(values):
        padded = rows.packed(values)
        return np.tile(padded, [1] * (padded.ndim - 1) + [len(models)])

    there = [rows.landmarks_mm.get(name) for name in ON_THE_THORAX]
    nowhere = np.full((3, len(rows.subject)), np.nan)
    landmarks = np.stack([nowhere if one is None else one for one in there], axis=1)
    return Problems(
        **vars(sets_of(models, rows.subjects)),
        angles=each_model(rows.angles),
        measured=each_model(rows.measured),
        counted=np.tile(rows.counted, len(models)),
        active_effects=jax.tree.map(each_model, rows.active_effects),
        landmarks_mm=None if all(one is None for one in there) else each_model(landmarks),
    )


def sets_of(models: Sequence[AnyModel], subjects: Sequence[str]) -> Sets:
    """Collect the parameter sets of all pairs of subject and model, each after its geometric fit."""
    sets, place = unique_sets(models, subjects)
    points = max(one.points_mm.shape[1] for one in sets)

    def each(values):
        return np.stack(values, axis=-1)[..., place]

    def padded(model: ParameterSet):
        return np.pad(model.points_mm, ((0, 0), (0, points - model.points_mm.shape[1])), mode="edge")

    def point_weights(model: ParameterSet):
        count = model.points_mm.shape[1]
        return np.where(np.arange(points) < count, 1.0 / count, 0.0)

    return Sets(
        girdle=take_problems(_fitted_girdles(sets), place),
        points_mm=each([padded(one) for one in sets]),
        point_weights=each([point_weights(one) for one in sets]),
        bounds_mm=each([one.bounds_mm for one in sets]),
        person_sd_mm=each([thorax_sd_mm(one) for one in sets]),
    )


_FEW = 8
"""Largest number of sets that are fitted one by one, all by the same compiled program."""

_SETS_AT_A_TIME = 64


def _fitted_girdles(sets: Sequence[ParameterSet]) -> Girdle:
    """Return the girdles of the sets after their geometric fits; sets with equally many points are fitted together."""
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


def select_problems(data: Problems, index: Int[np.ndarray, " chosen"], **changed: np.ndarray) -> Problems:
    """Select problems, any of them repeatedly, and replace some of their arrays."""
    return replace(take_problems(data, index), **changed)


def landmark_points(data: Problems, count: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return measured TS and AI of the counted postures as points, (3, landmarks, problems); none unless ``count``.

    Return also their weights, 1/m for each of m points, and their nominal distances to the ellipsoid, mm.
    """
    problems = data.counted.shape[1:]
    if data.landmarks_mm is None or not count:
        nothing = np.zeros((0, *problems))
        return np.zeros((3, 0, *problems)), nothing, nothing
    positions = np.asarray(data.landmarks_mm)
    known = np.isfinite(positions).all(axis=0) & data.counted
    anywhere = np.asarray(data.points_mm)[:, :1, None]
    levels = np.stack([data.girdle.ts_distance_mm, data.girdle.ai_distance_mm])[:, None]

    def flat(values: np.ndarray) -> np.ndarray:
        return values.reshape(*values.shape[:-3], -1, *problems)

    weights = known / np.maximum(known.sum(axis=(0, 1)), 1)
    return flat(np.where(known, positions, anywhere)), flat(weights), flat(np.broadcast_to(levels, known.shape))


def subject_problem(
    data: Problems,
    weight: Float[np.ndarray, " problems"],
    landmarks: float = 0.0,
    point_weights: Float[np.ndarray, "points problems"] | None = None,
) -> SubjectProblem:
    """Set up min E = D + landmarks L [mm^2] + weight mean(J) [deg^2] for each problem.

    ``point_weights`` replace the equal weights of D.
    """
    places, shares, levels = landmark_points(data, landmarks > 0.0)
    weights = np.asarray(data.point_weights if point_weights is None else point_weights)
    problem = SubjectProblem(
        data.girdle,
        np.concatenate([data.points_mm, places], axis=1),
        np.concatenate([weights, landmarks * shares]),
        np.concatenate([np.zeros_like(weights), levels]),
        data.angles,
        # the weight of an angle in E is weight / postures times its weight in J
        angle_weights(data.measured) * (weight / xp.sum(data.counted, axis=0))[None, None],
        data.counted,
        *data.bounds_mm,
    )
    return as_type(problem, weights.dtype)
