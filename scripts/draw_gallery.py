"""Draw pictures of docs/gallery.md with the library's own functions, from simulated data.

python -m scripts.draw_gallery    # after a change of what they show: two minutes
"""

from pathlib import Path
from typing import Annotated

import typer
from matplotlib.figure import Figure

from adapt import adapt_subjects, diagnose, simulate_model_subjects
from adapt.api import simulated_positions
from adapt.cli import app as cli
from adapt.engine.compilation_cache import keep_compiled
from adapt.output.diagnosis_figures import gap_heatmap, inclusion
from adapt.output.plots import draw_positions
from adapt.output.svg import svg
from models import load_model
from models.effects import EFFECTS
from motions import read_trial
from motions.files import atomic_write
from scripts.rooms import ROOT

TRIAL = ROOT / "motions" / "data" / "simulated_trial.trc"
MODEL = "R2"

app = typer.Typer(add_completion=False)


def positions() -> Figure:
    """Draw the coordinates of TS in the simulated trial that ships, as the model is and adapted."""
    motions = read_trial(TRIAL, subject="P01", motion="abduction", at_deg=range(0, 121, 20))
    model = load_model(MODEL)
    table = simulated_positions(adapt_subjects(motions, [model]), motions, [model])
    figure = Figure(figsize=(7.5, 2.2), layout="constrained")
    panels = figure.subplots(1, 3)
    for axes, axis in zip(panels, ("x", "y", "z"), strict=True):
        draw_positions(axes, table, MODEL, "P01", "TS", axis)
    panels[0].legend(frameon=False)
    return figure


@app.command()
def main(out: Annotated[Path, typer.Option(help="Folder of the pictures.")] = ROOT / "docs") -> None:
    """Draw positions, inclusion probabilities and heat map; the last two of the example in docs/diagnose.md."""
    keep_compiled()
    atomic_write(out / "positions.svg", svg(positions))
    model = load_model(MODEL)
    simulated = simulate_model_subjects(model, EFFECTS["skin_artefact"], subjects=10, noise_deg=1.5, seed=1)
    why = diagnose(simulated.motions, model)[MODEL]
    atomic_write(out / "inclusion.svg", svg(lambda: inclusion(why)))
    atomic_write(out / "heat_map.svg", svg(lambda: gap_heatmap(why)))


if __name__ == "__main__":
    cli.main(app)
