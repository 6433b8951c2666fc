"""How well do measured positions predict joint movement on held-out motions? A limit for any diagnosis that uses them.

    python scripts/research/named_causes/study_positions.py ../shared/motions_positions/bonepin_*.csv

Landmarks are predicted at the measured angles, without the closed chain, on each kind of motion in turn: with the
constants of the person alone, and with SC and AC that move with the posture, with subject-level amplitudes, with common
ones, or with the population amplitudes of the other persons. Root mean square distance, mm. Then, per shoulder, the
correlation of the movement of SC and AC predicted with subject-level amplitudes with the measured movement
(`--effect sc_translation=measured`). Prints Markdown.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import candidate_effects
from adapt.diagnosis.fit.discrepancy import TYPICAL
from adapt.diagnosis.fit.evidence import Evidence, Given
from adapt.diagnosis.fit.positions.position_evidence import position_evidence
from adapt.diagnosis.fit.positions.position_rows import PositionRows
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import Search, search_of
from adapt.diagnosis.position_findings import position_noise_mm
from models import load_model
from models.person.positions.measured_movement import measured_movement_mm
from scripts.reporting import markdown, measured

SET = "breteler_dissection"
JOINTS = ("ac_translation:posture", "sc_translation:posture")

Sizes = Callable[[Evidence, Callable[[Evidence], Given], int], Float[np.ndarray, " own"]]
"""Function that returns the amplitudes for the prediction of one shoulder."""


def main() -> None:
    """Print two tables."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    described.add_argument("motions", nargs="+", type=Path)
    given = described.parse_args()
    motions = measured(described, given.motions)
    shoulders, _ = usable(motions)
    model = load_model(SET)
    noise = position_noise_mm(motions)
    search = search_of(model, shoulders, candidate_effects(model, shoulders.subjects), position_noise_mm=noise)
    person = shoulders.person
    ways: dict[str, Sizes] = {
        "no movement": lambda evidence, of, s: np.zeros(evidence.matrix.shape[1] - evidence.shared - 1),
        "sizes of the person's own": lambda evidence, of, s: of(evidence).of_shoulders[s],
        "sizes that all have": lambda evidence, of, s: of(evidence).amplitude,
        "sizes of other persons": lambda evidence, of, s: of(evidence.of(person != person[s])).amplitude,
    }
    rows, movement = [], np.zeros(0)
    for word, sizes in ways.items():
        left, movement_of_way = predicted(search, sizes)
        rows.append([word, f"{np.sqrt((left**2).sum() / np.isfinite(left).sum() * 3.0):.2f}"])
        movement = movement_of_way if word == "sizes of the person's own" else movement
    print(markdown(["", "mm"], rows))
    correlations = []
    for k, name in enumerate(JOINTS):
        true = measured_movement_mm(name.partition(":")[0], motions)
        each = (correlation(movement[k][:, own], true[:, own]) for own in map(shoulders.rows_of, range(len(person))))
        correlations.append([name, *(f"{one:.2f}" for one in each)])
    print("\n" + markdown(["", *shoulders.subjects], correlations))


def predicted(search: Search, sizes: Sizes) -> tuple[Float[np.ndarray, "rows n"], Float[np.ndarray, "joints 3 rows"]]:
    """Predict every kind of motion from the others: the coordinates' residuals, and the movement of the joints."""
    candidates, shoulders = search.joint.candidates, search.joint.shoulders
    assert search.joint.positions is not None
    where = candidates.where(JOINTS)
    rows, zero = search.joint.positions.amplitudes(where), np.zeros(len(where))
    left, movement = np.zeros(rows.values_mm.shape), np.zeros((len(JOINTS), 3, len(shoulders.subject)))
    for motion in range(len(shoulders.kinds)):
        seen = shoulders.motion != motion
        evidence = position_evidence(rows, shoulders, TYPICAL, seen)

        def of(some: Evidence) -> Given:
            return some.given(np.arange(len(where)), zero, candidates.mean[where], candidates.scale[where])

        for subject in range(len(shoulders.subjects)):
            own = shoulders.rows_of(subject)
            a, fitted, tested = sizes(evidence, of, subject), own[seen[own]], own[~seen[own]]
            left[tested] = _with_constants(rows, rows.values_mm + rows.by_amplitude @ a, fitted, tested)
            for k, (effect, place) in enumerate(candidates.slices(JOINTS)):
                columns = effect.basis.strengths(len(effect.directions), shoulders.motions)
                movement[k][:, tested] = np.einsum("a,acp->cp", a[place], columns[..., tested])
    return left, movement


def _with_constants(rows: PositionRows, values, fitted, tested) -> Float[np.ndarray, "tested n"]:
    """Compute the held-out postures' residuals with the most probable constants of the fitted postures."""
    H = rows.by_constant[fitted].reshape(-1, rows.by_constant.shape[2])
    u = -np.linalg.solve(H.T @ H + np.eye(H.shape[1]), H.T @ values[fitted].ravel())
    return values[tested] + rows.by_constant[tested] @ u


def correlation(one: Float[np.ndarray, "3 rows"], other: Float[np.ndarray, "3 rows"]) -> float:
    """Correlate two movements over all directions, each about its mean."""
    x, y = (a - a.mean(axis=1, keepdims=True) for a in (one, other))
    return float((x * y).sum() / np.sqrt((x**2).sum() * (y**2).sum()))


if __name__ == "__main__":
    main()
