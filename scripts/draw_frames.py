"""Draw the frames of the bones and the sign of every angle from a parameter set: docs/frames.svg and docs/signs.svg.

The figures show a parameter set in the rest posture, not a person. In docs/signs.svg each angle alone grows by 15
degrees, so the chain does not stay closed there. The same set gives the same bytes.

    python scripts/draw_frames.py
"""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon

from adapt.cli import app as cli
from adapt.output.svg import BLUE, NOTE, ORANGE, svg
from models import load_model
from models.girdle import Girdle, bone_rotations, chain_landmarks
from motions.files import atomic_write
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import ANGLES
from scripts.rooms import ROOT

MODEL = "R2"
TURN_DEG = 15.0
"""Change of each angle: large enough to see, small enough for a shoulder."""

AXIS_MM = 45.0
"""Length of a drawn axis."""


class View(NamedTuple):
    """An orthographic view of the thorax frame: x lateral (right), y up, z backward."""

    name: str
    across: tuple[float, float, float]
    up: tuple[float, float, float]
    sides: tuple[str, str]
    """Directions at the left and right edge of the picture."""

    def of(self, points_mm: Float[np.ndarray, "3 ..."]) -> Float[np.ndarray, "2 ..."]:
        """Project positions in the thorax frame onto the picture, both in mm."""
        return np.tensordot(np.array([self.across, self.up]), points_mm, axes=1)


BEHIND = View("from behind", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), ("left", "right"))
RIGHT = View("from the right", (0.0, 0.0, -1.0), (0.0, 1.0, 0.0), ("back", "front"))
ABOVE = View("from above", (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), ("left", "right"))

SIGNS = {
    "clavicle_y": ("+ protraction: AC goes forward", (ABOVE, RIGHT)),
    "clavicle_z": ("+ elevation: AC goes up", (BEHIND, RIGHT)),
    "clavicle_x": ("+ backward axial rotation: the upper side goes back", (RIGHT, BEHIND)),
    "scapula_y": ("+ protraction: TS and AI go back", (ABOVE, RIGHT)),
    "scapula_z": ("+ lateral rotation: AI goes outward", (BEHIND, RIGHT)),
    "scapula_x": ("+ backward tipping: AI goes forward", (RIGHT, BEHIND)),
}
"""Effect of a growing angle, and the two views that show the effect best."""

POINTS = {"clavicle": ("SC", "AC"), "scapula": ("AC", "TS", "AI")}
FRAMES = {"thorax": ("IJ", "black"), "clavicle": ("SC", ORANGE), "scapula": ("AC", BLUE)}
"""Origin and colour of each frame."""

BEFORE, AFTER = {"color": "0.6"}, {"color": BLUE}

app = typer.Typer(add_completion=False)


class Pose(NamedTuple):
    """A girdle in one posture (mm, thorax frame): points by name, and the frame of each bone as columns."""

    points: dict[str, Float[np.ndarray, "3"]]
    frames: dict[str, Float[np.ndarray, "3 3"]]


def pose(girdle: Girdle, angles_deg: Float[np.ndarray, "6"]) -> Pose:
    """Place the bones of a girdle at six angles in degrees."""
    clavicle, scapula = (np.asarray(R) for R in bone_rotations(angles_deg / DEG))
    at = chain_landmarks(girdle, clavicle, scapula)
    points = {"IJ": np.zeros(3), "SC": girdle.sc_mm, "AC": at.AC, "TS": at.TS, "AI": at.AI}
    conoid = {"on the clavicle": at.clavicle_conoid, "on the scapula": at.scapula_conoid}
    points = {name: np.asarray(point) for name, point in (points | conoid).items()}
    return Pose(points, {"thorax": np.eye(3), "clavicle": clavicle, "scapula": scapula})


def turned_deg(angle: str) -> Float[np.ndarray, "6"]:
    """Return the rest posture with this angle increased by ``TURN_DEG``."""
    return REST_DEG + TURN_DEG * np.equal(ANGLES, angle)


def draw_signs(girdle: Girdle) -> Figure:
    """Draw every angle before and after its increase, in two views each."""
    figure = Figure(figsize=(9.6, 8.6), layout="constrained")
    panels: Any = figure.subfigures(3, 2)
    for panel, (angle, (words, views)) in zip(panels.T.flat, SIGNS.items(), strict=True):
        panel.suptitle(f"{angle}_deg\n{words}", fontsize=8.5, fontweight="bold")
        bone = angle.partition("_")[0]
        for axes, view in zip(panel.subplots(1, 2), views, strict=True):
            axes.set_gid(f"{angle} {view.name}")
            _surroundings(axes, girdle, view)
            for state, style in ((pose(girdle, REST_DEG), BEFORE), (pose(girdle, turned_deg(angle)), AFTER)):
                _bone(axes, state, bone, view, style)
            _names(axes, pose(girdle, turned_deg(angle)), view, POINTS[bone])
    _caption(figure, f"grey: at rest; blue: the angle is {TURN_DEG:g} degrees larger. Right shoulder")
    return figure


def draw_frames(girdle: Girdle) -> Figure:
    """Draw the landmarks and the frame of each bone at rest, in three views."""
    figure = Figure(figsize=(9.6, 3.6), layout="constrained")
    at = pose(girdle, REST_DEG)
    for axes, view in zip(figure.subplots(1, 3), (BEHIND, RIGHT, ABOVE), strict=True):
        axes.set_gid(view.name)
        _surroundings(axes, girdle, view)
        _line(axes, at, ("SC", "AC"), view, **BEFORE, linewidth=3.0)
        _bone(axes, at, "scapula", view, BEFORE)
        _line(axes, at, ("on the clavicle", "on the scapula"), view, color="black", linestyle=":", linewidth=2.0)
        for bone, (origin, colour) in FRAMES.items():
            for name, axis in zip("xyz", at.frames[bone].T, strict=True):
                _arrow(axes, view, at.points[origin], axis, name, colour)
        _names(axes, at, view, ("IJ", "SC", "AC", "TS", "AI"))
    words = "axes of the thorax (black, from IJ), the clavicle (orange, from SC) and the scapula (blue, from AC)"
    _caption(figure, f"{words}; dotted: the conoid. Right shoulder")
    return figure


def _surroundings(axes: Axes, girdle: Girdle, view: View) -> None:
    """Draw the outline of the thorax: the ellipsoid is parallel to the axes, so it is the ellipse of its semi-axes."""
    centre = view.of(np.asarray(girdle.centre_mm))
    width, height = 2.0 * abs(view.of(np.asarray(girdle.semi_axes_mm)))
    axes.add_patch(Ellipse(tuple(centre), width, height, facecolor="0.95", edgecolor="0.8"))
    low, high = LIMITS[view]
    axes.set(xlim=low, ylim=high, aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    axes.set_title(view.name, fontsize=8.0)
    for side, place, align in zip(view.sides, (0.0, 1.0), ("left", "right"), strict=True):
        axes.text(place, 0.0, side, transform=axes.transAxes, ha=align, va="bottom", **NOTE)


LIMITS = {
    BEHIND: ((-55.0, 215.0), (-155.0, 95.0)),
    RIGHT: ((-215.0, 55.0), (-155.0, 95.0)),
    ABOVE: ((-55.0, 215.0), (-205.0, 45.0)),
}
"""Limits of the picture in each view, mm: the right shoulder."""


def _bone(axes: Axes, at: Pose, bone: str, view: View, style: dict[str, str]) -> None:
    """Draw the clavicle as a line with the axes that show its axial rotation, or the scapula as its triangle."""
    if bone == "clavicle":
        _line(axes, at, POINTS[bone], view, marker="o", markersize=3, **style)
        middle = (at.points["SC"] + at.points["AC"]) / 2.0
        for name, axis in zip("yz", at.frames["clavicle"].T[1:], strict=True):
            _arrow(axes, view, middle, axis, name, style["color"])
        return
    corners = view.of(np.stack([at.points[name] for name in POINTS[bone]], axis=1))
    axes.add_patch(Polygon(corners.T, alpha=0.25, facecolor=style["color"]))
    _line(axes, at, (*POINTS[bone], "AC"), view, marker="o", markersize=3, **style)


def _line(axes: Axes, at: Pose, names: tuple[str, ...], view: View, **style) -> None:
    axes.plot(*view.of(np.stack([at.points[name] for name in names], axis=1)), **style)


def _arrow(axes: Axes, view: View, origin, axis, name: str, colour: str) -> None:
    start, along = view.of(origin), AXIS_MM * view.of(axis)
    if np.hypot(*along) < 0.35 * AXIS_MM:  # the axis points at the reader: its arrowhead would hide the rest
        return
    tip, (x, y) = tuple(start + along), start + 1.2 * along
    axes.annotate("", tip, tuple(start), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.0})
    axes.text(x, y, name, color=colour, ha="center", va="center", fontsize=7.5)


def _names(axes: Axes, at: Pose, view: View, names: tuple[str, ...]) -> None:
    for name in names:
        x, y = view.of(at.points[name])
        offset = (2, -10) if name == "SC" else (4, 4)  # the clavicle is drawn above the line to IJ
        axes.annotate(name, (x, y), offset, textcoords="offset points", fontsize=7.5, fontweight="bold")


def _caption(figure: Figure, text: str) -> None:
    figure.supxlabel(f"Simulated: the parameter set {MODEL}; {text}.", fontsize=8.0)


@app.command()
def main(
    out: Annotated[Path, typer.Option("--out", help="The folder to write into.")] = ROOT / "docs",
) -> None:
    """Draw the frames of the bones and the sign of every angle."""
    girdle = load_model(MODEL).girdle
    atomic_write(out / "frames.svg", svg(lambda: draw_frames(girdle)))
    atomic_write(out / "signs.svg", svg(lambda: draw_signs(girdle)))


if __name__ == "__main__":
    cli.main(app)
