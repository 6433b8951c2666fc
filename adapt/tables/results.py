# pyright: reportAttributeAccessIssue=false, reportIndexIssue=false, reportArgumentType=false, reportReturnType=false
# pyright: reportGeneralTypeIssues=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Results as pandas tables: one row per posture, one row per subject, and the tables of the thesis."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
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
from adapt.tables.in_notebook import notebook_html
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle
from models.person.family import AnyModel, girdles_of
from models.person.own_bones import NAMES, SIZES, with_own_sizes
from motions.rotations import DEG
from motions.table import ANGLES, BONES, Motions, counted

ALL_MOTIONS = "all"
"""Name, in the summary, of all motions of a subject together."""

STATISTICS = ("mean", "std", "max", "min")
"""Last rows of the tables of the thesis; std with n - 1."""

DIFFERENCES = [f"{angle}_difference_deg" for angle in ANGLES]

HELD_OUT = {bone: f"{bone}_held_out_deg" for bone in BONES}
"""Last columns of the summary, by bone."""

SUBJECT_COLUMNS = [
    *("motion", "subject"),
    *(f"{name}_deg" for name in (*ANGLES, *BONES)),
    *("postures", "postures_ok"),
]
"""Columns of the summary of one model and state."""

SubjectRows = Mapping[tuple[str, int], pd.DataFrame]
"""Rows of a table by model and state (0: as the model is, 1: adapted)."""


@dataclass(frozen=True, repr=False)
class Tables:
    """Tables of an adaptation."""

    fits: pd.DataFrame
    """``fits.csv``: one row per model, posture and state (adapted or not)."""
    parameters: pd.DataFrame
    """``parameters.csv``: one row per model and subject; Tables 6.5 and 6.6."""
    heldout: pd.DataFrame
    """``heldout.csv``: one row per model, subject and held-out motion or third, for the subjects with folds."""
    subjects: SubjectRows
    """Rows of subjects from which the summary is computed."""

    def __repr__(self) -> str:
        models = ", ".join(dict.fromkeys(self.parameters["model"]))
        return f"{type(self).__name__}({counted(self.parameters['subject'].nunique(), 'subject')}, {models})"

    def _repr_html_(self) -> str:
        """Return the mean gaps over the subjects, degrees, as a notebook shows them."""
        return mean_gaps_html(repr(self), self.summary)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Mean absolute differences by model, motion and subject: in sample by angle (Tables 6.1-6.4), held out by
        bone."""
        return summary_of(self.subjects, self.heldout)


def mean_gaps_html(line: str, summary: pd.DataFrame) -> str:
    """Write a line and the rows of a summary with the means over the subjects and all motions as HTML."""
    means = summary[(summary["subject"] == "mean") & (summary["motion"] == ALL_MOTIONS)]
    columns = ["model", "adapted", *(f"{bone}_deg" for bone in BONES), *HELD_OUT.values()]
    return notebook_html(line, columns, means[columns].itertuples(index=False))


def as_csv(table: pd.DataFrame) -> str:
    """Format a table as CSV with every digit of the numbers; an empty cell means 'no value'.

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
    """Return the shortest text from which each number can be read back exactly, as Python's ``repr`` writes it."""
    cells = orjson.dumps(np.ascontiguousarray(numbers), option=orjson.OPT_SERIALIZE_NUMPY)[1:-1].decode().split(",")
    size = np.abs(numbers)
    others = np.flatnonzero(~((size < _MOST_TINY) | (size >= _LEAST_ALIKE) & (size < _FIRST_OTHER)))
    for k, x in zip(others.tolist(), numbers[others].tolist(), strict=True):
        cells[k] = "" if x != x else repr(x)
    return cells


_MOST_TINY, _LEAST_ALIKE, _FIRST_OTHER = 1e-9, 1e-4, 1e16
"""Limits on the size of numbers that JSON writes as Python does: below the first, and from the second to the third.
Elsewhere Python writes an exponent of at least two digits, and JSON has no NaN."""


def _text(value: object) -> str:
    """Format a cell, with the quotation marks that it needs."""
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

    The rows mean, std, max and min follow the subjects. The layout is that of Tables 6.1-6.4, one block per model,
    motion (each, and all together) and state (before, after). Only postures whose fit is ``ok`` count; ``postures`` is
    the number of all, ``postures_ok`` of those that count. ``clavicle`` and ``scapula`` are the means of their three
    angles. After adaptation HELD_OUT has the same mean for each bone, with the row's postures held out: a motion; each
    motion in turn for all motions together; thirds of the postures of a subject with a single motion. The cells are
    empty for subjects without folds (``heldout.csv``).
    """
    return summary_of(rows_of_subjects(fits))


def rows_of_subjects(fits: pd.DataFrame) -> SubjectRows:
    """Collect the rows of subjects for a summary, over all motions and for each motion, by model and state."""
    whole = _means(fits, "model", "adapted", "subject").assign(motion=ALL_MOTIONS)
    each = dict(iter(_means(fits, "model", "adapted", "motion", "subject").groupby(["model", "adapted"])))
    return {
        key: pd.concat([rows, _by_motion(each[key])], ignore_index=True)[SUBJECT_COLUMNS]
        for key, rows in whole.groupby(["model", "adapted"], sort=False)
    }


def _by_motion(rows: pd.DataFrame) -> pd.DataFrame:
    """Sort motions by first appearance, and leave the subjects in their order."""
    return rows.sort_values("motion", key=lambda motions: pd.factorize(motions)[0], kind="stable")


def _means(fits: pd.DataFrame, *keys: str) -> pd.DataFrame:
    """Compute mean absolute differences over the postures with the same keys."""
    good = fits["status"] == status.OK
    absolute = fits[DIFFERENCES].abs().where(good).set_axis([f"{angle}_deg" for angle in ANGLES], axis=1)
    groups = absolute.assign(postures=1, postures_ok=good).groupby([fits[key] for key in keys], sort=False)
    means = groups[list(absolute)].mean()
    for bone, angles in BONES.items():
        means[f"{bone}_deg"] = means.iloc[:, angles].mean(axis=1)
    return means.join(groups[["postures", "postures_ok"]].sum()).reset_index()


def summary_of(subjects: SubjectRows, heldout: pd.DataFrame = NOTHING) -> pd.DataFrame:
    """Build the :func:`summary_table` from these rows of subjects, by model and state."""
    pieces = (summary_pieces(*key, lambda rows=rows: [rows], heldout) for key, rows in subjects.items())
    return pd.concat(chain.from_iterable(pieces), ignore_index=True)


def summary_pieces(
    model: str, adapted: int, chunks: Callable[[], Iterable[pd.DataFrame]], heldout: pd.DataFrame = NOTHING
) -> Iterator[pd.DataFrame]:
    """Build the summary of one model and state: for each motion the rows of subjects, chunk by chunk, then their
    statistics.

    ``chunks`` returns the rows of subjects anew each time, as there may be more of them than fit in memory.
    """
    found = _HeldOut.of(heldout[heldout["model"] == model] if adapted else NOTHING)
    motions = list(dict.fromkeys(chain.from_iterable(rows["motion"].unique() for rows in chunks())))
    # With a single motion, its block would repeat the block of all motions.
    for motion in motions if len(motions) > 2 else [ALL_MOTIONS]:
        numbers: list[pd.DataFrame] = []
        for rows in chunks():
            block = found.beside(rows[rows["motion"] == motion])
            numbers.append(block.drop(columns=["motion", "subject"]))
            yield _labelled(block, model, adapted, motion)
        yield _labelled(_statistics(pd.concat(numbers)), model, adapted, motion)


def _labelled(block: pd.DataFrame, model: str, adapted: int, motion: str) -> pd.DataFrame:
    known = {"model": model, "adapted": adapted, "motion": motion}
    return block.assign(**known)[[*known, *(name for name in block if name not in known)]]


class _HeldOut(NamedTuple):
    """Gaps on held-out postures of the subjects of one model."""

    gaps: pd.DataFrame
    """Gaps by subject and held-out motion."""
    several: frozenset[str]
    """Subjects with each motion held out."""

    @staticmethod
    def of(heldout: pd.DataFrame) -> "_HeldOut":
        motions, whole = heldout[heldout["kind"] == MOTION], by_subject(heldout)
        several = frozenset(motions["subject"])
        whole = whole[(whole["kind"] == MOTION) | ~whole["subject"].isin(several)].assign(held_out=ALL_MOTIONS)
        return _HeldOut(pd.concat([motions, whole]).set_index(["subject", "held_out"]), several)

    def beside(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Add HELD_OUT to the rows of subjects, where there is an in-sample gap to compare with."""
        some = rows[rows["subject"].isin(self.gaps.index.get_level_values("subject"))]  # few subjects in large runs
        if some.empty:
            return rows.assign(**dict.fromkeys(HELD_OUT.values(), np.nan))
        motion = some["motion"].where(some["subject"].isin(self.several), ALL_MOTIONS)
        gaps = self.gaps.reindex(pd.MultiIndex.from_arrays([some["subject"], motion])).set_axis(some.index)
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


def without_landmarks(parameters: pd.DataFrame) -> list[str]:
    """List the subjects that an objective with landmarks adapted without any position of TS and AI."""
    return parameters[parameters["L_mm2"].isna() & (parameters["status"] == status.OK)]["subject"].unique().tolist()


def parameters_table(
    subjects: Sequence[str],
    models: Sequence[AnyModel],
    adapted: Mapping[str, Adapted],
    sd_mm: Float[np.ndarray, "adapted problems"],
    fits: pd.DataFrame,
) -> pd.DataFrame:
    """Tabulate ``parameters.csv``: one row per model and subject.

    Lengths are in mm, J in deg^2, E in the units of its objective variant; ``L_mm2`` exists only where landmarks count.
    ``sd_mm``: SDs of ``adapt.evaluation.covariance``, problem = model * subjects + subject; left empty for subjects
    that were not adapted.
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
    """Return the last columns of ``parameters.csv``: each person's own sizes of bones and frames with their SDs,
    scales, noise, sizes far from people, and undetermined sizes."""
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
"""Distance of a size from the set's, in SDs, beyond which the size is reported as far from people."""

UNTOLD = 0.9
"""Ratio of posterior to prior SD above which the motions are said to determine next to nothing of a size."""

OWN_WORD = "own_bones"
"""Name of the column with the outcome of own bones (``own_adaptation.WORDS``)."""

OWN_SCALES = ("adapted_scale", "bones_scale", "frames_scale", "noise_deg")


def girdles_after(model: AnyModel, subjects: Sequence[str], parameters: pd.DataFrame) -> Girdle:
    """Build the adapted girdle of each of these subjects from a model's rows of ``parameters.csv``. Subjects may be
    repeated; a subject without a row gets NaN."""
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
    for model, mine in good.groupby("model", sort=False):
        for name in ADAPTED:
            values, at_bound = mine[f"{name}_mm"], int(mine[f"{name}_mm_at_bound"].sum())
            own_mm = mine[f"{name}_mm_model"].iloc[0]
            rows.append((model, name, own_mm, values.mean(), values.std(), at_bound, len(values)))
    return pd.DataFrame(rows, columns=["model", "parameter", "model_mm", "mean_mm", "sd_mm", "at_bound", "subjects"])
