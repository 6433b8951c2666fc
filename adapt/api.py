"""The two fits from Python: motions and models in, arrays and tables out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from adapt.adaptation import Adapted, adapt_lanes, fitted_lanes, lanes
from adapt.batch import pack
from adapt.fit import Fitted, fit_lanes, follow_motions
from adapt.objective import DEFAULT_READING, WEIGHT
from adapt.tables import ALL_MOTIONS, STATISTICS, fits_table, parameters_table, summary_table
from models.girdle import Girdle
from models.parameters import ParameterSet
from motions.errors import InputError
from motions.rotations import DEG
from motions.table import Motions

Progress = Callable[[str], None]


@dataclass(frozen=True)
class PostureFits:
    """Posture fits of every model with every posture."""

    by_model: dict[str, Fitted]
    """Lanes in the order of the motions' rows."""
    fits: pd.DataFrame
    """One row a model and posture: the columns of ``fits.csv``."""
    summary: pd.DataFrame
    """Mean absolute difference of each angle by model, motion and subject: Tables 6.1 and 6.2."""


@dataclass(frozen=True)
class Adaptations(PostureFits):
    """The same before and after adaptation, with the adapted parameters."""

    adapted: dict[str, Adapted]
    """By model; lanes in the order of ``motions.subjects``."""
    parameters: pd.DataFrame
    """One row a model and subject: the columns of ``parameters.csv``; Tables 6.5 and 6.6."""


def fit_postures(
    motions: Motions, models: ParameterSet | Sequence[ParameterSet], progress: Progress = lambda _: None
) -> PostureFits:
    """Fit every posture with every model as it is, without adaptation (thesis 6.2.4; Tables 6.1, 6.2)."""
    _check_names(motions)
    motions = _with_gaps(motions)
    by_model = {}
    for model in _as_list(models):
        progress(f"{model.name}: posture fits")
        by_model[model.name] = _fit_rows(motions, _repeated(model.girdle, len(motions.posture)))
    fits = pd.concat([fits_table(motions, name, False, f) for name, f in by_model.items()], ignore_index=True)
    return PostureFits(by_model, fits, summary_table(fits))


def adapt_subjects(
    motions: Motions,
    models: ParameterSet | Sequence[ParameterSet],
    weight: float = WEIGHT,
    reading: str = DEFAULT_READING,
    progress: Progress = lambda _: None,
) -> Adaptations:
    """Adapt every model to every subject over all its motions together (thesis 6.2.5-6.2.6; Tables 6.3-6.6).

    ``weight`` is w of Eq. 6.5 and ``reading`` a name of ``adapt.objective.READINGS``. Subjects are independent: one
    that fails has its status and leaves the others as they are.
    """
    models, motions = _as_list(models), _with_gaps(motions)
    before = fit_postures(motions, models, progress)
    batch = pack(motions)
    data = lanes(batch, models)
    adapted = adapt_lanes(data, weight, reading, lambda stage: progress(f"adaptation, {stage}"))
    subjects = len(batch.subjects)
    width = batch.angles.shape[-1]
    by_model, results, tables = {}, {}, []
    for number, model in enumerate(models):
        progress(f"{model.name}: posture fits after adaptation")
        mine = slice(number * width, number * width + subjects)
        results[model.name] = Adapted(**{k: v[..., mine] for k, v in vars(adapted).items()})
        after = fitted_lanes(data, adapted, np.arange(number * width, (number + 1) * width))
        rows = {k: batch.unpack(v.reshape(*v.shape[:-1], -1, width)) for k, v in vars(after).items()}
        girdle = _per_row(data.girdle, adapted, batch, number * width)
        by_model[model.name] = _followed(Fitted(**rows), girdle, motions)
        tables.append(fits_table(motions, model.name, True, by_model[model.name]))
    fits = pd.concat([before.fits, *tables], ignore_index=True)
    summary = summary_table(fits)
    parameters = parameters_table(motions.subjects, models, results, fits)
    return Adaptations(by_model, fits, summary, results, parameters)


def _check_names(motions: Motions) -> None:
    """Names that the tables use themselves cannot be those of a subject or a motion."""
    for word, names, reserved in (("subject", motions.subject, STATISTICS), ("motion", motions.motion, (ALL_MOTIONS,))):
        taken = sorted(set(names.tolist()) & set(reserved))
        if taken:
            cause = f"a {word} is called '{taken[0]}', which is a row of the summary"
            raise InputError("motions", None, cause, "Give it another name")


def _with_gaps(motions: Motions) -> Motions:
    """An infinite angle, which no file gives, was not measured either."""
    return replace(motions, angles_deg=np.where(np.isfinite(motions.angles_deg), motions.angles_deg, np.nan))


def _as_list(models) -> list[ParameterSet]:
    return [models] if isinstance(models, ParameterSet) else list(models)


def _repeated(girdle: Girdle, count: int) -> Girdle:
    return jax.tree.map(lambda x: jnp.repeat(x[..., None], count, axis=-1), girdle)


def _per_row(girdle: Girdle, adapted: Adapted, batch, first: int) -> Girdle:
    """The adapted girdle of each row of the motions."""
    lane = batch.unpack(np.broadcast_to(first + np.arange(batch.angles.shape[-1]), batch.counted.shape))
    chosen = girdle.with_adapted(jnp.asarray(adapted.theta_mm))
    return jax.tree.map(lambda x: x[..., lane], chosen)


def _fit_rows(motions: Motions, girdle: Girdle) -> Fitted:
    angles = motions.angles_deg.T / DEG
    return _followed(fit_lanes(girdle, angles, np.isfinite(angles)), girdle, motions)


def _followed(fitted: Fitted, girdle: Girdle, motions: Motions) -> Fitted:
    angles = motions.angles_deg.T / DEG
    return follow_motions(fitted, girdle, angles, np.isfinite(angles), previous_rows(motions))


def previous_rows(motions: Motions) -> np.ndarray:
    """Row of the posture before, in the same motion of the same subject by posture number; -1 for the first."""
    previous = np.full(len(motions.posture), -1)
    order = np.lexsort((motions.posture, motions.motion, motions.subject))
    same = (motions.subject[order[1:]] == motions.subject[order[:-1]]) & (
        motions.motion[order[1:]] == motions.motion[order[:-1]]
    )
    previous[order[1:][same]] = order[:-1][same]
    return previous
