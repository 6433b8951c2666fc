# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportReturnType=false, reportCallIssue=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Muscle arms and the forces that balance the arm, before and after adaptation, as tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt.tables.before_after import KEYS, STATES, BeforeAfter, State, before_and_after, subject_means
from models.muscles.arm_load import ArmLoad, arm_load
from models.muscles.balance import OK, Balance, balance, load_moments
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
from motions.landmarks.humerus_pose import (
    ASSUMED,
    AXIAL,
    COLUMNS,
    LANDMARKS,
    MOTION,
    PLANE,
    HumerusPose,
    humerus_pose,
    named_pose,
    warn_of_radians,
)
from motions.rotations import DEG
from motions.table import Motions

BODY_MASS_KG = 75.0
"""Default body mass. Assumption: the cadavers of Table 3.1 weighed 71 to 75 kg."""

JOINTS = ("sc", "ac", "gh")

_OLDEST = 2
"""Number of joints with which the tables begin; columns of the later joints come last."""


@dataclass(frozen=True)
class MuscleTables:
    """Tables of muscle arms and muscle forces before and after adaptation."""

    lines: pd.DataFrame
    """``muscle_lines.csv``: one row per model, posture, state and line."""
    muscles: pd.DataFrame
    """``muscles.csv``: one row per model, posture and muscle, before and after."""
    arms: pd.DataFrame
    """``muscle_arms.csv``: one row per model, subject and muscle, with the measure of the thesis."""
    balance: pd.DataFrame
    """``balance.csv``: one row per model and posture, before and after."""


def muscle_tables(
    models: Sequence[AnyModel],
    fits: pd.DataFrame,
    parameters: pd.DataFrame,
    body_mass_kg: float = BODY_MASS_KG,
    load_kg: float = 0.0,
    motions: Motions | None = None,
) -> MuscleTables:
    """Compute arms and balance of every posture that could be fitted before and after adaptation.

    ``motions``: motions of the fits, which state the orientation of the humerus; without them, the names of the motions
    determine it (:mod:`motions.landmarks.humerus_pose`). InputError where a set's scapula is not in the frame of the
    thesis, or where there is no such posture; InputWarning where the columns of the humerus look like radians.
    """
    if motions is not None:
        warn_of_radians(motions)
    load = arm_load(body_mass_kg, load_kg)
    pairs = [(model, before_and_after(model, fits, parameters)) for model in models]
    parts = [_of_model(model, pair, _pose_of(pair.rows, motions), load) for model, pair in pairs if len(pair.rows)]
    if not parts:
        cause = "no posture could be fitted before and after adaptation"
        raise InputError("motions", None, cause, "Look at the status of each in fits.csv of girdle adapt")
    lines, muscles, balances = (pd.concat(part, ignore_index=True) for part in zip(*parts, strict=True))
    return MuscleTables(lines, muscles, arms_table(muscles), balances)


def serratus_arms(pairs: Sequence[tuple[AnyModel, BeforeAfter]]) -> pd.DataFrame:
    """Tabulate ``muscle_arms.csv`` for the serratus alone, and only for sets whose scapula has landmarks."""
    parts = []
    for model, pair in pairs:
        subjects = pair.rows["subject"].tolist()
        if not subjects or not all_have_landmarks(model, subjects):
            continue
        lines = muscle_lines_of(model, subjects).only(SERRATUS)
        found = [pulls(lines, state.girdle, state.angles) for state in (pair.before, pair.after)]
        table = _muscle_arms(pair, lines, found, JOINTS)
        table.insert(0, "model", model.name)
        parts.append(table)
    return arms_table(pd.concat(parts, ignore_index=True)) if parts else pd.DataFrame()


def arms_table(muscles: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the measure of the thesis for a muscle (3.3.1): length of the mean arm, mean over each motion, then over
    motions.

    ``about_sc_ratio`` and so on: after over before; empty about a joint that the muscle does not cross.
    """
    columns = _arm_columns(JOINTS)
    parts = [
        subject_means(rows, columns).assign(muscle=muscle) for muscle, rows in muscles.groupby("muscle", sort=False)
    ]
    table = pd.concat(parts, ignore_index=True)[["model", "subject", "muscle", *columns]]
    for joint in JOINTS:
        before, after = (table[f"about_{joint}_{word}_mm"] for word in STATES)
        table[f"about_{joint}_ratio"] = (after / before).where(before > 0.0)
    oldest = [*_arm_columns(JOINTS[:_OLDEST]), *(f"about_{joint}_ratio" for joint in JOINTS[:_OLDEST])]
    newer = [name for name in table if name.startswith("about_") and name not in oldest]
    table = table[["model", "subject", "muscle", *oldest, *newer]]
    return table.sort_values(["model", "subject"], kind="stable", ignore_index=True)


def _arm_columns(joints: Sequence[str]) -> list[str]:
    return [f"about_{joint}_{word}_mm" for joint in joints for word in STATES]


def muscle_means(found: MuscleTables) -> pd.DataFrame:
    """Average the arms of ``muscle_arms.csv`` over subjects and the forces over postures, by model and muscle."""
    keys = ["model", "muscle"]
    arms = found.arms.groupby(keys, sort=False).mean(numeric_only=True)
    return arms.join(found.muscles.groupby(keys, sort=False)[[f"force_{word}_N" for word in STATES]].mean())


def _pose_of(rows: pd.DataFrame, motions: Motions | None) -> HumerusPose:
    """Return the pose of the humerus in the postures of these rows."""
    if motions is None:
        return named_pose(rows["motion"].tolist(), rows["humerus_elevation_deg"].to_numpy(float))
    keys = [motions.subject, motions.motion, motions.posture]
    place = pd.MultiIndex.from_arrays(keys).get_indexer(
        pd.MultiIndex.from_frame(rows[["subject", "motion", "posture"]])
    )
    pose = humerus_pose(motions)
    return HumerusPose(pose.angles[:, place], pose.known_by[place])


class _Found(NamedTuple):
    """Pulls and balance of a model's lines in one state."""

    state: State
    pulls: Pulls
    balance: Balance


def _of_model(
    model: AnyModel, pair: BeforeAfter, pose: HumerusPose, load: ArmLoad
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    lines, found = muscle_lines_of(model, pair.rows["subject"].tolist()), {}
    for word, state in zip(STATES, (pair.before, pair.after), strict=True):
        pulled = pulls(lines, state.girdle, state.angles, pose.angles)
        contact = contact_forces(state.girdle, state.angles)
        forces = balance(lines, pulled, contact, state.girdle, state.angles, pose.angles, load)
        found[word] = _Found(state, pulled, forces)
    detail = pd.concat([_lines(pair, lines, word, one, pose) for word, one in found.items()], ignore_index=True)
    tables = detail, _muscles(pair, lines, found, pose), _balance(pair, lines, found, pose, load)
    for table in tables:
        table.insert(0, "model", model.name)
    return tables


def _lines(pair: BeforeAfter, lines: MuscleLines, word: str, found: _Found, pose: HumerusPose) -> pd.DataFrame:
    """Tabulate the lines, one row per posture and line."""
    state, pulled = found.state, found.pulls
    by_angle = arms_by_angle_mm(lines, pulled, state.girdle, state.angles, pose.angles)
    free = arms_in_free_directions(by_angle, free_directions(state.girdle, state.angles))
    table = _repeated(pair.rows, len(lines.name))
    table["state"] = word
    table["muscle"], table["line"] = lines.muscle * len(pair.rows), lines.name * len(pair.rows)
    columns = {"length_mm": pulled.length_mm, "contact_mm": pulled.contact_mm, "depth_mm": pulled.depth_mm}
    columns |= _by_axis(pulled, JOINTS[:_OLDEST])
    columns |= {f"arm_{name}": free[k] for k, name in enumerate(FREE_COORDINATES)}
    columns["force_N"] = found.balance.force_N
    columns |= _by_axis(pulled, JOINTS[_OLDEST:])
    return table.assign(**{name: values.T.ravel() for name, values in columns.items()})


def _by_axis(pulled: Pulls, joints: Sequence[str]) -> dict[str, np.ndarray]:
    return {
        f"about_{joint}_{axis}_mm": getattr(pulled, f"about_{joint}_mm")[k]
        for joint in joints
        for k, axis in enumerate("xyz")
    }


def _muscles(pair: BeforeAfter, lines: MuscleLines, found: dict[str, _Found], pose: HumerusPose) -> pd.DataFrame:
    """Tabulate the muscles, one row per posture and muscle; ``moment_gh_before_Nm`` ...: moment about the axis of
    elevation, positive upwards."""
    both = [one.pulls for one in found.values()]
    table = _muscle_arms(pair, lines, both, JOINTS[:_OLDEST])
    for word, one in found.items():
        table[f"force_{word}_N"] = _by_muscle(lines, one.balance.force_N)
    newer = _muscle_arms(pair, lines, both, JOINTS[_OLDEST:])
    table = table.join(newer[_arm_columns(JOINTS[_OLDEST:])])
    for word, one in found.items():
        raising = np.einsum("xlp,xp->lp", one.pulls.about_gh_mm, _elevation_axis(pose))
        table[f"moment_gh_{word}_Nm"] = _by_muscle(lines, one.balance.force_N * raising / _MM_PER_M)
    return table


_MM_PER_M = 1000.0


def _elevation_axis(pose: HumerusPose) -> Float[np.ndarray, " 3 postures"]:
    """Compute the axis about which the arm is raised, thorax frame: the z-axis in abduction."""
    p = pose.angles[0]
    return np.stack([np.sin(p), np.zeros_like(p), np.cos(p)])


def _by_muscle(lines: MuscleLines, values: Float[np.ndarray, " lines postures"]) -> np.ndarray:
    """Sum over the lines of each muscle, to one number per posture and muscle."""
    return np.stack([values[lines.of(muscle)].sum(axis=0) for muscle in lines.muscles]).T.ravel()


def _muscle_arms(pair: BeforeAfter, lines: MuscleLines, found: list[Pulls], joints: Sequence[str]) -> pd.DataFrame:
    table = _repeated(pair.rows, len(lines.muscles))
    table["muscle"] = lines.muscles * len(pair.rows)
    for joint in joints:
        for word, one in zip(STATES, found, strict=True):
            arms = muscle_arms_mm(lines, getattr(one, f"about_{joint}_mm"))
            table[f"about_{joint}_{word}_mm"] = arms.T.ravel()
    return table


def _balance(
    pair: BeforeAfter, lines: MuscleLines, found: dict[str, _Found], pose: HumerusPose, load: ArmLoad
) -> pd.DataFrame:
    """Tabulate, one row per posture: statuses, contact forces, the largest share of a line's strength, the change, and
    GH.

    ``moved_share``: half of the sum of |change| of the muscle forces, divided by the sum before: 0 for the same forces,
    1 for entirely different ones (in size or in muscle). ``GH_before_N`` ...: force on the glenoid;
    ``GH_off_centre_before`` ...: how far towards the rim of the glenoid this force points, 1 at the rim;
    ``load_gh_before_Nm`` ...: moment of arm and load about the axis of elevation.
    """
    table = pair.rows.copy()
    for word, one in found.items():
        forces = one.balance
        table[f"status_{word}"] = forces.status
        for k, force in enumerate(FORCES):
            table[f"{force}_{word}_N"] = forces.contact_N[k]
        table[f"muscles_{word}_N"] = forces.force_N.sum(axis=0)
        table[f"largest_share_{word}"] = forces.share.max(axis=0)
    before, after = (_by_muscle(lines, one.balance.force_N).reshape(len(table), -1) for one in found.values())
    table["moved_share"] = 0.5 * abs(after - before).sum(axis=1) / before.sum(axis=1)
    for word, one in found.items():
        weights = load_moments(lines, one.state.girdle, one.state.angles, pose.angles, load)[:3]
        table[f"GH_{word}_N"] = np.linalg.norm(one.balance.gh_N, axis=0)
        table[f"GH_off_centre_{word}"] = one.balance.off_centre
        table[f"load_gh_{word}_Nm"] = (weights * _elevation_axis(pose)).sum(axis=0) / _MM_PER_M
    plane, _, axial = pose.angles * float(DEG)
    return table.assign(humerus_plane_deg=plane, humerus_axial_deg=axial, humerus_known_by=pose.known_by)


def _repeated(rows: pd.DataFrame, times: int) -> pd.DataFrame:
    return rows.loc[rows.index.repeat(times), KEYS].reset_index(drop=True)


def force_means(balances: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Average the numbers of ``balance.csv`` over the postures of each model; ``unbalanced`` and ``postures`` are
    counts."""
    means = balances.groupby("model", sort=False).mean(numeric_only=True)
    counts = {"unbalanced": unbalanced(balances)["model"].value_counts(), "postures": balances["model"].value_counts()}
    means = means.assign(**{name: count.reindex(means.index).fillna(0) for name, count in counts.items()})
    return {str(model): row.to_dict() for model, row in means.iterrows()}


def unbalanced(balances: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of ``balance.csv`` without a balance within the muscles' strength, before or after."""
    return balances[(balances["status_before"] != OK) | (balances["status_after"] != OK)]


_KNOWN_BY = {
    LANDMARKS: "was measured (GH, EM, EL)",
    COLUMNS: f"is that of the columns {PLANE} and {AXIAL}",
    MOTION: "is assumed from the motion's name, without turn about its own axis",
    ASSUMED: "is assumed to be raised in the plane of the scapula, without turn about its own axis",
}


def humerus_known_by(balances: pd.DataFrame) -> list[str]:
    """List the sources of the humerus orientation: one sentence per source, with its number of postures."""
    one = balances[balances["model"] == balances["model"].iloc[0]]
    counts = one["humerus_known_by"].value_counts()
    return [
        f"Of the humerus, the orientation in {n} of {len(one)} postures {_KNOWN_BY[str(by)]}."
        for by, n in counts.items()
    ]
