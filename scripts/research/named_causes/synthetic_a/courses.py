"""Random draws of a hidden effect, its course over elevation, and the change that it makes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scripts.research.named_causes.synthetic_a.chain import Chain
from scripts.research.named_causes.synthetic_a.conventions import Array
from scripts.research.named_causes.synthetic_a.subjects import Postures

FULL_ELEVATION_DEG = 150.0
"""Elevation at which an elevation-dependent effect reaches its amplitude."""


def _between(raw: Callable[[Array], Array], x: Array) -> Array:
    low, high = raw(np.zeros_like(x)), raw(np.ones_like(x))
    return (raw(x) - low) / (high - low)


def _step(x: Array, start: Array, end: Array) -> Array:
    u = np.clip((x - start) / (end - start), 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


COURSES: dict[str, tuple[tuple[tuple[float, float], ...], Callable[[Array, Array], Array]]] = {
    "sigmoid": (((0.4, 0.65), (0.08, 0.15)), lambda x, k: _between(lambda u: np.tanh((u - k[0]) / (2.0 * k[1])), x)),
    "smoothstep": (((0.05, 0.2), (0.75, 0.95)), lambda x, k: _step(x, k[0], k[1])),
    "late": (((0.4, 0.55), (1.0, 1.25)), lambda x, k: _between(lambda u: _step(u, k[0], k[1]), x)),
    "power": (((1.3, 2.5),), lambda x, k: x ** k[0]),
    "cosine": (((0.9, 1.1),), lambda x, k: _between(lambda u: 1.0 - np.cos(np.pi * u * k[0]), x)),
    "saturating": (((0.18, 0.45),), lambda x, k: _between(lambda u: -np.exp(-u / k[0]), x)),
    "hinge": (((0.3, 0.5), (0.05, 0.1)), lambda x, k: _between(lambda u: np.logaddexp(0.0, (u - k[0]) / k[1]), x)),
    "wiggle": (((1.3, 1.8), (0.06, 0.12)), lambda x, k: x ** k[0] + k[1] * np.sin(2.0 * np.pi * x)),
}
"""For each course the ranges of its shape parameters, drawn once per world, and its function of x = elevation / full
elevation, which is 0 with the arm hanging and 1 at full elevation. No course is a straight line."""


@dataclass
class Draw:
    """Random draws of one hidden effect in a world; `notes` goes to the truth."""

    postures: Postures
    amplitude: Array
    """Amplitude of each subject, in the effect's unit, size and sign included (s,)."""
    rng: np.random.Generator
    notes: dict[str, Any] = field(default_factory=dict)

    def constant(self) -> Array:
        """Return the amplitude at every posture (n,)."""
        return self.amplitude[self.postures.subject]

    def level(self, *courses: str) -> Array:
        """Return the amplitude times a course over elevation (n,).

        One course is drawn per world; its shape parameters vary a little by subject, its height by motion.
        """
        s, postures = self.postures.subject, self.postures
        name = str(self.rng.choice(courses))
        ranges, course = COURSES[name]
        shape = np.array([self.rng.uniform(*r) for r in ranges])
        own = shape[:, None] * (1.0 + 0.07 * np.clip(self.rng.standard_normal((len(shape), postures.subjects)), -2, 2))
        offset = 0.03 * np.clip(self.rng.standard_normal(postures.subjects), -2.0, 2.0)
        by_motion = np.concatenate([[1.0], self.rng.uniform(0.85, 1.15, len(postures.motions) - 1)])
        f = course(postures.elevation_deg / FULL_ELEVATION_DEG, own[:, s])
        self.notes |= {"course": name, "shape": shape, "shape_by_subject": own.T, "offset_fraction": offset}
        self.notes |= {"factor_by_motion": dict(zip(postures.motions, by_motion.tolist(), strict=True))}
        return self.constant() * (offset[s] + (1.0 - offset[s]) * f) * by_motion[postures.motion]

    def direction(self, mean: Sequence[float], world_sd: float, subject_sd: float = 0.15) -> Array:
        """Draw unit vectors for every posture (n, 3): one direction near `mean` per world, each subject's near it."""
        common = np.asarray(mean) + world_sd * self.rng.standard_normal(3)
        common /= np.linalg.norm(common)
        own = common + subject_sd * self.rng.standard_normal((self.postures.subjects, 3))
        own /= np.linalg.norm(own, axis=-1, keepdims=True)
        self.notes |= {"direction": common, "direction_by_subject": own}
        return own[self.postures.subject]

    def pick(self, key: str, options: Sequence[Any]) -> Any:
        """Draw one of the options and note it under `key`."""
        self.notes[key] = options[int(self.rng.integers(len(options)))]
        return self.notes[key]


@dataclass(frozen=True)
class Change:
    """Change that an effect makes: to the chain, or to its measured angles (n, 6) in rad, or to neither."""

    chain: Callable[[Chain], Chain] = lambda chain: chain
    angles: Callable[[Array], Array] = lambda q: q
    moves_landmarks: str = ""
    """Landmarks: '' stay on the true bones; 'scapula': TS and AI follow the measured scapula; 'all' turn with the
    frame."""
    turn: Array | None = None
    """Rotation vector of the frame (n, 3) in rad, for 'all'."""
