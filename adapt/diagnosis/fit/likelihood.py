"""What is believed of y, theta, the amplitudes and measured positions: a linear Gaussian model (``fit.evidence``)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.discrepancy import Discrepancy, Whitening, whitening
from adapt.diagnosis.fit.evidence import Evidence, without
from adapt.diagnosis.fit.joint_fit import JointFit, Model
from adapt.diagnosis.fit.positions.position_evidence import Grams, position_grams
from models.adapted_parameters import ADAPTED
from models.girdle import CONSTRAINTS

_N, _C = len(ADAPTED), len(CONSTRAINTS)


@dataclass(frozen=True)
class Likelihood:
    """What is believed of y, theta and the amplitudes of every shoulder."""

    model: Model
    whitening: Whitening
    between: float
    """SD of a_s about a, of the prior SD."""
    positions: Evidence | None
    """What measured positions say of all amplitudes."""

    @staticmethod
    def of(
        joint: JointFit,
        discrepancy: Discrepancy,
        seen: Bool[np.ndarray, " rows"] | None = None,
        grams: Callable[[float, float], Grams] | None = None,
    ) -> "Likelihood":
        """Factor what no cause explains, of all rows or of those that are seen; ``grams`` keeps what positions need."""
        rows, shoulders = joint.positions, joint.shoulders
        positions = None
        if rows:
            grams = grams or partial(position_grams, rows, shoulders, seen=seen)
            positions = grams(discrepancy.noise_deg, discrepancy.length_deg).evidence(discrepancy)
        return Likelihood(
            joint.model,
            whitening(shoulders, discrepancy, seen),
            discrepancy.between_shoulders,
            positions,
        )

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
        where: Int[np.ndarray, " some"],
        here: Float[np.ndarray, " some"],
    ) -> Evidence:
        """Integrate theta of every shoulder out; Z is dy in theta and in the amplitudes ``where``, which are ``here``
        in it."""
        constants = -0.5 * self.whitening.log_determinants - np.log(self.sd_mm).sum(axis=1)
        found = []
        for subject, rows in enumerate(self.whitening.rows):
            values = self.values(subject, y[None, rows], theta_mm[None, subject], np.zeros((1, self.shared)))
            (columns,) = np.concatenate([self.columns(subject, Z[None, rows]), values[..., None]], axis=2)
            rest, log_root = without(columns.T @ columns, _N)
            found.append(rest)
            constants[subject] -= log_root
        of_angles = Evidence(np.array(found), constants, self.shared, self.between)
        return of_angles.with_positions(self.positions.only(where), here) if self.positions else of_angles
