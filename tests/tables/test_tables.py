"""The tables of results on numbers small enough to check by hand."""

import numpy as np
import pandas as pd
import pytest

from adapt.solvers import status
from adapt.tables.folds import MOTION, POSTURES
from adapt.tables.held_out import NOTHING
from adapt.tables.results import (
    ALL_MOTIONS,
    DIFFERENCES,
    HELD_OUT,
    STATISTICS,
    as_csv,
    parameter_statistics,
    rows_of_subjects,
    summary_of,
    summary_table,
)
from models.adapted_parameters import ADAPTED
from motions import ANGLES

MEANS = [f"{angle}_deg" for angle in ANGLES]


def fits(*rows: tuple[str, str, float, str], model: str = "R2", adapted: int = 0) -> pd.DataFrame:
    """Make rows of ``fits.csv``: (subject, motion, d, status), with differences d, -2 d, 3 d, -4 d, 5 d, -6 d deg."""
    signed = np.array([1.0, -2.0, 3.0, -4.0, 5.0, -6.0])
    table = pd.DataFrame(
        {
            "model": model,
            "adapted": adapted,
            "subject": [row[0] for row in rows],
            "motion": [row[1] for row in rows],
            "status": [row[3] for row in rows],
        }
    )
    table[DIFFERENCES] = np.array([row[2] for row in rows])[:, None] * signed
    return table


def block(summary: pd.DataFrame, **chosen) -> pd.DataFrame:
    """Select the rows with these values, by subject (or statistic)."""
    mask = np.all([summary[column] == value for column, value in chosen.items()], axis=0)
    return summary[mask].set_index("subject")


THREE = fits(
    ("one", "abduction", 1.0, status.OK),
    ("one", "abduction", -3.0, status.OK),
    ("two", "abduction", 4.0, status.OK),
    ("three", "abduction", 9.0, status.OK),
)
"""Mean absolute difference of the first angle: 2, 4 and 9 degrees; the k-th angle has k times that."""


def test_a_subject_is_the_mean_of_its_absolute_differences():
    table = block(summary_table(THREE), motion=ALL_MOTIONS)
    assert table.index.tolist() == ["one", "two", "three", *STATISTICS]
    for subject, expected in {"one": 2.0, "two": 4.0, "three": 9.0}.items():
        np.testing.assert_allclose(table.loc[subject, MEANS].to_numpy(float), expected * np.arange(1, 7), rtol=1e-15)
        assert table.loc[subject, "clavicle_deg"] == pytest.approx(2.0 * expected, rel=1e-15)
        assert table.loc[subject, "scapula_deg"] == pytest.approx(5.0 * expected, rel=1e-15)


def test_statistics_are_those_of_the_subjects():
    """2, 4, 9: mean 5, std sqrt((9 + 1 + 16) / 2) = sqrt(13), with n - 1 as in Table 6.1 (its first column: 1.9)."""
    table = block(summary_table(THREE), motion=ALL_MOTIONS)
    for row, expected in {"mean": 5.0, "std": np.sqrt(13.0), "max": 9.0, "min": 2.0}.items():
        values = table.loc[row, [*MEANS, "clavicle_deg", "scapula_deg"]].to_numpy(float)
        np.testing.assert_allclose(values, expected * np.array([1, 2, 3, 4, 5, 6, 2, 5]), rtol=1e-14)


def test_table_6_1_first_column():
    """Ten subjects as printed give 4.0, 1.9, 7.4, 1.5 to one digit, so std has n - 1 (with n it would be 1.8)."""
    printed = (6.6, 3.9, 1.5, 7.4, 5.0, 3.1, 1.9, 4.9, 3.6, 2.5)
    rows = [(f"{k}", "abduction", value, status.OK) for k, value in enumerate(printed, 1)]
    table = block(summary_table(fits(*rows)), motion=ALL_MOTIONS)
    assert [round(table.loc[row, "clavicle_y_deg"], 1) for row in STATISTICS] == [4.0, 1.9, 7.4, 1.5]


def test_postures_that_are_not_ok_do_not_count():
    bad = fits(
        ("one", "abduction", 100.0, status.UNREACHABLE),
        ("two", "abduction", np.nan, status.INVALID),
        ("four", "abduction", 100.0, status.NOT_CONVERGED),
    )
    table = block(summary_table(pd.concat([THREE, bad], ignore_index=True)), motion=ALL_MOTIONS)
    assert table.loc[["one", "two", "three"], "clavicle_y_deg"].tolist() == [2.0, 4.0, 9.0]
    assert table.loc[["one", "two", "three", "four"], "postures"].tolist() == [3, 2, 1, 1]
    assert table.loc[["one", "two", "three", "four"], "postures_ok"].tolist() == [2, 1, 1, 0]
    assert np.isnan(table.loc["four", "clavicle_y_deg"])
    assert table.loc["mean", "clavicle_y_deg"] == 5.0
    assert (table.loc["mean", "postures"], table.loc["mean", "postures_ok"]) == (7, 4)


def test_an_angle_that_was_not_measured_does_not_count():
    rows = fits(("one", "abduction", 1.0, status.OK), ("one", "abduction", 3.0, status.OK))
    rows.loc[1, DIFFERENCES[0]] = np.nan
    table = block(summary_table(rows), motion=ALL_MOTIONS)
    assert table.loc["one", MEANS[:2]].tolist() == [1.0, 4.0]


def test_motions_apart_and_together():
    both = fits(("one", "abduction", 1.0, status.OK), ("one", "flexion", 2.0, status.OK))
    summary = summary_table(both)
    assert list(dict.fromkeys(summary["motion"])) == [ALL_MOTIONS, "abduction", "flexion"]
    values = [
        block(summary, motion=name).loc["one", "clavicle_y_deg"] for name in (ALL_MOTIONS, "abduction", "flexion")
    ]
    assert values == [1.5, 1.0, 2.0]
    assert list(dict.fromkeys(summary_table(THREE)["motion"])) == [ALL_MOTIONS]


def test_models_and_states_apart():
    after = fits(("one", "abduction", 1.0, status.OK), adapted=1)
    other = fits(("one", "abduction", 5.0, status.OK), model="R4")
    summary = summary_table(pd.concat([THREE, after, other], ignore_index=True))
    blocks = summary[["model", "adapted"]].drop_duplicates().to_numpy().tolist()
    assert blocks == [["R2", 0], ["R2", 1], ["R4", 0]]
    assert block(summary, model="R2", adapted=1).loc["one", "clavicle_y_deg"] == 1.0
    assert block(summary, model="R4").loc["mean", "clavicle_y_deg"] == 5.0
    assert np.isnan(block(summary, model="R4").loc["std", "clavicle_y_deg"])


def heldout(*rows: tuple[str, str, str, int, float], model: str = "R2") -> pd.DataFrame:
    """Make rows of ``heldout.csv``: (subject, kind, held out, postures, clavicle gap); the scapula has twice it."""
    table = pd.DataFrame(rows, columns=["subject", "kind", "held_out", "postures", "clavicle_gap_unseen_deg"])
    return table.assign(model=model, scapula_gap_unseen_deg=2.0 * table["clavicle_gap_unseen_deg"])


SEVERAL = [("one", "abduction"), ("one", "flexion"), ("two", "abduction"), ("three", "abduction"), ("three", "flexion")]

HELD_OUT_PARTS = (
    ("one", MOTION, "abduction", 2, 1.0),
    ("one", MOTION, "flexion", 1, 4.0),
    ("one", POSTURES, "third 1", 3, 50.0),
    ("two", POSTURES, "third 1", 2, 3.0),
    ("two", POSTURES, "third 2", 1, 6.0),
)
"""Held-out parts: of "one" both motions and, as in `girdle trust`, thirds; of "two", which has one motion, thirds."""


def before_and_after(model: str = "R2") -> pd.DataFrame:
    rows = [(*names, 1.0, status.OK) for names in SEVERAL]
    return pd.concat([fits(*rows, model=model, adapted=state) for state in (0, 1)], ignore_index=True)


def test_the_gap_held_out_stands_beside_that_in_sample():
    """One: (2 1 + 4) / 3 = 2; two: (2 3 + 6) / 3 = 4, also for its only motion; three was not held out."""
    summary = summary_of(rows_of_subjects(before_and_after()), heldout(*HELD_OUT_PARTS))
    assert summary.columns.tolist()[-4:] == ["postures", "postures_ok", *HELD_OUT.values()]
    expected = {
        ALL_MOTIONS: {"one": 2.0, "two": 4.0, "mean": 3.0, "std": np.sqrt(2.0), "max": 4.0, "min": 2.0},
        "abduction": {"one": 1.0, "two": 4.0, "mean": 2.5, "std": np.sqrt(4.5), "max": 4.0, "min": 1.0},
        "flexion": {"one": 4.0, "mean": 4.0, "max": 4.0, "min": 4.0},
    }
    for motion, values in expected.items():
        after = block(summary, motion=motion, adapted=1)
        found = {bone: after[column].dropna().to_dict() for bone, column in HELD_OUT.items()}
        assert found["clavicle"] == pytest.approx(values)
        assert found["scapula"] == pytest.approx({name: 2.0 * value for name, value in values.items()})
    assert summary.loc[summary["adapted"] == 0, list(HELD_OUT.values())].isna().to_numpy().all()


def test_the_gap_held_out_is_that_of_its_model():
    both = pd.concat([before_and_after(), before_and_after("R4")], ignore_index=True)
    summary = summary_of(
        rows_of_subjects(both),
        pd.concat([heldout(*HELD_OUT_PARTS), heldout(("one", MOTION, "flexion", 1, 9.0), model="R4")]),
    )
    mean = {model: block(summary, model=model, adapted=1, motion="all").loc["mean"] for model in ("R2", "R4")}
    assert {model: row["clavicle_held_out_deg"] for model, row in mean.items()} == {"R2": 3.0, "R4": 9.0}


def test_without_a_gap_in_sample_there_is_none_held_out():
    """A motion without a successful fit, of a subject whose other motion was held out by thirds."""
    lost = before_and_after()
    lost.loc[(lost["subject"] == "three") & (lost["motion"] == "flexion"), "status"] = status.UNREACHABLE
    summary = summary_of(rows_of_subjects(lost), heldout(("three", POSTURES, "third 1", 1, 5.0)))
    held = [block(summary, motion=m, adapted=1).loc["three", "scapula_held_out_deg"] for m in ("all", "abduction")]
    assert held == [10.0, 10.0]
    assert np.isnan(block(summary, motion="flexion", adapted=1).loc["three", "scapula_held_out_deg"])


@pytest.mark.parametrize("nothing", [NOTHING, heldout()])
def test_without_anything_held_out_the_columns_are_empty(nothing):
    summary = summary_of(rows_of_subjects(before_and_after()), nothing)
    assert summary[list(HELD_OUT.values())].isna().to_numpy().all()
    pd.testing.assert_frame_equal(summary, summary_table(before_and_after()))


def parameters(model: str, M_y_mm: list[float], words: list[str]) -> pd.DataFrame:
    """Make ``parameters.csv`` with M_y as given, and every other parameter at the set's own value, 7 mm."""
    columns: dict[str, object] = {"model": [model] * len(words), "status": words}
    for name in ADAPTED:
        columns[f"{name}_mm"] = M_y_mm if name == "M_y" else 7.0
        columns[f"{name}_mm_model"] = -296.0 if name == "M_y" else 7.0
        columns[f"{name}_mm_at_bound"] = [int(value > -200.0) if name == "M_y" else 0 for value in M_y_mm]
    return pd.DataFrame(columns)


def test_parameter_statistics_by_hand():
    """-300, -290, -190: mean -260, SD sqrt((40^2 + 30^2 + 70^2) / 2) = sqrt(3700), without the failed subject."""
    words = [status.OK, status.OK, status.OK, status.NOT_CONVERGED]
    R2 = parameters("R2", [-300.0, -290.0, -190.0, 1e6], words)
    found = parameter_statistics(pd.concat([R2, parameters("R4", [-230.0], [status.OK])], ignore_index=True))
    assert found["model"].tolist() == ["R2"] * 6 + ["R4"] * 6
    assert found["parameter"].tolist() == [*ADAPTED, *ADAPTED]
    M_y, others = found.iloc[0], found.iloc[1:6]
    assert M_y["mean_mm"] == pytest.approx(-260.0)
    assert M_y["sd_mm"] == pytest.approx(np.sqrt(3700.0))
    assert (M_y["model_mm"], M_y["at_bound"], M_y["subjects"]) == (-296.0, 1, 3)
    assert others["sd_mm"].tolist() == [0.0] * 5
    assert others["mean_mm"].tolist() == [7.0] * 5
    assert np.isnan(found.iloc[6]["sd_mm"])
    assert found.iloc[6]["subjects"] == 1


def test_parameter_statistics_of_nobody():
    found = parameter_statistics(parameters("R2", [-300.0], [status.NOT_CONVERGED]))
    assert found["model"].tolist() == []


def test_csv_is_that_of_pandas():
    """Numbers of every size, missing values, infinity, and names that need quotation marks."""
    generator = np.random.default_rng(4)
    values = generator.normal(size=200) * 10.0 ** generator.integers(-20, 20, 200)
    values[:8] = np.nan, np.inf, -np.inf, -0.0, 1e16, np.nextafter(1e16, 0.0), 1e-4, np.nextafter(1e-4, 0.0)
    values[8:12] = 1e-9, np.nextafter(1e-9, 0.0), 5e-324, -1e-100
    names = ["plain", "a,b", 'say "so"', "two\nlines", "", " space ", "ä", "=1"]
    table = pd.DataFrame({"name": np.resize(names, 200), "number": values, "count": np.arange(200), "x": np.nan})
    table["large"] = 10**17 + np.arange(200)
    for part in (table, table.iloc[:0]):
        assert as_csv(part) == part.to_csv(index=False, lineterminator="\n")
