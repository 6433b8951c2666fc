"""Printed numbers of Tables 4.6-4.8 and Appendices C and D that can be checked without the unpublished contours."""

import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from thesis_tables import LINES_OF_DISSECTION, MASSES_KG, TABLE_4_6, TABLE_4_7, TABLE_4_8

from models.muscles.muscle_lines import published_lines
from models.person.contours.stack_volume import stack_volume_cm3
from models.person.transfer.attachment_types import LARGE, SMALL
from models.person.transfer.contour_distances import spread_of
from tests.helpers.command import girdle, refused, written

THESIS = Path(__file__).parents[3] / "shared" / "thesis.txt"

ROUNDED = 0.05
"""Half of the last printed digit, mm."""


def sd_range(name: str, ddof: int) -> tuple[float, float]:
    """Compute the smallest and largest SD that distances with the printed mean, least and largest can have, with
    rounding.

    The SD is smallest with equal inner distances, and largest with all but one inner distance at an end.
    """
    mean, _, least, most = TABLE_4_7[name]
    count, found = LINES_OF_DISSECTION[name], []
    for by in (-ROUNDED, 0.0, ROUNDED):
        low, high, total = least + by, most - by, count * (mean + by)
        inner = total - low - high
        at_most = int(np.clip((inner - (count - 2) * low) / (high - low), 0, count - 3)) if count > 3 else 0
        ends = [high] * at_most + [low] * (count - 3 - at_most)
        for parts in ([inner / (count - 2)] * (count - 2), [*ends, inner - sum(ends)]):
            found.append(float(np.std([low, *parts, high], ddof=ddof)))
    return min(found), max(found)


@pytest.mark.parametrize("name", TABLE_4_7)
def test_table_4_7_is_of_the_cadavers_lines_with_the_sd_of_a_sample(name):
    """Check the SD with n - 1, as in ``spread_of``: every printed SD is possible; with n, one of three points is
    not."""
    least, most = sd_range(name, ddof=1)
    assert least - ROUNDED <= TABLE_4_7[name][1] <= most + ROUNDED


def test_of_three_points_the_sd_of_n_is_not_the_printed_one():
    assert sd_range("Insertion Teres Minor", ddof=0)[1] < TABLE_4_7["Insertion Teres Minor"][1] - 5 * ROUNDED
    assert spread_of(np.array([7.3, 7.4, 13.2])).sd_mm == pytest.approx(3.5, abs=0.15)


def test_the_counts_are_those_of_the_shipped_lines():
    muscles = {name: len(muscle["lines"]) for name, muscle in published_lines()["muscle"].items()}
    shipped = ("teres_major", "teres_minor", "infraspinatus", "subscapularis", "deltoid_scapular", "deltoid_clavicular")
    assert [muscles[name] for name in shipped] == list(LINES_OF_DISSECTION.values())


@pytest.mark.parametrize("name", TABLE_4_8)
def test_weighed_volumes_of_table_4_8_are_the_masses_of_das3_in_water(name):
    """1 g has 1 cm3 (4.3.10)."""
    assert 1000.0 * sum(MASSES_KG[name]) == pytest.approx(TABLE_4_8[name][1], abs=ROUNDED)


def test_the_printed_sphere_of_27_5_cm3_is_a_quarter_of_a_pixel_larger_and_not_the_slices():
    """Check slices of 5 mm without a gap and pixels of 300 mm / 256 (4.2).

    Wherever the slices lie, they explain less than the excess of the printed volume.
    """

    def volume(radius: float, first: float) -> float:
        z = first + 5.0 * np.arange(-10, 11)
        areas = np.pi * np.maximum(radius**2 - z**2, 0.0)
        return stack_volume_cm3({k: area for k, area in enumerate(areas.tolist()) if area > 0.0}, 5.0)

    offsets = np.linspace(0.0, 5.0, 51)
    assert max(volume(18.45, first) for first in offsets) < 26.5
    outside = volume(18.45 + 0.25 * 300.0 / 256.0, 0.0)
    assert outside == pytest.approx(27.5, rel=0.02)


def test_the_command_writes_the_rows_of_tables_4_6_and_4_7(tmp_path):
    """Check points placed at the printed distances from a line and a plane, with the second measurement in another
    frame.

    Distances to the plane z = 0: 4.1, 5.9, 4.1, 5.9 (mean 5.0, SD 1.04); shifted in the plane by sqrt(5.8^2 - 5.0^2).
    """
    line = np.array([[-100.0, 100.0], [0.0, 0.0], [0.0, 0.0]])
    to_line = np.array([[-20.0, 0.0, 20.0], [7.3, 7.4, 13.2], [0.0, 0.0, 0.0]])
    plane = np.array([[0.0, 30.0, 30.0, 0.0], [0.0, 0.0, 40.0, 40.0], [0.0] * 4])
    to_plane = plane + np.array([[np.sqrt(5.8**2 - 5.0**2)] * 4, [0.0] * 4, [4.1, 5.9, 4.1, 5.9]])
    marks = np.array([[0.0, -119.0, -139.0], [0.0, 0.0, -110.0], [0.0, 0.0, 0.0]])
    R, t = Rotation.from_euler("xyz", [30.0, -20.0, 110.0], degrees=True).as_matrix(), np.array([[40.0], [-7.0], [2.0]])
    points_file(tmp_path / "mri.csv", "attachment", {"minor": (line, "line"), "major": (plane, "plane")})
    other = {"minor": (R @ to_line + t, "line"), "major": (R @ to_plane + t, "plane")}
    points_file(tmp_path / "dissection.csv", "attachment", other)
    for name, place in (("one.csv", marks), ("other.csv", R @ marks + t)):
        points_file(tmp_path / name, "landmark", {k: (place[:, [i]], "") for i, k in enumerate(("AC", "TS", "AI"))})
    landmarks = ["--from-landmarks", tmp_path / "one.csv", "--to-landmarks", tmp_path / "other.csv"]
    arguments = ["transfer", tmp_path / "mri.csv", "--same-bone", "--measured", tmp_path / "dissection.csv"]
    ended = girdle(*arguments, *landmarks, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "rigidly by the landmarks AC, TS, AI (rms 0.0 mm)" in ended.out
    assert "assumed to be" not in ended.out
    rows = pd.read_csv(tmp_path / "out" / "distances.csv").set_index("attachment")
    of_line = rows.loc["minor", ["md_mm", "md_sd_mm", "mind_mm", "maxd_mm"]].to_numpy(float)
    assert of_line == pytest.approx(TABLE_4_7["Insertion Teres Minor"], abs=0.15)
    of_plane = rows.loc["major", ["mdp_mm", "mdp_sd_mm", "dmp_mm"]].to_numpy(float)
    assert of_plane == pytest.approx(TABLE_4_6["Origo Teres Major"], abs=0.15)


def test_measurements_in_one_frame_are_compared_as_they_are_and_a_surface_with_its_attachments(tmp_path):
    """Appendix C: points 2, 3 and 4 mm above a flat surface: mean 3.0, SD 1.0."""
    flat = np.array([[0.0, 10.0, 20.0], [0.0, 15.0, 0.0], [2.0, 3.0, 4.0]])
    points_file(tmp_path / "palpated.csv", "attachment", {"teres": (flat, "line")})
    facets = [[(-90.0, -90.0), (90.0, -90.0), (0.0, 90.0)]]
    lines = [f"vertex {x:g} {y:g} 0" for facet in facets for x, y in facet]
    stl = ["solid bone", "facet normal 0 0 1", "outer loop", *lines, "endloop", "endfacet", "endsolid bone"]
    (tmp_path / "bone.stl").write_text("\n".join(stl) + "\n", encoding="ascii")
    pytest.importorskip("vtkmodules")
    surface = ["--same-bone", "--to-surface", tmp_path / "bone.stl"]
    ended = girdle("transfer", tmp_path / "palpated.csv", *surface, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "both measurements are in one frame" in ended.out
    row = pd.read_csv(tmp_path / "out" / "distances.csv").loc[0]
    assert (row["surface_mm"], row["surface_sd_mm"]) == pytest.approx((3.0, 1.0))
    wrong = girdle("transfer", tmp_path / "palpated.csv", "--same-bone", "--from-surface", tmp_path / "bone.stl",
                   "--out", tmp_path / "none")  # fmt: skip
    refused(wrong, "--from-surface", "there is one bone", "--to-surface")
    points_file(tmp_path / "two.csv", "landmark", {"AC": (flat[:, :1], ""), "TS": (flat[:, 1:2], "")})
    both = ["--from-landmarks", tmp_path / "two.csv", "--to-landmarks", tmp_path / "two.csv"]
    few = girdle("transfer", tmp_path / "palpated.csv", "--same-bone", *both, "--out", tmp_path / "none")
    refused(few, str(tmp_path / "palpated.csv"), "2 landmarks of both measurements", "Give three landmarks of both")


def points_file(path: Path, kind: str, points: dict[str, tuple[np.ndarray, str]]) -> None:
    rows = [
        f"{name},{','.join(map(repr, row))}" + (f",{shape}" if shape else "")
        for name, (places, shape) in points.items()
        for row in places.T.tolist()
    ]
    head = f"{kind},x_mm,y_mm,z_mm" + (",shape" if any(shape for _, shape in points.values()) else "")
    written(path.parent, [head, *rows], path.name)


def thesis_part(first: str, last: str) -> str:
    if not THESIS.exists():
        pytest.skip(f"no text of the thesis in {THESIS}: it is not part of the project")
    text = THESIS.read_text(encoding="utf-8")
    start = text.index(first)
    return text[start : text.index(last, start)]


def test_appendix_c_has_the_84_contours_of_5_3_with_the_outliers_that_the_text_names():
    part = thesis_part("Appendix C: Muscle", "Appendix D: Muscle")
    rows = re.findall(r"^[A-Za-z][\w. ]+" + r"\t([\d.]+)" * 6 + "$", part, re.MULTILINE)
    means = np.array([[float(x) for x in row[::2]] for row in rows]).ravel()
    assert len(means) == 84
    assert (means > 20.0).sum() == 3  # the biceps
    assert sorted(means[(means > 10.0) & (means < 15.0)]) == [11.9, 13.7]
    assert (means <= 5.0).sum() == 70  # 83 %: the text has 85 % and gives no limit


def test_appendix_d_repeats_appendix_c_and_its_types_have_the_shares_of_5_3():
    """45 % small, 15 % large, 15, 10 and 15 % of the other types; the text rounds to 5 %."""
    part = thesis_part("Table D.2", "\nSummary\n")
    kinds = Counter(re.findall(r"^R2\d?-R2\d\s+[\d.]+\s+[\d.]+\s+[\d.]+\s+(SMALL|LARGE|T[123])\b", part, re.MULTILINE))
    printed = {SMALL: 45, LARGE: 15, "T1": 15, "T2": 10, "T3": 15}
    assert {name: 5 * round(20 * count / 84) for name, count in kinds.items()} == printed
    own = re.findall(r"^(R2[46]?)\t.*?\t([\d.]+)\t\(?([\d.]+)\)?\s*$", part, re.MULTILINE)
    appendix_c = thesis_part("Appendix C: Muscle", "Appendix D: Muscle")
    rows = re.findall(r"^[A-Za-z][\w. ]+((?:\t[\d.]+){6})$", appendix_c, re.MULTILINE)
    of_c = Counter(pair for row in rows for pair in list(pairwise(row.split()))[::2])
    assert len(own) == 84
    apart = Counter((mean, sd) for _, mean, sd in own) - of_c
    assert not apart
