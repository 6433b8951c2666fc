"""Drawings of measured and simulated landmark paths along each motion, for the page."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.result import Diagnosis, Positions

MOST_SUBJECTS = 3
"""Largest number of subjects whose paths are drawn: the first ones."""

WIDTH, HEIGHT = 340.0, 90.0
"""Size of a drawing in its own units; the numbers of the motions stand below."""

_AXES = ("lateral", "up", "backward")

_GAP = 1.0
"""Distance between motions, in postures."""

_ROOM = 0.05
"""Share of the range that is left free above and below."""

STATE_NAMES = {"base": "the model as it is", "adapted": "adapted", "with_causes": "adapted, with the causes"}

Polyline = str
"""Points in the notation of an SVG polyline."""


@dataclass(frozen=True)
class Drawing:
    """Path of a landmark of one subject: one component, or the distance to the measured position."""

    title: str
    low_mm: float
    high_mm: float
    measured: Sequence[tuple[float, float]]
    """Measured points, drawn as dots."""
    lines: Mapping[str, Sequence[Polyline]]
    """Simulated lines by state, one per motion."""
    motions: Sequence[tuple[float, str]]
    """Start and name of each motion."""


def shown_states(diagnosis: Diagnosis) -> list[str]:
    """List the states to draw; a state with causes exists only where the diagnosis names some."""
    return [state for state in STATE_NAMES if diagnosis.goes_further or state != "with_causes"]


def drawings(diagnosis: Diagnosis) -> dict[str, list[Drawing]]:
    """Draw per subject the landmarks that depend on one joint each: SC; AC, or AA where AC was not measured."""
    positions = diagnosis.positions
    names = [name for name in ("SC", "AC" if "AC" in positions.measured_mm else "AA") if name in positions.measured_mm]
    states = shown_states(diagnosis)
    found = {
        subject: [one for name in names for one in _of_landmark(positions, states, subject, name)]
        for subject in positions.motions.subjects[:MOST_SUBJECTS]
    }
    return {subject: every for subject, every in found.items() if every}


def _of_landmark(positions: Positions, states: Sequence[str], subject: str, name: str) -> Iterator[Drawing]:
    motions = positions.motions
    mine = np.flatnonzero(motions.subject == subject)
    kinds = list(dict.fromkeys(motions.motion[mine].tolist()))
    rows = [mine[motions.motion[mine] == kind] for kind in kinds]
    rows = [one[np.argsort(motions.posture[one], kind="stable")] for one in rows]
    measured = positions.measured_mm[name]
    simulated = {state: positions.simulated_mm[state][name] for state in states}
    if not np.isfinite(measured[:, mine]).any():
        return
    for axis, word in enumerate(_AXES):
        yield _drawing(f"{name}, {word}", rows, kinds, measured[axis], {s: one[axis] for s, one in simulated.items()})
    away = {state: np.linalg.norm(one - measured, axis=0) for state, one in simulated.items()}
    yield _drawing(f"{name}, distance", rows, kinds, np.full(measured.shape[1], np.nan), away)


def _drawing(
    title: str,
    rows: Sequence[np.ndarray],
    kinds: Sequence[str],
    measured: Float[np.ndarray, " rows"],
    simulated: Mapping[str, Float[np.ndarray, " rows"]],
) -> Drawing:
    every = np.concatenate(rows)
    values = np.concatenate([one[every] for one in (measured, *simulated.values())])
    low, high = float(np.nanmin(values, initial=np.inf)), float(np.nanmax(values, initial=-np.inf))
    starts = np.cumsum([0.0, *(len(one) + _GAP for one in rows)])
    step = WIDTH / max(starts[-1] - _GAP - 1.0, 1.0)
    room = max(_ROOM * (high - low), 1e-9)

    def points(number: int, of: Float[np.ndarray, " rows"]) -> list[tuple[float, float]]:
        """Return the drawn points of the known values of one motion."""
        along = step * (starts[number] + np.arange(len(rows[number])))
        up = HEIGHT * (1.0 - (of[rows[number]] - low + room) / (high - low + 2.0 * room))
        return [(round(float(x), 1), round(float(y), 1)) for x, y in zip(along, up, strict=True) if np.isfinite(y)]

    numbers = range(len(rows))
    return Drawing(
        title=title,
        low_mm=low,
        high_mm=high,
        measured=[point for number in numbers for point in points(number, measured)],
        lines={state: [_polyline(points(number, one)) for number in numbers] for state, one in simulated.items()},
        motions=[(round(float(step * start), 1), kind) for start, kind in zip(starts[:-1], kinds, strict=True)],
    )


def _polyline(points: Sequence[tuple[float, float]]) -> Polyline:
    return " ".join(f"{x:g},{y:g}" for x, y in points)
