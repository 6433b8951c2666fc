"""Evidence of sets of causes in the linear model around one fit.

    y = -(noise + discrepancy),   theta_s = set + SD (h + u_s),   a_s = a + between scale v_s,   a ~ N(mean, scale^2)

The vector y is that of ``projection.nearest_posture`` at theta_s and the amplitudes a_s of each shoulder s. SD is the
standard deviation of a person about the parameter set. The factors h, u_s and v_s are N(0, 1): h lets all persons
differ from the set in one direction, as the set is one person too, and v_s lets a cause that acts alike on all
shoulders differ in size. The discrepancy is the Gaussian process of ``fit.discrepancy``; the part of it that shoulders
have in common consists of curves with factors b ~ N(0, 1).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True)
class Given:
    """One set of causes in the linear model, with its evidence and the posterior of its amplitudes."""

    of_own: tuple[Float[np.ndarray, "subjects own own"], Float[np.ndarray, "subjects own every"]]
    """Matrix of e_s of every shoulder, and matrix of e_s with h, b, x (``Evidence.given``) and 1."""
    mean: Float[np.ndarray, " own"]
    scale: Float[np.ndarray, " own"]
    """SD of the prior of a, whose mean is ``mean``."""
    here: Float[np.ndarray, " own"]
    sd: Float[np.ndarray, " own"]
    """SD of a_s about a."""
    before: Float[np.ndarray, "subjects m m"]
    """Quadratic form of every shoulder in h, b, x and 1, where e_s is 0."""
    across: Float[np.ndarray, "subjects own m"]
    """Whitened matrix of e_s with h, b, x and 1: integrating e_s out subtracts across' across from ``before``."""
    constants: Float[np.ndarray, " subjects"]
    """Terms of the log evidence of every shoulder that do not depend on h, b and x."""

    @cached_property
    def rest(self) -> Float[np.ndarray, "subjects m m"]:
        """Quadratic form of every shoulder with e_s integrated out."""
        return self.before - np.swapaxes(self.across, 1, 2) @ self.across

    @cached_property
    def _of_all(self) -> tuple[np.ndarray, np.ndarray]:
        """Cholesky factor L of the sum over all shoulders, and the logarithm of the integral over h, b and x."""
        flat = self.across.reshape(-1, self.across.shape[2])
        return _integrated(self.before.sum(axis=0) - flat.T @ flat)

    @property
    def log_evidence(self) -> float:
        """Log evidence of all shoulders."""
        return float(self.constants.sum() + self._of_all[1])

    @cached_property
    def amplitude(self) -> Float[np.ndarray, " own"]:
        """Posterior mode of a."""
        z = highest(self._of_all[0])
        return self.mean + self.scale * z[len(z) - len(self.scale) :]

    def resampled(self, times: Float[np.ndarray, "draws subjects"]) -> Float[np.ndarray, " draws"]:
        """Compute the log evidence with weighted shoulders, for every draw of weights ``times``."""
        return times @ self.constants + _integrated(np.tensordot(times, self.rest, 1))[1]

    def amplitude_of(
        self, times: Float[np.ndarray, " subjects"]
    ) -> tuple[Float[np.ndarray, " own"], Float[np.ndarray, "own own"]]:
        """Compute the posterior mode of a with weighted shoulders, and L of the posterior precision L L'."""
        root, _ = _integrated(np.tensordot(times, self.rest, 1))
        n = len(root) - 1
        own = slice(n - len(self.scale), n)
        return self.mean + self.scale * highest(root)[own], root[own, own] / self.scale[:, None]

    @property
    def of_shoulders(self) -> Float[np.ndarray, "subjects own"]:
        """Posterior mode of a_s of every shoulder."""
        H, W = self.of_own
        e = -np.linalg.solve(H, (W @ np.append(highest(self._of_all[0]), 1.0))[..., None])[..., 0]
        return self.here + self.sd * e


class Evidence(NamedTuple):
    """Log density of the data and z of each shoulder.

        log p(data, z) = constant - z'Mz / 2,   z = (h, b, a_s - here, 1)

    The parameters theta_s are integrated out.
    """

    matrix: Float[np.ndarray, "subjects n n"]
    constants: Float[np.ndarray, " subjects"]
    shared: int
    """Number of shared factors h and b."""
    between: float | Float[np.ndarray, " own"]
    """SD of a_s about a, relative to the prior SD: one for all amplitudes, or one per amplitude in ``given``."""

    def with_positions(self, other: "Evidence", here: Float[np.ndarray, " every"]) -> "Evidence":
        """Add the log density of positions, ``other``, whose z contains a_s in place of a_s - here."""
        f, k = other.shared, len(here)
        n, shifted = self.shared + f, other.matrix.copy()
        shifted[..., -1] += other.matrix[..., f:-1] @ here
        shifted[:, -1] += here @ shifted[:, f:-1]
        angles, both, last = slice(self.shared), slice(self.shared, None), slice(n, None)
        matrix = np.zeros((len(self.matrix), n + k + 1, n + k + 1))
        matrix[:, both, both] = shifted
        matrix[:, angles, angles] = self.matrix[:, angles, angles]
        matrix[:, angles, last] = self.matrix[:, angles, both]
        matrix[:, last, angles] = self.matrix[:, both, angles]
        matrix[:, last, last] += self.matrix[:, both, both]
        return Evidence(matrix, self.constants + other.constants, n, self.between)

    def only(self, where: Int[np.ndarray, " own"]) -> "Evidence":
        """Select some of the amplitudes; the others are 0."""
        kept = np.concatenate([np.arange(self.shared), self.shared + where, [-1]])
        return self._replace(matrix=self.matrix[:, kept[:, None], kept])

    def of(self, shoulders: np.ndarray) -> "Evidence":
        """Select these shoulders."""
        return self._replace(matrix=self.matrix[shoulders], constants=self.constants[shoulders])

    def of_amplitudes(
        self, mean: Float[np.ndarray, " own"], scale: Float[np.ndarray, " own"]
    ) -> Float[np.ndarray, "own+1 own+1"]:
        """Integrate out all but a: return Q of -2 log p(data, a) = (a, 1)' Q (a, 1) + constant, without the prior of a.

        The evidence must be in a_s itself (here = 0).
        """
        k = len(mean)
        rest = self.given(np.arange(k), np.zeros(k), mean, scale).rest.sum(axis=0)
        rest[: self.shared, : self.shared] += np.eye(self.shared)
        in_x, _ = without(rest, self.shared)
        x = np.diag(np.append(1.0 / scale, 1.0))
        x[:-1, -1] = -mean / scale
        return x.T @ in_x @ x

    def given(
        self,
        where: Int[np.ndarray, " own"],
        here: Float[np.ndarray, " own"],
        mean: Float[np.ndarray, " own"],
        scale: Float[np.ndarray, " own"],
    ) -> Given:
        """Integrate h, b and the amplitudes ``where`` over their priors; the other amplitudes stay as they are.

        With a_s = here + SD e_s, a = mean + scale x and SD = between scale, the prior N(0, 1) of

            v_s = e_s + (here - mean) / SD - x / between

        is the prior of e_s given x. The variables e_s are integrated out of each shoulder; h, b and x remain, common to
        all shoulders.
        """
        f, k, sd, m = self.shared, len(where), self.between * scale, (here - mean) / (self.between * scale)
        own, n = f + where, f + k  # n: number of h, b and x
        H = np.eye(k) + sd[:, None] * self.matrix[:, own[:, None], own] * sd
        W = np.empty((len(H), k, n + 1))  # matrix of e_s with h, b, x and 1
        W[..., :f] = sd[:, None] * self.matrix[:, own, :f]
        W[..., f:n] = -np.eye(k) / self.between
        W[..., n] = sd * self.matrix[:, own, -1] + m
        before = np.zeros((len(H), n + 1, n + 1))
        before[:, :f, :f], before[:, :f, n], before[:, n, :f] = self.matrix[:, :f, :f], *(2 * [self.matrix[:, :f, -1]])
        before[:, f:n, f:n] = np.eye(k) / self.between**2
        before[:, f:n, n] = before[:, n, f:n] = -m / self.between
        before[:, n, n] = self.matrix[:, -1, -1] + m @ m
        root = np.linalg.cholesky(H)
        constants = self.constants - np.log(np.einsum("sii->si", root)).sum(axis=1)
        return Given((H, W), mean, scale, here, sd, before, np.linalg.solve(root, W), constants)


def highest(root: Float[np.ndarray, "m m"]) -> Float[np.ndarray, " n"]:
    """Find the mode of a Gaussian density from the Cholesky factor L of its quadratic form in some variables and 1."""
    return -np.linalg.solve(root[:-1, :-1].T, root[-1, :-1])


def _integrated(total: Float[np.ndarray, "*draws m m"]) -> tuple[np.ndarray, np.ndarray]:
    """Integrate out all variables of a quadratic form but the 1, with their priors: return L, and the log integral."""
    root = np.linalg.cholesky(total + np.diag(np.append(np.ones(total.shape[-1] - 1), 0.0)))
    diagonal = np.diagonal(root, axis1=-2, axis2=-1)
    return root, -np.log(diagonal[..., :-1]).sum(axis=-1) - 0.5 * diagonal[..., -1] ** 2


def without(matrix: Float[np.ndarray, "*shoulders n n"], first: int) -> tuple[np.ndarray, np.ndarray]:
    """Eliminate the first variables of a quadratic form: Schur complement, and half the log determinant of their
    block."""
    from scipy.linalg import solve_triangular  # takes 0.3 s to load, and not every command needs it

    root, beside = np.linalg.cholesky(matrix[..., :first, :first]), matrix[..., :first, first:]
    flat = zip(root.reshape(-1, first, first), beside.reshape(-1, *beside.shape[-2:]), strict=True)
    across = np.reshape([solve_triangular(*one, lower=True, check_finite=False) for one in flat], beside.shape)
    half_log = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
    return matrix[..., first:, first:] - np.swapaxes(across, -1, -2) @ across, half_log
