"""Imports go in one direction between rooms, folders stay small, and file names say what the files contain."""

import graphlib
from functools import cache
from pathlib import Path

import pytest

from scripts import draw_rooms, rooms

FILES = rooms.source_files()

MOST_ENTRIES = 12
"""Limit for the entries of a folder: as many as a reader takes in at once."""

NOT_COUNTED = {"__init__.py", "__main__.py", "__pycache__", "py.typed"}
DATA_FOLDERS = {"motions/data", "models/sets"}

SAME_BASENAME = {
    "__init__": "every package has one",
    "postures": "solvers/newton is for the plain chain, solvers/projection for any",
    "subjects": "solvers/newton is for the plain chain, solvers/projection for any",
    "rows": "motions/motion_csv/rows.py reads them from a file, solvers/rows.py lays them out as arrays",
    "held_out": "evaluation/held_out.py measures the gaps, tables/held_out.py is their table",
}
"""Basenames that several modules may have, with the reason."""

ONLY_IN = {
    "distributed": ("adapt.output",),
    "ezc3d": ("motions",),
    "jinja2": ("adapt.report",),
    "llvmlite": ("adapt.engine",),
    "matplotlib": ("adapt.output", "adapt.cli"),
    "nicegui": ("adapt.cli",),
    "plotly": ("adapt.report",),
    "pydicom": ("models",),
    "rich": ("adapt.cli",),
    "scipy": ("models", "adapt.solvers", "adapt.diagnosis", "adapt.trust"),
    "shapely": ("models",),
    "typer": ("adapt.cli",),
    "vtkmodules": ("models",),
}
"""Other packages, and the only rooms that import them: a web page does not print, a solver does not draw. matplotlib
draws figures of results and the window of `girdle contour`."""

WITHOUT_PANDAS = ("models", "adapt.engine", "adapt.solvers", "adapt.own_bones", "adapt.diagnosis")
"""Rooms that use typed arrays instead of pandas tables."""

NEVER_AT_RUN_TIME = ("casadi", "hypothesis", "jaxopt", "opensim", "pytest", "scripts", "tests")


@cache
def imports() -> tuple[rooms.Import, ...]:
    return tuple(rooms.imports(FILES))


@cache
def every_crossing() -> dict:
    return rooms.crossings(imports())


def folders() -> list[Path]:
    below = (path for package in rooms.PACKAGES for path in sorted((rooms.ROOT / package).rglob("*")))
    return [rooms.ROOT / package for package in rooms.PACKAGES] + [
        path for path in below if path.is_dir() and path.name not in NOT_COUNTED
    ]


def crossings_within(order) -> dict:
    return rooms.crossings(imports(), lambda module: rooms.folder(module, order))


def described(found) -> list[str]:
    return [f"{one.importer}, line {one.line}: {one.imported}" for one in found]


def test_every_room_has_a_place_in_the_order():
    assert {rooms.room(module) for module in FILES} == set(rooms.ORDER)


def backward(found, order) -> dict:
    return {ends: described(found[ends]) for ends in found if order.index(ends[1]) > order.index(ends[0])}


def test_a_room_imports_only_those_before_it():
    assert not backward(every_crossing(), rooms.ORDER)


@pytest.mark.parametrize("order", rooms.WITHIN, ids=lambda names: names[0].rpartition(".")[0])
def test_a_folder_inside_a_room_imports_only_those_before_it(order):
    assert not backward(crossings_within(order), order)


def test_nothing_but_python_dash_m_imports_the_command_line():
    importers = {ends[0] for ends in every_crossing() if ends[1] == "adapt.cli"}
    assert importers == {"adapt.__main__"}


def test_no_module_imports_itself_by_way_of_others():
    graph: dict[str, set[str]] = {module: set() for module in FILES}
    for one in imports():
        if one.imported in FILES and one.imported != one.importer:
            graph[one.importer].add(one.imported)
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, which names the cycle


@pytest.mark.parametrize("package", ONLY_IN)
def test_a_package_of_others_stays_in_its_room(package):
    importers = [one for one in imports() if one.imported.partition(".")[0] == package]
    assert importers, f"nothing imports {package} any more: delete it here and in pyproject.toml"
    assert not described(one for one in importers if rooms.room(one.importer) not in ONLY_IN[package])


def test_pandas_stays_at_the_edge():
    found = (one for one in imports() if one.imported.partition(".")[0] == "pandas")
    assert not described(one for one in found if rooms.room(one.importer) in WITHOUT_PANDAS)


def test_the_library_imports_no_oracle_script_or_test():
    assert not described(one for one in imports() if one.imported.partition(".")[0] in NEVER_AT_RUN_TIME)


@pytest.mark.parametrize("folder", folders(), ids=lambda path: str(path.relative_to(rooms.ROOT)))
def test_a_folder_can_be_taken_in_at_once(folder):
    if str(folder.relative_to(rooms.ROOT)) in DATA_FOLDERS:
        return
    entries = sorted(path.name for path in folder.iterdir() if path.name not in NOT_COUNTED)
    assert len(entries) <= MOST_ENTRIES, f"{len(entries)} entries: {', '.join(entries)}"


def test_a_basename_is_one_modules():
    by_name: dict[str, list[str]] = {}
    for module, path in FILES.items():
        by_name.setdefault(path.stem, []).append(module)
    assert not {name: modules for name, modules in by_name.items() if len(modules) > 1 and name not in SAME_BASENAME}
    gone = {name for name in SAME_BASENAME if len(by_name.get(name, ())) < 2 and not name.startswith("__")}
    assert not gone, "these are one module's by now: delete them from SAME_BASENAME"


def test_the_drawing_shows_the_imports_of_today():
    drawn = draw_rooms.arrows_in(draw_rooms.DRAWING.read_text(encoding="utf-8"))
    assert drawn == set(draw_rooms.arrows(every_crossing())), "run `make rooms`"


SOURCES = {
    "motions/__init__.py": "",
    "motions/table.py": "import numpy as np, json",
    "adapt/__init__.py": '"""The fits.\n\nMore."""\nfrom adapt import api',
    "adapt/api.py": "def late():\n    from motions.table import Motions\n    from .solvers import fit\n",
    "adapt/solvers/__init__.py": "from . import fit",
    "adapt/solvers/fit.py": "from .. import api\nfrom adapt.solvers import status",
}
"""A project with an import inside a function, relative imports, a submodule, and a name that is no module."""


def test_imports_are_read_from_the_source(tmp_path):
    for name, text in SOURCES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    files = rooms.source_files(tmp_path)
    assert set(rooms.imports(files)) == {
        ("motions.table", "numpy", 1),
        ("motions.table", "json", 1),
        ("adapt", "adapt.api", 4),
        ("adapt.api", "motions.table", 2),
        ("adapt.api", "adapt.solvers.fit", 3),
        ("adapt.solvers", "adapt.solvers.fit", 1),
        ("adapt.solvers.fit", "adapt.api", 1),
        ("adapt.solvers.fit", "adapt.solvers", 2),
    }
    assert set(rooms.crossings(rooms.imports(files))) == {
        ("adapt", "adapt.api"),
        ("adapt.api", "motions"),
        ("adapt.api", "adapt.solvers"),
        ("adapt.solvers", "adapt.api"),
    }
    assert rooms.purpose("adapt", files) == "The fits."
