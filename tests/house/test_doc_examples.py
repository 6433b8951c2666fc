"""Examples in the documents: the Python code runs, and the commands have the options that exist."""

import ast
import builtins
import contextlib
import inspect
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from documents import DOCUMENTS, FENCE, documents
from laboratory import write_c3d

from adapt.cli.app import app
from scripts.examples.simulated_trial import simulated_landmarks
from scripts.rooms import ROOT

GIRDLE: Any = typer.main.get_command(app)
GIRDLE_OPTIONS = {option for parameter in GIRDLE.params for option in parameter.opts}
TARGETS = set(re.findall(r"^([\w./]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))

SHELL = ("", "sh", "bash")
"""Kinds of blocks whose lines a reader types into a terminal."""

PYTHON, SLOW = "python", "python slow"
"""Kinds of Python blocks; those of a page form one session. Slow ones, which compile or take seconds, are not run:
their calls are checked against the functions' signatures."""

INLINE = re.compile(r"`((?:girdle|make) [^`]+)`")


def lines_to_type(document: Path) -> Iterator[list[str]]:
    """Yield each line of a page's blocks as words, continued lines joined, comments left out."""
    for kind, code in FENCE.findall(document.read_text(encoding="utf-8")):
        if kind in SHELL:
            for line in code.replace("\\\n", " ").splitlines():
                with contextlib.suppress(ValueError):  # an apostrophe marks prose or output, not a command
                    yield shlex.split(line, comments=True)


def arguments_of_girdle(words: list[str]) -> list[str] | None:
    """Return the arguments of a call of the command line, None if the line is no such call."""
    called = [place for place, word in enumerate(words) if Path(word).name == "girdle"]
    before = words[: called[0]] if called else []
    return words[called[0] + 1 :] if called and all(word == "time" or "=" in word for word in before) else None


def refusal(arguments: list[str]) -> str | None:
    """Return why the command line refuses these arguments; parses them without running anything."""
    name, *rest = arguments
    if name in GIRDLE_OPTIONS:
        return None
    if name not in GIRDLE.commands:
        return f"there is no girdle {name}"
    try:
        GIRDLE.commands[name].make_context(name, rest)
    except Exception as error:  # typer's errors for arguments have no public base class
        return f"girdle {shlex.join(arguments)}: {error}"
    return None


@documents
def test_the_command_line_takes_every_command(document):
    calls = filter(None, map(arguments_of_girdle, lines_to_type(document)))
    assert not [why for why in map(refusal, calls) if why]


@documents
def test_options_named_in_a_sentence_exist(document):
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    for command in INLINE.findall(text):
        program, name, *rest = command.split()
        if program == "make":
            assert name in TARGETS, command
        elif name.isalpha():
            known = {option for parameter in GIRDLE.commands[name].params for option in parameter.opts}
            assert {word.partition("=")[0] for word in rest if word.startswith("--")} <= known, command


def test_a_command_with_a_wrong_option_is_noticed():
    words = ["time", ".venv/bin/girdle", "adapt", "a.csv", "--modell", "R2", "--out", "out"]
    assert "--modell" in str(refusal(arguments_of_girdle(words) or []))
    assert refusal(["adapt", "a.csv", "--model", "R2", "--out", "out"]) is None


@documents
def test_make_has_every_target(document):
    for words in lines_to_type(document):
        if words[:1] == ["make"]:
            assert set(words[1:]) <= TARGETS


@pytest.fixture
def files_of_examples(tmp_path, monkeypatch) -> None:
    """Put the files that examples read into the working folder: two shipped simulated subjects and a trial."""
    header, *rows = (ROOT / "motions" / "data" / "simulated_subjects.csv").read_text(encoding="utf-8").splitlines()
    chosen = [row for row in rows if row.startswith(("simulated01,", "simulated02,"))]
    (tmp_path / "mysubjects.csv").write_text("\n".join([header, *chosen]) + "\n", encoding="utf-8")
    write_c3d(tmp_path / "P01.c3d", {name: places.T for name, places in simulated_landmarks("R2").items()})
    (tmp_path / "lab.toml").write_text('unit = "mm"\n', encoding="utf-8")
    monkeypatch.chdir(tmp_path)


def blocks(document: Path) -> list[tuple[str, str]]:
    """Return the Python blocks of a page in order, each with its kind."""
    return [found for found in FENCE.findall(document.read_text(encoding="utf-8")) if found[0] in (PYTHON, SLOW)]


def check_calls(code: str, names: dict[str, object]) -> None:
    """Check the arguments of every call of a named function against its signature."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            function = (vars(builtins) | names)[node.func.id]
            assert callable(function)
            keywords = {str(keyword.arg): None for keyword in node.keywords}
            inspect.signature(function).bind(*[None] * len(node.args), **keywords)


@pytest.mark.parametrize("document", [page for page in DOCUMENTS if blocks(page)], ids=lambda page: page.name)
def test_examples_run(document, files_of_examples):
    names: dict[str, object] = {}
    for kind, code in blocks(document):
        if kind == SLOW:
            imports = [node for node in ast.parse(code).body if isinstance(node, ast.Import | ast.ImportFrom)]
            exec("\n".join(map(ast.unparse, imports)), names)
            check_calls(code, names)
        else:
            exec(code, names)


def test_a_call_with_a_wrong_argument_is_noticed():
    with pytest.raises(TypeError, match="wieght"):
        check_calls(
            "adapt_subjects(motions, models, wieght=3)", {"adapt_subjects": lambda motions, models, weight=1: None}
        )
