"""What measured positions say of the amplitudes: the constants of each person and what is smooth integrated out."""

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
    """Give log p(positions, z) of each shoulder in z = (h, b, a_s, 1): of all rows, or of those that are seen."""
    return position_grams(rows, shoulders, discrepancy.noise_deg, discrepancy.length_deg, seen).evidence(discrepancy)


class Grams(NamedTuple):
    """X' N^-1 X of shoulders, N the noise of their coordinates: all that does not go by the sizes of curves."""

    of_shoulders: tuple["Gram", ...]
    amplitudes: int

    def evidence(self, discrepancy: Discrepancy) -> Evidence:
        """Give log p(positions, z) of each shoulder in z = (h, b, a_s, 1)."""
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
    """That of one shoulder: of its constants and curves; what all have in common, and its curves; amplitudes and 1."""

    matrix: Float[np.ndarray, "z z"]
    size: Int[np.ndarray, " z"]
    """Which of 1 and ``_SIZES`` each goes by."""
    of_person: int
    """How many are the person's, the first."""
    log_determinant: float
    """Of N."""


_SIZES = ("people", "own_mm", "own_turn_deg", "common_mm", "common_turn_deg")
"""Of constants, and of curves."""


def sizes_of_curves(discrepancy: Discrepancy) -> Float[np.ndarray, " sizes"]:
    """Give 1 and ``_SIZES``."""
    return np.array([1.0, *(getattr(discrepancy, name) for name in _SIZES)])


def position_grams(
    rows: PositionRows,
    shoulders: Shoulders,
    noise_deg: float,
    length_deg: float,
    seen: Bool[np.ndarray, " rows"] | None = None,
) -> Grams:
    """Make all rows white, or those that are seen."""
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
    """Give the rows of each shoulder that are seen, all by default, and their Gram, with more columns at last."""
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
    """Lay out curves of every coordinate, and of every angle."""
    n, count = rows.values_mm.shape[1], len(own)
    of_places = np.einsum("rk,nm->rnmk", curves, np.eye(n)).reshape(count, n, -1)
    of_turns = np.einsum("rk,rni->rnik", curves, rows.by_angle[own]).reshape(count, n, -1)
    return [of_places, of_turns]


def _white(
    rows: PositionRows, noise_deg: float, own: Int[np.ndarray, " own"], columns: Float[np.ndarray, "own n z"]
) -> tuple[Float[np.ndarray, "numbers z"], float]:
    """Make the coordinates of each posture white, and give the log determinant of their noise; a cell that was not
    measured is apart, with the variance 1."""
    known = rows.measured[own]
    by_angle = np.where(known[..., None], noise_deg * rows.by_angle[own], 0.0)
    covariance = by_angle @ np.swapaxes(by_angle, 1, 2)
    both = known[..., None] & known[:, None]
    covariance += np.where(both, rows.noise_mm**2 * rows.of_noise[own], np.eye(known.shape[1]))
    root = np.linalg.cholesky(covariance)
    white = np.linalg.inv(root) @ np.where(known[..., None], columns, 0.0)
    return white.reshape(-1, columns.shape[2]), 2.0 * float(np.log(np.einsum("rnn->rn", root)).sum())


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
