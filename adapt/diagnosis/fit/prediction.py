"""What any hypothesis would predict of unseen postures, by linear algebra around one exact fit.

At the fit of a hypothesis to everything, y of every row is linear in the adapted parameters and in the amplitudes of
all candidates. A fold leaves the normal equations of its rows out, so that every fold of every further hypothesis
costs a few small matrices. Within 5 % of the exact refit in most folds of six measured shoulders, 14 % at worst.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.joint_fit import Fitted, JointFit
from adapt.diagnosis.fit.unseen_folds import Folds
from adapt.solvers.extended.arrow_step import Quadratic, lowest
from adapt.solvers.extended.thorax_term import ThoraxPart
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)


_ENOUGH = 0.02
"""Decrease of E + prior at which an adaptation ends: its prediction is linear in what is left."""


class Predicted(NamedTuple):
    """A hypothesis at the folds."""

    amplitude: Float[np.ndarray, "groups own"]
    """Of group 0 with everything in, then of every fold."""
    theta_mm: Float[np.ndarray, "parts adapted"]
    gaps_deg: Float[np.ndarray, "tests 6"]
    """Mean |simulated - measured| of each angle; NaN of one that was not measured."""


@dataclass(frozen=True)
class Linearised:
    """The rows around one fit of everything."""

    joint: JointFit
    folds: Folds
    hypothesis: tuple[str, ...]
    fitted: Fitted
    y: Float[np.ndarray, "rows 3"]
    Z: Float[np.ndarray, "rows 3 n"]
    """dy in the adapted parameters and in the amplitudes of all candidates."""
    B: Float[np.ndarray, "rows 3 6"]
    products: Float[np.ndarray, "cells m m"]
    """2 w (Z y)'(Z y) of the rows of each subject that are held out together; m = n + 1."""
    shares: Float[np.ndarray, "parts cells"]
    """1 over the rows of the part where it has those of the cell, else 0."""
    thorax: ThoraxPart
    """Of every subject."""

    def amplitudes(self, hypothesis: Sequence[str]) -> Float[np.ndarray, " own"]:
        """Give the amplitudes of a hypothesis here: 0 of what is not in the fit."""
        every = np.zeros(len(self.joint.candidates.scale))
        every[self.joint.candidates.where(self.hypothesis)] = self.fitted.amplitude[0]
        return every[self.joint.candidates.where(hypothesis)]

    def normal_equations(self, where: Int[np.ndarray, " own"]) -> tuple[np.ndarray, np.ndarray]:
        """Give gradient and matrix of E of every part in its adapted parameters and in these amplitudes."""
        chosen = np.concatenate([np.arange(_N), _N + where, [-1]])
        every = np.tensordot(self.shares, self.products[:, chosen[:, None], chosen], axes=1)
        gradient, matrix = every[:, :-1, -1], every[:, :-1, :-1]
        gradient[:, :_N] += self.thorax.gradient[self.folds.arrays.subject]
        matrix[:, :_N, :_N] += self.thorax.matrix[self.folds.arrays.subject]
        return gradient, matrix

    def predict(self, hypothesis: Sequence[str]) -> Predicted:
        """Predict every fold under a hypothesis that has the one of the fit in it."""
        joint = self.joint
        where = joint.candidates.where(hypothesis)
        scale, mean, now = joint.candidates.scale[where], joint.candidates.mean[where], self.amplitudes(hypothesis)
        subject, group, importance = self.folds.arrays
        theta = self.fitted.theta_mm[subject]
        lower, upper = joint.model.bounds_mm[:, subject]
        groups = int(group[-1]) + 1
        quadratic = Quadratic(*self.normal_equations(where), importance, group)
        prior_gradient = np.broadcast_to(2.0 * (now - mean) / scale**2, (groups, len(where)))
        step = lowest(quadratic, groups, prior_gradient, np.diag(2.0 / scale**2)[None], (lower - theta, upper - theta))
        part = self.folds.part[self.folds.test_of]
        rows = self.folds.rows
        y = self.y[rows] + np.einsum("rij,rj->ri", self.Z[rows][..., :_N], step.theta[part])
        if len(where):
            y = y + np.einsum("rij,rj->ri", self.Z[rows][..., _N + where], step.amplitude[group[part]])
        gaps = np.abs(np.einsum("rij,ri->rj", self.B[rows], y))
        return Predicted(
            now + step.amplitude,
            theta + step.theta,
            self.folds.measured_means(gaps, joint.shoulders),
        )


def linearise(joint: JointFit, folds: Folds, hypothesis: Sequence[str], fitted: Fitted) -> Linearised:
    """Linearise around the fit of all postures (``joint`` has everybody's parts, one group)."""
    candidates, shoulders = joint.candidates, joint.shoulders
    near = joint.nearest(hypothesis, fitted)
    order = np.argsort(joint.rows)
    rows_first = (np.moveaxis(x, -1, 0) for x in (near.y, near.by_theta, near.by_channel, near.B))
    y, by_theta, by_channel, B = (x[order] for x in rows_first)
    Z = np.concatenate([by_theta, candidates.by_amplitude(by_channel)], axis=2)
    root = np.sqrt(2.0 * joint.model.weight * shoulders.weights)
    extended = np.concatenate([Z, y[:, :, None]], axis=2) * root[:, None, None]
    label = _labels(folds, len(shoulders.subject))
    cell = shoulders.subject * (label.max() + 2) + label
    cells = np.unique(cell)
    shares = [np.isin(cells, cell[part.rows]) / len(part.rows) for part in folds.parts]
    return Linearised(
        joint,
        folds,
        tuple(hypothesis),
        fitted,
        y,
        Z,
        B,
        np.array([_product(extended[cell == one]) for one in cells]),
        np.array(shares),
        joint.model.thorax(joint.arrays.subject)(fitted.theta_mm),
    )


def _product(rows: Float[np.ndarray, "some 3 n"]) -> Float[np.ndarray, "n n"]:
    flat = rows.reshape(-1, rows.shape[2])
    return flat.T @ flat


def _labels(folds: Folds, rows: int) -> Int[np.ndarray, " rows"]:
    """What is held out together with each row; of a row that no fold holds out, -1."""
    label = np.full(rows, -1)
    for test in folds.tests:
        label[test.rows] = test.motion
    return label


class Adaptation(NamedTuple):
    """A hypothesis fitted to all postures as `girdle adapt` does, and what it predicts of unseen ones."""

    hypothesis: Hypothesis
    fitted: Fitted
    linearised: Linearised
    predicted: Predicted


def adaptation(
    joint: JointFit, folds: Folds, hypothesis: Hypothesis, start: tuple[np.ndarray, np.ndarray] | None
) -> Adaptation:
    """Adapt all subjects, from these parameters and amplitudes; from every start of `girdle adapt` without them."""
    fitted = joint.from_starts() if start is None else joint.fit(hypothesis, start[0], start[1][None], _ENOUGH)
    linearised = linearise(joint, folds, hypothesis, fitted)
    return Adaptation(hypothesis, fitted, linearised, linearised.predict(hypothesis))
