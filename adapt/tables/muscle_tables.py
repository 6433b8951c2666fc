# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Muscle arms and the forces that balance the arm, before and after adaptation, as tables."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from adapt.tables.before_after import KEYS, STATES, BeforeAfter, State, before_and_after, subject_means
from models.muscles.balance import OK, Balance, arm_weight_N, balance
from models.muscles.contact import FORCES, contact_forces
from models.muscles.muscle_lines import SERRATUS, MuscleLines, all_have_landmarks, muscle_lines_of
from models.muscles.pulls import (
    Pulls,
    arms_by_angle_mm,
    arms_in_free_directions,
    free_directions,
    muscle_arms_mm,
    pulls,
)
from models.person.family import AnyModel
from motions.errors import InputError
from motions.formats.free_coordinates import FREE_COORDINATES

BODY_MASS_KG = 75.0
"""Of a person of whom it is not given. Assumed: the cadavers of Table 3.1 weighed 71 to 75 kg."""

JOINTS = ("sc", "ac")


@dataclass(frozen=True)
class MuscleTables:
    """What muscles do before and after adaptation."""

    lines: pd.DataFrame
    """``muscle_lines.csv``: one row a model, posture, state and line."""
    muscles: pd.DataFrame
    """``muscles.csv``: one row a model, posture and muscle, before and after."""
    arms: pd.DataFrame
    """``muscle_arms.csv``: one row a model, subject and muscle: the thesis's measure."""
    balance: pd.DataFrame
    """``balance.csv``: one row a model and posture, before and after."""


def muscle_tables(
    models: Sequence[AnyModel],
    fits: pd.DataFrame,
    parameters: pd.DataFrame,
    body_mass_kg: float = BODY_MASS_KG,
) -> MuscleTables:
    """Compute arms and balance of every posture that could be fitted before and after adaptation.

    InputError where a set's scapula is not in the thesis's frame, or where there is no such posture.
    """
    pairs = [(model, before_and_after(model, fits, parameters)) for model in models]
    parts = [_of_model(model, pair, body_mass_kg) for model, pair in pairs if len(pair.rows)]
    if not parts:
        cause = "no posture could be fitted before and after adaptation"
        raise InputError("motions", None, cause, "Look at the status of each in fits.csv of girdle adapt")
    lines, muscles, balances = (pd.concat(part, ignore_index=True) for part in zip(*parts, strict=True))
    return MuscleTables(lines, muscles, arms_table(muscles), balances)


def serratus_arms(pairs: Sequence[tuple[AnyModel, BeforeAfter]]) -> pd.DataFrame:
    """Tabulate ``muscle_arms.csv`` of the serratus alone, and of the sets whose scapula has landmarks alone."""
    parts = []
    for model, pair in pairs:
        subjects = pair.rows["subject"].tolist()
        if not subjects or not all_have_landmarks(model, subjects):
            continue
        lines = muscle_lines_of(model, subjects).only(SERRATUS)
        found = [pulls(lines, state.girdle, state.angles) for state in (pair.before, pair.after)]
        table = _muscle_arms(pair, lines, found)
        table.insert(0, "model", model.name)
        parts.append(table)
    return arms_table(pd.concat(parts, ignore_index=True)) if parts else pd.DataFrame()


def arms_table(muscles: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the thesis's measure of a muscle (3.3.1): length of the mean arm, mean over each motion, then over them.

    ``about_sc_ratio`` and ``about_ac_ratio``: after over before; none about AC of what ends at the clavicle.
    """
    columns = [f"about_{joint}_{word}_mm" for joint in JOINTS for word in STATES]
    parts = [
        subject_means(rows, columns).assign(muscle=muscle) for muscle, rows in muscles.groupby("muscle", sort=False)
    ]
    table = pd.concat(parts, ignore_index=True)[["model", "subject", "muscle", *columns]]
    for joint in JOINTS:
        before, after = (table[f"about_{joint}_{word}_mm"] for word in STATES)
        table[f"about_{joint}_ratio"] = (after / before).where(before > 0.0)
    return table.sort_values(["model", "subject"], kind="stable", ignore_index=True)


def muscle_means(found: MuscleTables) -> pd.DataFrame:
    """Average over subjects: the arms of ``muscle_arms.csv`` and, over postures, the forces; by model and muscle."""
    keys = ["model", "muscle"]
    arms = found.arms.groupby(keys, sort=False).mean(numeric_only=True)
    return arms.join(found.muscles.groupby(keys, sort=False)[[f"force_{word}_N" for word in STATES]].mean())


def _of_model(
    model: AnyModel, pair: BeforeAfter, body_mass_kg: float
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    lines, weight = muscle_lines_of(model, pair.rows["subject"].tolist()), arm_weight_N(body_mass_kg)
    found = [pulls(lines, state.girdle, state.angles) for state in (pair.before, pair.after)]
    states = list(zip(STATES, (pair.before, pair.after), found, strict=True))
    forces = {
        word: balance(lines, one, contact_forces(state.girdle, state.angles), state.girdle, state.angles, weight)
        for word, state, one in states
    }
    detail = pd.concat(
        [_lines(pair, lines, word, state, one, forces[word]) for word, state, one in states], ignore_index=True
    )
    tables = detail, _muscles(pair, lines, found, forces), _balance(pair, lines, forces)
    for table in tables:
        table.insert(0, "model", model.name)
    return tables


def _lines(
    pair: BeforeAfter, lines: MuscleLines, word: str, state: State, found: Pulls, forces: Balance
) -> pd.DataFrame:
    """One row a posture and line."""
    by_angle = arms_by_angle_mm(lines, found, state.girdle, state.angles)
    free = arms_in_free_directions(by_angle, free_directions(state.girdle, state.angles))
    table = _repeated(pair.rows, len(lines.name))
    table["state"] = word
    table["muscle"], table["line"] = lines.muscle * len(pair.rows), lines.name * len(pair.rows)
    columns = {"length_mm": found.length_mm, "contact_mm": found.contact_mm, "depth_mm": found.depth_mm}
    for joint, arms in (("sc", found.about_sc_mm), ("ac", found.about_ac_mm)):
        columns |= {f"about_{joint}_{axis}_mm": arms[k] for k, axis in enumerate("xyz")}
    columns |= {f"arm_{name}": free[k] for k, name in enumerate(FREE_COORDINATES)}
    columns["force_N"] = forces.force_N
    return table.assign(**{name: values.T.ravel() for name, values in columns.items()})


def _muscles(pair: BeforeAfter, lines: MuscleLines, found: list[Pulls], forces: dict[str, Balance]) -> pd.DataFrame:
    """One row a posture and muscle."""
    table = _muscle_arms(pair, lines, found)
    for word, one in forces.items():
        totals = np.stack([one.force_N[lines.of(muscle)].sum(axis=0) for muscle in lines.muscles])
        table[f"force_{word}_N"] = totals.T.ravel()
    return table


def _muscle_arms(pair: BeforeAfter, lines: MuscleLines, found: list[Pulls]) -> pd.DataFrame:
    table = _repeated(pair.rows, len(lines.muscles))
    table["muscle"] = lines.muscles * len(pair.rows)
    for joint in JOINTS:
        for word, one in zip(STATES, found, strict=True):
            arms = muscle_arms_mm(lines, getattr(one, f"about_{joint}_mm"))
            table[f"about_{joint}_{word}_mm"] = arms.T.ravel()
    return table


def _balance(pair: BeforeAfter, lines: MuscleLines, forces: dict[str, Balance]) -> pd.DataFrame:
    """One row a posture: statuses, contact forces, the largest share of a line's strength, and the change.

    ``moved_share``: half of the sum of |change| of the muscles' forces over the sum before: 0 the same forces, 1 wholly
    other ones (in size or in which muscle).
    """
    table = pair.rows.copy()
    for word, one in forces.items():
        table[f"status_{word}"] = one.status
        for k, force in enumerate(FORCES):
            table[f"{force}_{word}_N"] = one.contact_N[k]
        table[f"muscles_{word}_N"] = one.force_N.sum(axis=0)
        table[f"largest_share_{word}"] = one.share.max(axis=0)
    before, after = (
        np.stack([forces[word].force_N[lines.of(muscle)].sum(axis=0) for muscle in lines.muscles]) for word in STATES
    )
    table["moved_share"] = 0.5 * abs(after - before).sum(axis=0) / before.sum(axis=0)
    return table


def _repeated(rows: pd.DataFrame, times: int) -> pd.DataFrame:
    return rows.loc[rows.index.repeat(times), KEYS].reset_index(drop=True)


def force_means(balances: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Average the numbers of ``balance.csv`` over the postures of each model; ``unbalanced`` and ``postures`` count."""
    means = balances.groupby("model", sort=False).mean(numeric_only=True)
    counts = {"unbalanced": unbalanced(balances)["model"].value_counts(), "postures": balances["model"].value_counts()}
    means = means.assign(**{name: count.reindex(means.index).fillna(0) for name, count in counts.items()})
    return {str(model): row.to_dict() for model, row in means.iterrows()}


def unbalanced(balances: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of ``balance.csv`` without a balance within the muscles' strength, before or after."""
    return balances[(balances["status_before"] != OK) | (balances["status_after"] != OK)]
