"""Python interface of posture fit and adaptation: motions and models in, arrays and tables out."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import jax
import numpy as np
import pandas as pd
from numpy.typing import DTypeLike

from adapt.engine.batching import as_type, take_problems
from adapt.evaluation.covariance import Uncertainty, uncertainty, with_posterior
from adapt.evaluation.held_out import AdaptedSubjects, adapt_with_folds, gaps_deg, heldout_table, sample
from adapt.evaluation.position_check import Judge, adapted_to_all, as_they_are
from adapt.own_bones.own_adaptation import People, learn_people
from adapt.solvers.adaptation import Adapted
from adapt.solvers.motion_fits import fit_rows, rows_of_optima
from adapt.solvers.objective import (
    DEFAULT_OBJECTIVE,
    OBJECTIVES,
    WEIGHT,
    check_objective,
    check_weight,
    down_weighted,
)
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import Fold, motions_and_thirds, motions_or_thirds
from adapt.tables.positions_table import ADAPTED, BASE, positions_table
from adapt.tables.results import (
    ALL_MOTIONS,
    STATISTICS,
    Tables,
    fits_table,
    mean_gaps_html,
    own_columns,
    parameters_table,
    rows_of_subjects,
    summary_table,
    without_landmarks,
)
from models.effects.amplitudes import NO_EFFECTS, Amplitudes, PersonalSize, as_measured, sizes_of_persons, warn_of_sizes
from models.person.family import AnyModel, as_list, girdles_of
from models.person.own_bones import NO_SDS, OwnSDs
from models.person.positions.measured_movement import warn_of_unmeasured
from motions.errors import InputError, did_you_mean, listed, warn_input
from motions.motion_csv.typed_motions import check_motions
from motions.table import Motions, counted

Progress = Callable[[str], None]

_MOST_NAMED = 10
"""Largest number of names in a message."""


@dataclass(frozen=True, repr=False)
class PostureFits:
    """Fits of every posture with every model."""

    by_model: dict[str, PostureSolution]
    """Posture fits by model name, one per row of the motions, in the same order."""
    fits: pd.DataFrame
    """Table with one row per model and posture: the columns of ``fits.csv``."""

    def __repr__(self) -> str:
        subjects = counted(len(set(self.fits["subject"])), "subject")
        return f"{type(self).__name__}({subjects}, {', '.join(self.by_model)})"

    def _repr_html_(self) -> str:
        """Return the mean gaps over the subjects, degrees, as a notebook shows them."""
        return mean_gaps_html(repr(self), self.summary)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Mean absolute difference of each angle by model, motion and subject: Tables 6.1 and 6.2."""
        return summary_table(self.fits)


@dataclass(frozen=True, repr=False)
class Adaptations(Tables, PostureFits):
    """Posture fits before (``before``) and after adaptation (``by_model``), with the adapted parameters."""

    before: dict[str, PostureSolution]
    """Posture fits before adaptation, arranged like ``by_model``."""
    adapted: dict[str, Adapted]
    """Adaptations by model name, one per subject in the order of ``motions.subjects``."""
    problems: AdaptedSubjects
    """Adaptations of all models in one batch (problem = model * subjects + subject), with the held-out folds."""
    uncertainty: Uncertainty
    """Uncertainty of the adapted parameters, problem = model * subjects + subject."""

    def of(self, model: str) -> AdaptedSubjects:
        """Return the adaptations of one model, given its name."""
        return self.problems.of(list(self.adapted).index(model))


def fit_postures(
    motions: Motions,
    models: AnyModel | Sequence[AnyModel],
    progress: Progress = lambda _: None,
    dtype: DTypeLike = np.float64,
    effects: Amplitudes = NO_EFFECTS,
) -> PostureFits:
    """Fit every posture with every model as it is, without adaptation (thesis 6.2.4; Tables 6.1, 6.2).

    ``dtype`` and ``effects``: see :func:`adapt_subjects`.
    """
    models, motions = as_list(models), checked(motions)
    warn_of_sizes(effects)
    rows = posture_rows(motions, effects)
    warn_of_unmeasured(as_measured(effects), motions)
    fitted = _by_model(models, _before(motions, rows, models, progress, _type_of(dtype, effects)))
    return PostureFits(fitted, _fits(motions, fitted))


def _before(
    motions: Motions, rows: PostureRows, models: list[AnyModel], progress: Progress, dtype: DTypeLike
) -> PostureSolution:
    """Fit all postures with every model before adaptation; the models follow one another along the batch axis."""
    progress("posture fits")
    names = motions.subject.tolist()
    girdle = jax.tree.map(lambda *x: np.concatenate(x, axis=-1), *[girdles_of(one, names) for one in models])
    return fit_rows(rows.repeated(len(models), dtype), girdle)


def _fits(motions: Motions, *states: Mapping[str, PostureSolution]) -> pd.DataFrame:
    """Build ``fits.csv`` of all models from the fits before and, if given, after adaptation."""
    tables = [
        fits_table(motions, model, bool(adapted), fitted)
        for adapted, by_model in enumerate(states)
        for model, fitted in by_model.items()
    ]
    return pd.concat(tables, ignore_index=True)


def adapt_subjects(
    motions: Motions,
    models: AnyModel | Sequence[AnyModel],
    weight: float = WEIGHT,
    objective: str = DEFAULT_OBJECTIVE,
    progress: Progress = lambda _: None,
    held_out: Collection[str] | None = None,
    dtype: DTypeLike = np.float64,
    effects: Amplitudes = NO_EFFECTS,
    thorax_downweighting: float = 1.0,
    folds: Callable[[Motions], list[Fold]] = motions_or_thirds,
    own_bones: bool | OwnSDs | People = False,
) -> Adaptations:
    """Adapt every model to every subject over all its motions together (thesis 6.2.5-6.2.6; Tables 6.3-6.6).

    A model is a parameter set, or a collection with a set for each subject (``models.person.family.PersonalSets``).

    ``weight`` is w of Eq. 6.5, ``objective`` the objective variant, a name of ``adapt.solvers.objective.OBJECTIVES``.
    Subjects are independent: a subject that fails has its own status and leaves the other subjects unchanged. The
    subjects in ``held_out`` are adapted again without each of their motions or, with a single motion, without each
    third of their postures (``adapt.evaluation.held_out``). By default ``held_out`` contains all subjects or, of more
    than 400 subjects, a sample. These repeated adaptations take about twice the time of the rest; ``held_out=()`` omits
    them. ``folds`` chooses other folds (``adapt.tables.folds``).

    ``dtype``: with float32, fits are iterated in float32, and again in float64 where they do not converge. On simulated
    subjects, angles differ by at most 3e-4 degrees and parameters by 0.03 mm
    (``scripts/research/speed/measure_float32.py``). Where E has several local minima, one subject in a thousand ends in
    another minimum, which is as often lower as higher.

    ``effects`` are known to be active, before and after adaptation. A mapping gives the amplitudes by name of the
    effect: one amplitude per direction, ``{"scapula_landmark_bias": (0.0, 12.0, 0.0)}``, equal for all subjects; a
    ``PersonalSize``, with which the amplitudes of each subject are adapted too; or, for ``sc_translation`` and
    ``ac_translation``, ``"measured"``: the joint moves as the positions in the motions say, about their means over all
    postures of the subject, held-out postures included. See ``models.effects.amplitudes``. Effects act in the chain; D
    remains the thorax distance of the ellipsoid without effects. Fits with effects are iterated in float64 whatever
    ``dtype`` is, and take two to four times as long as fits without effects.

    ``thorax_downweighting``: with the value k, the thorax points of the set, where they are another person's, count 1/k
    in E. A w that is k times as large has the same result.

    ``own_bones``: adapt bones and frames of each person beside the six parameters, as far as people differ
    (``adapt.own_bones``), in float64, instead of minimising E within bounds. The value is True; or SDs by name that
    replace the default values (``models.person.own_bones``); or what ``learn_people`` has learnt from other motions.
    Where own bones do not predict a person's own motions, or are not found, the plain adaptation is kept
    (``adapt.evaluation.own_or_plain``); column ``own_bones`` says so.
    """
    check_weight(weight)
    check_objective(objective)
    motions = checked(motions)
    _check_held_out(held_out, motions.subjects)
    warn_of_sizes(effects)
    if not isinstance(own_bones, bool | Mapping | People):
        remedy = "Give True, False, SDs by name, or what learn_people has learnt"
        raise InputError("own_bones", None, f"this is {own_bones!r}", remedy)
    if own_bones is not False:
        check_own_bones(effects, objective, thorax_downweighting, weight)
    as_asked = (weight, objective, held_out, dtype, effects, thorax_downweighting, own_bones, folds, progress)
    result = adapt_checked(motions, models, *as_asked)
    if OBJECTIVES[objective].landmarks and (without := without_landmarks(result.parameters)):
        cause = f"no positions of TS and AI: {listed(without, _MOST_NAMED)}"
        warn_input(InputError("objective", None, cause, "They are adapted without them"))
    return result


def adapt_checked(
    motions: Motions,
    models: AnyModel | Sequence[AnyModel],
    weight: float,
    objective: str,
    held_out: Collection[str] | None,
    dtype: DTypeLike,
    effects: Amplitudes,
    thorax_downweighting: float,
    own_bones: bool | OwnSDs | People,
    folds: Callable[[Motions], list[Fold]] = motions_or_thirds,
    progress: Progress = lambda _: None,
) -> Adaptations:
    """Adapt as :func:`adapt_subjects` does, for a chunk of the subjects of a run with checked motions and options.

    ``held_out`` may name subjects of other chunks.
    """
    models, weight = as_list(models), down_weighted(weight, thorax_downweighting)
    dtype, subjects = _type_of(dtype, effects), motions.subjects
    rows = posture_rows(motions, effects)
    warn_of_unmeasured(as_measured(effects), motions)
    as_they_are = _before(motions, rows, models, progress, dtype)
    chosen = sample(subjects) if held_out is None else set(held_out)
    chosen_folds = [fold for fold in folds(motions) if subjects[fold.subject] in chosen]
    people = _people(own_bones, rows, models, held_out=bool(chosen_folds))
    found = adapt_with_folds(rows, models, chosen_folds, weight, objective, progress, dtype, people)
    progress("uncertainty")
    uncertain = uncertainty(as_type(found.data, float), found.adapted)
    if found.own_bones is not None:
        uncertain = with_posterior(uncertain, found.own_bones)
    progress("postures after adaptation")
    return _results(motions, models, effects, as_they_are, found, uncertain)


def _people(
    own_bones: bool | OwnSDs | People, rows: PostureRows, models: Sequence[AnyModel], *, held_out: bool
) -> People | None:
    """Return the variation between persons, learnt from the rows if it is not given; None without own bones."""
    if own_bones is False or isinstance(own_bones, People):
        return own_bones or None
    return learn_people(rows, models, NO_SDS if own_bones is True else own_bones, held_out)


def _results(
    motions: Motions,
    models: Sequence[AnyModel],
    effects: Amplitudes,
    as_they_are: PostureSolution,
    found: AdaptedSubjects,
    uncertain: Uncertainty,
) -> Adaptations:
    """Build the result of :func:`adapt_subjects` with its tables."""
    subjects = motions.subjects
    optima = rows_of_optima(found.rows, found.data, found.adapted)
    before, after = (_by_model(models, every) for every in (as_they_are, optima))
    results = _by_model(models, found.adapted)
    fits = _fits(motions, before, after)
    parameters = parameters_table(subjects, models, results, uncertain.sd_mm, fits)
    seen = {"before": before, "in_sample": after}
    seen_deg = {word: [gaps_deg(motions, one) for one in fitted.values()] for word, fitted in seen.items()}
    return Adaptations(
        by_model=after,
        fits=fits,
        before=before,
        adapted=results,
        problems=found,
        uncertainty=uncertain,
        subjects=rows_of_subjects(fits),
        parameters=parameters.assign(
            **sizes_of_persons(effects, found.adapted.sizes),
            **({} if found.own_bones is None else own_columns(found.own_bones, found.adapted.status)),
        ),
        heldout=heldout_table(subjects, list(results), found.held_out, seen_deg),
    )


def simulated_positions(result: Adaptations, motions: Motions, models: AnyModel | Sequence[AnyModel]) -> pd.DataFrame:
    """Tabulate ``positions.csv``: simulated and measured landmarks of these motions, before and after adaptation.

    Positions are in the thorax frame, mm. Simulated positions include the constants of each person that the measured
    positions determine, fitted to all postures of the person (``adapt.evaluation.person_constants``).
    """
    tables = []
    for model in as_list(models):
        found = result.of(model.name)
        judge = Judge.of(model, found.rows)
        states = {BASE: as_they_are(model, found.rows, result.before[model.name]), ADAPTED: adapted_to_all(found)}
        for state, chains in states.items():
            simulated = judge.simulated_mm(chains)
            tables.append(positions_table(motions, model.name, state, simulated, judge.measured_mm))
    return pd.concat(tables, ignore_index=True)


def check_own_bones(effects: Amplitudes, objective: str, thorax_downweighting: float, weight: float = WEIGHT) -> None:
    """Raise an InputError for options that do not enter the objective of own bones; warn of w."""
    cause = ""
    if objective != DEFAULT_OBJECTIVE or thorax_downweighting != 1.0:
        cause = "the objective of own bones has no D: no variant of E and no down-weighting changes it"
    elif any(isinstance(one, PersonalSize) for one in effects.values()):
        cause = "sizes of effects of each person's own are not fitted beside them"
    if cause:
        raise InputError("--own-bones", None, cause, "Leave one of the two out")
    if weight != WEIGHT:
        cause = f"w = {weight:g} changes no adaptation with own bones, only the plain ones kept where they fail"
        warn_input(InputError("--own-bones", None, cause, "Leave --weight out"))


def _check_held_out(held_out: Collection[str] | None, subjects: Sequence[str]) -> None:
    """Raise an InputError where this is no collection, or names somebody who is no subject."""
    if held_out is None:
        return
    if isinstance(held_out, str):
        cause = f"{held_out!r} is a text, not a collection of names"
        raise InputError("held_out", None, cause, f"Give [{held_out!r}]")
    known = set(subjects)
    if unknown := [name for name in held_out if name not in known]:
        remedy = f"{did_you_mean(str(unknown[0]), subjects)}Give names of motions.subjects"
        raise InputError("held_out", None, f"there is no subject {unknown[0]!r}", remedy)


def adapt_with_every_fold(
    motions: Motions,
    models: Sequence[AnyModel],
    weight: float = WEIGHT,
    progress: Progress = lambda _: None,
    own_bones: bool = False,
) -> Adaptations:
    """Adapt as :func:`adapt_subjects` does, holding out each motion and each third of the postures of all subjects."""
    everybody, folds = motions.subjects, motions_and_thirds
    return adapt_subjects(
        motions, models, weight, progress=progress, held_out=everybody, folds=folds, own_bones=own_bones
    )


def checked(motions: Motions) -> Motions:
    """Check the motions (``check_motions``), also for names that the tables use for their own rows."""
    motions = check_motions(motions)
    for word, names, reserved in (("subject", motions.subject, STATISTICS), ("motion", motions.motion, (ALL_MOTIONS,))):
        taken = sorted(set(names.tolist()) & set(reserved))
        if taken:
            cause = f"a {word} is called '{taken[0]}', which is a row of the summary"
            raise InputError("motions", None, cause, "Give it another name")
    return motions


def _type_of(dtype: DTypeLike, effects: Amplitudes) -> DTypeLike:
    """Return the floating-point type of the fits: float64 with effects, else ``dtype``. InputError for another type:
    a fit in whole numbers or half precision ends anywhere."""
    if np.dtype(dtype) not in (np.float32, np.float64):
        raise InputError("dtype", None, f"fits cannot be of type {np.dtype(dtype)}", "Give np.float64 or np.float32")
    return np.float64 if effects else dtype


_Problems = TypeVar("_Problems", PostureSolution, Adapted)


def _by_model(models: Sequence[AnyModel], every: _Problems) -> dict[str, _Problems]:
    """Split a batch with equally many problems per model into one batch per model name."""
    width = len(every.status) // len(models)
    return {model.name: take_problems(every, slice(k * width, (k + 1) * width)) for k, model in enumerate(models)}
