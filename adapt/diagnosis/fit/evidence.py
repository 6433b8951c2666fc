"""The evidence of sets of causes in the linear model around one fit: everything but the amplitudes integrated out.

    y = -(noise + discrepancy),   theta_s = set + SD (h + u_s),   a_s = a + between scale v_s,   a ~ N(mean, scale^2)

y is that of ``projection.nearest_posture`` at theta_s and the amplitudes a_s of each shoulder s. SD is that of a person
about the set, h and u_s are N(0, 1): all persons may differ from the set in one direction, as it is one person too.
A cause acts alike on all shoulders, but not the same: v_s are N(0, 1). The discrepancy is the Gaussian process of
``fit.discrepancy``; what shoulders have in common of it is curves with factors b ~ N(0, 1).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.discrepancy import Discrepancy, Whitening, whitening
from adapt.diagnosis.fit.joint_fit import Model
from adapt.diagnosis.fit.shoulders import Shoulders
from models.adapted_parameters import ADAPTED
from models.girdle import CONSTRAINTS

_N, _C = len(ADAPTED), len(CONSTRAINTS)


class Given(NamedTuple):
    """A set of causes, in the linear model."""

    log_evidence: float
    amplitude: Float[np.ndarray, " own"]
    """a, where its posterior is highest."""
    of_all: Float[np.ndarray, " every"]
    """h, b, x (``Evidence.given``) and 1 there."""
    matrix: Float[np.ndarray, "subjects n n"]
    """Of every shoulder, in e_s and of_all."""
    mean: Float[np.ndarray, " own"]
    scale: Float[np.ndarray, " own"]
    """Of the prior of a."""
    here: Float[np.ndarray, " own"]
    sd: Float[np.ndarray, " own"]
    """Of a_s about a."""
    rest: Float[np.ndarray, "subjects m m"]
    """Of every shoulder, in of_all: ``matrix`` with e_s integrated out."""
    constants: Float[np.ndarray, " subjects"]
    """What does not go by of_all, of the log evidence of every shoulder."""

    def resampled(self, times: Float[np.ndarray, "draws subjects"]) -> Float[np.ndarray, " draws"]:
        """Compute the log evidence of shoulders that count so much each."""
        return times @ self.constants + _integrated(np.tensordot(times, self.rest, 1))[1]

    def amplitude_of(
        self, times: Float[np.ndarray, " subjects"]
    ) -> tuple[Float[np.ndarray, " own"], Float[np.ndarray, "own own"]]:
        """Compute a of shoulders that count so much each, and L of the precision L L' of its posterior."""
        root, _ = _integrated(np.tensordot(times, self.rest, 1))
        n = len(root) - 1
        own = slice(n - len(self.scale), n)
        return self.mean + self.scale * _highest(root)[own], root[own, own] / self.scale[:, None]

    @property
    def of_shoulders(self) -> Float[np.ndarray, "subjects own"]:
        """Give a_s, where their posterior is highest."""
        k = len(self.sd)
        e = -np.linalg.solve(self.matrix[:, :k, :k], (self.matrix[:, :k, k:] @ self.of_all)[..., None])[..., 0]
        return self.here + self.sd * e


class Evidence(NamedTuple):
    """log p(data, z) of each shoulder: a constant - z'Mz / 2 of z = (h, b, a_s - here, 1), theta_s integrated out."""

    matrix: Float[np.ndarray, "subjects n n"]
    constants: Float[np.ndarray, " subjects"]
    shared: int
    """How many of h and b there are."""
    between: float
    """SD of a_s about a, of the prior SD."""

    def of(self, shoulders: np.ndarray) -> "Evidence":
        """Take these shoulders."""
        return self._replace(matrix=self.matrix[shoulders], constants=self.constants[shoulders])

    def given(
        self,
        where: Int[np.ndarray, " own"],
        here: Float[np.ndarray, " own"],
        mean: Float[np.ndarray, " own"],
        scale: Float[np.ndarray, " own"],
    ) -> Given:
        """Integrate h, b and the amplitudes ``where`` over their priors; the others stay.

        With a_s = here + SD e_s and a = mean + scale x, SD = between scale, v_s = e_s + (here - mean) / SD - x /
        between: that is the prior of e_s, which is integrated out of each shoulder. h, b and x of all are left.
        """
        k, f, sd = len(where), self.shared, self.between * scale
        n = f + k  # of h, b and x
        kept = np.concatenate([f + where, np.arange(f), [-1]])
        data = self.matrix[:, kept[:, None], kept]  # in a_s, h, b and 1
        data[:, :k] *= sd[:, None]
        data[:, :, :k] *= sd
        v = np.concatenate(
            [np.eye(k), np.zeros((k, f)), -np.eye(k) / self.between, ((here - mean) / sd)[:, None]], axis=1
        )
        matrix = np.tile(v.T @ v, (len(data), 1, 1))  # in e_s, h, b, x and 1
        others = np.append(np.arange(n), n + k)
        matrix[:, others[:, None], others] += data
        rest, log_root = _without(matrix, k)
        constants = self.constants - log_root
        root, log_integral = _integrated(rest.sum(axis=0))
        z = _highest(root)
        log_evidence, a = float(constants.sum() + log_integral), mean + scale * z[f:]
        return Given(log_evidence, a, np.append(z, 1.0), matrix, mean, scale, here, sd, rest, constants)


@dataclass(frozen=True)
class Likelihood:
    """What is believed of y, theta and the amplitudes of every shoulder."""

    model: Model
    whitening: Whitening
    between: float
    """SD of a_s about a, of the prior SD."""

    @staticmethod
    def of(
        model: Model, shoulders: Shoulders, discrepancy: Discrepancy, seen: Bool[np.ndarray, " rows"] | None = None
    ) -> "Likelihood":
        """Factor what no cause explains, of all rows or of those that are seen."""
        return Likelihood(model, whitening(shoulders, discrepancy, seen), discrepancy.between_shoulders)

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
    ) -> Float[np.ndarray, "groups k m"]:
        """Lay out the slopes of what is white of a shoulder (``values``): in theta; in h and b; the others."""
        groups, own, _, n = slopes.shape
        curves, sd, end = self.whitening.curves[subject], self.sd_mm[subject], _N + self.shared
        white = (self.whitening.inverse_root[subject] @ slopes.reshape(groups, own, _C * n)).reshape(slopes.shape)
        found = np.zeros((groups, own * _C + _N, n + self.shared))
        rows = found[:, : own * _C].reshape(groups, own, _C, n + self.shared)
        rows[..., :_N], rows[..., end:] = white[..., :_N], white[..., _N:]
        for k, place in enumerate(np.split(np.arange(2 * _N, end), _C)):
            rows[:, :, k, place] = curves
        prior = found[:, own * _C :]
        prior[..., :_N], prior[..., _N : 2 * _N] = np.diag(1.0 / sd), -np.eye(_N)
        return found

    def values(
        self,
        subject: int,
        y: Float[np.ndarray, "groups own 3"],
        theta_mm: Float[np.ndarray, "groups adapted"],
        f: Float[np.ndarray, "groups factors"],
    ) -> Float[np.ndarray, "groups k"]:
        """Compute what is white of a shoulder at f = (h, b): its rows, and theta less what persons have in common."""
        h, b = np.split(f, [_N], axis=1)
        common = self.whitening.curves[subject] @ np.swapaxes(b.reshape(len(b), _C, -1), 1, 2)
        rows = self.whitening.inverse_root[subject] @ y + common
        prior = (theta_mm - self.model.theta_mm[subject]) / self.sd_mm[subject] - h
        return np.concatenate([rows.reshape(len(b), _C * rows.shape[1]), prior], axis=1)

    def evidence(
        self,
        theta_mm: Float[np.ndarray, "subjects adapted"],
        y: Float[np.ndarray, "rows 3"],
        Z: Float[np.ndarray, "rows 3 n"],
    ) -> Evidence:
        """Integrate theta of every shoulder out; Z is dy in theta and in all amplitudes."""
        constants = -0.5 * self.whitening.log_determinants - np.log(self.sd_mm).sum(axis=1)
        found = []
        for subject, rows in enumerate(self.whitening.rows):
            values = self.values(subject, y[None, rows], theta_mm[None, subject], np.zeros((1, self.shared)))
            (columns,) = np.concatenate([self.columns(subject, Z[None, rows]), values[..., None]], axis=2)
            rest, log_root = _without(columns.T @ columns, _N)
            found.append(rest)
            constants[subject] -= log_root
        return Evidence(np.array(found), constants, self.shared, self.between)


def _highest(root: Float[np.ndarray, "m m"]) -> Float[np.ndarray, " n"]:
    """Find where a quadratic in some variables and 1 is highest, by its L."""
    return -np.linalg.solve(root[:-1, :-1].T, root[-1, :-1])


def _integrated(total: Float[np.ndarray, "*draws m m"]) -> tuple[np.ndarray, np.ndarray]:
    """Integrate all but the 1 of a quadratic over their priors: L of the sum, and the logarithm of the integral."""
    root = np.linalg.cholesky(total + np.diag(np.append(np.ones(total.shape[-1] - 1), 0.0)))
    diagonal = np.diagonal(root, axis1=-2, axis2=-1)
    return root, -np.log(diagonal[..., :-1]).sum(axis=-1) - 0.5 * diagonal[..., -1] ** 2


def _without(matrix: Float[np.ndarray, "*shoulders n n"], first: int) -> tuple[np.ndarray, np.ndarray]:
    """Eliminate the first variables of a quadratic: the Schur complement, and half the log determinant of theirs."""
    root = np.linalg.cholesky(matrix[..., :first, :first])
    across = np.linalg.solve(root, matrix[..., :first, first:])
    half_log = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
    return matrix[..., first:, first:] - np.swapaxes(across, -1, -2) @ across, half_log
