"""Log density of measured positions given the amplitudes: constants of persons and smooth curves are integrated out."""

from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.discrepancy import Discrepancy, common_position_curves, own_position_curves
from adapt.diagnosis.fit.evidence import Evidence, Given, without
from adapt.diagnosis.fit.positions.position_rows import PositionRows
from adapt.diagnosis.fit.shoulders import Shoulders


def position_evidence(
    rows: PositionRows, shoulders: Shoulders, discrepancy: Discrepancy, seen: Bool[np.ndarray, " rows"] | None = None
) -> Evidence:
    """Compute log p(positions, z) of each shoulder, z = (h, b, a_s, 1), over all rows or where ``seen`` is True."""
    return position_grams(rows, shoulders, discrepancy.noise_deg, discrepancy.length_deg, seen).evidence(discrepancy)


class Grams(NamedTuple):
    """Gram matrices X' N^-1 X of shoulders, N the noise covariance of their coordinates: the parts that do not depend
    on the sizes of curves."""

    of_shoulders: tuple["Gram", ...]
    amplitudes: int

    def evidence(self, discrepancy: Discrepancy) -> Evidence:
        """Compute log p(positions, z) of each shoulder, z = (h, b, a_s, 1)."""
        sizes = sizes_of_curves(discrepancy)
        matrices, constants = [], []
        for gram in self.of_shoulders:
            size = sizes[gram.size]
            kept = np.flatnonzero(size)
            matrix = size[kept, None] * gram.matrix[kept[:, None], kept] * size[kept]
            first = int(np.count_nonzero(size[: gram.of_person]))
            matrix[:first, :first] += np.eye(first)
            rest, half_log = without(matrix, first)
            matrices.append(rest)
            constants.append(-0.5 * gram.log_determinant - half_log)
        shared = len(matrices[0]) - self.amplitudes - 1
        return Evidence(np.array(matrices), np.array(constants), shared, discrepancy.between_shoulders)


class Gram(NamedTuple):
    """Gram matrix of one shoulder, of its constants and curves, common constants and curves, the amplitudes, and 1."""

    matrix: Float[np.ndarray, "z z"]
    size: Int[np.ndarray, " z"]
    """Index of each column's scale in ``sizes_of_curves``."""
    of_person: int
    """Number of columns of the person, which come first."""
    log_determinant: float
    """Log determinant of N."""


_SIZES = ("people", "own_mm", "own_turn_deg", "common_mm", "common_turn_deg")
"""Hyperparameters that scale the constants (``people``) and the curves (all others)."""


def sizes_of_curves(discrepancy: Discrepancy) -> Float[np.ndarray, " sizes"]:
    """Return 1 and the values of ``_SIZES``."""
    return np.array([1.0, *(getattr(discrepancy, name) for name in _SIZES)])


def position_grams(
    rows: PositionRows,
    shoulders: Shoulders,
    noise_deg: float,
    length_deg: float,
    seen: Bool[np.ndarray, " rows"] | None = None,
) -> Grams:
    """Compute the Gram matrices of all rows, or of those where ``seen`` is True."""
    every = grams_with(
        rows, shoulders, noise_deg, length_deg, seen, lambda own: np.zeros((*rows.values_mm[own].shape, 0))
    )
    return Grams(tuple(gram for _, gram in every), rows.by_amplitude.shape[2])


def grams_with(
    rows: PositionRows,
    shoulders: Shoulders,
    noise_deg: float,
    length_deg: float,
    seen: Bool[np.ndarray, " rows"] | None,
    last: Callable[[Int[np.ndarray, " own"]], Float[np.ndarray, "own n more"]],
) -> Iterator[tuple[Int[np.ndarray, " own"], Gram]]:
    """Yield the rows of each shoulder where ``seen`` is True (default: all), and their Gram, which ends with the
    columns of ``last``."""
    seen = np.ones(len(shoulders.subject), bool) if seen is None else seen
    common = common_position_curves(shoulders, length_deg)
    for subject in range(len(shoulders.subjects)):
        own = shoulders.rows_of(subject)
        own = own[seen[own]]
        of_person = [rows.by_constant[own], *_of_curve(rows, own, own_position_curves(shoulders, own, length_deg))]
        of_all = [rows.by_common[own], *_of_curve(rows, own, common[own])]
        every = [*of_person, *of_all, rows.by_amplitude[own], rows.values_mm[own, :, None], last(own)]
        white, log_determinant = _white(rows, noise_deg, own, np.concatenate(every, axis=2))
        size = np.repeat([1, 2, 3, 0, 4, 5, 0, 0, 0], [one.shape[2] for one in every])
        yield own, Gram(white.T @ white, size, sum(one.shape[2] for one in of_person), log_determinant)


def _of_curve(
    rows: PositionRows, own: Int[np.ndarray, " own"], curves: Float[np.ndarray, "own curves"]
) -> list[Float[np.ndarray, "own n k"]]:
    """Lay out the curves of every coordinate, and of every angle."""
    n, count = rows.values_mm.shape[1], len(own)
    of_places = np.einsum("rk,nm->rnmk", curves, np.eye(n)).reshape(count, n, -1)
    of_turns = np.einsum("rk,rni->rnik", curves, rows.by_angle[own]).reshape(count, n, -1)
    return [of_places, of_turns]


def _white(
    rows: PositionRows, noise_deg: float, own: Int[np.ndarray, " own"], columns: Float[np.ndarray, "own n z"]
) -> tuple[Float[np.ndarray, "numbers z"], float]:
    """Whiten the coordinates of each posture, and return the log determinant of their noise covariance.

    A coordinate that was not measured is independent of the others, with the value 0 and the variance 1.
    """
    known = rows.measured[own]
    by_angle = np.where(known[..., None], noise_deg * rows.by_angle[own], 0.0)
    covariance = by_angle @ np.swapaxes(by_angle, 1, 2)
    both = known[..., None] & known[:, None]
    covariance += np.where(both, rows.noise_mm**2 * rows.of_noise[own], np.eye(known.shape[1]))
    root = np.linalg.cholesky(covariance)
    white = np.linalg.inv(root) @ np.where(known[..., None], columns, 0.0)
    return white.reshape(-1, columns.shape[2]), 2.0 * float(np.log(np.einsum("rnn->rn", root)).sum())


def given_by_positions(positions: Evidence, candidates: Candidates, hypothesis: Hypothesis) -> Given:
    """Return a set of causes in the model of the positions alone."""
    where = candidates.where(hypothesis)
    mean, scale = candidates.mean[where], candidates.scale[where]
    return positions.only(where).given(np.arange(len(where)), np.zeros(len(where)), mean, scale)


class Shown(NamedTuple):
    """Causes of a set that positions show, with their amplitudes by positions alone.

    Angles show which constraint is violated, and own bones explain a violation as well as a joint that moves. The
    diagnosis therefore ignores the information of angles about a movement that was seen (modularization: Liu, Bayarri &
    Berger 2009, Bayesian Analysis 4:119-150): the size is that of the positions.
    """

    names: Hypothesis
    where: Int[np.ndarray, " own"]
    """Indices of their amplitudes among those of the set."""
    given: Given


def shown_sizes(
    positions: Evidence | None, candidates: Candidates, hypothesis: Hypothesis, causes: Collection[str]
) -> Shown | None:
    """Return the effects of a set whose cause is in ``causes``, sized by positions; None where there are none."""
    names = tuple(name for name in hypothesis if candidates.causes[name] in causes)
    if positions is None or not names:
        return None
    where = np.flatnonzero(np.isin(candidates.where(hypothesis), candidates.where(names)))
    return Shown(names, where, given_by_positions(positions, candidates, names))
