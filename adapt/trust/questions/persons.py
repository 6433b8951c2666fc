"""Measured postures with a model's adapted parameters, and averages over persons with their intervals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.shoulders import Shoulders, shoulders_of
from adapt.engine.batching import take_problems
from adapt.evaluation.held_out import held_out
from adapt.solvers import status
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import problems_of
from adapt.solvers.rows import posture_rows
from adapt.tables.folds import MOTION, motions_and_thirds
from models.girdle import Girdle
from models.person.family import AnyModel, girdles_of
from motions.errors import InputError, listed
from motions.rotations import DEG
from motions.table import Motions

_MOST_NAMED = 10
"""Limit of subjects named in a message."""


@dataclass(frozen=True)
class HeldOutMotion:
    """Motion of a subject, with the parameters adapted without it."""

    tested: Int[np.ndarray, " tested"]
    """Row indices of the motion."""
    fitted: Int[np.ndarray, " fitted"]
    """Row indices of the subject's other motions."""
    theta_mm: Float[np.ndarray, " adapted"]


@dataclass(frozen=True)
class AdaptedRows:
    """Rows of motions with a model: as it is, adapted, and adapted without the motion of each row."""

    model: AnyModel
    motions: Motions
    adapted_mm: Float[np.ndarray, "adapted rows"]
    without_mm: Float[np.ndarray, "adapted rows"]
    """NaN for a subject with one motion, or where the adaptation failed."""
    held_out_motions: tuple[HeldOutMotion, ...]

    @property
    def angles(self) -> Float[np.ndarray, "6 rows"]:
        """Measured angles, rad."""
        return self.motions.angles_deg.T / DEG

    def girdle(self, theta_mm: Float[np.ndarray, "adapted rows"] | None = None) -> Girdle:
        """Return the model's girdle for each row, as it is or with parameters ``theta_mm``."""
        return self.girdle_at(np.arange(len(self.motions.posture)), theta_mm)

    def girdle_at(
        self, rows: Int[np.ndarray, " chosen"], theta_mm: Float[np.ndarray, "adapted chosen"] | None = None
    ) -> Girdle:
        """Return the girdle of the given rows, as it is or with parameters ``theta_mm``."""
        own = girdles_of(self.model, self.motions.subject[rows].tolist())
        return own if theta_mm is None else own.with_adapted(theta_mm)


def whole(motions: Motions) -> Motions:
    """Select the postures with all six angles and an elevation. Raises InputError where there is none."""
    known = np.isfinite(motions.angles_deg).all(axis=1) & np.isfinite(motions.humerus_elevation_deg)
    if not known.any():
        remedy = "Give motions measured with bone pins, or with landmarks and an estimated axial rotation"
        raise InputError("the motions", None, "no posture has six angles and an elevation of the arm", remedy)
    return motions.select(known)


def adapt_rows(motions: Motions, model: AnyModel) -> AdaptedRows:
    """Adapt the model to each subject, and to each subject without each of its motions."""
    batch = posture_rows(motions)
    data = problems_of(batch, [model])
    adapted = adapt_batch(data)
    folds = [fold for fold in motions_and_thirds(motions) if fold.kind == MOTION]
    theta = held_out(data, batch, folds).adapted if folds else take_problems(adapted, slice(0))
    number = {name: k for k, name in enumerate(batch.subjects)}
    rows = np.array([number[name] for name in motions.subject.tolist()])
    without = np.full((len(adapted.theta_mm), len(rows)), np.nan)
    held_out_motions = []
    for k, fold in enumerate(folds):
        if theta.status[k] == status.OK:
            held_out_motions.append(HeldOutMotion(fold.tested, fold.fitted, theta.theta_mm[:, k]))
            without[:, fold.tested] = theta.theta_mm[:, k, None]
    good = np.where(adapted.status == status.OK, adapted.theta_mm, np.nan)
    return AdaptedRows(model, motions, good[:, rows], without, tuple(held_out_motions))


def closest(girdle: Girdle, angles: Float[np.ndarray, "6 rows"]) -> Float[np.ndarray, "6 rows"]:
    """Fit the closest closed posture of each row, rad; NaN where the fit fails or an angle is missing."""
    known = np.isfinite(angles).all(axis=0) & np.isfinite(girdle.adapted_mm).all(axis=0)
    part = np.flatnonzero(known)
    fitted = fit_batch(take_problems(girdle, part), angles[:, part], np.ones((6, len(part)), bool))
    found = np.full(angles.shape, np.nan)
    found[:, part] = np.where(fitted.status == status.OK, fitted.angles, np.nan)
    return found


def with_noise_alone(data: AdaptedRows, noise_deg: float, seed: int) -> Motions:
    """Simulate measurements of the adapted model's closed postures, with errors of SD ``noise_deg`` in every angle."""
    closed = closest(data.girdle(data.adapted_mm), data.angles).T * DEG
    errors = np.random.Generator(np.random.PCG64(seed)).standard_normal(closed.shape)
    return replace(data.motions, angles_deg=closed + noise_deg * errors)


@dataclass(frozen=True)
class Interval:
    """Mean over persons with its 95 % interval; the ends are NaN for one person, all three values for none."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Persons:
    """Subjects, their persons and group means; left and right side of a person count as one person."""

    shoulders: Shoulders
    is_mean: Bool[np.ndarray, " subjects"]

    @staticmethod
    def of(motions: Motions, means: Sequence[str]) -> "Persons":
        """Separate persons from group means. Raises InputError for a mean that is not a subject."""
        unknown = [name for name in means if name not in motions.subjects]
        if unknown:
            cause, there = f"no subject is called '{unknown[0]}'", listed(motions.subjects, _MOST_NAMED)
            raise InputError("--mean", None, cause, f"Take one of {there}")
        return Persons(shoulders_of(motions), np.isin(motions.subjects, list(means)))

    def by_subject(self, values: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " subjects"]:
        """Average the values of each subject's rows, without NaN; NaN where a subject has no value."""
        parts = [values[self.shoulders.rows_of(s)] for s in range(len(self.is_mean))]
        return np.array([np.nanmean(part) if np.isfinite(part).any() else np.nan for part in parts])

    def each(self, of_subjects: Float[np.ndarray, " subjects"]) -> Float[np.ndarray, " persons"]:
        """Average the sides of each person, without NaN and without group means."""
        number, known = self.shoulders.person, np.isfinite(of_subjects)
        real = dict.fromkeys(number[~self.is_mean & known].tolist())
        return np.array([of_subjects[(number == one) & known].mean() for one in real])

    def mean(self, of_subjects: Float[np.ndarray, " subjects"]) -> float:
        """Average over persons; NaN without persons."""
        values = self.each(of_subjects)
        return float(values.mean()) if len(values) else float("nan")

    def interval(self, of_subjects: Float[np.ndarray, " subjects"]) -> Interval:
        """Compute the mean over persons with its 95 % t interval."""
        values, middle = self.each(of_subjects), self.mean(of_subjects)
        if len(values) < 2:
            return Interval(middle, float("nan"), float("nan"))
        from scipy.stats import t as student  # few commands need it

        half = float(student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values)))
        return Interval(middle, middle - half, middle + half)

    def means(self, of_subjects: Float[np.ndarray, " subjects"]) -> dict[str, float]:
        """Return the value of each group mean, by name."""
        return {name: float(of_subjects[k]) for k, name in enumerate(self.shoulders.subjects) if self.is_mean[k]}
