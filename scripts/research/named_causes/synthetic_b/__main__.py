"""`python -m scripts.research.named_causes.synthetic_b`: write the worlds of a condition as files."""

from pathlib import Path
from typing import Annotated

import typer

from scripts.research.named_causes.synthetic_b.worlds import Condition, write_condition


def main(
    out: Annotated[Path, typer.Argument(help="Folder of the worlds: OUT/CONDITION/NAME.", file_okay=False)],
    condition: Annotated[Condition, typer.Option(help="How many subjects, and what of them.")] = "ten",
    seed: Annotated[int, typer.Option(help="The same seed gives the same worlds.")] = 1,
    noise_deg: Annotated[float, typer.Option(min=0.0, help="SD of an angle.")] = 1.5,
) -> None:
    """Make simulated worlds with hidden effects, for external_worlds.py."""
    write_condition(condition, out, seed, noise_deg)
    print(f"{out / condition}: done")


if __name__ == "__main__":
    typer.run(main)
