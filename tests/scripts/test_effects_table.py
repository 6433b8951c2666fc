"""The table of effects in docs/effects.md is that of the library, and its units are those of the terminal."""

from command import girdle

from models.effects import EFFECTS
from scripts import effects_table


def test_the_table_is_current():
    """If this fails, run `python -m scripts.effects_table`: an effect has changed."""
    assert effects_table.PAGE.read_text(encoding="utf-8").endswith(f"\n\n{effects_table.table()}")


def test_directions_and_units_are_those_of_the_terminal():
    printed = girdle("effects").out
    rows = [line.split("|")[1:-1] for line in effects_table.table().splitlines()[2:]]
    assert [row[0] for row in rows] == [f"`{name}`" for name in EFFECTS]
    for (_, directions, unit), name in zip(rows, EFFECTS, strict=True):
        for words, sign in effects_table.SHORT.items():
            unit = unit.replace(sign, words)
        assert f"--effect {name}={directions.replace('<br>', '')} in {unit}\n" in printed
