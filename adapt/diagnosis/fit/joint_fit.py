"""Joint fits of the diagnosis: subjects with sets of causes, on all or some of their postures, as one batch.

Each subject has the objective E of ``girdle adapt`` (thesis Eq. 6.5), with thorax down-weighting where the thorax
points are another person's (``Model.thorax_downweighting``); see ``adapt.solvers.projection.gauss_newton``. A problem
is one subject in one group; the problems of a group have one set of causes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.positions.position_rows import PositionRows
from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.engine.batching import take_problems
from adapt.solvers.objective import WEIGHT, down_weighted
from adapt.solvers.problems import Sets, sets_of
from adapt.solvers.projection.gauss_newton import End, Objective, minimise
from adapt.solvers.projection.grouped_problems import GroupedProblems, Shared
from adapt.solvers.projection.nearest_posture import Nearest
from adapt.solvers.projection.thorax_term import Thorax
from models.adapted_parameters import ADAPTED, STARTS_MM
from models.effects import Effect
from models.person.family import AnyModel, unique_sets
from models.person.thorax_ellipsoid import has_own_thorax

_N = len(ADAPTED)

_MOST_STEPS = 400
"""Maximum number of steps: fits of measured motions take 5 to 30, the hardest 60 to 300."""

SETTLED = 1e-4
"""Convergence tolerance: decrease of E + prior in a step, a thousandth of what one effect adds."""

THORAX_DOWNWEIGHTING = 30.0
"""Down-weighting K of thorax points of another person, which count 1/30 in E. With w = 10, chosen for such
points, the ellipsoid stays so close to another person's thorax that every candidate that releases the ellipsoid
predicts better, whatever is active. w = 300 predicts held-out motions of measured shoulders best, with every
parameter set (docs/research/trust.md)."""


class JointProblem(NamedTuple):
    """One subject in one group, with the rows that it is adapted to."""

    subject: int
    group: int
    rows: Int[np.ndarray, " chosen"]


@dataclass(frozen=True)
class Model:
    """Parameter set of each subject after its geometric fit, with the effects that may be active."""

    sets: Sets
    """Parameter sets in the order of the subjects; all subjects may have the same one."""
    effects: tuple[Effect, ...]
    thorax_downweighting: float = 1.0
    """Thorax down-weighting K: the thorax points count 1/K, so that w is K times as large."""

    @property
    def weight(self) -> float:
        """Weight w of E."""
        return down_weighted(WEIGHT, self.thorax_downweighting)

    @staticmethod
    def of(parameters: AnyModel, subjects: Sequence[str], effects: tuple[Effect, ...]) -> "Model":
        """Fit the ellipsoid of each parameter set to its thorax points: the starting point of every adaptation."""
        own = all(has_own_thorax(one) for one in unique_sets([parameters], subjects)[0])
        return Model(sets_of([parameters], subjects), effects, 1.0 if own else THORAX_DOWNWEIGHTING)

    @cached_property
    def theta_mm(self) -> Float[np.ndarray, "subjects adapted"]:
        """Adapted parameters as the parameter sets have them."""
        return np.asarray(self.sets.girdle.adapted_mm).T

    def thorax(self, subject: Int[np.ndarray, " problems"]) -> Thorax:
        """Return the thorax points of problems with these subjects."""
        girdle, points, weights = take_problems(
            (self.sets.girdle, self.sets.points_mm, self.sets.point_weights), subject
        )
        return Thorax(girdle, points, weights, np.zeros(weights.shape))


@dataclass(frozen=True)
class JointFit:
    """Joint fit of a model to subjects, with the candidates and the problems."""

    model: Model
    shoulders: Shoulders
    candidates: Candidates
    problems: tuple[JointProblem, ...]
    positions: PositionRows | None = None
    """Measured landmarks of all shoulders, where they are data of the fits."""

    @cached_property
    def rows(self) -> Int[np.ndarray, " every"]:
        """Row indices of all problems, one problem after the other."""
        return np.concatenate([problem.rows for problem in self.problems])

    @cached_property
    def subject(self) -> Int[np.ndarray, " problems"]:
        """Subject number of each problem."""
        return np.array([problem.subject for problem in self.problems])

    @cached_property
    def group(self) -> Int[np.ndarray, " problems"]:
        """Group number of each problem."""
        return np.array([problem.group for problem in self.problems])

    @property
    def groups(self) -> int:
        """Number of groups."""
        return self.problems[-1].group + 1

    @cached_property
    def _grouped(self) -> GroupedProblems:
        counts = np.array([len(problem.rows) for problem in self.problems])
        of_row = np.repeat(np.arange(len(counts)), counts)
        return GroupedProblems(
            girdle=take_problems(self.model.sets.girdle, self.subject),
            thorax=self.model.thorax(self.subject),
            bounds_mm=tuple(self.model.sets.bounds_mm[..., self.subject]),
            effects=self.model.effects,
            strengths=np.zeros((self.candidates.columns.shape[1], len(of_row))),
            angles=self.shoulders.angles[:, self.rows],
            measured=self.shoulders.measured[:, self.rows],
            weights=self.model.weight / counts[of_row] * self.shoulders.weights[self.rows],
            problem=of_row,
            group=self.group,
            strengths_are_known=True,  # slopes in the strengths come from with_whole_slopes
        )

    def _shared(self, hypotheses: Sequence[Hypothesis]) -> Shared:
        """Lay out the amplitudes of each group's hypothesis, padded with idle amplitudes to the largest hypothesis."""
        places = [self.candidates.where(one) for one in hypotheses]
        most, group_of_row = max(map(len, places)), self.group[self._grouped.problem]
        every, strengths = self.candidates.acting
        channels = np.zeros((len(every), most, self.groups), int)
        columns = np.zeros((len(every), most, len(self.rows)))
        scale, mean = np.ones((most, self.groups)), np.zeros((most, self.groups))
        for group, where in enumerate(places):
            at, own = np.flatnonzero(group_of_row == group), slice(len(where))
            channels[:, own, group] = every[:, where]
            columns[:, own, at[0] : at[-1] + 1] = strengths[:, where][..., self.rows[at]]
            scale[own, group], mean[own, group] = self.candidates.scale[where], self.candidates.mean[where]
        used = columns.any(axis=(1, 2))
        return Shared(channels[used], columns[used], scale, mean)

    def of(self, problems: tuple[JointProblem, ...]) -> "JointFit":
        """Return this fit with other problems."""
        return replace(self, problems=problems)

    def _strengths(
        self, hypotheses: Sequence[Hypothesis], amplitudes: Sequence[Float[np.ndarray, " own"]]
    ) -> Float[np.ndarray, "channels every"]:
        """Compute the strengths of each group's hypothesis with these amplitudes, at the rows of the group."""
        found, group = np.zeros(self._grouped.strengths.shape), self.group[self._grouped.problem]
        for number, (hypothesis, amplitude) in enumerate(zip(hypotheses, amplitudes, strict=True)):
            own, where = group == number, self.candidates.where(hypothesis)
            found[:, own] = np.einsum(
                "k,krc->cr", amplitude, self.candidates.columns[where[:, None], :, self.rows[own]]
            )
        return found

    def nearest(
        self,
        hypotheses: Sequence[Hypothesis],
        theta_mm: Float[np.ndarray, "problems adapted"],
        amplitudes: Sequence[Float[np.ndarray, " own"]],
    ) -> Nearest:
        """Find the nearest postures of all rows with each group's hypothesis and amplitudes, and the whole slopes."""
        strengths = self._strengths(hypotheses, amplitudes)
        return self._grouped.with_whole_slopes(theta_mm.T, strengths, self._grouped.nearest(theta_mm.T, strengths))

    def objective(self, hypotheses: Sequence[Hypothesis]) -> Objective:
        """Return E of a batch of hypotheses, one group per hypothesis; this fit must have a single group."""
        groups = range(len(hypotheses))
        every = self.of(tuple(problem._replace(group=group) for group in groups for problem in self.problems))
        return Objective(every._grouped, every._shared(hypotheses))

    def from_starts(self) -> End:
        """Adapt every problem without effects from each starting point of ``girdle adapt``, and keep the lowest E."""
        first = self.model.theta_mm[self.subject]
        none = np.zeros((0, self.groups))
        nothing = self._shared([()] * self.groups)
        found = [_minimum(self._grouped, nothing, first + start, none) for start in STARTS_MM]
        best = found[0]
        for other in found[1:]:
            lower = other.E < best.E
            theta = np.where(lower, other.theta_mm, best.theta_mm)
            best = best._replace(theta_mm=theta, E=np.minimum(best.E, other.E))
        return best


def _minimum(problems: GroupedProblems, shared: Shared, theta_mm, amplitude) -> End:
    return minimise(problems, shared, theta_mm.T, amplitude, lambda gain, _: gain < SETTLED, _MOST_STEPS)


@dataclass(frozen=True)
class Linearised:
    """Linear model of the rows around adaptations without causes."""

    joint: JointFit
    theta_mm: Float[np.ndarray, "subjects adapted"]
    y: Float[np.ndarray, "rows 3"]
    Z: Float[np.ndarray, "rows 3 n"]
    """Derivatives of y with respect to the adapted parameters and the amplitudes of all candidates."""
    B: Float[np.ndarray, "rows 3 6"]


def linearise(joint: JointFit, theta_mm: Float[np.ndarray, "subjects adapted"]) -> Linearised:
    """Linearise the rows around these parameters; ``joint`` has all subjects, in one group."""
    near, order = joint.nearest([()], theta_mm, [np.zeros(0)]), np.argsort(joint.rows)
    rows_first = (np.moveaxis(x, -1, 0) for x in (near.y, near.by_theta, near.by_channel, near.B))
    y, by_theta, by_channel, B = (x[order] for x in rows_first)
    Z = np.concatenate([by_theta, joint.candidates.by_amplitude(by_channel)], axis=2)
    return Linearised(joint, theta_mm, y, Z, B)


def everybody(shoulders: Shoulders) -> tuple[JointProblem, ...]:
    """Put all postures of all subjects in one group."""
    return tuple(JointProblem(s, 0, shoulders.rows_of(s)) for s in range(len(shoulders.subjects)))
