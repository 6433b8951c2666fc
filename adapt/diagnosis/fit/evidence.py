"""The evidence of sets of causes in the linear model around one fit: everything but the amplitudes integrated out.

    y = -(noise + discrepancy),   theta_s = set + SD (h + u_s),   a_s = a + between scale v_s,   a ~ N(mean, scale^2)

y is that of ``projection.nearest_posture`` at theta_s and the amplitudes a_s of each shoulder s. SD is that of a person
about the set, h and u_s are N(0, 1): all persons may differ from the set in one direction, as it is one person too.
A cause acts alike on all shoulders, but not the same: v_s are N(0, 1). The discrepancy is the Gaussian process of
``fit.discrepancy``; what shoulders have in common of it is curves with factors b ~ N(0, 1).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int


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
        return self.mean + self.scale * highest(root)[own], root[own, own] / self.scale[:, None]

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
    between: float | Float[np.ndarray, " own"]
    """SD of a_s about a, of the prior SD: of all amplitudes, or of each that is given."""

    def with_positions(self, other: "Evidence", here: Float[np.ndarray, " every"]) -> "Evidence":
        """Add what positions say, which is in a_s and not in a_s - here."""
        f, k = other.shared, len(here)
        shift = np.eye(f + k + 1)
        shift[f:-1, -1] = here
        n = self.shared + f
        matrix = np.zeros((len(self.matrix), n + k + 1, n + k + 1))
        for place, added in (
            (np.r_[: self.shared, n : n + k + 1], self.matrix),
            (np.r_[self.shared : n + k + 1], shift.T @ other.matrix @ shift),
        ):
            matrix[:, place[:, None], place] += added
        return Evidence(matrix, self.constants + other.constants, n, self.between)

    def only(self, where: Int[np.ndarray, " own"]) -> "Evidence":
        """Take some of the amplitudes; the others are 0."""
        kept = np.concatenate([np.arange(self.shared), self.shared + where, [-1]])
        return self._replace(matrix=self.matrix[:, kept[:, None], kept])

    def of(self, shoulders: np.ndarray) -> "Evidence":
        """Take these shoulders."""
        return self._replace(matrix=self.matrix[shoulders], constants=self.constants[shoulders])

    def of_amplitudes(
        self, mean: Float[np.ndarray, " own"], scale: Float[np.ndarray, " own"]
    ) -> Float[np.ndarray, "own+1 own+1"]:
        """Integrate all but a: Q of -2 log p(data, a) = (a, 1)' Q (a, 1) + a constant, without the prior of a; a_s is
        absolute."""
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
        rest, log_root = without(matrix, k)
        constants = self.constants - log_root
        root, log_integral = _integrated(rest.sum(axis=0))
        z = highest(root)
        log_evidence, a = float(constants.sum() + log_integral), mean + scale * z[f:]
        return Given(log_evidence, a, np.append(z, 1.0), matrix, mean, scale, here, sd, rest, constants)


def highest(root: Float[np.ndarray, "m m"]) -> Float[np.ndarray, " n"]:
    """Find where a quadratic in some variables and 1 is highest, by its L."""
    return -np.linalg.solve(root[:-1, :-1].T, root[-1, :-1])


def _integrated(total: Float[np.ndarray, "*draws m m"]) -> tuple[np.ndarray, np.ndarray]:
    """Integrate all but the 1 of a quadratic over their priors: L of the sum, and the logarithm of the integral."""
    root = np.linalg.cholesky(total + np.diag(np.append(np.ones(total.shape[-1] - 1), 0.0)))
    diagonal = np.diagonal(root, axis1=-2, axis2=-1)
    return root, -np.log(diagonal[..., :-1]).sum(axis=-1) - 0.5 * diagonal[..., -1] ** 2


def without(matrix: Float[np.ndarray, "*shoulders n n"], first: int) -> tuple[np.ndarray, np.ndarray]:
    """Eliminate the first variables of a quadratic: the Schur complement, and half the log determinant of theirs."""
    root = np.linalg.cholesky(matrix[..., :first, :first])
    across = np.linalg.solve(root, matrix[..., :first, first:])
    half_log = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
    return matrix[..., first:, first:] - np.swapaxes(across, -1, -2) @ across, half_log
