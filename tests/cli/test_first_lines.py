"""The first output a new user sees: ``girdle`` alone, ``--version``, ``--help``, shell completion, a first table."""

import os
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer
from command import girdle
from handmade import adaptations, motions_of, rising

from adapt.cli import app as cli
from adapt.cli.terminal.console import PlainConsole
from adapt.cli.terminal.print_tables import print_summary
from models import load_model

ROOT = Path(__file__).parents[2]

COMMANDS = (
    *("fit", "adapt", "diagnose", "trust", "muscles", "convert", "model", "contour", "models", "simulate"),
    *("effects", "doctor"),
)


def test_alone_it_says_three_lines_that_do_the_main_job_and_where_help_is():
    ended = girdle()
    assert (ended.status, ended.err) == (0, "")
    *job, more = ended.out.splitlines()
    assert [line.split()[1] for line in job] == ["convert", "adapt", "diagnose"]
    assert "girdle --help" in more


@pytest.mark.parametrize("line", cli.FIRST_LINES.splitlines()[:3])
def test_the_lines_are_as_the_commands_take_them(line):
    """Parsing the line would refuse an unknown option or a surplus argument."""
    name, *arguments = shlex.split(line, comments=True)[1:]
    command = typer.main.get_command(cli.app).commands[name]  # type: ignore[attr-defined]
    assert command.make_context(name, arguments).params


def test_the_lines_lead_from_one_to_the_next():
    convert, adapt, diagnose = (shlex.split(line, comments=True) for line in cli.FIRST_LINES.splitlines()[:3])
    assert convert[3] == adapt[2] == diagnose[2]


def test_version():
    ended = girdle("--version")
    assert (ended.status, ended.out) == (0, f"girdle {version('girdle')}\n")


def test_help_lists_every_command_in_order():
    ended = girdle("--help")
    named = [words[1] for words in map(str.split, ended.out.splitlines()) if len(words) > 1]
    assert ended.status == 0
    assert [name for name in named if name in COMMANDS] == list(COMMANDS)


@pytest.fixture
def as_a_program(monkeypatch):
    """Use the name of the installed command: the completion would show that of pytest otherwise."""
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_show_completion(monkeypatch, as_a_program, shell):
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")  # tests run outside a shell, so name one
    ended = girdle("--show-completion", shell)
    assert ended.status == 0
    assert f"_GIRDLE_COMPLETE=complete_{shell}" in ended.out


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("girdle ad", ["adapt"]),
        ("girdle mo", ["model", "models"]),
        ("girdle trust --cho", ["--choose-weight"]),
        ("girdle adapt --cho", []),
    ],
)
def test_what_is_typed_is_completed(monkeypatch, as_a_program, typed, offered):
    monkeypatch.setenv("_GIRDLE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    assert girdle().out.split() == offered


def test_a_real_shell_completes(tmp_path):
    """A script run in bash detects its shell, and the completion that it prints works there."""
    program = tmp_path / "girdle"
    program.write_text(f"#!{sys.executable}\nfrom adapt.cli.app import main\n\nmain()\n")
    program.chmod(0o700)
    lines = (
        'eval "$(girdle --show-completion)"',
        "COMP_WORDS=(girdle trust --cho) COMP_CWORD=2",
        '"$(complete -p girdle | sed "s/.*-F \\([^ ]*\\) .*/\\1/")" girdle',
        "echo ${COMPREPLY[@]}",
    )
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        ["bash", "-c", "\n".join(lines)], capture_output=True, text=True, env=environment, check=True
    )
    assert ended.stdout == "--choose-weight\n"


HEAVY = ("jax", "jaxtyping", "numpy", "pandas", "scipy", "models", "adapt.solvers")
"""Libraries that take over a second to import; help, the version and a usage error need none of them."""


@pytest.mark.parametrize(
    ("words", "status"),
    [
        ([], 0),
        (["--version"], 0),
        (["--help"], 0),
        *(([name, "--help"], 0) for name in typer.main.get_command(cli.app).commands),  # type: ignore[attr-defined]
        (["diagnose", "--modls", "x"], 2),
        (["adapt"], 2),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, list) else str(given),
)
def test_what_computes_nothing_waits_for_no_library(words, status):
    code = (
        "import atexit, sys; from adapt.cli.entry import main; "
        f"atexit.register(lambda: print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)); main()"
    )
    command = [sys.executable, "-c", code, *words]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr.splitlines()[-1]) == (status, "[]")


NOT_AT_ONCE = ("matplotlib", "scipy", "optimistix", "jaxopt", "plotly", "jinja2", "ezc3d", "nicegui")
"""Libraries that only some commands need, together over a second of every start."""


def test_an_adaptation_waits_for_no_library_of_others():
    code = f"import sys, adapt.cli.commands.fit_runs; print(*[name for name in {NOT_AT_ONCE} if name in sys.modules])"
    command = [sys.executable, "-c", code]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == []


def test_at_80_columns_a_subject_of_fifteen_letters_stays_in_one_piece(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    summary = adaptations(motions_of(rising(1, 4), ["simulated_trial"]), [load_model("R2")]).summary
    print_summary(PlainConsole(), summary, 1)
    assert capsys.readouterr().out.count(" simulated_trial ") == 2
