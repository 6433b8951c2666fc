"""Do the bones of a person's two shoulders correlate? Prints Markdown.

    python scripts/research/person/study_both_sides.py ../shared/motions/bonepin_*.csv

Subjects whose names belong to one person (``motions.table.person_of``) form a pair. Model: the sizes z of each side, in
SDs (``models.person.own_bones``), are N(0, 1), and each size has a correlation r between left and right.
First table: -2 log likelihood of r, with the sizes integrated out about each shoulder's posterior mode. Second table:
held-out gaps where the other side, also without the held-out motion, supplies a prior for the bones. As a control, both
tables also pair each shoulder with another person's: that gain is common to all shoulders, not to one person's.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from adapt.engine.batching import take_problems
from adapt.evaluation.predictions import gaps_of, held_out_angles
from adapt.own_bones.own_adaptation import OwnBones, adapt_own_bones, spread_of, with_own_noise
from adapt.solvers.objective import WEIGHT
from adapt.solvers.problems import Problems, problems_of, select_problems
from adapt.solvers.rows import PostureRows, posture_rows
from models import ParameterSet, load_model, model_names
from models.girdle import Girdle
from models.person.own_bones import GROUPS, SIZES, Spread
from motions import Motions
from motions.table import person_of
from scripts.reporting import markdown, measured

CORRELATIONS = (0.3, 0.5, 0.7, 0.9)
HELD_OUT_AT = 0.7
"""Correlation for the second table, where the likelihood of the bones is highest."""

_GROUP = np.array([one.group for one in SIZES])


class Told(NamedTuple):
    """Gaussian belief N(mean, covariance) about sizes in SDs, one row per shoulder."""

    mean: Float[np.ndarray, "shoulders sizes"]
    covariance: Float[np.ndarray, "shoulders sizes sizes"]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("motions", nargs="+", type=Path, metavar="MOTIONS")
    parser.add_argument("--model", action="append", default=[], help="parameter sets; default: all")
    given = parser.parse_args()
    motions = measured(parser, given.motions)
    models = [load_model(name) for name in given.model or model_names()]
    pairs = sides_of(motions.subjects)
    print(likelihood_table(motions, models, pairs))
    print()
    print(held_out_table(motions, models, pairs))


def sides_of(subjects: Sequence[str]) -> Int[np.ndarray, "persons 2"]:
    """Return the indices of both shoulders of each person who has two."""
    of: dict[str, list[int]] = {}
    for k, name in enumerate(subjects):
        of.setdefault(person_of(name), []).append(k)
    return np.array([both for both in of.values() if len(both) == 2])


def pairings(pairs: Int[np.ndarray, "persons 2"]) -> list[Int[np.ndarray, "persons 2"]]:
    """Pair first sides with second sides: the true pairs, then every pairing in which nobody keeps their own."""
    ways = np.array(list(permutations(range(len(pairs)))))
    strangers = ways[(ways != np.arange(len(pairs))).all(axis=1)]
    return [pairs, *(np.column_stack([pairs[:, 0], pairs[way, 1]]) for way in strangers)]


def of_angles(own: OwnBones) -> Told:
    """Return the posterior of the sizes of each shoulder alone."""
    sd = np.where(own.prior_sd > 0.0, own.prior_sd, 1.0).T
    covariance = np.moveaxis(own.covariance, -1, 0) / (sd[:, :, None] * sd[:, None])
    return Told(own.sizes.T / sd, covariance)


def told_by_other_side(other: Told, correlation: Float[np.ndarray, " sizes"]) -> Told:
    """Convert the other side's posterior N(m, P) into a prior of this side: N(r m, r P r + 1 - r^2)."""
    each = np.diag(1.0 - correlation**2)
    return Told(correlation * other.mean, correlation[:, None] * other.covariance * correlation + each)


def minus_two_log_likelihood(one: Told, other: Told, correlation: Float[np.ndarray, " sizes"]) -> float:
    """Compute -2 log likelihood of the correlation for one pair, relative to no correlation.

    A posterior N(m, P) with the prior N(0, 1) contains the information L = P^-1 - 1 and v = P^-1 m. With the joint
    prior covariance S the value is log det(1 + S L) - v' (1 + S L)^-1 S v.
    """
    n = len(correlation)
    inverse = np.zeros((2 * n, 2 * n))
    inverse[:n, :n], inverse[n:, n:] = np.linalg.inv(one.covariance), np.linalg.inv(other.covariance)
    seen, v = inverse - np.eye(2 * n), inverse @ np.concatenate([one.mean, other.mean])
    both = np.eye(2 * n)
    both[:n, n:] = both[n:, :n] = np.diag(correlation)

    def value(prior: Float[np.ndarray, "both both"]) -> float:
        system = np.eye(2 * n) + prior @ seen
        return float(np.linalg.slogdet(system)[1] - v @ np.linalg.solve(system, prior @ v))

    return value(both) - value(np.eye(2 * n))


def likelihood_table(motions: Motions, models: Sequence[ParameterSet], pairs: Int[np.ndarray, "persons 2"]) -> str:
    """Tabulate -2 log likelihood by group and correlation, mean over the sets; in brackets the range of the control."""
    rows, lines = posture_rows(motions), []
    data = problems_of(rows, models)
    spread = spread_of(models, rows.subjects)
    *_, own = adapt_own_bones(data, spread, with_own_noise(data, spread), WEIGHT)
    told, width = of_angles(own), len(rows.subjects)
    for group in GROUPS:
        cells = []
        for r in CORRELATIONS:
            correlation = np.where(group == _GROUP, r, 0.0)
            each = [
                sum(
                    minus_two_log_likelihood(_at(told, a), _at(told, b), correlation)
                    for first in range(0, width * len(models), width)
                    for a, b in (first + way).tolist()
                )
                / len(models)
                for way in pairings(pairs)
            ]
            strangers = f" ({min(each[1:]):.1f} to {max(each[1:]):.1f})" if len(each) > 1 else ""
            cells.append(f"{each[0]:.1f}{strangers}")
        lines.append([group, *cells])
    return markdown(["-2 log likelihood, less that of 0", *(f"r = {r}" for r in CORRELATIONS)], lines)


def _at(told: Told, k) -> Told:
    return Told(told.mean[k], told.covariance[k])


def held_out_table(motions: Motions, models: Sequence[ParameterSet], pairs: Int[np.ndarray, "persons 2"]) -> str:
    """Tabulate held-out gaps of each side alone, with the other side, and with another person's side."""
    rows = posture_rows(motions)
    correlation = np.where(_GROUP == "bones", HELD_OUT_AT, 0.0)
    lines, ways = [], pairings(pairs)
    for model in models:
        cells = [_gaps(rows, model, pairs, np.zeros(len(SIZES)))]
        cells += [_gaps(rows, model, way, correlation) for way in ways]
        lines.append([model.name, *(f"{clavicle:.2f}, {scapula:.2f}" for clavicle, scapula in cells)])
    header = ["held out: clavicle, scapula, deg", "each alone", f"bones of the person, r = {HELD_OUT_AT}"]
    return markdown([*header, *(f"of others, {k + 1}" for k in range(len(ways) - 1))], lines)


def _gaps(rows: PostureRows, model: ParameterSet, pairs, correlation) -> tuple[float, float]:
    data = problems_of(rows, [model])
    subject, other, mine, others, tested = _parts(rows, pairs)
    part, of_other = select_problems(data, subject, counted=mine), select_problems(data, other, counted=others)
    spread = spread_of([model], rows.subjects)
    at, there = take_problems(spread, subject), take_problems(spread, other)
    *_, own = adapt_own_bones(of_other, there, with_own_noise(of_other, there), WEIGHT)
    scales = with_own_noise(part, at)
    part, at = with_belief(part, at, told_by_other_side(of_angles(own), correlation))
    gaps = gaps_of(part, held_out_angles(*adapt_own_bones(part, at, scales, WEIGHT)[:2], tested))
    return float(np.nanmean(gaps[:3])), float(np.nanmean(gaps[3:]))


def with_belief(data: Problems, spread: Spread, told: Told) -> tuple[Problems, Spread]:
    """Shift every girdle to the mean and transform the columns, so that sizes ~ N(0, 1) become sizes ~ N(m, P)."""
    moved = np.einsum("ksp,ps->kp", spread.columns_mm, told.mean)
    columns = np.einsum("ksp,pst->ktp", spread.columns_mm, np.linalg.cholesky(told.covariance))
    girdle = Girdle.of_numbers(np.asarray(data.girdle.numbers_mm) + moved)
    return replace(data, girdle=girdle), spread._replace(columns_mm=columns)


def _parts(rows: PostureRows, pairs):
    """Return each shoulder without each of its motions, and the other side without the same motion."""
    motion, counted = rows.packed(rows.motion), np.asarray(rows.counted)
    found = [
        (one, other, counted[:, one] & ~tested, counted[:, other] & (motion[:, other] != name), tested)
        for one, other in [*pairs.tolist(), *pairs[:, ::-1].tolist()]
        for name in np.unique(motion[counted[:, one], one])
        for tested in [counted[:, one] & (motion[:, one] == name)]
    ]
    subject, other, mine, others, tested = zip(*found, strict=True)
    return np.array(subject), np.array(other), *(np.stack(one, axis=-1) for one in (mine, others, tested))


if __name__ == "__main__":
    main()
