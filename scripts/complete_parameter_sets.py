"""Write the shipped parameter sets, models/*.toml, from the printed numbers."""

from models.completion import write_sets
from models.parameters import FOLDER


def main() -> None:
    write_sets(FOLDER)


if __name__ == "__main__":
    main()
