"""Write the shipped parameter sets, models/sets/*.toml, from the printed numbers."""

import typer

from models.parameter_sets import FOLDER
from scripts.completion import write_sets


def main() -> None:
    """Write the shipped parameter sets from the printed numbers and the rules that complete them."""
    write_sets(FOLDER)


if __name__ == "__main__":
    typer.run(main)
