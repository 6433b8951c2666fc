# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""The gap on postures that an adaptation has not seen: each motion held out in turn, and every third posture."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float
from numpy.typing import DTypeLike

from adapt.engine.batching import as_type
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.objective import DEFAULT_READING, WEIGHT
from adapt.solvers.padded_batch import Batch, pack
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problem_batch import ProblemBatch, problem_batch, select_problems
from adapt.tables.held_out import BONE_PREFIXES, MOTION, NOTHING, POSTURES, SEEN
from adapt.tables.results import DIFFERENCES
from adapt.trust.folds import hold_out_motions, hold_out_thirds
from models.effects.known import NO_EFFECTS, Amplitudes, active_effects
from models.person.family import AnyModel
from motions.rotations import DEG
from motions.table import Motions

MOST_SUBJECTS = 400
"""Of whom parts are held out where nobody says of whom: more take longer than their adaptation, and tell no more."""


@dataclass(frozen=True)
class Fold:
    """One subject, the postures its girdle is adapted to and those its gap is looked at."""

    subject: int
    kind: str
    held_out: str
    fitted: Bool[np.ndarray, " postures"]
    tested: Bool[np.ndarray, " postures"]


def folds(motions: Motions, batch: Batch) -> list[Fold]:
    """Hold out every motion of every subject that has several, and every third posture of every subject."""
    found = []
    for subject, (names, counted) in enumerate(_named(motions, batch)):
        motions_of_subject = hold_out_motions(counted, names)
        held = [(MOTION, str(name), part) for name, part in motions_of_subject.items() if len(motions_of_subject) > 1]
        held += [(POSTURES, f"third {k + 1}", part) for k, part in enumerate(hold_out_thirds(counted))]
        found += [
            Fold(subject, kind, name, counted & ~part, part)
            for kind, name, part in held
            if part.any() and (counted & ~part).any()
        ]
    return found


def fewest_folds(motions: Motions, batch: Batch) -> list[Fold]:
    """Hold out every motion of a subject that has several, and every third posture of one that has not."""
    every = folds(motions, batch)
    several = {part.subject for part in every if part.kind == MOTION}
    return [part for part in every if part.kind == MOTION or part.subject not in several]


def _named(motions: Motions, batch: Batch):
    counted = np.asarray(batch.counted)
    return [(motions.motion[batch.rows[:, s]], counted[:, s]) for s in range(len(batch.subjects))]


def sample(subjects: Sequence[str], most: int = MOST_SUBJECTS) -> frozenset[str]:
    """Sample at most ``most`` subjects, one in so many in the order of the files."""
    return frozenset(subjects[:: -(-len(subjects) // most)])


@dataclass(frozen=True)
class HeldOut:
    """L = models x folds problems; problem = model * folds + fold."""

    adapted: Adapted
    """Without the postures held out."""
    unseen_deg: Float[np.ndarray, "6 postures problems"]
    """|simulated - measured| at the postures tested; NaN elsewhere and where a fit failed."""


def held_out(
    data: ProblemBatch,
    subjects: int,
    parts: Sequence[Fold],
    weight: float = WEIGHT,
    reading: str = DEFAULT_READING,
    progress: Callable[[str], None] = lambda _: None,
) -> HeldOut:
    """Adapt every problem (model * subjects + subject) of ``data`` anew without the postures of each of its folds."""
    models = data.counted.shape[1] // subjects
    problem = np.concatenate([m * subjects + np.array([part.subject for part in parts]) for m in range(models)])
    fitted, tested = (
        np.tile(np.stack([getattr(part, k) for part in parts], axis=1), models) for k in ("fitted", "tested")
    )
    progress(f"held-out gaps, {len(problem)} adaptations")
    part_of = select_problems(data, problem, counted=fitted)
    without = adapt_batch(part_of, weight, reading)
    part_of = part_of.with_sizes(without.sizes)
    return HeldOut(without, _gaps_deg(part_of, without.theta_mm, tested & (without.status == status.OK)))


def held_out_gaps(
    motions: Motions,
    models: Sequence[AnyModel],
    fits: pd.DataFrame,
    weight: float = WEIGHT,
    reading: str = DEFAULT_READING,
    progress: Callable[[str], None] = lambda _: None,
    choose: Callable[[Motions, Batch], list[Fold]] = folds,
    dtype: DTypeLike = np.float64,
    effects: Amplitudes = NO_EFFECTS,
) -> pd.DataFrame:
    """Compute ``heldout.csv`` of these motions and the table of their fits before and after adaptation."""
    batch, names = pack(motions), [model.name for model in models]
    parts = choose(motions, batch)
    if not parts:
        return NOTHING
    known = active_effects(effects, motions).at(batch.rows)
    data = as_type(problem_batch(batch, list(models), known), dtype)
    found = held_out(data, len(batch.subjects), parts, weight, reading, progress)
    return heldout_table(batch.subjects, names, parts, found, reported_gaps_deg(batch, names, fits))


def reported_gaps_deg(batch: Batch, models: Sequence[str], fits: pd.DataFrame) -> dict[str, np.ndarray]:
    """Look up |simulated - measured|, degrees, of all postures in the table of their fits.

    By state, before and after adaptation (in sample), (6, postures, problems); NaN where the fit is not ``ok``.
    """
    gaps = {}
    for word, state in SEEN.items():
        parts = []
        for model in models:
            rows = fits[(fits["model"] == model) & (fits["adapted"] == state)]
            good = (rows["status"] == status.OK).to_numpy()
            parts.append(np.where(good, rows[DIFFERENCES].abs().to_numpy().T, np.nan)[:, batch.rows])
        gaps[word] = np.concatenate(parts, axis=-1)
    return gaps


def _gaps_deg(
    data: ProblemBatch, theta_mm, tested: Bool[np.ndarray, "postures problems"]
) -> Float[np.ndarray, "6 postures problems"]:
    posture, problem = np.nonzero(tested)
    if not len(problem):
        return np.full((6, *tested.shape), np.nan)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    found = fit_batch(data.girdles_at(theta_mm, posture, problem), angles, measured)
    result = np.full((6, *tested.shape), np.nan)
    result[:, posture, problem] = np.where(
        measured & (found.status == status.OK), np.abs(found.angles - angles) * DEG, np.nan
    )
    return result


def heldout_table(
    subjects: Sequence[str],
    models: Sequence[str],
    parts: Sequence[Fold],
    found: HeldOut,
    seen_deg: Mapping[str, Float[np.ndarray, "6 postures problems"]],
) -> pd.DataFrame:
    """Tabulate ``heldout.csv``: one row per model, subject and part held out.

    Gaps are mean |simulated - measured|, degrees. All are of the postures held out: before adaptation, adapted to
    everything (in_sample) and without them (unseen). ``seen_deg``: the first two, by problem model * subjects +
    subject.
    """
    rows = []
    for m, model in enumerate(models):
        for k, part in enumerate(parts):
            problem = m * len(parts) + k
            row: dict[str, object] = {"model": model, "subject": subjects[part.subject]}
            row |= {"kind": part.kind, "held_out": part.held_out}
            row |= {"postures": int(part.tested.sum()), "adapted_to": int(part.fitted.sum())}
            of_subject = m * len(subjects) + part.subject
            gaps = {word: seen_deg[word][:, part.tested, of_subject] for word in SEEN if word in seen_deg}
            for word, gap in (gaps | {"unseen": found.unseen_deg[:, part.tested, problem]}).items():
                for bone, angles in BONE_PREFIXES.items():
                    row[f"{bone}gap_{word}_deg"] = mean_of(gap[angles])
            row["status"] = found.adapted.status[problem]
            rows.append(row)
    return pd.DataFrame(rows)


def mean_of(gaps_deg: Float[np.ndarray, "..."]) -> float:
    """Average the gaps that are there, degrees; NaN where there is none."""
    known = gaps_deg[np.isfinite(gaps_deg)]
    return float(known.mean()) if known.size else float("nan")
