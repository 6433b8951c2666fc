# pyright: reportAttributeAccessIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Bad, unusual and good subjects in one run; invalid models; very many postures."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command import Ended, girdle, refused, written
from test_cli import OPEN_MM, shipped_lines

from adapt import adapt_subjects
from adapt.cli.terminal.print_verdict import verdicts
from adapt.solvers import status
from adapt.tables.results import DIFFERENCES
from models import load_model
from models.parameter_sets import FOLDER
from motions import ANGLES, Motions, read_motions
from motions.rhythm_subjects import DATA_FILE

SAME = 1e-12
"""Relative tolerance: results do not depend on the batch, but sums over other shapes may round differently."""

GOOD = ["simulated01", "simulated02"]


def of_first(name: str, change) -> list[str]:
    """Return the first shipped subject's rows under another name, with ``change(k, cells)`` of row k's six cells."""
    lines = []
    for k, line in enumerate(shipped_lines(1)[1:]):
        cells = line.split(",")
        lines.append(",".join([name, *cells[1:4], *change(k, cells[4:10]), *cells[10:]]))
    return lines


def cell(k: int, place: int, text: str):
    return lambda row, cells: [text if (row, j) == (k, place) else c for j, c in enumerate(cells)]


ANGLES_OF_ONE = ["-30", "12", "7", "32", "11", "-10"]

LEFT_OUT = {
    "nan_posture": (of_first("nan_posture", lambda k, c: ["nan"] * 6 if k == 3 else c), "no angle was measured"),
    "empty_posture": (of_first("empty_posture", lambda k, c: [""] * 6 if k == 3 else c), "no angle was measured"),
    "infinite": (of_first("infinite", cell(4, 2, "-inf")), "clavicle_x_deg is infinite"),
    "overflow": (of_first("overflow", cell(4, 2, "1e400")), "clavicle_x_deg is infinite"),
    "huge": (of_first("huge", cell(4, 5, "1e300")), "more than 180 degrees"),
}
STRANGE = {
    "constant": of_first("constant", lambda k, c: ANGLES_OF_ONE),
    "one_posture": of_first("one_posture", lambda k, c: c)[5:6],
    "half_a_turn_apart": of_first("half_a_turn_apart", lambda k, c: ["170", *c[1:]]),
    "three_angles": of_first("three_angles", lambda k, c: [c[0], c[1], "", c[3], "", ""]),
}
"""Valid but unusual subjects. In "half_a_turn_apart" the bones contradict each other; "three_angles" leaves no gap."""


@pytest.fixture(scope="module")
def everyone(tmp_path_factory) -> tuple[Ended, dict[str, pd.DataFrame]]:
    """Run `girdle adapt` on two good subjects among the others; return its tables."""
    folder = tmp_path_factory.mktemp("everyone")
    header, *good = shipped_lines(2)
    bad = [line for lines, _ in LEFT_OUT.values() for line in lines]
    strange = [line for lines in STRANGE.values() for line in lines]
    path = written(folder, [header, *good[:14], *bad, *strange, *good[14:]])
    result = girdle("adapt", path, "--model", "R2", "--out", folder / "out")
    return result, {name: pd.read_csv(folder / "out" / f"{name}.csv") for name in ("fits", "parameters")}


def test_who_cannot_be_used_is_named_and_nobody_else(everyone):
    result, tables = everyone
    assert result.status == 3
    assert "Traceback" not in result.err
    left_out = [line for line in result.messages if line.startswith("left out: ")]
    assert len(left_out) == len(LEFT_OUT)
    for name, (_, cause) in LEFT_OUT.items():
        (line,) = [line for line in left_out if f"subject '{name}'" in line]
        assert cause in line
    assert tables["parameters"]["subject"].tolist() == [GOOD[0], *STRANGE, GOOD[1]]
    count = len(STRANGE) + len(GOOD)
    assert f"{count - 1} of {count} subjects adapted" in result.out, "who was left out has no gap"


def test_good_subjects_are_what_they_are_alone(everyone):
    """Equal to rounding, as the file has 17 digits."""
    _, tables = everyone
    motions = read_motions(DATA_FILE)
    alone = adapt_subjects(motions.select(np.isin(motions.subject, GOOD)), load_model("R2"))
    for name, expected in (("fits", alone.fits), ("parameters", alone.parameters)):
        rows = tables[name][tables[name]["subject"].isin(GOOD)].reset_index(drop=True)
        assert (rows["status"] == expected["status"]).all()
        for column in expected.select_dtypes("number"):
            np.testing.assert_allclose(rows[column], expected[column], rtol=SAME, atol=SAME * 180.0, err_msg=column)


def test_what_is_called_ok_closes_and_the_rest_is_named(everyone):
    result, tables = everyone
    fits, parameters = tables["fits"], tables["parameters"]
    ok = fits[fits["status"] == status.OK]
    assert np.abs(ok[["a1_mm", "a2_mm", "a3_mm"]].to_numpy()).max() <= OPEN_MM
    measured = ok[[f"{angle}_measured_deg" for angle in ANGLES]].notna()
    np.testing.assert_array_equal(np.isfinite(ok[DIFFERENCES]), measured)
    failed = set(fits[(fits["status"] != status.OK) & (fits["adapted"] == 1)]["subject"])
    failed |= set(parameters[parameters["status"] != status.OK]["subject"])
    named = {re.split(": ", line)[1] for line in result.messages if line.startswith("not handled: ")}
    assert named == failed
    assert not named & set(GOOD)


def test_equal_postures_are_fitted_alike_and_one_posture_is_enough(everyone):
    _, tables = everyone
    fits = tables["fits"].set_index(["subject", "adapted"])
    for adapted in (0, 1):
        constant = fits.loc[("constant", adapted)][[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy()
        assert np.ptp(constant, axis=0).max() < 1e-6
    parameters = tables["parameters"].set_index("subject")
    assert parameters.loc["one_posture", "status"] == status.OK
    after, before = (parameters.loc["one_posture", f"mean_j_{when}_deg2"] for when in ("after", "before"))
    assert after <= before


def test_angles_without_numbers_from_python():
    """Through Python, an infinite angle counts as not measured, and a posture of NaN makes its subject invalid."""
    motions = read_motions(DATA_FILE)
    part = motions.select(motions.subject == GOOD[0])
    names = ["good", "nan_posture", "infinite", "gap"]
    angles_deg = np.stack([part.angles_deg] * len(names))
    angles_deg[1, 3] = np.nan
    angles_deg[2, 3, 2], angles_deg[3, 3, 2] = -np.inf, np.nan
    every = Motions.concatenate([part] * len(names))
    every.angles_deg[:] = angles_deg.reshape(-1, 6)
    every = replace(every, subject=np.repeat(names, len(part.posture)))
    result = adapt_subjects(every, load_model("R2"))
    by_name = result.parameters.set_index("subject")
    assert by_name["status"].tolist() == [status.OK, status.INVALID, status.OK, status.OK]
    pd.testing.assert_series_equal(by_name.loc["infinite"], by_name.loc["gap"], check_names=False)
    after = result.fits[(result.fits["subject"] == "nan_posture") & (result.fits["adapted"] == 1)]
    assert set(after["status"]) == {status.INVALID}, "of a girdle without numbers"


def test_contradictory_angles_end_with_closed_chains_or_a_word(tmp_path):
    """Clavicle and scapula half a turn apart, and random angles, among good subjects."""
    header, *good = shipped_lines(1)
    numbers = np.random.default_rng(0).uniform(-180.0, 180.0, (14, 6))
    apart = of_first("apart", lambda k, c: ["170", *c[1:]])
    drawn = of_first("drawn", lambda k, c: [f"{x:.3f}" for x in numbers[k]])
    result = girdle("fit", written(tmp_path, [header, *apart, *good, *drawn]), "--out", tmp_path / "out")
    fits = pd.read_csv(tmp_path / "out" / "fits.csv")
    ok = fits[fits["status"] == status.OK]
    assert np.abs(ok[["a1_mm", "a2_mm", "a3_mm"]].to_numpy()).max() <= OPEN_MM
    lost = set(fits[fits["status"] != status.OK]["subject"])
    left_out = {name for name in ("apart", "drawn") if name not in set(fits["subject"])}
    assert result.status == (3 if lost | left_out else 0)
    assert all(any(name in line for line in result.messages) for name in lost | left_out)
    alone = girdle("fit", written(tmp_path, [header, *good], "good.csv"), "--out", tmp_path / "alone")
    assert alone.status == 0
    expected = pd.read_csv(tmp_path / "alone" / "fits.csv").select_dtypes("number")
    found = fits[fits["subject"] == GOOD[0]].reset_index(drop=True)[expected.columns]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=SAME * 180.0)


TOO_MANY = 10_000


def test_ten_thousand_postures_of_one_subject(tmp_path):
    """Postures on a straight line between the first two postures: every fit is near the one before."""
    header, first, second = shipped_lines(1)[:3]
    low, high = (np.array(line.split(",")[3:10], dtype=float) for line in (first, second))
    rows = low + (high - low) * np.linspace(0.0, 1.0, TOO_MANY)[:, None]
    lines = [f"P1,slow,{k + 1}," + ",".join(f"{x:.6f}" for x in row) for k, row in enumerate(rows)]
    path = written(tmp_path, [header.removesuffix(",origin"), *lines])
    result = girdle("fit", path, "--model", "R2", "--out", tmp_path / "out")
    assert (result.status, result.messages) == (0, [])
    fits = pd.read_csv(tmp_path / "out" / "fits.csv")
    assert len(fits) == TOO_MANY
    assert set(fits["status"]) == {status.OK}
    assert set(fits["jump"]) == {0}
    steps = fits[[f"{angle}_simulated_deg" for angle in ANGLES]].diff().abs().max().max()
    assert steps < 10.0 * np.abs(high - low).max() / TOO_MANY


MODELS = {
    "a zero axis": (r"semi_axes_mm = \[153.0", "semi_axes_mm = [0.0", "must be at least 1 mm"),
    "a collinear scapula": (r"ai_mm = \[.*\]", "ai_mm = [-60.0, 0.0, 0.0]", "lie on a line"),
    "a negative length": (r"\nlength_mm = ", "\nlength_mm = -", "must be at least 1 mm"),
    "a number that is none": (r"\nlength_mm = [0-9.]+", "\nlength_mm = nan", "not finite"),
    "an infinite one": (r"\nlength_mm = [0-9.]+", "\nlength_mm = -inf", "not finite"),
    "a code": (r"\nlength_mm = [0-9.]+", "\nlength_mm = \"__import__('os')\"", "must be one number"),
}


@pytest.mark.parametrize(("old", "new", "cause"), MODELS.values(), ids=MODELS)
def test_a_model_that_is_no_girdle_is_status_2(tmp_path, old, new, cause):
    text, count = re.subn(old, new, (FOLDER / "R2.toml").read_text())
    assert count == 1
    (tmp_path / "own.toml").write_text(text)
    motion, model = written(tmp_path, shipped_lines()), tmp_path / "own.toml"
    result = girdle("adapt", motion, "--model", model, "--out", tmp_path / "x")
    refused(result, str(model), cause, "")
    assert not (tmp_path / "x").exists()


def test_a_wrong_sign_is_a_warning_of_so_many_subjects(tmp_path):
    """The adaptation would look good, but no person's scapula has such angles with the arm down."""
    header, *rows = shipped_lines(10)
    flipped = [",".join([*cells[:7], f"-{cells[7]}", *cells[8:]]) for cells in (row.split(",") for row in rows)]
    twice = [row.replace("simulated", "again") for row in flipped]
    for command in ("adapt", "fit"):
        said = girdle(command, written(tmp_path, [header, *flipped, *twice]), "--out", tmp_path / command).messages
        assert len(said) == 11
        assert re.match(r"warning: .*motion\.csv: simulated01: scapula_y_deg .* is -\d+ with the arm low", said[0])
        assert said[10].startswith("warning: the motions: 10 more subjects are like this")
    assert girdle("fit", written(tmp_path, [header, *rows]), "--out", tmp_path / "right").messages == []


def test_where_nobody_was_adapted_no_gap_is_given():
    """The gap would come from fits that did not converge."""
    motions = read_motions(DATA_FILE)
    result = adapt_subjects(motions.select(motions.subject == motions.subjects[0]), load_model("R2"), held_out=())
    nobody = replace(result, parameters=result.parameters.assign(status=status.NOT_CONVERGED))
    assert list(verdicts(nobody.parameters, nobody.heldout, nobody.summary)) == ["R2: none of 1 subjects adapted."]


def test_where_no_posture_was_fitted_the_verdict_says_so_in_place_of_a_gap():
    """R2 with a conoid that closes the chain in no posture, before adaptation and after it."""
    motions, R2 = read_motions(DATA_FILE), load_model("R2")
    short = replace(R2, girdle=replace(R2.girdle, conoid_length_mm=np.array(3.0)))
    result = adapt_subjects(motions.select(motions.subject == motions.subjects[0]), short, held_out=())
    said = next(verdicts(result.parameters, result.heldout, result.summary))
    assert re.search(r"adapted to: clavicle not fitted -> \d\.\d deg, scapula not fitted -> \d\.\d deg; ", said)
    gaps = [name for name in result.summary if name.endswith("_deg")]
    nowhere = result.summary.assign(**dict.fromkeys(gaps, np.nan))
    said = next(verdicts(result.parameters, result.heldout, nowhere))
    assert "1 of 1 subjects adapted; no gap, as no posture could be fitted; " in said
