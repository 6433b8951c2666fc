"""The documents name files, modules and pages that exist, and the README stays short."""

import ast
import importlib
import re
from pathlib import Path

import pytest

from scripts.rooms import PACKAGES, ROOT

DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
"""Not the changelog: it names what was."""

MOST_LINES_OF_README = 150

PATH = re.compile(r"(?<![\w./-])(?:adapt|docs|models|motions|scripts|tests)/[\w./*-]*[\w*/]")
"""A path from the root; ``*`` stands for anything."""

MODULE = re.compile(r"`((?:adapt|models|motions|scripts)(?:\.(?!csv`)\w+)+)`")
"""A dotted name in backticks: a module, or what it holds."""

LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)

documents = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def anchors(document: Path) -> set[str]:
    """What a link may name after #: each heading in lower case, without punctuation, blanks as hyphens."""
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def resolved(name: str) -> object:
    """The module of this name, or what a module of its beginning holds."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        folder = ROOT.joinpath(*parts[:length])
        if folder.is_dir() or folder.with_suffix(".py").exists():
            found: object = importlib.import_module(".".join(parts[:length]))
            for attribute in parts[length:]:
                found = getattr(found, attribute)
            return found
    raise ModuleNotFoundError(name)


@documents
def test_links_resolve(document):
    dead = []
    for target in LINK.findall(document.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        page = (document.parent / name).resolve() if name else document
        if not page.exists() or (anchor and anchor not in anchors(page)):
            dead.append(target)
    assert not dead


@documents
def test_paths_exist(document):
    named = set(PATH.findall(document.read_text(encoding="utf-8")))
    assert not sorted(name for name in named if not any(ROOT.glob(name.rstrip("/"))))


@documents
def test_dotted_names_exist(document):
    for name in MODULE.findall(document.read_text(encoding="utf-8")):
        resolved(name)


@documents
def test_imports_of_examples_work(document):
    for language, code in FENCE.findall(document.read_text(encoding="utf-8")):
        if language != "python":
            continue
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.partition(".")[0] in PACKAGES:
                for alias in node.names:
                    resolved(f"{node.module}.{alias.name}")


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= MOST_LINES_OF_README


def test_every_page_is_linked_from_the_readme():
    linked = set(LINK.findall((ROOT / "README.md").read_text(encoding="utf-8")))
    assert {f"docs/{page.name}" for page in (ROOT / "docs").glob("*.md")} <= linked
