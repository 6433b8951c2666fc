"""The two fits from Python: motions and models in, arrays and tables out."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import jax
import numpy as np
import pandas as pd
from numpy.typing import DTypeLike

from adapt.engine.batching import as_type
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.motion_rows import MotionRows, fit_rows, rows_of_optima
from adapt.solvers.objective import DEFAULT_READING, WEIGHT
from adapt.solvers.padded_batch import pack
from adapt.solvers.posture_fits import Fitted
from adapt.solvers.problem_batch import problem_batch
from adapt.tables.held_out import NOTHING
from adapt.tables.results import (
    ALL_MOTIONS,
    STATISTICS,
    Tables,
    fits_table,
    parameters_table,
    rows_of_subjects,
    summary_table,
)
from adapt.trust.covariance import Uncertainty, uncertainty
from adapt.trust.held_out import fewest_folds, held_out_gaps, sample
from models.effects.known import NO_EFFECTS, Amplitudes, active_effects, sizes_of_persons, weight_factor
from models.person.family import AnyModel, as_list, girdles_of
from motions.errors import InputError
from motions.table import Motions, check_motions

Progress = Callable[[str], None]


@dataclass(frozen=True)
class PostureFits:
    """Posture fits of every model with every posture."""

    by_model: dict[str, Fitted]
    """Problems in the order of the motions' rows."""
    fits: pd.DataFrame
    """One row a model and posture: the columns of ``fits.csv``."""

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Mean absolute difference of each angle by model, motion and subject: Tables 6.1 and 6.2."""
        return summary_table(self.fits)


@dataclass(frozen=True)
class Adaptations(Tables, PostureFits):
    """The same before and after adaptation, with the adapted parameters."""

    adapted: dict[str, Adapted]
    """By model; problems in the order of ``motions.subjects``."""
    uncertainty: Uncertainty
    """Of problem number = model * subjects + subject."""


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
    motions = _with_gaps(motions)
    by_model, fits = _before(motions, as_list(models), progress, _type_of(dtype, effects), effects)
    return PostureFits(by_model, fits)


def _before(
    motions: Motions, models: list[AnyModel], progress: Progress, dtype: DTypeLike, effects: Amplitudes
) -> tuple[dict[str, Fitted], pd.DataFrame]:
    """The fits of the models as they are, and their table."""
    _check_names(motions)
    progress("posture fits")
    names = motions.subject.tolist()
    girdle = jax.tree.map(lambda *x: np.concatenate(x, axis=-1), *[girdles_of(one, names) for one in models])
    rows = MotionRows.of_models(motions, len(models), effects, dtype)
    by_model = _by_model(models, fit_rows(rows, girdle))
    return by_model, pd.concat([fits_table(motions, k, False, v) for k, v in by_model.items()], ignore_index=True)


def adapt_subjects(
    motions: Motions,
    models: AnyModel | Sequence[AnyModel],
    weight: float = WEIGHT,
    reading: str = DEFAULT_READING,
    progress: Progress = lambda _: None,
    held_out: Collection[str] | None = None,
    dtype: DTypeLike = np.float64,
    effects: Amplitudes = NO_EFFECTS,
) -> Adaptations:
    """Adapt every model to every subject over all its motions together (thesis 6.2.5-6.2.6; Tables 6.3-6.6).

    A model is a parameter set, or a set for each subject (``models.person.family.PersonalSets``).

    ``weight`` is w of Eq. 6.5 and ``reading`` a name of ``adapt.solvers.objective.READINGS``. Subjects are independent:
    one that fails has its status and leaves the others as they are. The subjects ``held_out`` are adapted again without
    each of their motions, or, with a single motion, each third of their postures: see ``adapt.trust.held_out``. By
    default all are, of more than 400 a sample; this takes about twice the time of the rest, and ``()`` spares it.

    ``dtype``: with float32 the fits are iterated in it, and again in float64 where that does not converge. Of simulated
    subjects angles differ by at most 3e-4 degrees and parameters by 0.03 mm
    (``scripts/research/speed/measure_float32.py``); where E has several optima, one subject in a thousand ends in
    another one, as often a lower as a higher one.

    ``effects`` that are known to be at work, before as after adaptation: the amplitude of each direction by name,
    ``{"scapula_landmark_bias": (0.0, 12.0, 0.0)}``, the same in every subject; or a ``PersonalSize``, and the size of
    each subject is adapted too. See ``models.effects.known``. They act in the chain; D stays that of the ellipsoid
    without them. ``thorax_points`` multiplies w. Their fits are iterated in float64 whatever ``dtype``; they take
    two to four times as long as those without.
    """
    models, motions, weight = as_list(models), _with_gaps(motions), weight * weight_factor(effects)
    dtype = _type_of(dtype, effects)
    _, before = _before(motions, models, progress, dtype, effects)
    batch = pack(motions)
    known = active_effects(effects, motions).at(batch.rows)
    data = as_type(problem_batch(batch, models, known), dtype)
    adapted = adapt_batch(data, weight, reading, lambda stage: progress(f"adaptation, {stage}"))
    data = data.with_sizes(adapted.sizes)
    parts = _parts(len(models), len(batch.subjects))
    results = {model.name: adapted.take(part) for model, part in zip(models, parts, strict=True)}
    progress("uncertainty")
    uncertain = uncertainty(as_type(data, float), adapted)
    progress("postures after adaptation")
    rows = MotionRows.of_models(motions, len(models), effects, dtype)
    by_model = _by_model(models, rows_of_optima(rows, batch, data, adapted))
    tables = [fits_table(motions, name, True, fitted) for name, fitted in by_model.items()]
    fits = pd.concat([before, *tables], ignore_index=True)
    parameters = parameters_table(motions.subjects, models, results, uncertain.sd_mm, fits)
    parameters = parameters.assign(**sizes_of_persons(effects, adapted.sizes))
    chosen = sample(motions.subjects) if held_out is None else held_out
    heldout = _held_out(motions, models, fits, weight, reading, progress, dtype, effects, chosen)
    return Adaptations(
        by_model=by_model,
        fits=fits,
        adapted=results,
        uncertainty=uncertain,
        subjects=rows_of_subjects(fits),
        parameters=parameters,
        heldout=heldout,
    )


def _held_out(
    motions: Motions, models, fits, weight, reading, progress, dtype, effects, subjects: Collection[str]
) -> pd.DataFrame:
    chosen = np.isin(motions.subject, list(subjects))
    if not chosen.any():
        return NOTHING
    of_chosen = pd.DataFrame(fits[fits["subject"].isin(list(subjects))])
    return held_out_gaps(
        motions.select(chosen), models, of_chosen, weight, reading, progress, fewest_folds, dtype, effects
    )


def _check_names(motions: Motions) -> None:
    """Names that the tables use themselves cannot be those of a subject or a motion."""
    for word, names, reserved in (("subject", motions.subject, STATISTICS), ("motion", motions.motion, (ALL_MOTIONS,))):
        taken = sorted(set(names.tolist()) & set(reserved))
        if taken:
            cause = f"a {word} is called '{taken[0]}', which is a row of the summary"
            raise InputError("motions", None, cause, "Give it another name")


def _with_gaps(motions: Motions) -> Motions:
    """An infinite angle, which no file gives, was not measured either."""
    check_motions(motions)
    return replace(motions, angles_deg=np.where(np.isfinite(motions.angles_deg), motions.angles_deg, np.nan))


def _type_of(dtype: DTypeLike, effects: Amplitudes) -> DTypeLike:
    """What the fits are iterated in: with effects in float64."""
    return np.float64 if effects else dtype


def _by_model(models: Sequence[AnyModel], fitted: Fitted) -> dict[str, Fitted]:
    parts = _parts(len(models), len(fitted.status) // len(models))
    return {model.name: fitted.take(part) for model, part in zip(models, parts, strict=True)}


def _parts(models: int, width: int) -> list[slice]:
    """Of each model in turn, where its ``width`` problems are."""
    return [slice(k * width, (k + 1) * width) for k in range(models)]
