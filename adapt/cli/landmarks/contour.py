"""Run of ``girdle contour``: image slices and clicks in, points of bones in mm out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from models.person.contours.band import Settings
from models.person.contours.click_table import Click, Label, as_csv, by_slice, read_clicks, write_clicks
from models.person.contours.closed_contour import vectorised
from models.person.contours.edge_path import slopes_of
from models.person.contours.image_slices import ImageSlice, read_slices
from models.person.contours.slice_stack import doubtful, follow
from models.person.contours.stack_volume import area_mm2, stack_volume_cm3
from motions.errors import InputError
from motions.files import atomic_write, printable, refuse_replacing
from motions.formats.person_file import SURFACES

_DIGITS = 3
"""Decimals of a coordinate, mm or pixels."""


@dataclass(frozen=True)
class Followed:
    """One contour followed through the slices."""

    label: Label
    slices: int
    points: int
    volume_cm3: float
    """Sum of the areas times the distance between slices; NaN for a single slice."""
    left_out: tuple[str, ...]
    """Files of the slices in which a part of the contour lies on no edge; their points are not written."""


def write_contours(
    paths: Sequence[Path],
    clicks: Path,
    out: Path,
    settings: Settings,
    vector_px: float,
    sizes_mm: tuple[float | None, float | None],
    in_window: str = "",
    volumes: Path | None = None,
) -> list[Followed]:
    """Write the points of every contour in the form that ``girdle model --points`` reads.

    ``in_window``: surface for which a window takes clicks first; these are added to the file of clicks. ``volumes``:
    file for the volume of each surface. Raise an InputError where a slice, a click or a contour is wrong.
    """
    refuse_replacing(out, (*paths, clicks))
    if volumes is not None:
        refuse_replacing(volumes, (*paths, clicks, out))
    slices = read_slices(paths, *sizes_mm)
    known = read_clicks(clicks, slices) if clicks.exists() or not in_window else []
    if in_window:
        known = _clicked(slices, known, in_window, settings)
        if known:
            write_clicks(clicks, known, slices)
    rows, done = [], []
    for label, mine in by_slice(known, str(clicks)).items():
        try:
            found = follow(lambda k: slopes_of(slices[k].grey), len(slices), mine, settings)
        except ValueError as error:
            raise InputError(str(clicks), None, f"{label.surface}: {error}", "Look at the clicks there") from error
        weak = doubtful(found, mine)
        polygons = {k: vectorised(one.points_px, vector_px) for k, one in found.items() if k not in weak}
        of_label = [row for k, polygon in polygons.items() for row in _rows(label, slices[k], polygon)]
        volume = _volume_cm3({k: slices[k].to_mm(found[k].points_px) for k in polygons}, slices)
        weak_files = tuple(Path(slices[k].file).name for k in weak)
        done.append(Followed(label, len(polygons), len(of_label), volume, weak_files))
        rows += of_label
    if not rows:
        raise InputError(str(clicks), None, "there are no clicks", "Click in a window with --click, or write them")
    atomic_write(out, as_csv(rows, list(rows[0])))
    if volumes is not None:
        columns = [*Label._fields, "slices", "volume_cm3"]
        known = [one.label._asdict() | {"slices": one.slices, "volume_cm3": one.volume_cm3} for one in done]
        atomic_write(volumes, as_csv(known, columns))
    return done


def _volume_cm3(contours_mm: dict[int, np.ndarray], slices: Sequence[ImageSlice]) -> float:
    if len(contours_mm) < 2:
        return float("nan")
    step = slices[1].origin_mm - slices[0].origin_mm
    normal = np.cross(slices[0].x_mm, slices[0].y_mm)
    slice_mm = float(step @ normal / np.linalg.norm(normal))
    return stack_volume_cm3({k: area_mm2(one) for k, one in contours_mm.items()}, slice_mm)


def _clicked(slices: list[ImageSlice], known: list[Click], surface: str, settings: Settings) -> list[Click]:
    import matplotlib.pyplot as plt

    from adapt.cli.landmarks.click_window import ClickWindow, require_screen

    require_screen()
    window = ClickWindow(slices, known, Label(surface=surface), settings)
    plt.show()
    return window.clicks


def _rows(label: Label, of: ImageSlice, polygon_px) -> list[dict[str, object]]:
    name = Path(of.file).name
    return [
        {**label._asdict(), **{f"{axis}_mm": round(float(v), _DIGITS) for axis, v in zip("xyz", xyz, strict=True)}}
        | {"slice": name, "x_px": round(float(px[0]), _DIGITS), "y_px": round(float(px[1]), _DIGITS)}
        for xyz, px in zip(of.to_mm(polygon_px).T, polygon_px.T, strict=True)
    ]


def print_contours(console: Console, done: Sequence[Followed], out: Path) -> None:
    """Print the contours that were found, and the slices to look at."""
    for one in done:
        whose = " ".join(word for word in one.label if word)
        volume = "" if np.isnan(one.volume_cm3) else f", {one.volume_cm3:.1f} cm3"
        console.print(printable(f"{whose}: {one.points} points in {one.slices} slices{volume}"), soft_wrap=True)
        if one.label.surface not in SURFACES:
            said = f"{whose}: girdle model takes no such surface, but {', '.join(SURFACES)}"
            console.print(printable(said), soft_wrap=True)
        if one.left_out:
            named = ", ".join(one.left_out)
            said = f"{whose}: left out, part of the contour lies on no edge: {named}. Correct it there, or draw it anew"
            console.print(printable(said), soft_wrap=True)
    console.print(f"{out} written", soft_wrap=True)
