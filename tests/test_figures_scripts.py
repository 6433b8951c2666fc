"""The scripts on the output of `girdle adapt`: a hand-made folder whose figures can be worked out by hand."""

from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
import pytest
from typer.testing import CliRunner

from motions import ANGLES, InputError
from scripts import draw_before_after

GAP_DEG = {0: 3.0, 1: 1.0}
"""Simulated less measured, every angle, before and after adaptation."""


def fits(subject: str) -> pd.DataFrame:
    """Three postures before and after; the measured angles rise with the humerus."""
    rows = [
        {"model": "R2", "subject": subject, "motion": "abduction", "posture": posture, "adapted": adapted}
        | {"humerus_elevation_deg": 30.0 * posture, "status": "ok", "jump": 0}
        | {f"{angle}_measured_deg": 5.0 * posture for angle in ANGLES}
        | {f"{angle}_simulated_deg": 5.0 * posture + GAP_DEG[adapted] for angle in ANGLES}
        for adapted in (0, 1)
        for posture in range(3)
    ]
    return pd.DataFrame(rows)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """fits.csv of the subjects 001 and b."""
    pd.concat([fits("001"), fits("b")]).to_csv(tmp_path / "fits.csv", index=False)
    return tmp_path


def drawn(folder: Path, name: str, *options: str) -> str:
    """The SVG that the script writes with these options."""
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
