"""The scripts for the output of `girdle adapt`, on a hand-made folder whose figures can be computed by hand."""

from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
import pytest
from typer.testing import CliRunner

from models.adapted_parameters import ADAPTED
from motions import ANGLES, InputError
from scripts import draw_before_after, summarise_gap

GAP_DEG = {0: 3.0, 1: 1.0}
"""Simulated less measured, for every angle, before and after adaptation."""


def fits(subject: str) -> pd.DataFrame:
    """Make three postures before and after adaptation; the measured angles increase with the humerus."""
    rows = [
        {"model": "R2", "subject": subject, "motion": "abduction", "posture": posture, "adapted": adapted}
        | {"humerus_elevation_deg": 30.0 * posture, "status": "ok", "jump": 0}
        | {f"{angle}_measured_deg": 5.0 * posture for angle in ANGLES}
        | {f"{angle}_simulated_deg": 5.0 * posture + GAP_DEG[adapted] for angle in ANGLES}
        for adapted in (0, 1)
        for posture in range(3)
    ]
    return pd.DataFrame(rows)


def summary(adapted: int, mean_deg: float, max_deg: float) -> pd.DataFrame:
    """Make the statistics rows of all motions, and rows of one motion and one subject that the scripts must not use.

    The clavicle has half the scapula's mean, and each angle a tenth less than the one before it. The held-out gap is a
    degree larger.
    """
    means = {f"{angle}_deg": max_deg - 0.1 * k for k, angle in enumerate(reversed(ANGLES))}
    bones = {"clavicle_deg": mean_deg / 2.0, "scapula_deg": mean_deg}
    bones |= {f"{bone}_held_out_deg": bones[f"{bone}_deg"] + 1.0 for bone in ("clavicle", "scapula")}
    wrong = dict.fromkeys((*means, *bones), 99.0)
    rows = [("all", "001", wrong), ("all", "mean", wrong | bones), ("all", "max", wrong | means)]
    rows += [("abduction", "mean", wrong), ("abduction", "max", wrong)]
    return pd.DataFrame(
        [{"model": "R2", "adapted": adapted, "motion": motion, "subject": name} | row for motion, name, row in rows]
    )


def parameters(
    subject: str, moved_mm: tuple[float, float], at_bound: tuple[str, ...], status: str
) -> dict[str, object]:
    """Make one row of parameters.csv."""
    row: dict[str, object] = {"model": "R2", "subject": subject, "status": status}
    for name in ADAPTED:
        row |= {f"{name}_mm": 100.0, f"{name}_mm_model": 100.0, f"{name}_mm_at_bound": int(name in at_bound)}
    return row | {"M_y_mm": 100.0 + moved_mm[0], "M_z_mm": 100.0 + moved_mm[1]}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write the tables of `girdle adapt` for the subjects 001, b and c; c did not converge."""
    pd.concat([fits("001"), fits("b")]).to_csv(tmp_path / "fits.csv", index=False)
    pd.concat([summary(0, 6.0, 20.0), summary(1, 3.0, 10.0)]).to_csv(tmp_path / "summary.csv", index=False)
    rows = [
        parameters("001", (3.0, 4.0), ("A_y",), "ok"),
        parameters("b", (0.0, -15.0), ("A_y", "conoid_length"), "ok"),
        parameters("c", (1000.0, 0.0), ("M_y",), "not_converged"),
    ]
    pd.DataFrame(rows).to_csv(tmp_path / "parameters.csv", index=False)
    return tmp_path


def drawn(folder: Path, name: str, *options: str) -> str:
    """Return the SVG that the script writes with these options."""
    out = folder / "figures" / name
    arguments = [str(folder / "fits.csv"), "--out", str(out), *options]
    result = CliRunner().invoke(draw_before_after.app, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return out.read_text(encoding="utf-8")


def words(svg: str) -> list[str]:
    return [node.text or "" for node in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


def test_the_figure_names_its_subject_and_its_gaps(folder):
    text = words(drawn(folder, "a.svg", "--subject", "001", "--model", "R2"))
    assert "001, abduction, parameter set R2" in text
    assert text.count("3.0° → 1.0°") == len(ANGLES)
    assert {"measured", "simulated, before adaptation", "simulated, after adaptation"} <= set(text)
    assert {"scapula to thorax, degrees", "clavicle to thorax, degrees", "humerus elevation, degrees"} <= set(text)


def test_the_figure_says_the_gap_where_its_motion_was_held_out(folder):
    """The subject's only motion has the gap of all motions. Without summary or held-out gaps nothing is printed."""
    table = pd.read_csv(folder / "summary.csv", dtype={"subject": str})
    mine = (table["subject"] == "001") & (table["adapted"] == 1)
    table.loc[mine, ["scapula_held_out_deg", "clavicle_held_out_deg"]] = 1.25, 2.5
    table.to_csv(folder / "summary.csv", index=False)
    note = "grey: mean |simulated − measured|, before → after"
    said = f"{note}; held out: scapula 1.2°, clavicle 2.5°"
    assert said in words(drawn(folder, "a.svg", "--subject", "001"))
    assert note in words(drawn(folder, "b.svg", "--subject", "b"))
    (folder / "summary.csv").unlink()
    assert note in words(drawn(folder, "c.svg", "--subject", "001"))


def test_the_same_table_gives_the_same_bytes(folder):
    assert drawn(folder, "a.svg") == drawn(folder, "b.svg")


def test_a_failed_fit_and_an_angle_not_measured_are_left_out(folder):
    table = pd.read_csv(folder / "fits.csv")
    table.loc[table["posture"] == 2, "status"] = "unreachable"
    table.loc[table["posture"] == 2, [f"{angle}_simulated_deg" for angle in ANGLES]] = 999.0
    table["clavicle_x_measured_deg"] = float("nan")
    table.to_csv(folder / "fits.csv", index=False)
    text = words(drawn(folder, "a.svg", "--subject", "b", "--title", "Somebody"))
    assert "Somebody, abduction, parameter set R2" in text
    assert text.count("3.0° → 1.0°") == len(ANGLES) - 1
    assert "not measured" in text


@pytest.mark.parametrize(("option", "column"), [("--subject", "subject"), ("--model", "model"), ("--motion", "motion")])
def test_a_name_that_is_not_there_is_named_with_those_that_are(folder, option, column):
    with pytest.raises(InputError, match=f"no {column} 'nobody'. Use one of"):
        drawn(folder, "a.svg", option, "nobody")


def test_the_table_of_the_gap_is_the_one_worked_out_by_hand(folder, capsys):
    """Scapula: tipping is the worst angle; clavicle: axial rotation, 0.3 deg less. Centre: (5 + 15) / 2 mm."""
    summarise_gap.main(folder)
    *_, row, _, endings = capsys.readouterr().out.splitlines()
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    gaps = ["6.0 -> 3.0 (4.0)", "20.0 -> 10.0", "3.0 -> 1.5 (2.5)", "19.7 -> 9.7"]
    assert cells == ["R2", *gaps, "10 mm", "2 of 2 (A_y 2, conoid_length 1)"]
    assert endings.startswith("ok: 2 of 3 adaptations, 12 of 12 posture fits; 0 jumps along a motion.")


def test_a_folder_of_something_else_is_named(folder):
    (folder / "summary.csv").unlink()
    with pytest.raises(InputError, match=r"summary\.csv"):
        summarise_gap.main(folder)


def test_a_folder_of_an_earlier_version_is_to_be_written_anew(folder):
    table = pd.read_csv(folder / "summary.csv").drop(columns="scapula_held_out_deg")
    table.to_csv(folder / "summary.csv", index=False)
    with pytest.raises(InputError, match=r"no column scapula_held_out_deg\. Run `girdle adapt` anew"):
        summarise_gap.main(folder)
