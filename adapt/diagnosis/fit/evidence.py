"""The evidence of sets of causes in the linear model around one fit: everything but the amplitudes integrated out.

    y = -(noise + discrepancy),   theta_s = set + SD (h + u_s),   a ~ N(mean, scale^2)

y is that of ``extended.nearest_posture`` at theta of each shoulder and the amplitudes a of the causes. SD is that of a
person about the set, h and u_s are N(0, 1): all persons may differ from the set in one direction, as it is one person
too. The discrepancy is the Gaussian process of ``fit.discrepancy``; what shoulders have in common of it is curves with
factors b ~ N(0, 1).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.discrepancy import Whitening
from adapt.diagnosis.fit.joint_fit import Model
from models.adapted_parameters import ADAPTED
from models.girdle import CONSTRAINTS

_N, _C = len(ADAPTED), len(CONSTRAINTS)


class Given(NamedTuple):
    """A set of causes, in the linear model."""

    log_evidence: float
    amplitude: Float[np.ndarray, " own"]
    """Where the posterior is highest."""
    root: Float[np.ndarray, "own own"]
    """L of its precision L L'."""


class Evidence(NamedTuple):
    """log p(data, a) = constant - g'd - d'A d / 2 of a = here + d, the prior of a left out."""

    matrix: Float[np.ndarray, "every every"]
    gradient: Float[np.ndarray, " every"]
    constant: float

    def given(
        self,
        where: Int[np.ndarray, " own"],
        here: Float[np.ndarray, " own"],
        mean: Float[np.ndarray, " own"],
        scale: Float[np.ndarray, " own"],
    ) -> Given:
        """Integrate the amplitudes ``where`` over their prior; the others stay."""
        off = (here - mean) / scale
        root = np.linalg.cholesky(self.matrix[np.ix_(where, where)] * np.outer(scale, scale) + np.eye(len(where)))
        down = np.linalg.solve(root, self.gradient[where] * scale + off)
        log_evidence = self.constant - 0.5 * off @ off + 0.5 * down @ down - np.log(np.diag(root)).sum()
        return Given(float(log_evidence), here - scale * np.linalg.solve(root.T, down), root / scale[:, None])


@dataclass(frozen=True)
class Likelihood:
    """What is believed of y and theta of every shoulder."""

    model: Model
    whitening: Whitening

    @property
    def shared(self) -> int:
        """How many of h and b there are."""
        return _N + _C * self.whitening.curves[0].shape[1]

    @property
    def sd_mm(self) -> Float[np.ndarray, "subjects adapted"]:
        """SD of each person about its set."""
        return self.model.sets.person_sd_mm.T

    def columns(
        self,
        subject: int,
        slopes: Float[np.ndarray, "groups own 3 n"],
        y: Float[np.ndarray, "groups own 3"],
        theta_mm: Float[np.ndarray, "groups adapted"],
    ) -> Float[np.ndarray, "groups k m"]:
        """Lay out what is white of a shoulder: its rows, and theta less what persons have in common.

        Columns: slopes in theta; in h and b; the other slopes; last the values themselves, where h = b = 0.
        """
        groups, own, _, n = slopes.shape
        curves, sd, end = self.whitening.curves[subject], self.sd_mm[subject], _N + self.shared
        extended = np.concatenate([slopes, y[..., None]], axis=3).reshape(groups, own, -1)
        white = (self.whitening.inverse_root[subject] @ extended).reshape(groups, own, _C, n + 1)
        found = np.zeros((groups, own * _C + _N, n + self.shared + 1))
        rows = found[:, : own * _C].reshape(groups, own, _C, -1)
        rows[..., :_N], rows[..., end:] = white[..., :_N], white[..., _N:]
        for k, place in enumerate(np.split(np.arange(2 * _N, end), _C)):
            rows[:, :, k, place] = curves
        prior = found[:, own * _C :]
        prior[..., :_N], prior[..., _N : 2 * _N] = np.diag(1.0 / sd), -np.eye(_N)
        prior[..., -1] = (theta_mm - self.model.theta_mm[subject]) / sd
        return found

    def evidence(
        self,
        theta_mm: Float[np.ndarray, "subjects adapted"],
        y: Float[np.ndarray, "rows 3"],
        Z: Float[np.ndarray, "rows 3 n"],
    ) -> Evidence:
        """Integrate theta of every shoulder, h and b out; Z is dy in theta and in all amplitudes."""
        constant = -0.5 * self.whitening.log_determinant - np.log(self.sd_mm).sum()
        total = np.diag(np.append(np.ones(self.shared), np.zeros(Z.shape[2] - _N + 1)))
        for subject, rows in enumerate(self.whitening.rows):
            (columns,) = self.columns(subject, Z[None, rows], y[None, rows], theta_mm[None, subject])
            rest, log_root = _without(columns.T @ columns, _N)
            total += rest
            constant -= log_root
        rest, log_root = _without(total, self.shared)
        return Evidence(rest[:-1, :-1], rest[:-1, -1], float(constant - log_root - 0.5 * rest[-1, -1]))


def _without(matrix: Float[np.ndarray, "n n"], first: int) -> tuple[Float[np.ndarray, "m m"], float]:
    """Eliminate the first variables of a quadratic: the Schur complement, and half the log determinant of theirs."""
    root = np.linalg.cholesky(matrix[:first, :first])
    across = np.linalg.solve(root, matrix[:first, first:])
    return matrix[first:, first:] - across.T @ across, float(np.log(np.diag(root)).sum())
