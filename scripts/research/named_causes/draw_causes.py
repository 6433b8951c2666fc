"""Draw the gap that each cause leaves after adaptation: docs/causes.svg, and the same numbers as a table on stdout.

Simulated: ten subjects per cause. Each has the girdle of the parameter set with six parameters of its own, one active
effect of typical size, and no noise; then the set is adapted to the subjects. The first row has no effect: its gap
comes from the thorax points, which are another person's. The script takes some minutes.

    python scripts/research/named_causes/draw_causes.py
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adapt import adapt_subjects
from adapt.cli import app as cli
from adapt.engine.compilation_cache import keep_compiled
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.output.svg import svg
from models import ParameterSet, load_model
from models.effects import EFFECTS, Effect
from motions.files import atomic_write
from motions.table import ANGLE_NAMES, ANGLES
from scripts.rooms import ROOT

MODEL, SUBJECTS, SEED = "R2", 10, 1
ELEVATIONS_DEG = ((0.0, 50.0), (50.0, 100.0), (100.0, 180.0))
COLUMNS = (*(ANGLE_NAMES[angle] for angle in ANGLES), *(f"arm at {low:g}-{high:g}" for low, high in ELEVATIONS_DEG))
NOTHING = "no cause"
DARK = 0.6
"""Share of the largest value above which letters are white, for contrast."""

app = typer.Typer(add_completion=False)


def gaps_deg(model: ParameterSet, effect: Effect | None) -> Float[np.ndarray, " columns"]:
    """Simulate an effect, adapt, and average |simulated - measured| by angle, and by elevation over all angles."""
    motions = simulate_model_subjects(model, effect, SUBJECTS, noise_deg=0.0, seed=SEED).motions
    fits = adapt_subjects(motions, model, held_out=()).fits.query("adapted == 1 and status == 'ok'")
    gaps = np.abs(fits[[f"{angle}_difference_deg" for angle in ANGLES]].to_numpy())
    elevation = fits["humerus_elevation_deg"].to_numpy()
    by_elevation = [gaps[(low <= elevation) & (elevation < high)].mean() for low, high in ELEVATIONS_DEG]
    return np.array([*gaps.mean(axis=0), *by_elevation])


def draw(names: list[str], values: Float[np.ndarray, "causes columns"]) -> Figure:
    """Draw one row per cause: degrees by angle, and by elevation of the arm."""
    figure = Figure(figsize=(9.0, 1.9 + 0.24 * len(names)), layout="constrained")
    parts = np.split(values, [len(ANGLES)], axis=1)
    axes: list[Axes] = list(figure.subplots(1, 2, sharey=True, width_ratios=[part.shape[1] for part in parts]))
    for one, part, columns in zip(axes, parts, (COLUMNS[: len(ANGLES)], COLUMNS[len(ANGLES) :]), strict=True):
        one.imshow(part, cmap="Blues", vmin=0.0, vmax=values.max(), aspect="auto")
        for (row, column), value in np.ndenumerate(part):
            colour = "white" if value > DARK * values.max() else "black"
            one.text(column, row, f"{value:.1f}", ha="center", va="center", color=colour, fontsize=7.0)
        one.set_xticks(range(len(columns)), [name.replace(" ", "\n", 1) for name in columns])
        one.set_yticks(range(len(names)), names)
        one.xaxis.tick_top()
        one.tick_params(length=0.0)
        one.spines[:].set_visible(False)
    figure.supxlabel(
        f"Simulated: mean |gap| after adaptation, degrees; {SUBJECTS} subjects of {MODEL}, one cause, no noise.",
        fontsize=8.0,
    )
    return figure


@app.command()
def main(
    out: Annotated[Path, typer.Option("--out", help="The SVG to write.")] = ROOT / "docs" / "causes.svg",
) -> None:
    """Draw the gap that each cause leaves after adaptation, by angle and elevation."""
    keep_compiled()
    model = load_model(MODEL)
    effects = {NOTHING: None} | {name: effect for name, effect in EFFECTS.items() if ":" not in name}
    values = {}
    for name, effect in effects.items():
        values[name] = gaps_deg(model, effect)
        print(f"{name:24}", *(f"{value:5.1f}" for value in values[name]), flush=True)
    atomic_write(out, svg(lambda: draw(list(values), np.array(list(values.values())))))


if __name__ == "__main__":
    cli.main(app)
