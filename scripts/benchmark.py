"""Compare the speed of the fits with other solvers and with the peak performance of the machine (`make speed`).

``scripts/research/speed/side_by_side.py`` measures, and explains what is compared and why the comparison is fair.
"""

import json
from typing import Annotated

import typer

from scripts.research.speed.side_by_side import side_by_side

app = typer.Typer(add_completion=False)


@app.command()
def benchmark(
    model: str = "R2",
    subjects: Annotated[int, typer.Option(min=8, help="Subjects of the throughput.")] = 1000,
    peers: Annotated[int, typer.Option(min=2, help="Of these, how many the peers solve in a repeat.")] = 100,
    repeats: Annotated[int, typer.Option(min=1)] = 3,
    largest: Annotated[int, typer.Option(help="Largest number of subjects of the scaling.")] = 8000,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object instead of lines.")] = False,
) -> None:
    """Measure the speed of the fits and of the other solvers, and compare."""
    result = side_by_side(model, subjects, peers, repeats, largest)
    if as_json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key}: {value}")


if __name__ == "__main__":
    app()
