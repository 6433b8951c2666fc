"""The words that a shell completes, `adapt/cli/shell_words.txt`, read from the command line.

python -m scripts.shell_words      # after a change of a command or an option
"""

import re
from typing import Any

import typer

from adapt.cli.app import app
from adapt.cli.entry import WORDS


def written() -> str:
    """Write every command with its help and its options, a line each."""
    group: Any = typer.main.get_command(app)
    lines = []
    for name, command in group.commands.items():
        lines.append(f"{name}\t{_first_sentence(command.help)}")
        for parameter in command.params:
            for option in (one for one in (*parameter.opts, *parameter.secondary_opts) if one.startswith("--")):
                lines.append(f"{name}\t{option}\t{_first_sentence(getattr(parameter, 'help', ''))}")
    return "\n".join(lines) + "\n"


def _first_sentence(text: str | None) -> str:
    """On one line, without marks that a shell would read."""
    sentence = re.split(r"(?<=[.:;])\s", " ".join((text or "").split()))[0]
    return re.sub(r"[`'\"$\\\[\]]", "", sentence).rstrip(".:;")


def main() -> None:
    """Write the file."""
    WORDS.write_text(written(), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
