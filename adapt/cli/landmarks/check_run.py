# pyright: reportGeneralTypeIssues=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Run of ``girdle check``: do the landmarks fit one bone, and how do two measurements of a bone differ?"""

import warnings
from pathlib import Path

import pandas as pd
import typer
from rich.console import Console

from adapt.cli.ending import EXIT_SOME_NOT_HANDLED
from adapt.cli.options import console, errors
from adapt.cli.terminal.console import folding_table
from adapt.output.run_files import inputs_record, results_folder, transaction, write_run, write_table
from adapt.tables.landmark_tables import distances_table, motions_table, thorax_of_landmarks, two_tables
from motions import InputError
from motions.checks.trial import NEEDED, against_global, slipped, sound_landmarks
from motions.errors import InputWarning, warn_input
from motions.formats.landmark_sets import LandmarkSet, read_landmark_sets
from motions.landmarks.mapping import MIDDLES, Mapping, read_mapping
from motions.landmarks.sampled_postures import THORAX_COLUMNS

_MOST_PRINTED = 60
"""Largest number of rows of a table on the terminal."""


def check_landmarks(landmarks: Path, out: Path, other: Path | None, names: Path | None) -> None:
    """Check landmarks, write and print the tables of ``girdle check``, and end with the errors found."""
    mapping = read_mapping(names)
    sets = read_landmark_sets(landmarks, mapping)
    thorax = None if mapping.R_lab_global is None else thorax_of_landmarks(sets, mapping.R_lab_global)
    tables = _of_one(sets) if other is None else differences_of_two(landmarks, other, mapping)
    for subject, rows in () if thorax is None else thorax.groupby("subject", sort=False):
        if turned := against_global(rows[list(THORAX_COLUMNS)].to_numpy(float)):
            warn_input(InputError(str(landmarks), None, f"{subject}: {turned[0]}", turned[1]))
    with results_folder(out) as folder, transaction(folder) as staged:
        for name, table in zip(("distances", "rigid_motions"), tables, strict=True):
            write_table(table, staged / f"{name}.csv")
        if thorax is not None:
            write_table(thorax, staged / "thorax.csv")
        write_run(staged, "check", inputs_record([path for path in (landmarks, other) if path], []), {})
    _print_tables(console, *tables, thorax)
    wrong = [] if other is not None else [error for own in sets for error in unsound(own, str(landmarks))]
    for error in wrong:
        errors.print(f"wrong: {error}", soft_wrap=True)
    if wrong:
        raise typer.Exit(EXIT_SOME_NOT_HANDLED)


def _of_one(sets: list[LandmarkSet]) -> tuple[pd.DataFrame, pd.DataFrame]:
    return distances_table(sets), motions_table(sets)


def differences_of_two(file: Path, other: Path, mapping: Mapping) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Compare two files of one posture each (``two_tables``); raise an InputError where they cannot be compared."""
    first, second = read_landmark_sets(file, mapping), read_landmark_sets(other, mapping)
    for path, sets in ((file, first), (other, second)):
        if len(sets) > 1:
            cause = f"it has {len(sets)} subjects, and two measurements are of one"
            raise InputError(str(path), None, cause, "Give a file of one subject")
        try:
            sets[0].mean_mm()
        except ValueError as error:
            raise InputError(str(path), None, str(error), "Give a file of one posture, or one file alone") from error
    try:
        return two_tables(first[0], second[0])
    except ValueError as error:
        raise InputError(str(other), None, str(error), f"Name its points as in {file}; at most 16 a bone") from error


def unsound(own: LandmarkSet, file: str) -> list[str]:
    """List impossible landmarks, jumps and landmark outliers; none for points that are no shoulder landmarks."""
    needed = [name for name in NEEDED if name not in MIDDLES]
    if not set(needed) <= set(own.points_mm):
        return []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        try:
            outliers = slipped(sound_landmarks(own.points_mm, own.subject, file))
        except InputError as error:
            return [str(error)]
    remedy = "Palpate it again, or leave the posture out"
    where = {name: ", ".join(own.postures[k] for k in rows) for name, rows in outliers.items()}
    causes = [f"{own.subject}: {name} slipped in posture {said}" for name, said in where.items()]
    said = [str(one.message) for one in caught if isinstance(one.message, InputWarning)]
    return [*said, *(str(InputError(file, None, one, remedy)) for one in causes)]


def _print_tables(
    console: Console, distances: pd.DataFrame, motions: pd.DataFrame, thorax: pd.DataFrame | None
) -> None:
    of_bones = distances[distances["bone"] != ""]
    two = "difference_mm" in distances
    columns = ("first_mm", "second_mm", "difference_mm") if two else ("mean_mm", "sd_mm", "least_mm", "most_mm")
    _print(console, "Distances within bones, mm", of_bones, ("bone", "one", "other"), columns)
    columns = ("angle_deg", "residual_mm", "residual_sd_mm", "residual_most_mm")
    heads = ("bone", "points") if two else ("bone", "posture")
    _print(console, "Rigid motion, and what is left after it", motions, heads, columns)
    if thorax is not None:
        heads = ("subject", "posture")
        _print(console, "Thorax against the global frame, degrees", thorax, heads, list(thorax.columns[2:]))


def _print(console: Console, title: str, rows: pd.DataFrame, heads, numbers) -> None:
    if not len(rows):
        return
    shown = folding_table(title, heads, numbers)
    for row in rows.head(_MOST_PRINTED).to_dict("records"):
        cells = ["-" if pd.isna(row[name]) else f"{row[name]:.1f}" for name in numbers]
        shown.add_row(*(str(row[name]) for name in heads), *cells)
    console.print(shown)
    if len(rows) > _MOST_PRINTED:
        console.print(f"{len(rows)} rows: the others in the file")
