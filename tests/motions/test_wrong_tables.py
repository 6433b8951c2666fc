# pyright: reportArgumentType=false, reportReturnType=false
# (pandas says "Series | DataFrame" of nearly every result)
"""Typical mistakes in tables of postures: each gets a warning that names it; correct tables get none.

Each table is made from the shipped subjects (simulated), or from the measured shoulders where these are available.
"""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from motions import ANGLES, InputError, read_motions, read_trial, write_motions
from motions.checks.motion_table import FEWEST_STILL
from motions.errors import InputWarning
from motions.rhythm_subjects import DATA_FILE
from motions.table import warn_of_alike_motions

Change = Callable[[pd.DataFrame], pd.DataFrame]

ANGLE_COLUMNS = [f"{angle}_deg" for angle in ANGLES]
CLAVICLE, SCAPULA = ANGLE_COLUMNS[:3], ANGLE_COLUMNS[3:]
TRIAL = DATA_FILE.parent / "simulated_trial.trc"


def said_of(table: pd.DataFrame, folder: Path) -> str:
    """Return all messages about a motion file with these rows, refusals included; empty if there are none."""
    table.to_csv(folder / "m.csv", index=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            refused = read_motions(folder / "m.csv").rejected
        except InputError as error:
            refused = (error,)
    return " ".join(map(str, (*(one.message for one in caught), *refused)))


def shipped() -> pd.DataFrame:
    """Return one of the shipped subjects: abduction and forward flexion."""
    table = pd.read_csv(DATA_FILE)
    return table[table["subject"] == "simulated01"].reset_index(drop=True)


def in_second(change: Callable[[pd.DataFrame], object], columns: list[str]) -> Change:
    """Change columns in the rows of the last motion."""

    def changed(table: pd.DataFrame) -> pd.DataFrame:
        rows = table["motion"] == table["motion"].iloc[-1]
        table.loc[rows, columns] = change(table.loc[rows, columns])
        return table

    return changed


def with_row(row: int | list[int], columns: list[str], values: object) -> Change:
    """Put other values into a row."""

    def changed(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[row, columns] = values
        return table

    return changed


def exchanged(a: str, b: str) -> Change:
    return lambda table: table.rename(columns={a: b, b: a})


def held(table: pd.DataFrame) -> pd.DataFrame:
    """Make the last three postures of each motion copies of the one before."""
    last = table.groupby("motion").cumcount() > 3
    table.loc[last, ANGLE_COLUMNS] = np.nan
    return table.assign(**table[ANGLE_COLUMNS].ffill())


def with_mean(table: pd.DataFrame) -> pd.DataFrame:
    mean = table[:1].assign(subject="Mean", **table[ANGLE_COLUMNS].mean())
    return pd.concat([table, mean])


def rounded_copy(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(subject="copy", **table[ANGLE_COLUMNS].round(2))


def same_motions(table: pd.DataFrame) -> pd.DataFrame:
    first = table[table["motion"] == "abduction"]
    return pd.concat([first, first.assign(motion="forward_flexion")])


WRONG: dict[str, tuple[Change, str]] = {
    "a motion in radians": (
        in_second(np.radians, ANGLE_COLUMNS),
        "clavicle_y_deg never exceeds 3.14 in motion 'forward_flexion', so it looks like radians",
    ),
    "a scapula in radians": (in_second(np.radians, SCAPULA), "scapula_y_deg never exceeds 3.14 in motion"),
    "a row of zeros": (
        with_row(13, ANGLE_COLUMNS, 0.0),
        "in posture 7 of 'forward_flexion' all angles of the clavicle are within 3.14",
    ),
    "a clavicle from its rest": (
        lambda table: table.assign(**(table[CLAVICLE] - table[CLAVICLE].iloc[0])),
        "in posture 1 of 'abduction' all angles of the clavicle are within 3.14",
    ),
    "a motion of the other side": (
        in_second(lambda part: -part, ["clavicle_y_deg", "scapula_y_deg"]),
        "clavicle_y_deg has another sign in 'forward_flexion' than in the other motions",
    ),
    "a sign turned round in a motion": (
        in_second(lambda part: -part, ["clavicle_z_deg"]),
        "clavicle_z_deg has another sign in 'forward_flexion' than in the other motions",
    ),
    "copied rows": (held, "in posture 5 of 'abduction' all angles are those of the posture before"),
    "a recording that stood still": (
        lambda table: table.assign(**table[["humerus_elevation_deg", *ANGLE_COLUMNS]].iloc[0]),
        "all 7 postures of 'abduction' are the same; all 7 postures of 'forward_flexion' are the same",
    ),
    "a motion twice": (same_motions, "'abduction' and 'forward_flexion' have the same angles"),
    "a subject twice": (
        lambda table: pd.concat([table, table.assign(subject="copy")]),
        "copy has the angles of simulated01. Is one a copy of the other?",
    ),
    "a subject twice, without a posture and in another order": (
        lambda table: pd.concat([table, table.assign(subject="copy").iloc[1:].sample(frac=1.0, random_state=1)]),
        "copy has the angles of simulated01",
    ),
    "a subject twice, with fewer digits": (
        lambda table: pd.concat([digits := table.assign(**table[ANGLE_COLUMNS] + 0.001), rounded_copy(digits)]),
        "copy has the angles of simulated01",
    ),
    "a subject twice, in whole degrees": (
        lambda table: pd.concat([table.round(0), table.assign(subject="copy").round(0)]),
        "copy has the angles of simulated01",
    ),
    "a row of means": (with_mean, "'Mean' reads like a row of totals"),
    "a first posture off": (
        with_row(0, ["scapula_z_deg"], 97.0),
        "scapula_z_deg is 97 in posture 1 of 'abduction', 16 beside it",
    ),
    "a number of the posture for the elevation": (
        lambda table: table.assign(humerus_elevation_deg=table["posture"]),
        "in 'abduction' scapula_z_deg changes by 60 and humerus_elevation_deg by 6",
    ),
    "a tenth of the elevation": (
        lambda table: table.assign(
            humerus_elevation_deg=table["humerus_elevation_deg"] / 10.0, scapula_z_deg=table["scapula_z_deg"] / 2.0
        ),
        "scapula_z_deg changes by 32 and humerus_elevation_deg never exceeds 15. Is that the elevation",
    ),
    "a code for an elevation": (
        with_row(9, ["humerus_elevation_deg"], 180.0),
        "humerus_elevation_deg is 180 in posture 3 of 'forward_flexion', 25 before and 75 after it, and the girdle",
    ),
    "zeros for an angle": (
        with_row([1, 9, 10], ["clavicle_z_deg"], 0.0),
        "clavicle_z_deg is exactly 0 in 3 postures, first in posture 2 of 'abduction'. Empty its cells",
    ),
    "an axial rotation of zeros in a motion": (
        in_second(lambda part: 0.0 * part, ["clavicle_x_deg"]),
        "clavicle_x_deg is exactly 0 in 6 postures, first in posture 2 of 'forward_flexion'",
    ),
    "a column copied": (
        lambda table: table.assign(scapula_x_deg=table["clavicle_z_deg"]),
        "clavicle_z_deg and scapula_x_deg are the same in every posture. Is one column a copy of the other?",
    ),
    "elevations of both bones exchanged": (
        exchanged("clavicle_z_deg", "scapula_z_deg"),
        "scapula_z_deg is as clavicle_z_deg is in people, and the other way round",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_table_is_named(tmp_path, name):
    change, said = WRONG[name]
    assert said in said_of(change(shipped()), tmp_path)
    assert not said_of(shipped(), tmp_path)


def test_an_angle_may_pass_through_zero_and_begin_there(tmp_path):
    """Rounded to 0.1 degree a slow angle is exactly 0 in some frames; an axial rotation begins at 0 in each motion."""
    slow = dense().assign(scapula_x_deg=np.round(np.sin(np.arange(19) / 2.0) * 3.0, 1))
    slow.loc[[0, 6, 7, 13], "scapula_x_deg"] = 0.0
    assert not said_of(slow, tmp_path)
    both = pd.concat([slow, slow.assign(motion="scaption", clavicle_y_deg=slow["clavicle_y_deg"] + 0.3)])
    begins = both.assign(clavicle_x_deg=both["clavicle_x_deg"].where(both["posture"] > 1, 0.0))
    assert not said_of(begins, tmp_path)


def test_postures_in_any_order_have_no_elevation_out_of_line(tmp_path):
    """The girdle of a person who moves it little does not follow by more than noise."""
    table = dense()
    table[ANGLE_COLUMNS] = table[ANGLE_COLUMNS].iloc[4] + 0.05 * (table[ANGLE_COLUMNS] - table[ANGLE_COLUMNS].iloc[4])
    table["posture"] = np.random.default_rng(0).permutation(19) + 1
    assert "humerus_elevation_deg" not in said_of(table, tmp_path)


def test_a_posture_between_near_neighbours_is_out_of_line_by_less(tmp_path):
    """A zero between postures 8 degrees of the arm apart is named; between postures 75 degrees apart it may be true."""
    table = dense()
    assert not said_of(table, tmp_path)
    table.loc[8, "scapula_z_deg"] = 0.0
    assert "scapula_z_deg is 0 in posture 9 of 'abduction'" in said_of(table, tmp_path)
    table["humerus_elevation_deg"] *= np.where(table["posture"] == 9, 1.0, 0.0)
    assert "scapula_z_deg is 0 in posture 9" not in said_of(table, tmp_path)


def dense() -> pd.DataFrame:
    """Interpolate the abduction of the shipped subject at nineteen elevations."""
    coarse = shipped()[:7]
    at = np.linspace(0.0, 150.0, 19)
    columns = {name: np.interp(at, coarse["humerus_elevation_deg"], coarse[name]) for name in ANGLE_COLUMNS}
    names = {"subject": "P", "motion": "abduction", "posture": np.arange(1, 20), "humerus_elevation_deg": at}
    return pd.DataFrame(names | columns)


def test_frames_of_an_export_that_stopped_are_named(tmp_path):
    """Numbers of many digits never repeat; rounded numbers may, for a person who stands still."""
    table = dense().assign(humerus_elevation_deg=30.0)
    table[ANGLE_COLUMNS] = shipped()[ANGLE_COLUMNS].iloc[0].to_numpy() + 0.1 * np.arange(19)[:, None] + 1.0 / 3.0
    table.loc[10:, ANGLE_COLUMNS] = table.loc[10, ANGLE_COLUMNS].to_numpy()
    assert "8 postures of 'abduction' are the same as the one before" in said_of(table, tmp_path)
    assert not said_of(table.round(1), tmp_path)
    fewer = table[: 10 + FEWEST_STILL - 1]
    assert not said_of(fewer, tmp_path)


def test_postures_rounded_to_degrees_may_be_the_same(tmp_path):
    rounded = dense().round(0)
    rounded.loc[1, ANGLE_COLUMNS] = rounded.loc[0, ANGLE_COLUMNS].to_numpy()
    assert not said_of(rounded, tmp_path)


def test_a_scapula_that_turns_inward_while_the_clavicle_carries_it_forward_is_named(tmp_path):
    """In horizontal flexion, 90 degrees minus the protraction is as large as the protraction and changes backward."""
    count, rest = 12, shipped()[ANGLE_COLUMNS].iloc[3].to_numpy(float)
    angles = rest + np.outer(np.linspace(0.0, 12.0, count), [1.0, 0.1, 0.1, 0.9, 0.1, 0.1])
    names = {"subject": "P", "motion": "horizontal_flexion", "posture": np.arange(1, count + 1)}
    table = pd.DataFrame(names | {"humerus_elevation_deg": 75.0} | dict(zip(ANGLE_COLUMNS, angles.T, strict=True)))
    assert not said_of(table, tmp_path)
    said = said_of(table.assign(scapula_y_deg=90.0 - table["scapula_y_deg"]), tmp_path)
    assert "scapula_y_deg changes by -0.9 degrees a degree of clavicle_y_deg while the arm is held" in said


@pytest.fixture(scope="module")
def measured_positions(measured_files: tuple[Path, ...]) -> list[pd.DataFrame]:
    """Return the measured shoulders with SC and AA, or skip."""
    folder = measured_files[0].parent.with_name("motions_positions")
    return [pd.read_csv(path) for path in sorted(folder.glob("*.csv"))]


def converted(folder: Path) -> pd.DataFrame:
    """Return the shipped trial with angles computed from its landmarks, and SC, AC, TS, AI beside them."""
    at = tuple(range(10, 130, 10))
    write_motions(read_trial(TRIAL, at_deg=at), folder / "converted.csv")
    table = pd.read_csv(folder / "converted.csv")
    return table[[name for name in table if name.endswith(("_deg", "_mm")) or name in ("subject", "motion", "posture")]]


def places(name: str) -> list[str]:
    return [f"{name}_{axis}_mm" for axis in "xyz"]


def reversed_in_time(table: pd.DataFrame) -> pd.DataFrame:
    columns = [*places("AC"), *places("TS"), *places("AI")]
    table[columns] = table[columns].to_numpy()[::-1]
    return table


AGAINST_ANGLES: dict[str, tuple[Change, str]] = {
    "angles of the clavicle exchanged": (
        lambda table: exchanged("clavicle_z_deg", "clavicle_x_deg")(
            table.assign(clavicle_x_deg=table["clavicle_x_deg"] + 15.0)  # the zero of this angle is a convention
        ),
        "with clavicle_z_deg and clavicle_x_deg exchanged. Are the columns what their names say",
    ),
    "90 degrees minus protraction": (
        lambda table: table.assign(scapula_y_deg=90.0 - table["scapula_y_deg"]),
        "with 90 minus scapula_y_deg. Are the columns what their names say",
    ),
    "rows in another order": (
        reversed_in_time,
        "from where the angles of their rows put them. Are the rows of positions in another order",
    ),
    "a marker that jumps": (
        lambda table: table.assign(AC_z_mm=table["AC_z_mm"] + 25.0 * (table["posture"] == 4)),
        "in posture 4 of 'simulated_trial' AC or SC is",
    ),
    "a landmark copied down": (
        lambda table: table.assign(**table[places("TS")].iloc[0]),
        "TS is at one place in every posture while the arm moves",
    ),
    "a landmark copied down from the fifth posture": (
        lambda table: table.assign(**table[places("TS")].where(table["posture"] <= 5).ffill()),
        "TS is at one place in postures 5 to 12 of 'simulated_trial' while the clavicle turns by",
    ),
    "zeros for a landmark": (
        with_row([3, 5], places("SC"), 0.0),
        "SC is at (0, 0, 0) in 2 postures, first in posture 4 of 'simulated_trial'. IJ is the origin",
    ),
    "the acromion under the name of TS": (
        lambda table: table.drop(columns=[*places("TS"), *places("AI")]).rename(
            columns=dict(zip(places("AC"), places("TS"), strict=True))
        ),
        "TS lies along the clavicle, 0 degrees off it from SC. Is it AC or AA?",
    ),
}


@pytest.mark.parametrize("name", AGAINST_ANGLES)
def test_positions_that_the_angles_beside_them_do_not_have_are_named(tmp_path, name):
    change, said = AGAINST_ANGLES[name]
    assert said in said_of(change(converted(tmp_path)), tmp_path)
    assert not said_of(converted(tmp_path), tmp_path)


def test_rows_of_the_measured_positions_in_another_order_are_named(measured_positions, tmp_path):
    """SC and AA are 1 to 3 mm (rms) from rigid bones at the measured angles, and 12 to 42 mm and more if reversed in
    time, except for one of the six shoulders."""
    named = 0
    for table in measured_positions:
        assert not said_of(table, tmp_path)
        for motion in table["motion"].unique():
            rows = table["motion"] == motion
            columns = [*places("SC"), *places("AA")]
            table.loc[rows, columns] = table.loc[rows, columns].to_numpy()[::-1]
        said = said_of(table, tmp_path)
        named += "from where the angles of their rows put them" in said or "off the angles" in said
    assert named >= len(measured_positions) - 1


def test_a_number_without_its_leading_zero_is_another_subject(tmp_path):
    table = pd.concat([shipped().assign(subject="01"), dense().assign(subject="1"), dense().assign(subject="1.05")])
    table.to_csv(tmp_path / "m.csv", index=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        motions = read_motions(tmp_path / "m.csv")
    with pytest.warns(InputWarning, match="'01' and '1' count as 2 subjects"):
        warn_of_alike_motions(motions, "m.csv")


def test_one_angle_of_another_unit_in_a_file_of_angles_is_named(tmp_path):
    """A .mot file states one unit for all of its columns."""
    columns = {name.removesuffix("_deg"): shipped()[name][:7] for name in ("humerus_elevation_deg", *ANGLE_COLUMNS)}
    columns["scapula_z"] = np.radians(columns["scapula_z"])
    head = ["m", "version=1", "nRows=7", f"nColumns={len(columns) + 1}", "inDegrees=yes", "endheader"]
    rows = pd.DataFrame({"time": np.arange(7) / 100.0} | columns).to_csv(sep="\t", index=False)
    (tmp_path / "m.mot").write_text("\n".join(head) + "\n" + rows)
    with pytest.warns(
        InputWarning, match="scapula_z_deg never exceeds 3.14 while the arm moves: it looks like radians"
    ):
        read_trial(tmp_path / "m.mot")
