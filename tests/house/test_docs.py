"""The documents name files, modules and pages that exist, and the README stays short."""

import ast
import importlib
import re
from pathlib import Path

from documents import DOCUMENTS, FENCE, documents

from scripts.reference import documented_names
from scripts.rooms import PACKAGES, ROOT

MOST_LINES_OF_README = 93

PUBLIC = (*PACKAGES, "adapt.report", "models.effects")
"""Packages whose exported names are public (docs/python.md)."""

PATH = re.compile(r"(?<![\w./-])(?:adapt|docs|models|motions|scripts|tests)/[\w./*-]*[\w*/]")
"""A path from the root; ``*`` stands for anything."""

MODULE = re.compile(r"`((?:adapt|models|motions|scripts)(?:\.(?!csv`)\w+)+)`")
"""A dotted name in backticks: a module, or one of its members."""

LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(document: Path) -> set[str]:
    """Return the anchors of a page: each heading in lower case, without punctuation, blanks as hyphens."""
    text = FENCE.sub("", document.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def resolved(name: str) -> object:
    """Import the module of this name, or get the member of a module."""
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
    for kind, code in FENCE.findall(document.read_text(encoding="utf-8")):
        if not kind.startswith("python"):
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


def test_every_page_of_results_is_linked_from_their_list():
    research = ROOT / "docs" / "research"
    linked = set(LINK.findall((research / "README.md").read_text(encoding="utf-8")))
    assert {page.name for page in research.glob("*.md")} - {"README.md"} <= linked


def test_every_page_is_in_the_navigation_of_the_site():
    listed = re.findall(
        r"(\S+?)>?$", (ROOT / "docs" / "site" / "navigation.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    pages = {str(page.relative_to(ROOT).with_suffix("")) for page in DOCUMENTS} - {"README"}
    assert pages <= {name.removeprefix("<") for name in listed}


def test_the_reference_has_every_public_name():
    named = documented_names()
    for name in named:
        resolved(name)
    exported = {f"{package}.{name}" for package in PUBLIC for name in importlib.import_module(package).__all__}
    assert exported <= named
