# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Terminal output of ``girdle muscles``: moment arms, and the forces that balance the arm."""

from collections.abc import Mapping

import pandas as pd
from rich.console import Console

from adapt.cli.terminal.console import folding_table
from adapt.tables.before_after import STATES
from adapt.tables.muscle_tables import JOINTS, MuscleTables, force_means, humerus_known_by, muscle_means, unbalanced
from models.muscles.contact import FORCES

_MOST_NAMED = 10
"""Largest number of postures without a solution that are named; balance.csv has all."""


def print_muscles(console: Console, found: MuscleTables) -> None:
    """Print moment arms by muscle and contact forces by model, before -> after, and the postures without a solution."""
    _print_arms(console, found)
    _print_contact(console, found.balance)
    console.print(*humerus_known_by(found.balance), sep="\n", soft_wrap=True)
    left = unbalanced(found.balance)
    for row in left.head(_MOST_NAMED).to_dict("records"):
        where = f"{row['model']}, {row['subject']}, {row['motion']}, posture {row['posture']}"
        said = f"{row['status_before']} before, {row['status_after']} after adaptation"
        console.print(f"no balance: {where}: {said}", soft_wrap=True)
    if len(left) > _MOST_NAMED:
        console.print(f"and {len(left) - _MOST_NAMED} more: see balance.csv")


def _print_arms(console: Console, found: MuscleTables) -> None:
    title = "Arm of the mean line, mm, and force to hold the arm, N; means, before -> after adaptation"
    table = folding_table(title, ("model", "muscle"), ("about SC", "about AC", "about GH", "force"))
    for key, row in muscle_means(found).iterrows():
        pairs = (*((f"about_{joint}_{{}}_mm", ".0f") for joint in JOINTS), ("force_{}_N", ".1f"))
        table.add_row(*map(str, key), *(_change(row, name, form) for name, form in pairs))
    console.print(table)


def _print_contact(console: Console, balances: pd.DataFrame) -> None:
    title = "Forces that hold the arm, N; means of postures, before -> after; share of muscle force that moved"
    table = folding_table(title, ("model",), (*FORCES, "GH", "muscles", "moved"))
    for model, row in force_means(balances).items():
        names = [f"{force}_{{}}_N" for force in (*FORCES, "GH", "muscles")]
        table.add_row(model, *(_change(row, name, ".0f") for name in names), f"{100 * row['moved_share']:.0f} %")
    console.print(table)


def _change(row: Mapping, name: str, form: str) -> str:
    before, after = (row[name.format(word)] for word in STATES)
    return f"{before:{form}} -> {after:{form}}"
