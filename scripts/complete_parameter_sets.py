"""Write the shipped parameter sets, models/*.toml, from the printed numbers."""

import typer

from models.completion import write_sets
from models.parameters import FOLDER


def main() -> None:
    """Write the shipped parameter sets anew, from the printed numbers and the rules that complete them."""
    write_sets(FOLDER)


if __name__ == "__main__":
    typer.run(main)
