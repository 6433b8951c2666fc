"""Draw the rooms of the code and the imports between them, from the source, as docs/rooms.svg.

A box is a room (a package, folder or file) with the first line of its docstring; a room stands above all that it
imports. An arrow is an import; an arrow is left out where a chain of other arrows leads to the same room. The same
source gives the same bytes.

    python scripts/draw_rooms.py
"""

import re
import textwrap
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import typer
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path as Curve

from adapt.cli import app as cli
from adapt.output.svg import BLUE, svg
from motions.files import atomic_write
from scripts import rooms

DRAWING = rooms.ROOT / "docs" / "rooms.svg"
HIDDEN = {"adapt", "adapt.__main__"}
"""Rooms that are not drawn: they only import others and do no work themselves."""

WIDTH, HEIGHT = 2.1, 0.86
"""Size of a box, inches."""

COLUMN, LAYER = 2.4, 1.24
"""Distance between the centres of neighbouring boxes, horizontally and vertically, inches."""

THIN = 0.5
"""Share of a column that an arrow takes where it passes between boxes."""

LETTERS = 35
"""Longest line of a description, in characters."""

SWEEPS = 12
"""Sweeps over the layers that move each node towards the middle of its neighbours; the order settles well before."""

FILL = {"motions": "#e3f1ea", "models": "#fbeed3", "adapt": "#e6eef7"}
JOINT = "--"
"""Separator of the two rooms in the id of an arrow."""

Node = str | tuple[str, str, int]
"""A room, or the place where the arrow between two rooms passes a layer."""

app = typer.Typer(add_completion=False)


def arrows(pairs: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the arrows to draw, importer first, without those that a chain of other arrows implies."""
    below: dict[str, set[str]] = {}
    for importer, imported in pairs:
        if not HIDDEN & {importer, imported}:
            below.setdefault(importer, set()).add(imported)

    def reached(name: str) -> set[str]:
        direct = below.get(name, set())
        return direct.union(*map(reached, direct))

    return sorted(
        (importer, imported)
        for importer, direct in below.items()
        for imported in direct
        if not any(imported in reached(other) for other in direct)
    )


def arrows_in(text: str) -> set[tuple[str, str]]:
    """Return the arrows (importer, imported) of a drawing, from its text."""
    ids = re.findall(rf'<g id="([\w.]+){JOINT}([\w.]+)"', text)
    return {(importer, imported) for importer, imported in ids}


def layers(drawn: Iterable[tuple[str, str]]) -> list[list[Node]]:
    """Arrange rooms and passing arrows in layers from the bottom, each layer ordered from left to right."""
    drawn = list(drawn)
    level: dict[str, int] = {}
    for name in rooms.ORDER:  # imported rooms come before their importers
        if any(name in ends for ends in drawn):
            level[name] = 1 + max((level[low] for high, low in drawn if high == name), default=-1)
    rows: list[list[Node]] = [[] for _ in range(max(level.values()) + 1)]
    for name, height in level.items():
        rows[height].append(name)
    neighbours: dict[Node, list[Node]] = {}
    for high, low in drawn:
        chain = route(high, low, level)
        for node, height in zip(chain[1:-1], range(level[high] - 1, level[low], -1), strict=True):
            rows[height].append(node)
        for one, other in pairwise(chain):
            neighbours.setdefault(one, []).append(other)
            neighbours.setdefault(other, []).append(one)
    for _ in range(SWEEPS):
        for ordered in (rows, rows[::-1]):
            for index, row in enumerate(ordered):
                x = places(rows)
                ordered[index][:] = sorted(row, key=lambda node: _middle(x, neighbours[node]))
    return rows


def route(high: str, low: str, level: Mapping[str, int]) -> list[Node]:
    """Return the nodes along an arrow: the importer, a place in every layer that it passes, the imported room."""
    return [high, *((high, low, height) for height in range(level[high] - 1, level[low], -1)), low]


def places(rows: Iterable[list[Node]]) -> dict[Node, float]:
    """Return the horizontal position of each room and passing arrow, inches to the right of the middle."""
    x: dict[Node, float] = {}
    for row in rows:
        widths = [COLUMN * (1.0 if isinstance(node, str) else THIN) for node in row]
        left = -sum(widths) / 2.0
        for node, width in zip(row, widths, strict=True):
            x[node] = left + width / 2.0
            left += width
    return x


def _middle(x: Mapping[Node, float], nodes: list[Node]) -> float:
    return sum(x[node] for node in nodes) / len(nodes)


def draw(drawn: list[tuple[str, str]], purposes: Mapping[str, str]) -> Figure:
    """Draw these arrows in the current style, with the purpose of each room."""
    rows = layers(drawn)
    x = places(rows)
    height = {node: LAYER * index for index, row in enumerate(rows) for node in row}
    level = {node: index for index, row in enumerate(rows) for node in row if isinstance(node, str)}
    half = max(abs(place) + COLUMN / 2.0 for place in x.values())
    low, high = -LAYER / 2.0, LAYER * (len(rows) - 0.5)
    figure = Figure(figsize=(2.0 * half, high - low))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-half, half), ylim=(low, high))
    axes.set_axis_off()
    for importer, imported in drawn:
        points = [(x[node], height[node]) for node in route(importer, imported, level)]
        patch = FancyArrowPatch(path=_curve(points), arrowstyle="-|>", mutation_scale=9, color="0.45", linewidth=0.9)
        patch.set_gid(f"{importer}{JOINT}{imported}")
        axes.add_patch(patch)
    for name in level:
        corner = (x[name] - WIDTH / 2.0, height[name] - HEIGHT / 2.0)
        colour = FILL[name.partition(".")[0]]
        box = FancyBboxPatch(
            corner, WIDTH, HEIGHT, "round,pad=0,rounding_size=0.07", facecolor=colour, edgecolor=BLUE, linewidth=0.8
        )
        axes.add_patch(box)
        top = height[name] + HEIGHT / 2.0 - 0.08
        axes.text(x[name], top, title(name), ha="center", va="top", fontsize=9.5, fontweight="bold")
        text = "\n".join(textwrap.wrap(purposes[name], LETTERS)[:4])
        axes.text(x[name], top - 0.2, text, ha="center", va="top", fontsize=6.8, color="0.2", linespacing=1.15)
    return figure


def title(name: str) -> str:
    """Return the path of a room: a folder ends in a slash, a file in .py."""
    path = name.replace(".", "/")
    return f"{path}/" if (rooms.ROOT / path).is_dir() else f"{path}.py"


def _curve(points: list[tuple[float, float]]) -> Curve:
    """Return a smooth line from the lower edge of the first box down to the upper edge of the last one."""
    (first_x, first_y), *_, (last_x, last_y) = points
    ends = [(first_x, first_y - HEIGHT / 2.0), *points[1:-1], (last_x, last_y + HEIGHT / 2.0)]
    vertices, codes = [ends[0]], [Curve.MOVETO]
    for (from_x, from_y), (to_x, to_y) in pairwise(ends):
        bend = (from_y - to_y) / 2.0
        vertices += [(from_x, from_y - bend), (to_x, to_y + bend), (to_x, to_y)]
        codes += [Curve.CURVE4] * 3
    return Curve(vertices, codes)


@app.command()
def main(
    out: Annotated[Path, typer.Option("--out", help="The SVG to write.")] = DRAWING,
) -> None:
    """Draw the rooms of the code and the imports between them."""
    files = rooms.source_files()
    purposes = {name: rooms.purpose(name, files) for name in rooms.ORDER}
    drawn = arrows(rooms.crossings(rooms.imports(files)))
    atomic_write(out, svg(lambda: draw(drawn, purposes)))


if __name__ == "__main__":
    cli.main(app)
