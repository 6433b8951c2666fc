"""Gaussian model of y, theta, the effect amplitudes and the measured positions (``fit.evidence``)."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.discrepancy import Discrepancy, Whitening, common_curves, whitening
from adapt.diagnosis.fit.evidence import Evidence, without
from adapt.diagnosis.fit.joint_fit import JointFit, Model
from adapt.diagnosis.fit.positions.position_evidence import position_evidence
from adapt.diagnosis.fit.positions.shown_noise import ShownNoise, shown_noise
from models.adapted_parameters import ADAPTED
from models.girdle import CONSTRAINTS

_N, _C = len(ADAPTED), len(CONSTRAINTS)


@dataclass(frozen=True)
class Likelihood:
    """Linear Gaussian model of y, theta and the amplitudes of every shoulder."""

    model: Model
    whitening: Whitening
    between: float
    """SD of a_s about a, relative to the prior SD."""
    positions: Evidence | None = None
    """Log density of the measured positions as a function of all amplitudes."""
    shown: ShownNoise | None = None
    """Noise of y that the measured positions show."""

    @staticmethod
    def of(
        joint: JointFit,
        discrepancy: Discrepancy,
        seen: Bool[np.ndarray, " rows"] | None = None,
    ) -> "Likelihood":
        """Factor the covariance of the unexplained part, of all rows or of those where ``seen`` is True."""
        white = whitening(joint.shoulders, discrepancy, common_curves(joint.shoulders, discrepancy), seen)
        rows, positions, shown = joint.positions, None, None
        if rows:
            positions = position_evidence(rows, joint.shoulders, discrepancy, seen)
            shown = shown_noise(rows, joint.shoulders, discrepancy, seen)
        white = white.without(shown.known) if shown else white
        return Likelihood(joint.model, white, discrepancy.between_shoulders, positions, shown)

    @property
    def shared(self) -> int:
        """Number of shared factors h and b."""
        return _N + self._whitened.blocks * self.whitening.curves[0].shape[1]

    @cached_property
    def sd_mm(self) -> Float[np.ndarray, "subjects adapted"]:
        """SD of each person's adapted parameters about the parameter set."""
        return np.asarray(self.model.sets.person_sd_mm).T

    @cached_property
    def _whitened(self) -> "_SideBySide":
        """Whitening of all shoulders as padded arrays."""
        white, most = self.whitening, max(map(len, self.whitening.rows))
        together = max(map(len, white.inverse_root)) // most
        first, place = 0, np.zeros((len(white.rows), most), int)
        root = np.zeros((len(place), together * most, together * most))
        curves = np.zeros((len(place), together * most, white.curves[0].shape[1]))
        for subject, own in enumerate(white.rows):
            place[subject], place[subject, : len(own)] = first, np.arange(first, first + len(own))
            some = (most * np.arange(together)[:, None] + np.arange(len(own))).ravel()
            root[subject, some[:, None], some] = white.inverse_root[subject]
            curves[subject, some] = white.curves[subject]
            first += len(own)
        return _SideBySide(place, root, curves, _C // together)

    def values(
        self,
        y: Float[np.ndarray, "groups rows 3"],
        theta_mm: Float[np.ndarray, "groups subjects adapted"],
        f: Float[np.ndarray, "groups factors"],
    ) -> tuple[Float[np.ndarray, "groups subjects blocks m"], Float[np.ndarray, "groups subjects adapted"]]:
        """Compute the whitened residuals of every shoulder at f = (h, b): of its rows, and of theta about h.

        ``y``: all rows of one shoulder, then of the next.
        """
        at, (h, b) = self._whitened, np.split(f[:, None], [_N], axis=2)
        common = at.curves[:, None] @ b.reshape(len(f), 1, at.blocks, -1, 1)
        return (at.white(y[..., None]) + common)[..., 0], (theta_mm - self.model.theta_mm) / self.sd_mm - h

    def quadratic(
        self,
        y: Float[np.ndarray, "groups rows 3"],
        slopes: Float[np.ndarray, "groups rows 3 n"],
        theta_mm: Float[np.ndarray, "groups subjects adapted"],
        f: Float[np.ndarray, "groups factors"],
    ) -> Float[np.ndarray, "groups subjects m m"]:
        """Compute M of -2 log p = z'Mz of every shoulder, z = (changes of theta, h, b and other variables, 1).

        ``slopes``: derivatives of y with respect to theta, and then to the other variables.
        """
        at, (white, prior) = self._whitened, self.values(y, theta_mm, f)
        (groups, subjects, *_), n, end = white.shape, slopes.shape[3], _N + self.shared
        own = np.concatenate([at.white(slopes), white[..., None]], axis=4)
        flat = own.reshape(groups, subjects, -1, n + 1)
        across = np.swapaxes(at.curves, 1, 2)
        M = np.zeros((groups, subjects, self.shared + n + 1, self.shared + n + 1))
        which = np.append(np.arange(_N), np.arange(end, end + n + 1 - _N))
        M[:, :, which[:, None], which] = np.swapaxes(flat, 2, 3) @ flat
        of_curves = across[:, None] @ own
        for k, place in enumerate(np.split(np.arange(2 * _N, end), at.blocks)):
            M[:, :, place[:, None], place] = across @ at.curves
            M[:, :, place[:, None], which] = of_curves[:, :, k]
            M[:, :, which[:, None], place] = np.swapaxes(of_curves[:, :, k], 2, 3)
        self._add_prior(M, prior)
        return M

    def _add_prior(
        self, M: Float[np.ndarray, "groups subjects m m"], prior: Float[np.ndarray, "groups subjects adapted"]
    ) -> None:
        """Add the prior of theta about the common shift h: the square of ``prior`` + theta / SD - h."""
        theta, h, precision = np.arange(_N), np.arange(_N, 2 * _N), 1.0 / self.sd_mm
        M[..., theta, theta] += precision**2
        M[..., h, h] += 1.0
        M[..., -1, -1] += (prior**2).sum(axis=-1)
        beside = (theta, h, -precision), (theta, -1, precision * prior), (h, -1, -prior)
        for one, other, product in beside:
            M[..., one, other] += product
            M[..., other, one] += product

    def evidence(
        self,
        theta_mm: Float[np.ndarray, "subjects adapted"],
        y: Float[np.ndarray, "rows 3"],
        Z: Float[np.ndarray, "rows 3 n"],
        where: Int[np.ndarray, " some"],
        here: Float[np.ndarray, " some"],
    ) -> Evidence:
        """Integrate theta of every shoulder out.

        ``Z``: derivatives of y with respect to theta and the amplitudes ``where``, whose values are ``here``.
        """
        rows, none = np.concatenate(self.whitening.rows), np.zeros((1, self.shared))
        if self.shown:
            added = self.shown.of(where)
            y = y + added @ np.append(here, 1.0)
            Z = np.concatenate([Z[..., :_N], Z[..., _N:] + added[..., :-1]], axis=2)
        (M,) = self.quadratic(y[None, rows], Z[None, rows], theta_mm[None], none)
        matrix, half_log = without(M, _N)
        constants = -0.5 * self.whitening.log_determinants - np.log(self.sd_mm).sum(axis=1) - half_log
        of_angles = Evidence(matrix, constants, self.shared, self.between)
        return of_angles.with_positions(self.positions.only(where), here) if self.positions else of_angles


class _SideBySide(NamedTuple):
    """Whitening of all shoulders. Shoulders with fewer rows than others are padded with rows of 0 at the end."""

    place: Int[np.ndarray, "subjects own"]
    """Index of each row among the rows of all shoulders; for padding, index of the shoulder's first row."""
    root: Float[np.ndarray, "subjects m m"]
    curves: Float[np.ndarray, "subjects m curves"]
    blocks: int
    """Number of blocks of constraints that are whitened together: three blocks of one, or one block of three."""

    def white(self, x: Float[np.ndarray, "groups rows 3 n"]) -> Float[np.ndarray, "groups subjects blocks m n"]:
        """Whiten the rows."""
        own = np.moveaxis(x[:, self.place], 3, 2)
        return self.root[:, None] @ own.reshape(*own.shape[:2], self.blocks, -1, own.shape[4])
