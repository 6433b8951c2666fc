"""Write the words for shell completion, `adapt/cli/shell_words.txt`, from the command line's own definitions.

python -m scripts.shell_words      # after a change of a command or an option
"""

import re
from typing import Any

import typer

from adapt.cli.app import app
from adapt.cli.entry import WORDS


def written() -> str:
    """Return the text of the file: every command with its help, and its options, one per line."""
    group: Any = typer.main.get_command(app)
    lines = []
    for name, command in group.commands.items():
        lines.append(f"{name}\t{_first_sentence(command.help)}")
        for parameter in command.params:
            for option in (one for one in (*parameter.opts, *parameter.secondary_opts) if one.startswith("--")):
                lines.append(f"{name}\t{option}\t{_first_sentence(getattr(parameter, 'help', ''))}")
    return "\n".join(lines) + "\n"


def _first_sentence(text: str | None) -> str:
    """Return the first sentence on one line, without characters that a shell would interpret."""
    sentence = re.split(r"(?<=[.:;])\s", " ".join((text or "").split()))[0]
    return re.sub(r"[`'\"$\\\[\]]", "", sentence).rstrip(".:;")


def main() -> None:
    """Write the file of words."""
    WORDS.write_text(written(), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
