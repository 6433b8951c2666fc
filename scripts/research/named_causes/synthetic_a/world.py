"""A world: simulated subjects as the diagnosis may see them, and the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scripts.research.named_causes.synthetic_a.catalogue import EFFECTS, draw_effect, effects_of
from scripts.research.named_causes.synthetic_a.chain import CLOSED_MM, Chain, read_chain
from scripts.research.named_causes.synthetic_a.conventions import (
    ANGLES,
    DEG,
    LANDMARK_STREAM,
    LANDMARKS,
    NOISE_STREAM,
    PARAMETERS,
    PLANES_DEG,
    Array,
    Mask,
)
from scripts.research.named_causes.synthetic_a.courses import FULL_ELEVATION_DEG, Change, Draw
from scripts.research.named_causes.synthetic_a.rotations import apply, rotation_from_cardan, rotation_from_vector
from scripts.research.named_causes.synthetic_a.subjects import (
    Postures,
    Subjects,
    draw_subject,
    join,
    lay_out,
    rhythm_deg,
    with_parameters,
)

ELEVATIONS_DEG = (0.0, 25.0, 50.0, 75.0, 100.0, 125.0, 150.0)
LANDMARK_NOISE_MM = 2.0
MAX_MOVE_DEG = 25.0
"""Limit on each angle between the wished-for and the closed posture; a subject beyond it is not plausible."""
ATTEMPTS = 200
"""Draws of one subject before its open postures are dropped."""


@dataclass(frozen=True)
class World:
    """Simulated subjects: the table for the diagnosis, the truth for afterwards, and arrays for checks, row by row."""

    table: pd.DataFrame
    truth: dict[str, Any]
    clean_deg: Array
    """Measured angles without noise (n, 6)."""
    true_deg: Array
    """Angles of the closed posture (n, 6)."""
    closure_mm: Array
    """A1-A3 of the true chain, effect included, at the true posture (n, 3)."""
    gap_mm: Array
    """A1-A3 of the subject's chain without the effect, at the measured angles without noise (n, 3)."""


def make_world(
    label: str,
    model_toml_path: str | Path,
    subjects: int = 10,
    noise_deg: float = 1.5,
    size: float = 1.0,
    seed: int = 0,
    motions: Sequence[str] = ("abduction", "forward_flexion"),
    elevations: Sequence[float] = ELEVATIONS_DEG,
    mixed_sign: bool = False,
    landmarks: bool = False,
) -> World:
    """Simulate subjects with the effect `label` hidden in their motions.

    `noise_deg` is the SD on each angle, `size` a factor on the amplitudes (0: no effect), `elevations` are of the
    humerus in deg, `mixed_sign` draws the effect's sign for each subject, `landmarks` adds columns in mm.
    """
    names = effects_of(label)
    if unknown := [m for m in motions if m not in PLANES_DEG]:
        raise ValueError(f"no motion is called {unknown[0]!r}. Take some of {', '.join(PLANES_DEG)}")
    if size < 0.0 or noise_deg < 0.0 or subjects < 1 or not len(motions) or not len(elevations):
        raise ValueError("sizes and noises are at least 0, and there is a subject, a motion and an elevation at least")
    postures = lay_out(subjects, motions, elevations)
    model, base = read_chain(model_toml_path, len(postures.subject))
    hidden = {name: draw_effect(name, postures, size, seed, mixed_sign) for name in names}
    changes = [change for change, _ in hidden.values()]

    people, own, chain, q, closure, open_ = close_subjects(base, postures, changes, seed)
    measured, points = measure(chain, q, changes)
    gap, _ = own.gap(measured)

    shape = (subjects, len(postures.subject) // subjects)
    noise = np.random.default_rng([seed, NOISE_STREAM]).standard_normal((*shape, 6)).reshape(-1, 6) * noise_deg
    columns: dict[str, Any] = {
        "subject": [f"simulated{s + 1:02d}" for s in postures.subject],
        "motion": [postures.motions[m] for m in postures.motion],
        "posture": postures.number,
        "humerus_elevation_deg": postures.elevation_deg,
    }
    columns |= dict(zip(ANGLES, (measured / DEG + noise).T, strict=True))
    if landmarks:
        shake = np.random.default_rng([seed, LANDMARK_STREAM]).standard_normal((4, len(q), 3)) * LANDMARK_NOISE_MM
        for name, point, more in zip(LANDMARKS, points, shake, strict=True):
            columns |= {f"{name}_{axis}_mm": (point + more)[:, k] for k, axis in enumerate("xyz")}
    table = pd.DataFrame(columns)
    keep = ~open_
    truth = tell(label, model, base, postures, people, hidden, size, noise_deg, seed, mixed_sign, open_)
    return World(
        table.drop(index=np.flatnonzero(open_)).reset_index(drop=True),
        truth,
        measured[keep] / DEG,
        q[keep] / DEG,
        closure[keep],
        gap[keep],
    )


def close_subjects(
    base: Chain, postures: Postures, changes: Sequence[Change], seed: int
) -> tuple[Subjects, Chain, Chain, Array, Array, Mask]:
    """Draw subjects whose chains close with the active effects.

    Returns the subjects, their chains without and with the effects, the closed postures (n, 6) in rad, their residuals
    (n, 3) in mm, and a mask of the postures that stayed open. A subject with an open or implausible posture is drawn
    again; the other subjects are kept.
    """
    drawn = [draw_subject(seed, s, 0) for s in range(postures.subjects)]
    n = len(postures.subject)
    q, gap, new = np.zeros((n, 6)), np.zeros((n, 3)), np.ones(n, dtype=bool)
    attempt = 0
    while True:
        people = join(drawn)
        own = chain = with_parameters(base, people, postures)
        for change in changes:
            chain = change.chain(chain)
        wish = rhythm_deg(people, postures) * DEG
        q[new], gap[new] = chain.rows(new).close(wish[new])
        far = np.max(np.abs(q - wish), axis=-1) > MAX_MOVE_DEG * DEG
        open_ = ~(np.max(np.abs(gap), axis=-1) < CLOSED_MM) | far
        attempt += 1
        if not open_.any() or attempt == ATTEMPTS:
            return people, own, chain, q, gap, open_
        again = np.unique(postures.subject[open_])
        new = np.isin(postures.subject, again)
        for s in again:
            drawn[s] = draw_subject(seed, int(s), attempt)


def measure(chain: Chain, q: Array, changes: Sequence[Change]) -> tuple[Array, list[Array]]:
    """Return the noise-free measurement: angles (n, 6) in rad, and the points SC, AC, TS, AI (n, 3) in mm."""
    measured = q
    points = list(chain.points(q))
    for change in changes:
        before, measured = measured, change.angles(measured)
        if change.moves_landmarks == "scapula":
            R_old, R_new = rotation_from_cardan(before[:, 3:]), rotation_from_cardan(measured[:, 3:])
            moved = R_new @ np.swapaxes(R_old, 1, 2)
            points[2:] = [points[1] + apply(moved, p - points[1]) for p in points[2:]]
        if change.moves_landmarks == "all" and change.turn is not None:
            E = rotation_from_vector(change.turn)
            points = [apply(E, p) for p in points]
    return measured, points


def tell(
    label: str,
    model: str,
    base: Chain,
    postures: Postures,
    people: Subjects,
    hidden: dict[str, tuple[Change, Draw]],
    size: float,
    noise_deg: float,
    seed: int,
    mixed_sign: bool,
    dropped: Mask,
) -> dict[str, Any]:
    """Collect the truth, ready for JSON."""
    ids = [f"simulated{s + 1:02d}" for s in range(postures.subjects)]
    start = np.concatenate([base.centre[0, 1:], base.semi[0], base.targets[0, 2:]])
    effects = {}
    for name, (_, draw) in hidden.items():
        effect = EFFECTS[name]
        effects[name] = {
            "definition": " ".join((effect.make.__doc__ or "").split()),
            "unit": effect.unit,
            "scale": effect.scale,
            "amplitude": dict(zip(ids, draw.amplitude.tolist(), strict=True)),
            "parameters": {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in draw.notes.items()},
        }
    return {
        "origin": "simulated",
        "label": label,
        "labels": list(hidden),
        "model": model,
        "size": size,
        "noise_deg": noise_deg,
        "seed": seed,
        "mixed_sign": mixed_sign,
        "full_elevation_deg": FULL_ELEVATION_DEG,
        "effects": effects,
        "subjects": {
            subject: {
                **dict(zip(PARAMETERS, (start + people.parameter_mm[s]).tolist(), strict=True)),
                "rest_deg": people.rest_deg[s].tolist(),
                "slope_factors": people.slope[s].tolist(),
                "axial_rotation_deg": float(people.axial_deg[s]),
            }
            for s, subject in enumerate(ids)
        },
        "dropped": [
            [ids[postures.subject[i]], postures.motions[postures.motion[i]], int(postures.number[i])]
            for i in np.flatnonzero(dropped)
        ],
    }
