# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Gaps on held-out postures: every subject is adapted, and adapted again without each of its folds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int
from numpy.typing import DTypeLike

from adapt.engine.batching import as_type, take_problems
from adapt.evaluation.own_or_plain import Persons, own_bones, own_or_plain
from adapt.evaluation.predictions import Adapt, HeldOutAngles, Places, gaps_of, held_out_angles, predicted
from adapt.own_bones.own_adaptation import OwnBones, People, spread_of, with_landmarks
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.objective import DEFAULT_OBJECTIVE, WEIGHT
from adapt.solvers.problems import Problems, problems_of, select_problems
from adapt.solvers.rows import PostureRows, one_in_so_many
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import Fold
from adapt.tables.held_out import BONE_PREFIXES, NOTHING, SEEN
from models.effects import ActiveEffects
from models.person.family import AnyModel
from motions.rotations import DEG
from motions.table import Motions

MOST_SUBJECTS = 400
"""Default limit on the number of subjects with held-out motions: more take longer than their adaptation, and add no
information."""


def sample(subjects: Sequence[str], most: int = MOST_SUBJECTS) -> frozenset[str]:
    """Sample at most ``most`` subjects, evenly spaced in the order of the files."""
    return frozenset(one_in_so_many(subjects, most))


@dataclass(frozen=True)
class HeldOut:
    """Adaptations with held-out postures: L = models x folds problems; problem = model * folds + fold."""

    folds: tuple[Fold, ...]
    adapted: Adapted
    """Adaptations without the held-out postures."""
    gaps_deg: tuple[Float[np.ndarray, "6 tested"], ...]
    """|simulated - measured| at the tested postures, per problem; NaN where not measured and where a fit failed."""
    data: Problems
    """Problems of the folds, with the subject-level amplitudes that were found."""
    angles: tuple[Float[np.ndarray, "6 tested"], ...]
    """Simulated angles at the tested postures, rad; NaN where a fit failed."""

    def of(self, chosen: Int[np.ndarray, " some"]) -> "HeldOut":
        """Select some problems."""
        return HeldOut(
            tuple(self.folds[k % len(self.folds)] for k in chosen),
            take_problems(self.adapted, chosen),
            tuple(self.gaps_deg[k] for k in chosen),
            take_problems(self.data, chosen),
            tuple(self.angles[k] for k in chosen),
        )


@dataclass(frozen=True)
class AdaptedSubjects:
    """Adaptations of every subject with every model; problem = model * subjects + subject."""

    rows: PostureRows
    data: Problems
    """Problems with the subject-level amplitudes that were found."""
    adapted: Adapted
    """Adaptations to all postures."""
    held_out: HeldOut
    own_bones: OwnBones | None = None
    """Sizes of each person's own bones and frames, where they were adapted."""

    def of(self, model: int) -> "AdaptedSubjects":
        """Select one model, by its number."""
        subjects, folds = len(self.rows.subjects), len(self.held_out.folds)
        mine, of_folds = (slice(model * width, (model + 1) * width) for width in (subjects, folds))
        data = select_problems(self.data, np.arange(mine.start, mine.stop))
        own = None if self.own_bones is None else take_problems(self.own_bones, mine)
        without = self.held_out.of(np.arange(of_folds.start, of_folds.stop))
        return AdaptedSubjects(self.rows, data, take_problems(self.adapted, mine), without, own)


def adapt_with_folds(
    rows: PostureRows,
    models: Sequence[AnyModel],
    folds: Sequence[Fold],
    weight: float = WEIGHT,
    objective: str = DEFAULT_OBJECTIVE,
    progress: Callable[[str], None] = lambda _: None,
    dtype: DTypeLike = np.float64,
    people: People | None = None,
    effects: ActiveEffects | None = None,
) -> AdaptedSubjects:
    """Adapt every model to every subject, and again without the rows that each fold holds out.

    The other arguments are those of ``adapt.adapt_subjects``. With ``people`` every person has own bones, and may have
    ``effects`` of their own: (channels, postures, subjects and then folds), of one model.
    """
    data = problems_of(rows, models)
    if people is not None:
        return _with_own_bones(data, rows, models, folds, weight, progress, people, effects)
    data = as_type(data, dtype)
    adapted = adapt_batch(data, weight, objective, lambda stage: progress(f"adaptation, {stage}"))
    found = nothing_held_out(data, adapted)
    if folds:
        found = held_out(data, rows, folds, weight, objective, progress)
    return AdaptedSubjects(rows, data.with_sizes(adapted.sizes), adapted, found)


def nothing_held_out(data: Problems, adapted: Adapted) -> HeldOut:
    """Return a result without folds."""
    return HeldOut((), take_problems(adapted, slice(0)), (), take_problems(data, slice(0)), ())


def _with_own_bones(
    data: Problems,
    rows: PostureRows,
    models: Sequence[AnyModel],
    folds: Sequence[Fold],
    weight: float,
    progress: Callable[[str], None],
    people: People,
    effects: ActiveEffects | None,
) -> AdaptedSubjects:
    """Adapt with folds and with own bones; folds use scales learnt without the person."""
    progress("own bones")
    several = data.counted.shape[1]
    problem, fitted, tested = _places_of_folds(rows, folds, len(models))
    every = np.append(np.arange(several), problem)
    both = select_problems(data, every, counted=np.append(data.counted, fitted, axis=1))
    if effects is not None:
        both = replace(both, active_effects=effects)
    persons = _persons(both, rows, models, people, every, np.arange(len(every)) >= several)
    found = own_or_plain(both, persons, weight)  # one batch: in the end few of either kind still iterate
    own_data, adapted, own = take_problems(found, slice(several))
    of_folds, without = take_problems(found[:2], slice(several, None))
    angles = held_out_angles(of_folds, without, tested)
    return AdaptedSubjects(rows, own_data, adapted, _as_held_out(folds, of_folds, without, angles, tested), own)


def _persons(
    data: Problems,
    rows: PostureRows,
    models: Sequence[AnyModel],
    people: People,
    problem: Int[np.ndarray, " some"],
    is_fold: Bool[np.ndarray, " some"],
) -> Persons:
    """Describe the differences between the persons of these problems; folds have scales learnt without the
    person."""
    everybody, without = (people.of(models, rows.subjects, held_out) for held_out in (False, True))
    motion = np.tile(rows.packed(rows.motion), len(models))
    spread, unsure = spread_of(models, rows.subjects, people.sds), people.unsure_of(models, rows.subjects)
    kin = np.arange(len(everybody))
    persons = Persons(spread, everybody, people.are_few, motion, unsure, kin).at(problem)
    spread = with_landmarks(persons.spread, data, rows, models, problem)
    scales = [(without if fold else everybody)[k] for k, fold in zip(problem.tolist(), is_fold.tolist(), strict=True)]
    return persons._replace(spread=spread, scales=scales)


def held_out_with_own_bones(
    rows: PostureRows,
    model: AnyModel,
    folds: Sequence[Fold],
    people: Sequence[People],
    fold_effects: ActiveEffects,
    weight: float = WEIGHT,
) -> HeldOut:
    """Adapt each fold with bones of the person's own, whether they predict or not, and predict the held-out postures.

    ``people``: differences between persons, one per fold. ``fold_effects``: (channels, postures, folds), with the
    postures of ``rows``.
    """
    data = problems_of(rows, [model])
    problem, fitted, tested = _places_of_folds(rows, folds, 1)
    known = {id(one): one.of([model], rows.subjects, held_out=True) for one in people}
    scales = [known[id(one)][fold.subject] for one, fold in zip(people, folds, strict=True)]

    def adapt(of_folds: Problems, which: Int[np.ndarray, " folds"]) -> tuple[Problems, Adapted]:
        of_folds = replace(of_folds, active_effects=fold_effects)
        persons = _persons(of_folds, rows, [model], people[0], which, np.ones(len(which), bool))
        alike = np.array([list(known).index(id(one)) for one in people])
        kin = which + len(rows.subjects) * alike  # shared by the folds of a person with the same effects
        return own_bones(of_folds, persons._replace(scales=scales, kin=kin), weight)[:2]

    return _as_held_out(folds, *predicted(data, problem, fitted, tested, adapt), tested)


def held_out(
    data: Problems,
    rows: PostureRows,
    folds: Sequence[Fold],
    weight: float = WEIGHT,
    objective: str = DEFAULT_OBJECTIVE,
    progress: Callable[[str], None] = lambda _: None,
) -> HeldOut:
    """Adapt every problem (model * subjects + subject) of ``data`` again without the rows that each of its folds holds
    out.

    ``folds`` must not be empty.
    """

    def adapt(of_folds: Problems, _) -> tuple[Problems, Adapted]:
        without = adapt_batch(of_folds, weight, objective)
        return of_folds.with_sizes(without.sizes), without

    return _held_out(data, rows, folds, progress, adapt)


def _held_out(
    data: Problems, rows: PostureRows, folds: Sequence[Fold], progress: Callable[[str], None], adapt: Adapt
) -> HeldOut:
    problem, fitted, tested = _places_of_folds(rows, folds, data.counted.shape[1] // len(rows.subjects))
    progress(f"held-out gaps, {len(problem)} adaptations")
    return _as_held_out(folds, *predicted(data, problem, fitted, tested, adapt), tested)


def _as_held_out(
    folds: Sequence[Fold], data: Problems, without: Adapted, angles: HeldOutAngles, tested: Places
) -> HeldOut:
    gaps, simulated = (
        tuple(one[:, mine, k] for k, mine in enumerate(tested.T)) for one in (gaps_of(data, angles), angles)
    )
    return HeldOut(tuple(folds), without, gaps, data, simulated)


def _places_of_folds(
    rows: PostureRows, folds: Sequence[Fold], models: int
) -> tuple[Int[np.ndarray, " folds"], Places, Places]:
    """Return the problem of each fold of each model, and the postures that are fitted and tested."""
    subject = np.array([fold.subject for fold in folds], int)
    problem = (len(rows.subjects) * np.arange(models)[:, None] + subject).ravel()
    fitted, tested = (
        np.tile(_places(rows, each), models)
        for each in ([fold.fitted for fold in folds], [fold.tested for fold in folds])
    )
    return problem, fitted, tested


def _places(rows: PostureRows, each: Sequence[np.ndarray]) -> Places:
    """Mark the rows of each fold among the postures of its subject."""
    place = rows.posture
    found = np.zeros((len(rows.counted), len(each)), bool)
    for k, mine in enumerate(each):
        found[place[mine], k] = True
    return found


def gaps_deg(motions: Motions, fitted: PostureSolution) -> Float[np.ndarray, "6 rows"]:
    """Compute |simulated - measured| for fits of all rows, degrees; NaN where not measured and where the fit failed."""
    return np.where(fitted.status == status.OK, np.abs(fitted.angles * DEG - motions.angles_deg.T), np.nan)


def heldout_table(
    subjects: Sequence[str],
    models: Sequence[str],
    found: HeldOut,
    seen_deg: Mapping[str, Sequence[Float[np.ndarray, "6 rows"]]],
) -> pd.DataFrame:
    """Tabulate ``heldout.csv``: one row per model, subject and held-out motion or third.

    Gaps are mean |simulated - measured| over the held-out postures, degrees: before adaptation, adapted to all postures
    (in_sample) and adapted without the held-out ones (`unseen`). ``seen_deg``: the gaps of the first two, by model, at
    all rows.
    """
    rows, words = [], found.adapted.status
    for m, model in enumerate(models):
        for k, fold in enumerate(found.folds):
            problem = m * len(found.folds) + k
            row: dict[str, object] = {"model": model, "subject": subjects[fold.subject]}
            row |= {"kind": fold.kind, "held_out": fold.held_out}
            row |= {"postures": len(fold.tested), "adapted_to": len(fold.fitted)}
            gaps = {word: seen_deg[word][m][:, fold.tested] for word in SEEN if word in seen_deg}
            for word, gap in (gaps | {"unseen": found.gaps_deg[problem]}).items():
                for bone, angles in BONE_PREFIXES.items():
                    row[f"{bone}gap_{word}_deg"] = mean_of(gap[angles])
            row["status"] = words[problem]
            rows.append(row)
    return pd.DataFrame(rows) if rows else NOTHING


def mean_of(gaps_deg: Float[np.ndarray, "..."]) -> float:
    """Average the finite gaps, degrees; NaN where there is none."""
    known = gaps_deg[np.isfinite(gaps_deg)]
    return float(known.mean()) if known.size else float("nan")
