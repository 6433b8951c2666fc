"""``girdle contour`` on synthetic slices: from images and clicks to points in mm, and the refusals of bad input."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import girdle, refused
from matplotlib.backend_bases import KeyEvent, MouseEvent
from PIL import Image
from scipy.ndimage import gaussian_filter

from adapt.cli.landmarks import click_window
from adapt.cli.landmarks.click_window import ClickWindow
from models.person.contours import image_slices
from models.person.contours.band import Settings
from models.person.contours.click_table import Label
from models.person.contours.image_slices import read_slices

HEAD_MM = 18.5
"""Radius of the humeral head (thesis 4.3.5)."""

WITHIN_MM = 0.1

SIZE, PIXEL_MM, SLICE_MM = 72, 0.8, 2.5

CENTRE_MM = np.array([31.2, 27.9, 20.0])
"""Centre of the head, from the first pixel of the first slice."""


@dataclass(frozen=True)
class Scan:
    """Slices as files, and clicks in the middle slice."""

    files: list[Path]
    clicks: Path


def pictures(count: int = 17, noise: float = 4.0) -> list[np.ndarray]:
    """Make slices through a bright ball, 8 bit."""
    y, x = np.mgrid[:SIZE, :SIZE] * PIXEL_MM
    generator = np.random.default_rng(3)
    found = []
    for k in range(count):
        away = np.sqrt((x - CENTRE_MM[0]) ** 2 + (y - CENTRE_MM[1]) ** 2 + (k * SLICE_MM - CENTRE_MM[2]) ** 2) - HEAD_MM
        grey = 40.0 + 150.0 * gaussian_filter(np.clip(0.5 - away / PIXEL_MM, 0.0, 1.0), (0.7, 0.7))
        found.append(np.clip(grey + noise * generator.standard_normal(grey.shape), 0, 255).astype(np.uint8))
    return found


def png_scan(folder: Path, first: int = 4, last: int = 13) -> Scan:
    """Write the slices that cut the ball as s1.png to s10.png; by number, 10 comes after 9."""
    files = []
    for number, image in enumerate(pictures()[first:last], start=first + 1):
        path = folder / f"s{number}.png"
        Image.fromarray(image).save(path)
        files.append(path)
    clicks = folder / "clicks.csv"
    middle = CENTRE_MM[:2] / PIXEL_MM
    rows = [
        f"s9.png,{middle[0] + 23 * np.cos(a):.1f},{middle[1] + 23 * np.sin(a):.1f},humeral_head"
        for a in np.radians([5, 95, 185, 275])
    ]
    clicks.write_text("\n".join(["slice,x_px,y_px,surface", *rows]) + "\n")
    return Scan(files, clicks)


def dicom_scan(folder: Path) -> Scan:
    """Write the scan as DICOM, rotated in the patient's frame, with file names against the order of the slices."""
    from pydicom.dataset import Dataset, FileMetaDataset
    from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

    scan = png_scan(folder)
    across, down = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
    files = []
    for k, image in enumerate(pictures()[4:13]):
        read = Dataset()
        read.SOPClassUID, read.SOPInstanceUID, read.Modality = CTImageStorage, generate_uid(), "CT"
        read.Rows, read.Columns = image.shape
        read.SamplesPerPixel, read.PhotometricInterpretation, read.PixelRepresentation = 1, "MONOCHROME2", 0
        read.BitsAllocated, read.BitsStored, read.HighBit = 8, 8, 7
        read.PixelSpacing = [PIXEL_MM, PIXEL_MM]
        read.ImageOrientationPatient = [*across, *down]
        read.ImagePositionPatient = list(np.array([-50.0, 10.0, 200.0]) + (k + 4) * SLICE_MM * np.cross(across, down))
        read.PixelData = image.tobytes()
        read.file_meta = FileMetaDataset()
        read.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        path = folder / f"im{99 - k}.dcm"
        read.save_as(path, enforce_file_format=True)
        files.append(path)
    scan.clicks.write_text(scan.clicks.read_text().replace("s9.png", files[4].name))
    return Scan(files, scan.clicks)


def points_of(path: Path) -> np.ndarray:
    return pd.read_csv(path)[["x_mm", "y_mm", "z_mm"]].to_numpy().T


def test_a_muscle_of_any_name_has_its_volume(tmp_path):
    """Slices 5 to 13 of the ball have the volume sum of pi (R^2 - z^2) times 2.5 mm."""
    scan, volumes = png_scan(tmp_path), tmp_path / "volumes.csv"
    scan.clicks.write_text(scan.clicks.read_text().replace("humeral_head", "teres major"))
    sizes = "--pixel-mm", PIXEL_MM, "--slice-mm", SLICE_MM, "--volumes", volumes, "--inside", "bright"
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "points.csv", *sizes)
    assert (said.status, said.messages) == (0, [])
    assert "teres major: girdle model takes no such surface, but thorax" in said.out
    z = np.arange(4, 13) * SLICE_MM - CENTRE_MM[2]
    expected = (np.pi * (HEAD_MM**2 - z**2)).sum() * SLICE_MM / 1000.0
    row = pd.read_csv(volumes).iloc[0]
    assert (row["surface"], row["slices"]) == ("teres major", 9)
    assert row["volume_cm3"] == pytest.approx(expected, rel=0.02)


def test_neither_clicks_nor_points_are_replaced(tmp_path):
    scan, out = png_scan(tmp_path), tmp_path / "points.csv"
    before = scan.clicks.read_bytes()
    for files, where in (
        (("--out", scan.clicks), scan.clicks),
        (("--out", out, "--volumes", scan.clicks), scan.clicks),
        (("--out", out, "--volumes", out), out),
    ):
        ended = girdle("contour", *scan.files, "--clicks", scan.clicks, *files)
        refused(ended, str(where), "this command reads this file and would replace it", "Name another file")
    assert scan.clicks.read_bytes() == before
    assert not out.exists()


def test_points_of_png_slices_lie_on_the_ball(tmp_path):
    scan, out = png_scan(tmp_path), tmp_path / "points.csv"
    sizes = "--pixel-mm", PIXEL_MM, "--slice-mm", SLICE_MM
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", out, "--inside", "bright", *sizes)
    assert (said.status, said.messages) == (0, [])
    table = pd.read_csv(out)
    assert f"humeral_head: {len(table)} points in 9 slices, " in said.out
    assert list(dict.fromkeys(table["slice"])) == [f"s{k}.png" for k in range(5, 14)]
    away = np.linalg.norm(points_of(out).T - (CENTRE_MM - [0.0, 0.0, 4 * SLICE_MM]), axis=1) - HEAD_MM
    assert np.sqrt(np.mean(away**2)) < WITHIN_MM
    np.testing.assert_allclose(table["x_mm"], PIXEL_MM * table["x_px"], rtol=0.0, atol=2e-3)


def test_a_humeral_head_in_dicom_becomes_gh_and_its_radius_in_a_set(tmp_path):
    """Through `girdle model --points`: radius 18.5 mm within 0.1, in the frame of the landmarks, the patient's."""
    scan, out = dicom_scan(tmp_path), tmp_path / "points.csv"
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", out, "--inside", "bright")
    assert (said.status, said.messages) == (0, [])
    centre = np.array([-50.0 - CENTRE_MM[2], 10.0 + CENTRE_MM[0], 200.0 - CENTRE_MM[1]])
    away = np.linalg.norm(points_of(out).T - centre, axis=1) - HEAD_MM
    assert np.sqrt(np.mean(away**2)) < WITHIN_MM
    landmarks_mm = {"IJ": (0, 0, 0), "C7": (0, 40, 120), "PX": (0, -170, -10), "T8": (0, -150, 130)}
    landmarks_mm |= {"SC": (20, -8, 12), "AC": (160, 30, 70), "TS": (75, -20, 135), "AI": (85, -125, 150)}
    columns = {f"{n}_{axis}_mm": [xyz[k]] for n, xyz in landmarks_mm.items() for k, axis in enumerate("xyz")}
    pd.DataFrame(columns).to_csv(tmp_path / "P01.csv", index=False)
    said = girdle("model", tmp_path / "P01.csv", "--points", out, "--out", tmp_path / "P01.toml")
    assert said.status == 0
    line = next(one for one in said.out.splitlines() if "humeral head" in one)
    radius = float(line.partition("radius ")[2].partition(" ")[0])
    assert radius == pytest.approx(HEAD_MM, abs=WITHIN_MM)


def test_slices_in_which_the_contour_left_its_edge_are_named_and_left_out(tmp_path):
    """Slices beyond the ball have no edge to follow."""
    scan = png_scan(tmp_path, 4, 17)
    sizes = "--pixel-mm", PIXEL_MM, "--slice-mm", SLICE_MM
    said = girdle(
        "contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", "--inside", "bright", *sizes
    )
    assert said.status == 0
    named = next(line for line in said.out.splitlines() if "left out, part of the contour lies on no edge" in line)
    assert "s17.png" in named
    assert "s9.png" not in named
    kept = set(pd.read_csv(tmp_path / "p.csv")["slice"])
    assert kept == {path.name for path in scan.files if path.name not in named}


def pressed(window: ClickWindow, x_px: float, y_px: float, button: int = 1) -> None:
    axes = window.figure.axes[0]
    at = axes.transData.transform((x_px, y_px))
    MouseEvent("button_press_event", window.figure.canvas, *at, button=button)._process()  # type: ignore[attr-defined]


def typed(window: ClickWindow, key: str) -> None:
    KeyEvent("key_press_event", window.figure.canvas, key)._process()  # type: ignore[attr-defined]


def drawn(window: ClickWindow) -> bool:
    """Check whether a contour is drawn, and not only clicks."""
    return any(np.size(line.get_xdata()) > 50 for line in window.figure.axes[0].lines)


def test_the_window_takes_clicks_and_corrections_and_shows_what_they_give(tmp_path):
    """The test sends matplotlib's own events, without a screen."""
    slices = read_slices(png_scan(tmp_path).files, PIXEL_MM, SLICE_MM)
    window = ClickWindow(slices, [], Label(surface="humeral_head"), Settings("bright"))
    for _ in range(4):
        typed(window, "n")
    middle = CENTRE_MM[:2] / PIXEL_MM
    for k, a in enumerate(np.radians([5, 95, 185, 275])):
        assert window.contour is None or k == 3
        pressed(window, *(middle + 23.0 * np.array([np.cos(a), np.sin(a)])))
    assert window.contour is not None
    away = np.linalg.norm(window.contour - middle[:, None], axis=0) - HEAD_MM / PIXEL_MM
    assert np.sqrt(np.mean(away**2)) < WITHIN_MM / PIXEL_MM
    pressed(window, 3.0, 4.0)
    pressed(window, 3.0, 4.0, button=3)
    assert [one.slice for one in window.clicks] == [4, 4, 4, 4]
    typed(window, "n")
    typed(window, "c")
    pressed(window, 20.0, 20.0)
    assert (window.clicks[-1].slice, window.clicks[-1].use) == (5, "correct")
    assert window.contour is None  # a contour needs three clicks
    typed(window, "p")
    assert window.current == 4
    assert not drawn(window)
    pressed(window, 20.0, 20.0, button=3)
    typed(window, "n")
    pressed(window, 20.0, 20.0, button=3)
    typed(window, "p")
    pressed(window, *(middle + 23.0 * np.array([np.cos(-1.5), np.sin(-1.5)])))
    assert window.contour is not None
    assert drawn(window)


def test_without_a_screen_the_window_is_refused(tmp_path):
    scan = png_scan(tmp_path)
    sizes = "--pixel-mm", PIXEL_MM, "--slice-mm", SLICE_MM
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", "--click", *sizes)
    refused(said, "--click", "shows no window", "Run it where there is a screen")


def test_clicks_of_a_window_are_added_to_the_file_and_used(tmp_path, monkeypatch):
    """A fake screen, and a user who clicks four times in the first slice."""
    scan = png_scan(tmp_path)
    windows: list[ClickWindow] = []
    made = ClickWindow.__init__

    def kept(self, *arguments):
        made(self, *arguments)
        windows.append(self)

    def shown():
        radius = np.sqrt(HEAD_MM**2 - (CENTRE_MM[2] - 4 * SLICE_MM) ** 2) / PIXEL_MM
        for a in np.radians([5, 95, 185, 275]):
            pressed(windows[0], *(CENTRE_MM[:2] / PIXEL_MM + radius * np.array([np.cos(a), np.sin(a)])))

    monkeypatch.setattr(ClickWindow, "__init__", kept)
    monkeypatch.setattr(click_window, "require_screen", lambda: None)
    monkeypatch.setattr(click_window.plt, "show", shown)
    options = "--click", "--surface", "scapula", "--inside", "bright", *SIZES
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", *options)
    assert (said.status, said.messages) == (0, [])
    clicks = pd.read_csv(scan.clicks)
    assert clicks["surface"].tolist() == ["humeral_head"] * 4 + ["scapula"] * 4
    assert clicks["slice"].tolist() == ["s9.png"] * 4 + ["s5.png"] * 4
    assert set(pd.read_csv(tmp_path / "p.csv")["surface"]) == {"humeral_head", "scapula"}
    again = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "q.csv", *options[3:])
    assert again.status == 0
    assert (tmp_path / "q.csv").read_bytes() == (tmp_path / "p.csv").read_bytes()


def test_a_window_that_is_closed_without_a_click_leaves_no_file(tmp_path, monkeypatch):
    scan = png_scan(tmp_path)
    scan.clicks.unlink()
    monkeypatch.setattr(click_window, "require_screen", lambda: None)
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", "--click", *SIZES)
    refused(said, str(scan.clicks), "there are no clicks", "Click in a window")
    assert not scan.clicks.exists()


SIZES = ("--pixel-mm", "0.8", "--slice-mm", "2.5")

WRONG = {
    "no slice of that name": ("x.png,1,1,", "there is no slice 'x.png'", "a number from 1 to 9"),
    "outside the image": ("s9.png,90,1,", "the click at (90, 1) is not in the image of 72 x 72 pixels", "from 0"),
    "an empty cell": ("s9.png,,1,", "the click at (nan, 1) is not in the image", "from 0"),
    "no number": ("s9.png,1,a,", "'a' is not a number", "decimal point"),
    "two clicks": (
        "s7.png,1,1,humeral_head",
        "1 clicks draw no closed contour (humeral_head in slice 3)",
        "three or more",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_click_is_one_message(tmp_path, what):
    row, cause, remedy = WRONG[what]
    scan = png_scan(tmp_path)
    scan.clicks.write_text(scan.clicks.read_text() + row + "\n")
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", *SIZES)
    line = ", line 6" if "contour" not in cause else ""
    refused(said, f"{scan.clicks}{line}", cause, remedy)
    assert not (tmp_path / "p.csv").exists()


def test_corrections_come_in_threes_after_a_contour(tmp_path):
    scan = png_scan(tmp_path)
    for rows, cause in (
        ("slice,x_px,y_px,use\n9,1,1,correct\n", "1 clicks are no corrections (thorax in slice 9)"),
        ("slice,x_px,y_px,use\n" + "9,1,1,correct\n" * 3, "thorax: no slice has clicks to draw a contour from"),
        ("slice,x_px,y_px,use\n9,1,1,erase\n", "there is no use 'erase'"),
        ("slice,x_px\n9,1\n", "there is no column y_px"),
        ("slice,x_px,y_px\n", "there are no rows under the header"),
    ):
        scan.clicks.write_text(rows)
        said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", *SIZES)
        assert (said.status, said.err.count("\n")) == (2, 1), said.err
        assert cause in said.err


def test_wrong_images_are_one_message(tmp_path):
    scan = png_scan(tmp_path)
    common = "--clicks", scan.clicks, "--out", tmp_path / "p.csv"
    refused(girdle("contour", *scan.files, *common), str(scan.files[0]), "how large a pixel is", "Say --pixel-mm")
    (tmp_path / "text.png").write_text("no image")
    said = girdle("contour", tmp_path / "text.png", *common, *SIZES)
    refused(said, str(tmp_path / "text.png"), "no image that can be read", "Give DICOM or PNG")
    refused(
        girdle("contour", tmp_path / "gone.png", *common, *SIZES), str(tmp_path / "gone.png"), "cannot be read", "Check"
    )
    Image.fromarray(np.zeros((9, 8), np.uint8)).save(tmp_path / "s99.png")
    said = girdle("contour", *scan.files, tmp_path / "s99.png", *common, *SIZES)
    refused(said, str(tmp_path / "s99.png"), "it has 8 x 9 pixels", "one series")
    (tmp_path / "empty").mkdir()
    refused(girdle("contour", tmp_path / "empty", *common), str(tmp_path / "empty"), "no image in this folder", "Give")
    said = girdle("contour", *scan.files, *common, *SIZES, "--inside", "grey")
    refused(said, "--inside", "there is no 'grey'", "bright, dark, either")


def test_wrong_dicom_is_one_message(tmp_path):
    import pydicom

    scan = dicom_scan(tmp_path)
    common = "--clicks", scan.clicks, "--out", tmp_path / "p.csv"
    twice = tmp_path / "twice.dcm"
    twice.write_bytes(scan.files[2].read_bytes())
    said = girdle("contour", *scan.files, twice, *common)
    assert "it is in the same place as" in said.err
    read = pydicom.dcmread(scan.files[2])
    del read.ImagePositionPatient
    read.save_as(twice)
    refused(girdle("contour", twice, *common), str(twice), "does not say where its pixels are", "series of slices")
    read = pydicom.dcmread(scan.files[2])
    read.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    read.save_as(twice)
    said = girdle("contour", *scan.files, twice, *common)
    refused(said, str(twice), "its pixels lie otherwise", "one series")
    said = girdle("contour", *scan.files, tmp_path / "s9.png", *common)
    refused(said, str(tmp_path / "s9.png"), "this is no DICOM file, and others are", "one kind")


def test_without_the_extra_one_message_says_what_to_install(tmp_path, monkeypatch):
    scan, real = png_scan(tmp_path), importlib.util.find_spec
    monkeypatch.setattr(
        image_slices.importlib.util, "find_spec", lambda name: None if name in ("pydicom", "shapely") else real(name)
    )
    said = girdle("contour", *scan.files, "--clicks", scan.clicks, "--out", tmp_path / "p.csv", *SIZES)
    refused(said, "girdle contour", "contours need pydicom and shapely", "pip install pydicom shapely")
