# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Tables 3.4, 3.5 and 6.1-6.6 for any motions and parameter sets, beside the printed tables of R2, R4 and R6.

The tables follow the thesis. Tables 3.4 and 3.5 are for mean motions with the sets as they are. For Tables 6.1-6.6
every set is adapted to the abduction and forward flexion of a subject together, and the tables are for the abduction.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt.api import Adaptations, Progress, adapt_subjects, fit_postures
from adapt.solvers import status
from adapt.tables.results import DIFFERENCES, STATISTICS, parameter_statistics
from adapt.trust.thesis import printed
from models.adapted_parameters import ADAPTED
from models.person.family import AnyModel
from motions.errors import InputError, listed
from motions.table import ANGLES, Motions

COLUMNS = ("table", "source", "model", "row", "quantity", "unit", "value", "sd")
"""Columns of ``comparison.csv``; ``sd`` is over postures in Tables 3.4 and 3.5, over subjects in Table 6.5."""

THESIS, GIRDLE = "thesis", "girdle"
"""Sources of a number."""

ABDUCTIONS, FLEXIONS = ("abduction", "frontal_elevation"), ("forward_flexion", "sagittal_elevation")
"""Names of the two motions in motion files."""

LEAST_J = "least mean J"
"""Name of the table of lower bounds of mean(J) that follow from Tables 6.1-6.4."""

FIVE = tuple(angle for angle in ANGLES if angle != "clavicle_x")

_GAPS = {False: ("Table 6.1", "Table 6.2"), True: ("Table 6.3", "Table 6.4")}
"""Tables of clavicle and scapula; the key is True for adapted sets."""

_MOST_NAMED = 10
"""Limit of names listed in a message."""

Row = tuple[str, str, str, str, str, str, float, float]


@dataclass(frozen=True)
class Comparison:
    """Tables, and the adaptations for Tables 6.1-6.6, which are None where all subjects are mean motions."""

    table: pd.DataFrame
    """One row per number, with ``COLUMNS``."""
    adaptations: Adaptations | None


@dataclass(frozen=True)
class MotionNames:
    """Names, in the file, of the motions of Tables 3.4 and 3.5."""

    abduction: str
    flexion: str

    @staticmethod
    def of(motions: Motions, abduction: str = "", flexion: str = "") -> "MotionNames":
        """Return the given names, or by default the names in ``ABDUCTIONS`` and ``FLEXIONS`` that the motions have."""
        there = set(motions.motion.tolist())
        found = MotionNames(
            _name(abduction, ABDUCTIONS, there, "--abduction"), _name(flexion, FLEXIONS, there, "--flexion")
        )
        if found.abduction == found.flexion:
            cause = f"abduction and flexion are both {found.flexion!r}"
            raise InputError("--flexion", None, cause, "Name two motions")
        return found


def _name(given: str, known: Sequence[str], there: set[str], option: str) -> str:
    found = [name for name in ((given,) if given else known) if name in there]
    if len(found) == 1:
        return found[0]
    several = f"there are motions {' and '.join(found)}" if found else f"there is no motion {given or known[0]!r}"
    names = listed(sorted(there), _MOST_NAMED)
    raise InputError("the motions", None, several, f"Name the one that is meant: {option} NAME; there are {names}")


def comparison(
    motions: Motions,
    models: Sequence[AnyModel],
    names: MotionNames,
    means: Sequence[str] = (),
    progress: Progress = lambda _: None,
) -> Comparison:
    """Compute the thesis's tables for these motions and models, and add the printed tables of the thesis's models.

    ``means``: subjects that are mean motions, for Tables 3.4 and 3.5; all others are persons, for Tables 6.1-6.6.
    Raises InputError where no person has both motions.
    """
    unknown = [name for name in means if name not in motions.subjects]
    if unknown:
        cause, there = f"no subject is called '{unknown[0]}'", listed(motions.subjects, _MOST_NAMED)
        raise InputError("--mean", None, cause, f"Take one of {there}")
    known = {model.name for model in models} & set(printed.SETS)
    rows, found = list[Row](), None
    if means:
        chosen = motions.select(np.isin(motions.subject, list(means)))
        fits = fit_postures(chosen, models, progress).fits
        rows += [*_printed_means(known), *_mean_motions(fits, names)]
    rest = motions.select(~np.isin(motions.subject, list(means)))
    if len(rest.posture):
        found = adapt_subjects(_of_both(rest, names), models, progress=progress, held_out=())
        rows += [*_printed_gaps(known), *_gaps(found, names), *_printed_parameters(known), *_parameters(found)]
        rows += [*_printed_least_j(known), *_least_j(found, names)]
    return Comparison(pd.DataFrame(rows, columns=list(COLUMNS)), found)


def lacking(motions: Motions, names: MotionNames, means: Sequence[str] = ()) -> dict[str, str]:
    """Describe, by person, the motions that are missing in persons without both motions."""
    found = {}
    for subject in motions.subjects:
        own = set(motions.motion[motions.subject == subject].tolist())
        missing = [name for name in (names.abduction, names.flexion) if name not in own]
        if missing and subject not in means:
            found[subject] = f"no motion {' and no motion '.join(missing)}, and Tables 6.1-6.6 are of both"
    return found


def _of_both(motions: Motions, names: MotionNames) -> Motions:
    without = lacking(motions, names)
    kept = ~np.isin(motions.subject, list(without)) & np.isin(motions.motion, (names.abduction, names.flexion))
    if not kept.any():
        cause = f"no subject has both {names.abduction} and {names.flexion}"
        raise InputError("the motions", None, cause, "Name two motions of one subject: --abduction NAME --flexion NAME")
    return motions.select(kept)


def _mean_motions(fits: pd.DataFrame, names: MotionNames) -> Iterable[Row]:
    """Compute Tables 3.4 and 3.5: mean and SD of |simulated - measured| over the postures."""
    good = fits[fits["status"] == status.OK]
    for table, motion in (("Table 3.4", names.abduction), ("Table 3.5", names.flexion)):
        mine = good[good["motion"] == motion]
        for (model, subject), rows in mine.groupby(["model", "subject"], sort=False):
            off = rows[DIFFERENCES].abs()
            for angle, mean, sd in zip(ANGLES, off.mean(), off.std(), strict=True):
                yield table, GIRDLE, model, subject, angle, "deg", mean, sd


def _printed_means(known: set[str]) -> Iterable[Row]:
    for name in ("Table 3.4", "Table 3.5"):
        table = printed.tables()[name]
        for model in sorted(known):
            for row, angle in zip(table.rows, ANGLES, strict=True):
                value, sd = table.cell(row, model), table.cell(row, f"{model} SD")
                yield name, THESIS, model, "mean of ten subjects", angle, "deg", value, sd


def _gaps(found: Adaptations, names: MotionNames) -> Iterable[Row]:
    """Compute Tables 6.1-6.4: mean |simulated - measured| over the postures of abduction, for each subject, and
    statistics over subjects."""
    summary = found.summary[found.summary["motion"] == names.abduction]
    for row in summary.to_dict("records"):
        for k, table in enumerate(_GAPS[bool(row["adapted"])]):
            for angle in ANGLES[3 * k : 3 * k + 3]:
                yield table, GIRDLE, row["model"], row["subject"], angle, "deg", row[f"{angle}_deg"], np.nan


def _printed_gaps(known: set[str]) -> Iterable[Row]:
    for adapted, names in _GAPS.items():
        gaps = printed.gaps_deg(adapted)
        for model in sorted(known):
            values = gaps[printed.SETS.index(model)]
            for k, angle in enumerate(ANGLES):
                table = names[k // 3]
                for subject, value in enumerate(values[k], 1):
                    yield table, THESIS, model, str(subject), angle, "deg", value, np.nan
                for word in STATISTICS:
                    column = printed.tables()[table].columns[3 * printed.SETS.index(model) + k % 3]
                    yield table, THESIS, model, word, angle, "deg", printed.tables()[table].cell(word, column), np.nan


def _parameters(found: Adaptations) -> Iterable[Row]:
    """Compute Table 6.6, the sets' own parameters, and Table 6.5, mean and SD over the adapted subjects."""
    for row in parameter_statistics(found.parameters).to_dict("records"):
        yield "Table 6.6", GIRDLE, row["model"], "set", row["parameter"], "mm", row["model_mm"], np.nan
        yield "Table 6.5", GIRDLE, row["model"], "mean", row["parameter"], "mm", row["mean_mm"], row["sd_mm"]


def _printed_parameters(known: set[str]) -> Iterable[Row]:
    for model in sorted(known):
        k = printed.SETS.index(model)
        numbers = zip(ADAPTED, printed.own_mm()[k], printed.adapted_mm()[k], printed.sd_mm()[k], strict=True)
        for name, own, mean, sd in numbers:
            yield "Table 6.6", THESIS, model, "set", name, "mm", own, np.nan
            yield "Table 6.5", THESIS, model, "mean", name, "mm", mean, sd


def _least_j(found: Adaptations, names: MotionNames) -> Iterable[Row]:
    summary = found.summary[found.summary["motion"] == names.abduction]
    rows = summary[~summary["subject"].isin(STATISTICS)]
    for model, mine in rows.groupby("model", sort=False):
        columns = [f"{angle}_deg" for angle in ANGLES]
        gaps = {bool(state): part[columns].to_numpy(float).T for state, part in mine.groupby("adapted")}
        yield from _bounds(GIRDLE, str(model), gaps)


def _printed_least_j(known: set[str]) -> Iterable[Row]:
    for model in sorted(known):
        k = printed.SETS.index(model)
        yield from _bounds(THESIS, model, {adapted: printed.gaps_deg(adapted)[k] for adapted in (False, True)})


def _bounds(source: str, model: str, gaps: Mapping[bool, Float[np.ndarray, "6 subjects"]]) -> Iterable[Row]:
    """Compute a lower bound of mean(J) of abduction (Jensen), the mean over angles of squared mean gaps: its mean over
    subjects before and after adaptation, and the number of subjects in which it grows. The last row has the share of
    gaps that shrink."""
    for label, angles in (("six angles", ANGLES), ("five, without the axial rotation", FIVE)):
        before, after = (printed.least_mean_j_deg2(gaps[adapted][None], angles)[0] for adapted in (False, True))
        yield LEAST_J, source, model, "as it is", label, "deg2", float(before.mean()), np.nan
        yield LEAST_J, source, model, "adapted", label, "deg2", float(after.mean()), np.nan
        yield LEAST_J, source, model, "grows in", label, "subjects", float((after > before).sum()), np.nan
    shrinks = 100.0 * float((gaps[True] < gaps[False]).mean())
    yield "Tables 6.1-6.4", source, model, "shrinks", "gap of a subject and angle", "%", shrinks, np.nan


_MEASURES: dict[str, Callable[[pd.Series], float]] = {"mean": pd.Series.mean, "max": pd.Series.max}


def conclusions(table: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the numbers behind the thesis's conclusions from Tables 6.1-6.4: mean and largest gap by source and
    model."""
    numbered = table[~table["row"].isin(STATISTICS)]
    rows = []
    for bone, k in (("clavicle", 0), ("scapula", 1)):
        for word, measure in _MEASURES.items():
            for (source, model), mine in numbered.groupby(["source", "model"], sort=False):
                parts = [mine[mine["table"] == _GAPS[adapted][k]]["value"] for adapted in (False, True)]
                if len(parts[0]):
                    rows.append((source, model, bone, word, *(float(measure(part)) for part in parts)))
    return pd.DataFrame(rows, columns=["source", "model", "bone", "measure", "before_deg", "after_deg"])
