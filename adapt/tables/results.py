# pyright: reportAttributeAccessIssue=false, reportIndexIssue=false, reportArgumentType=false, reportReturnType=false
# pyright: reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""The results as tables: one row a posture, one row a subject, and the thesis's tables. Pandas lives here."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from itertools import chain
from typing import NamedTuple

import jax
import numpy as np
import orjson
import pandas as pd
from jaxtyping import Float, Shaped

from adapt.own_bones.own_adaptation import OwnBones
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import MOTION
from adapt.tables.held_out import NOTHING, by_subject
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle
from models.person.family import AnyModel, girdles_of
from models.person.own_bones import NAMES, SIZES, with_own_sizes
from motions.rotations import DEG
from motions.table import ANGLES, BONES, Motions

ALL_MOTIONS = "all"
"""Name, in the summary, of all motions of a subject together."""

STATISTICS = ("mean", "std", "max", "min")
"""The last rows of the thesis's tables; std with n - 1."""

DIFFERENCES = [f"{angle}_difference_deg" for angle in ANGLES]

HELD_OUT = {bone: f"{bone}_held_out_deg" for bone in BONES}
"""The last columns of the summary, by bone."""

SUBJECT_COLUMNS = [
    *("motion", "subject"),
    *(f"{name}_deg" for name in (*ANGLES, *BONES)),
    *("postures", "postures_ok"),
]
"""Of the summary, where model and state are known."""

SubjectRows = Mapping[tuple[str, int], pd.DataFrame]
"""Rows of a table by model and state (0: as the model is, 1: adapted)."""


@dataclass(frozen=True, repr=False)
class Tables:
    """The tables of an adaptation."""

    fits: pd.DataFrame
    """One row a model, posture and state (adapted or not): the columns of ``fits.csv``."""
    parameters: pd.DataFrame
    """One row a model and subject: the columns of ``parameters.csv``; Tables 6.5 and 6.6."""
    heldout: pd.DataFrame
    """One row a model, subject and part held out: the columns of ``heldout.csv``; none of whom none was asked for."""
    subjects: SubjectRows
    """What the summary is made of."""

    def __repr__(self) -> str:
        models = ", ".join(dict.fromkeys(self.parameters["model"]))
        return f"{type(self).__name__}({self.parameters['subject'].nunique()} subjects, {models})"

    def _repr_html_(self) -> str:
        """Show the mean gaps over the subjects, degrees, where a notebook asks for it."""
        summary = self.summary
        means = summary[(summary["subject"] == "mean") & (summary["motion"] == ALL_MOTIONS)]
        columns = ["model", "adapted", *(f"{bone}_deg" for bone in BONES), *HELD_OUT.values()]
        return f"<p>{escape(repr(self))}</p>{means[columns].to_html(index=False, float_format='%.1f', na_rep='')}"

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Mean absolute difference of each angle by model, motion and subject: Tables 6.1-6.4; and of what was held
        out."""
        return summary_of(self.subjects, self.heldout)


def as_csv(table: pd.DataFrame) -> str:
    """Format a table as CSV with every digit that the numbers have; an empty cell is 'no value'.

    pandas would write the same, in three times as much time.
    """
    header = ",".join(_text(name) for name in table)
    rows = zip(*(_cells(table[name]) for name in table), strict=True)
    return "\n".join([header, *map(",".join, rows), ""])


def _cells(column: pd.Series) -> list[str]:
    if column.dtype.kind in "iuf" and len(column):
        return _number_cells(column.to_numpy())
    values = column.tolist()
    texts = {value: _text(value) for value in dict.fromkeys(values)}
    return [texts[value] for value in values]


def _number_cells(numbers: Shaped[np.ndarray, " rows"]) -> list[str]:
    """The shortest text that gives each number back, as Python's ``repr`` writes it."""
    cells = orjson.dumps(np.ascontiguousarray(numbers), option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].decode().split(",")
    size = np.abs(numbers)
    others = np.flatnonzero(~((size < _MOST_TINY) | (size >= _LEAST_ALIKE) & (size < _FIRST_OTHER)))
    for k, x in zip(others.tolist(), numbers[others].tolist(), strict=True):
        cells[k] = "" if x != x else repr(x)
    return cells


_MOST_TINY, _LEAST_ALIKE, _FIRST_OTHER = 1e-9, 1e-4, 1e16
"""Below the first and between the others JSON writes a number as Python does. Elsewhere Python has an exponent of two
digits at least; not a number is in no JSON."""


def _text(value: object) -> str:
    """A cell with the quotation marks that it needs."""
    if value is None or value != value:
        return ""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow([value, ""])
    return text.getvalue().removesuffix(",\n")


def fits_table(motions: Motions, model: str, adapted: bool, fitted: PostureSolution) -> pd.DataFrame:
    """Tabulate ``fits.csv``: one row per posture.

    Angles are in degrees, constraint residuals in mm, lambda in deg^2 per mm.
    """
    simulated = fitted.angles.T * DEG
    columns: dict[str, object] = {
        "model": model,
        "subject": motions.subject,
        "motion": motions.motion,
        "posture": motions.posture,
        "humerus_elevation_deg": motions.humerus_elevation_deg,
        "adapted": int(adapted),
    }
    for k, angle in enumerate(ANGLES):
        columns[f"{angle}_measured_deg"] = motions.angles_deg[:, k]
        columns[f"{angle}_simulated_deg"] = simulated[:, k]
        columns[f"{angle}_difference_deg"] = simulated[:, k] - motions.angles_deg[:, k]
    columns["j_deg2"] = fitted.j_deg2
    for k in range(3):
        columns[f"a{k + 1}_mm"] = fitted.residual_mm[k]
    for k in range(3):
        columns[f"lambda{k + 1}"] = fitted.multipliers[k]
    columns["status"] = fitted.status
    columns["jump"] = fitted.jump.astype(int)
    return pd.DataFrame(columns)


def summary_table(fits: pd.DataFrame) -> pd.DataFrame:
    """Tabulate ``summary.csv``: mean absolute difference in degrees by subject and angle.

    The rows mean, std, max and min come with the subjects. The layout is that of Tables 6.1-6.4, one block per model,
    motion (each, and all together) and state (before, after). Only postures whose fit is ``ok`` count; ``postures`` and
    ``postures_ok`` say how many there were and counted. ``clavicle`` and ``scapula`` are the means of their three
    angles. After adaptation HELD_OUT says the same of each bone where the row's postures were held out from it: a
    motion, each in turn for all motions together, thirds of the postures of who has a single motion. Empty for who was
    not held out (``heldout.csv``).
    """
    return summary_of(rows_of_subjects(fits))


def rows_of_subjects(fits: pd.DataFrame) -> SubjectRows:
    """Collect what a summary is made of: the rows of subjects, of all motions and of each, by model and state."""
    whole = _means(fits, "model", "adapted", "subject").assign(motion=ALL_MOTIONS)
    each = dict(iter(_means(fits, "model", "adapted", "motion", "subject").groupby(["model", "adapted"])))
    return {
        key: pd.concat([rows, _by_motion(each[key])], ignore_index=True)[SUBJECT_COLUMNS]
        for key, rows in whole.groupby(["model", "adapted"], sort=False)
    }


def _by_motion(rows: pd.DataFrame) -> pd.DataFrame:
    """Motions in the order in which they first appear, subjects as they stand."""
    return rows.sort_values("motion", key=lambda motions: pd.factorize(motions)[0], kind="stable")


def _means(fits: pd.DataFrame, *keys: str) -> pd.DataFrame:
    """Mean absolute differences of the postures with the same keys."""
    good = fits["status"] == status.OK
    absolute = fits[DIFFERENCES].abs().where(good).set_axis([f"{angle}_deg" for angle in ANGLES], axis=1)
    groups = absolute.assign(postures=1, postures_ok=good).groupby([fits[key] for key in keys], sort=False)
    means = groups[list(absolute)].mean()
    for bone, angles in BONES.items():
        means[f"{bone}_deg"] = means.iloc[:, angles].mean(axis=1)
    return means.join(groups[["postures", "postures_ok"]].sum()).reset_index()


def summary_of(subjects: SubjectRows, heldout: pd.DataFrame = NOTHING) -> pd.DataFrame:
    """Build the :func:`summary_table` of these rows of subjects, by model and state."""
    pieces = (summary_pieces(*key, lambda rows=rows: [rows], heldout) for key, rows in subjects.items())
    return pd.concat(chain.from_iterable(pieces), ignore_index=True)


def summary_pieces(
    model: str, adapted: int, parts: Callable[[], Iterable[pd.DataFrame]], heldout: pd.DataFrame = NOTHING
) -> Iterator[pd.DataFrame]:
    """Build it of one model and state: motion by motion, and of each the rows part by part, then their statistics.

    ``parts`` gives the rows of subjects anew each time, as there may be more of them than fit in memory.
    """
    found = _HeldOut.of(heldout[heldout["model"] == model] if adapted else NOTHING)
    motions = list(dict.fromkeys(chain.from_iterable(rows["motion"].unique() for rows in parts())))
    # With one motion alone, all motions say the same.
    for motion in motions if len(motions) > 2 else [ALL_MOTIONS]:
        numbers: list[pd.DataFrame] = []
        for rows in parts():
            block = found.beside(rows[rows["motion"] == motion])
            numbers.append(block.drop(columns=["motion", "subject"]))
            yield _labelled(block, model, adapted, motion)
        yield _labelled(_statistics(pd.concat(numbers)), model, adapted, motion)


def _labelled(block: pd.DataFrame, model: str, adapted: int, motion: str) -> pd.DataFrame:
    known = {"model": model, "adapted": adapted, "motion": motion}
    return block.assign(**known)[[*known, *(name for name in block if name not in known)]]


class _HeldOut(NamedTuple):
    """The gaps on held-out postures of the subjects of one model."""

    gaps: pd.DataFrame
    """By subject and what was held out."""
    several: frozenset[str]
    """Of whom each motion was."""

    @staticmethod
    def of(heldout: pd.DataFrame) -> "_HeldOut":
        motions, whole = heldout[heldout["kind"] == MOTION], by_subject(heldout)
        several = frozenset(motions["subject"])
        whole = whole[(whole["kind"] == MOTION) | ~whole["subject"].isin(several)].assign(held_out=ALL_MOTIONS)
        return _HeldOut(pd.concat([motions, whole]).set_index(["subject", "held_out"]), several)

    def beside(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Give the rows of subjects with HELD_OUT, where there is a gap in sample to stand beside."""
        some = rows[rows["subject"].isin(self.gaps.index.get_level_values("subject"))]  # of many few are held out
        if some.empty:
            return rows.assign(**dict.fromkeys(HELD_OUT.values(), np.nan))
        part = some["motion"].where(some["subject"].isin(self.several), ALL_MOTIONS)
        gaps = self.gaps.reindex(pd.MultiIndex.from_arrays([some["subject"], part])).set_axis(some.index)
        columns = {}
        for bone, name in HELD_OUT.items():
            columns[name] = gaps[f"{bone}_gap_unseen_deg"].where(some[f"{bone}_deg"].notna()).reindex(rows.index)
        return rows.assign(**columns)


def _statistics(block: pd.DataFrame) -> pd.DataFrame:
    table = block.drop(columns=["postures", "postures_ok"]).agg(list(STATISTICS))
    table.insert(0, "subject", list(STATISTICS))
    table["postures"] = block["postures"].sum()
    table["postures_ok"] = block["postures_ok"].sum()
    return table.reset_index(drop=True)[["subject", *block]]


def parameters_table(
    subjects: Sequence[str],
    models: Sequence[AnyModel],
    adapted: Mapping[str, Adapted],
    sd_mm: Float[np.ndarray, "adapted problems"],
    fits: pd.DataFrame,
) -> pd.DataFrame:
    """Tabulate ``parameters.csv``: one row per model and subject.

    Lengths are in mm, J in deg^2, E in the units of its reading; ``L_mm2`` is there only where landmarks count.
    ``sd_mm``: of ``adapt.evaluation.covariance``, problem = model * subjects + subject; none of who was not adapted.
    """
    each = np.split(sd_mm, len(models), axis=1)
    return pd.concat(
        [
            _model_parameters(subjects, model, adapted[model.name], sd, fits)
            for model, sd in zip(models, each, strict=True)
        ],
        ignore_index=True,
    )


def _model_parameters(subjects, model: AnyModel, adapted: Adapted, sd_mm, fits: pd.DataFrame) -> pd.DataFrame:
    columns: dict[str, object] = {"model": model.name, "subject": list(subjects)}
    own = np.asarray(girdles_of(model, subjects).adapted_mm)
    good = adapted.status == status.OK
    for k, name in enumerate(ADAPTED):
        columns[f"{name}_mm"] = adapted.theta_mm[k]
        columns[f"{name}_mm_model"] = own[k]
        columns[f"{name}_mm_sd"] = np.where(good, sd_mm[k], np.nan)
        columns[f"{name}_mm_at_bound"] = adapted.at_bound[k].astype(int)
    mine = fits[(fits["model"] == model.name) & (fits["status"] == status.OK)]
    columns["E"] = adapted.E
    columns["D_mm2"] = adapted.D_mm2
    if adapted.landmark_weight.any():
        columns["L_mm2"] = adapted.L_mm2
    for word, state in (("before", 0), ("after", 1)):
        j = mine[mine["adapted"] == state].groupby("subject")["j_deg2"].mean()
        columns[f"mean_j_{word}_deg2"] = j.reindex(subjects).to_numpy()
    columns["status"] = adapted.status
    return pd.DataFrame(columns)


def own_columns(own: OwnBones, words: Shaped[np.ndarray, " problems"]) -> dict[str, np.ndarray]:
    """Give the columns of ``parameters.csv`` behind all others: the sizes of bones and frames of each person's own with
    their SDs, scales, noise, and what is far from people."""
    good, columns = words == status.OK, {}
    for k, size in enumerate(SIZES[len(ADAPTED) :], len(ADAPTED)):
        columns[size.key] = np.where(good, own.sizes[k], np.nan)
        columns[f"{size.key}_sd"] = np.where(good, own.sd[k], np.nan)
    for name, values in zip(OWN_SCALES, own.scales, strict=True):
        columns[name] = values
    far = np.abs(own.sizes) > FAR_SDS * own.prior_sd
    untold = (own.prior_sd > 0.0) & (own.told < 1.0 - UNTOLD**2)
    for name, which in (("far_from_people", far), ("not_told", untold)):
        columns[name] = np.array([" ".join(np.array(NAMES)[one].tolist()) for one in (which & good).T], object)
    return columns | {OWN_WORD: np.where(good, own.word, "")}


FAR_SDS = 2.5
"""Of a size from the set's beyond which it is said to be far from what people are."""

UNTOLD = 0.9
"""A size whose posterior SD is more of the prior's is one of which the motions say next to nothing."""

OWN_WORD = "own_bones"
"""The column that says what became of the bones of a person's own (``own_adaptation.WORDS``)."""

OWN_SCALES = ("adapted_scale", "bones_scale", "frames_scale", "noise_deg")


def girdles_after(model: AnyModel, subjects: Sequence[str], parameters: pd.DataFrame) -> Girdle:
    """Build the adapted girdle of each of these subjects, as often as it is named, from the rows of ``parameters.csv``
    of a model; NaN of who is not there."""
    table = parameters[parameters["model"] == model.name].set_index("subject").reindex(list(subjects))
    girdle = jax.tree.map(np.asarray, girdles_of(model, subjects))
    theta = table[[f"{name}_mm" for name in ADAPTED]].to_numpy(float).T
    own = {size.key: table[size.key].to_numpy(float) for size in SIZES[len(ADAPTED) :] if size.key in table}
    own_girdle = with_own_sizes(girdle, own) if own else girdle
    return jax.tree.map(np.asarray, own_girdle.with_adapted(theta))


def parameter_statistics(parameters: pd.DataFrame) -> pd.DataFrame:
    """Compute mean and SD over subjects of each adapted parameter, mm, by model: Table 6.5 beside Table 6.6."""
    good = parameters[parameters["status"] == status.OK]
    rows = []
    for model, part in good.groupby("model", sort=False):
        for name in ADAPTED:
            values, at_bound = part[f"{name}_mm"], int(part[f"{name}_mm_at_bound"].sum())
            own_mm = part[f"{name}_mm_model"].iloc[0]
            rows.append((model, name, own_mm, values.mean(), values.std(), at_bound, len(values)))
    return pd.DataFrame(rows, columns=["model", "parameter", "model_mm", "mean_mm", "sd_mm", "at_bound", "subjects"])
