"""Shell completion: the words are those of the command line, and TAB does not wait for JAX."""

import subprocess
import sys

import pytest

from adapt.cli.entry import WORDS
from scripts import shell_words

ASKS = "import sys; from adapt.cli.entry import main; main()"


def completed(line: str, **environment: str) -> list[str]:
    """Return what bash offers at the end of a line."""
    asked = {"_GIRDLE_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    code = f"import os; os.environ.update({asked | environment!r}); {ASKS}"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    return ended.stdout.split()


def test_the_words_are_those_of_the_command_line():
    """If this fails, run `python -m scripts.shell_words`: a command or an option has changed."""
    assert WORDS.read_text(encoding="utf-8") == shell_words.written()


@pytest.mark.parametrize(
    ("line", "expected"),
    [("girdle di", {"diagnose"}), ("girdle adapt --eff", {"--effect", "--effects-of"}), ("girdle fit --bogus", set())],
)
def test_a_tab_offers_commands_and_options(line, expected):
    assert set(completed(line)) == expected


def test_a_tab_does_not_wait_for_jax():
    """A TAB imports neither JAX nor numpy nor pandas."""
    asked = {"_GIRDLE_COMPLETE": "complete_bash", "COMP_WORDS": "girdle ad", "COMP_CWORD": "1"}
    code = (
        f"import atexit, os, sys; os.environ.update({asked!r}); "
        "atexit.register(lambda: print(sorted({'jax', 'numpy', 'pandas'} & set(sys.modules)), file=sys.stderr)); "
        f"{ASKS}"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.stdout.split(), ended.stderr.strip()) == (["adapt"], "[]")
