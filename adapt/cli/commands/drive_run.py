# pyright: reportGeneralTypeIssues=false
# (pandas says "Hashable" of a group's key)
"""Run of ``girdle drive``."""

from pathlib import Path

import pandas as pd
from rich.console import Console

from adapt.cli.ending import finish
from adapt.cli.options import console
from adapt.cli.terminal.console import folding_table
from adapt.cli.terminal.print_tables import HEADERS
from adapt.output.run_files import inputs_record, results_folder, transaction, write_run, write_table
from adapt.tables.driven_table import DrivenPostures, coordinates_of_postures, driven_postures
from models import load_model
from motions import Motions, read_motions, write_motions
from motions.formats.free_coordinates import COORDINATE_COLUMNS, FREE_COORDINATES, read_free_coordinates
from motions.motion_csv.columns import ANGLE_COLUMNS

_MOST_PRINTED = 50
"""Largest number of postures printed, one per line."""


def drive_motions(motions: list[Path], out: Path, model: str, inverse: bool) -> None:
    """Compute postures, or coordinates with ``inverse``; write the files of ``girdle drive`` and print the result."""
    record, parameters = inputs_record(motions, [model]), load_model(model)
    read = read_motions if inverse else read_free_coordinates
    table = Motions.concatenate([read(path) for path in motions])
    found = (coordinates_of_postures if inverse else driven_postures)(table, parameters)
    with results_folder(out) as folder, transaction(folder) as staged:
        write_table(found.table, staged / "driven.csv")
        if not inverse and (reached := found.as_motions) is not None:
            write_motions(reached, staged / "motions.csv")
        write_run(staged, "drive", record, {"inverse": inverse}, table.rejected)
    _print_driven(console, found)
    finish(table, found.failed)


def _print_driven(console: Console, found: DrivenPostures) -> None:
    """Print the postures of each motion; dashes where a posture was not reached."""
    shown = found.table.head(_MOST_PRINTED)
    for (subject, motion), rows in shown.groupby(["subject", "motion"], sort=False):
        title = f"{found.model.name}, {subject}, {motion}: mm and degrees"
        table = folding_table(title, (), ("no.", *FREE_COORDINATES, *HEADERS))
        for row in rows.to_dict("records"):
            values = [row[name] for name in (*COORDINATE_COLUMNS, *ANGLE_COLUMNS)]
            table.add_row(str(row["posture"]), *("-" if pd.isna(value) else f"{value:.1f}" for value in values))
        console.print(table)
    if len(found.status) > len(shown):
        console.print(f"{len(found.status)} postures: the others in driven.csv")
