"""Write the table of `docs/effects.md`, the directions and units that `--effect` takes, from the effects themselves.

python -m scripts.effects_table    # after a change of an effect
"""

import typer

from adapt.cli.commands.list_runs import amplitude_places, amplitude_unit
from models.effects import EFFECTS, Effect
from scripts.rooms import ROOT

PAGE = ROOT / "docs" / "effects.md"

HEAD = "|effect|directions|unit|\n|---|---|---|\n"
"""Head of the table, without blanks, of which each would count as a word."""


SHORT = {", at 150 degrees of elevation": " at 150°", " per 30 deg": "/30°"}
"""Words of units, and their signs in the table."""

_MOST_LETTERS = 50
"""Largest width of a cell in letters."""


def table() -> str:
    """Return the table: one row per effect, as `girdle effects` prints it."""
    rows = [f"|`{one.name}`|{_directions(one)}|{_unit(one)}|" for one in EFFECTS.values()]
    return HEAD + "\n".join(rows) + "\n"


def _directions(effect: Effect) -> str:
    """List the directions as ``--effect`` takes them, on lines of their own where they are too long for a screen."""
    places = amplitude_places(effect)
    return places if len(places) < _MOST_LETTERS else places.replace(",", ",<br>")


def _unit(effect: Effect) -> str:
    """Write the unit without the words of elevation and bone angle, which stand once above the table."""
    unit = amplitude_unit(effect)
    for words, sign in SHORT.items():
        unit = unit.replace(words, sign)
    return unit


def main() -> None:
    """Write the table, below the text of the page."""
    text = PAGE.read_text(encoding="utf-8").partition(HEAD)[0]
    PAGE.write_text(text + table(), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
