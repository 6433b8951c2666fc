"""What measured positions say of the amplitudes: the constants of each person and what is smooth integrated out."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.discrepancy import Discrepancy, position_curves, position_whitening
from adapt.diagnosis.fit.evidence import Evidence, Given, without
from adapt.diagnosis.fit.positions.position_rows import PositionRows
from adapt.diagnosis.fit.shoulders import Shoulders


def position_evidence(
    rows: PositionRows, shoulders: Shoulders, discrepancy: Discrepancy, seen: Bool[np.ndarray, " rows"] | None = None
) -> Evidence:
    """Give log p(positions, z) of each shoulder in z = (h, b, a_s, 1): of all rows, or of those that are seen."""
    seen = np.ones(len(shoulders.subject), bool) if seen is None else seen
    matrices, constants, curves = [], [], position_curves(shoulders, discrepancy)
    for subject in range(len(shoulders.subjects)):
        own = shoulders.rows_of(subject)
        own = own[seen[own]]
        white, log_determinant = _white(rows, shoulders, discrepancy, own, curves[own])
        constant = rows.by_constant.shape[2]
        matrix = white.T @ white
        matrix[:constant, :constant] += np.eye(constant)
        rest, half_log = without(matrix, constant)
        matrices.append(rest)
        constants.append(-0.5 * log_determinant - half_log)
    shared = matrices[0].shape[0] - rows.by_amplitude.shape[2] - 1
    return Evidence(np.array(matrices), np.array(constants), shared, discrepancy.between_shoulders)


def _white(
    rows: PositionRows,
    shoulders: Shoulders,
    discrepancy: Discrepancy,
    own: Int[np.ndarray, " own"],
    curves: Float[np.ndarray, "own curves"],
) -> tuple[Float[np.ndarray, "numbers z"], float]:
    """Make the coordinates of a shoulder white: slopes in u, h, b and a, and the values."""
    measured, n = rows.measured[own], rows.values_mm.shape[1]
    variance = rows.places * rows.noise_mm**2 + (discrepancy.noise_deg * rows.lever_mm[own]) ** 2
    inverse_root, log_determinant = position_whitening(shoulders, discrepancy, own, variance, measured)
    of_curves = np.einsum("rb,nk->rnkb", curves, np.eye(n)).reshape(len(own), n, -1)
    shared, values = [rows.by_common[own], of_curves], rows.values_mm[own, :, None]
    columns = np.concatenate(
        [discrepancy.people * rows.by_constant[own], *shared, rows.by_amplitude[own], values], axis=2
    )
    white = inverse_root @ np.swapaxes(np.where(measured[..., None], columns, 0.0), 0, 1)
    return white.reshape(-1, columns.shape[2]), log_determinant


def given_by_positions(positions: Evidence, candidates: Candidates, hypothesis: Hypothesis) -> Given:
    """Give a set of causes by positions alone."""
    where = candidates.where(hypothesis)
    mean, scale = candidates.mean[where], candidates.scale[where]
    return positions.only(where).given(np.arange(len(where)), np.zeros(len(where)), mean, scale)


class Shown(NamedTuple):
    """The causes of a set that positions show, and what positions alone say of their amplitudes.

    Angles show which constraint gives way, and bones of a person's own explain that as well as a joint that moves. So
    what they say of a movement that was seen is cut off (Liu, Bayarri & Berger 2009, Bayesian Analysis 4:119-150,
    modularization): its size is that of the positions.
    """

    names: Hypothesis
    where: Int[np.ndarray, " own"]
    """Their amplitudes among those of the set."""
    given: Given


def shown_sizes(
    positions: Evidence | None, candidates: Candidates, hypothesis: Hypothesis, causes: Collection[str]
) -> Shown | None:
    """Give the effects of a set whose cause positions show; None where there is none."""
    names = tuple(name for name in hypothesis if candidates.causes[name] in causes)
    if positions is None or not names:
        return None
    where = np.flatnonzero(np.isin(candidates.where(hypothesis), candidates.where(names)))
    return Shown(names, where, given_by_positions(positions, candidates, names))
