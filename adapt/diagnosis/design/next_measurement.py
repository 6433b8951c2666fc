"""Which further measurement would best separate the candidates left, by how much: from the model, not from residuals.

Each proposal changes the postures, quantities, subjects or noise; its gain is the expected log evidence between the two
candidates that look most similar (see ``separability``), and the probability it would give to the right one of them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from adapt.diagnosis.design.separability import projected_onto_model, separation
from adapt.diagnosis.fit.linear_model import Hypothesis
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.result import Proposal
from models.effects import Effect
from models.effects.effect import SHOWN
from models.girdle import Girdle, landmarks
from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.rotations import DEG

_ELEVATIONS_DEG = np.arange(0.0, 151.0, 25.0)
"""Of a further motion: seven postures."""

_PLANES_DEG = {"scapular plane": 30.0, "forward flexion": 90.0, "abduction": 0.0}


def propose(
    girdle: Girdle, effects: tuple[Effect, ...], candidates: Sequence[Hypothesis], data: Observed, noise: Noise
) -> list[Proposal]:
    """Propose measurements for at least two candidates, the most separating first."""
    postures = projected_onto_model(girdle, effects, data, noise)

    def least(data: Observed, noise: Noise) -> float:
        apart = separation(girdle, effects, candidates, data, noise)
        pairs = np.minimum(apart, apart.T)[np.triu_indices(len(candidates), 1)]
        return float(max(pairs.min(), 0.0))

    now = least(postures, noise)
    found = []
    for what, change in _changes(girdle, effects, postures).items():
        then = least(*change(postures, noise))
        found.append(Proposal(what, now, then, 1.0 / (1.0 + math.exp(-min(then, 50.0)))))
    return sorted(found, key=lambda proposal: -proposal.separation_then)


Change = Callable[[Observed, Noise], tuple[Observed, Noise]]


def _changes(girdle: Girdle, effects, data: Observed) -> dict[str, Change]:
    """What could be measured beside what was."""
    subjects = len(data.subjects)
    changes: dict[str, Change] = {
        "every posture measured four times": lambda data, noise: (
            data,
            Noise(noise.angle_deg / 2.0, noise.landmark_mm / 2.0),
        ),
        f"twice as many subjects ({2 * subjects})": lambda data, noise: (
            data.select_subjects(np.tile(np.arange(subjects), 2)),
            noise,
        ),
    }
    for name, plane_deg in _PLANES_DEG.items():
        changes[f"a further motion in all subjects: {name}, 0-150 degrees"] = _with_motion(
            girdle, effects, name, plane_deg
        )
    if len(data.values) == 6:
        changes[f"positions of {', '.join(SHOWN)} beside the angles"] = lambda data, noise: (
            _with_landmarks(girdle, data),
            noise,
        )
    return changes


def _with_motion(girdle: Girdle, effects, name: str, plane_deg: float) -> Change:
    def change(data: Observed, noise: Noise) -> tuple[Observed, Noise]:
        count, subjects = len(_ELEVATIONS_DEG), len(data.subjects)
        rest = np.repeat(REST_DEG[:, None], count, axis=1)
        coefficients = np.repeat(COEFFICIENTS[:, :, None], count, axis=2)
        angles = np.asarray(girdle_angles_deg(rest, np.full(count, plane_deg), _ELEVATIONS_DEG, coefficients)) / DEG
        more = Observed(
            values=np.repeat(angles[:, :, None], subjects, axis=2),
            measured=np.ones((6, count, subjects), bool),
            elevation_deg=np.repeat(_ELEVATIONS_DEG[:, None], subjects, axis=1),
            counted=np.ones((count, subjects), bool),
            motion=np.full((count, subjects), len(data.motions)),
            subjects=data.subjects,
            motions=(f"further {name}",),
        )
        more = projected_onto_model(girdle, effects, more, noise)
        if len(data.values) > 6:
            more = _with_landmarks(girdle, more)
        arrays = {
            key: np.concatenate([value, getattr(more, key)], axis=-2)
            for key, value in vars(data).items()
            if isinstance(value, np.ndarray)
        }
        return replace(data, **arrays, motions=(*data.motions, *more.motions)), noise

    return change


def _with_landmarks(girdle: Girdle, data: Observed) -> Observed:
    """The same postures with the positions that the model as it is predicts."""
    at = landmarks(girdle.over_axes(2), jnp.asarray(data.values[:6]))
    SC = jnp.broadcast_to(girdle.sc_mm[:, None, None], at.AC.shape)
    positions = np.concatenate([np.asarray(x) for x in (SC, at.AC, at.TS, at.AI)])
    everywhere = np.broadcast_to(data.counted, positions.shape)
    return replace(
        data,
        values=np.concatenate([data.values[:6], positions]),
        measured=np.concatenate([data.measured[:6], everywhere]),
    )
