"""Read the rooms of the code (packages, folders, files) and their imports from the source, without importing any.

`tests/house` checks the directions of the imports with it, `scripts/draw_rooms.py` draws them.
"""

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PACKAGES = ("motions", "models", "adapt")

ORDER = (
    "motions",
    "models",
    "adapt.differentiable",
    "adapt.engine",
    "adapt.solvers",
    "adapt.own_bones",
    "adapt.tables",
    "adapt.evaluation",
    "adapt.api",
    "adapt.diagnosis",
    "adapt.trust",
    "adapt",
    "adapt.report",
    "adapt.output",
    "adapt.cli",
    "adapt.__main__",
)
"""The rooms. Each may import the rooms before it and none after it. `adapt` alone is `adapt/__init__.py`."""

WITHIN = (
    ("motions.checks", "motions.motion_csv", "motions.landmarks", "motions.formats"),
    ("adapt.solvers.newton", "adapt.solvers.projection"),
    ("adapt.diagnosis.fit", "adapt.diagnosis.inference", "adapt.diagnosis.texts"),
)
"""Folders inside a room, ordered by the same rule."""


class Import(NamedTuple):
    """One module imports another; ``imported`` may belong to another project."""

    importer: str
    imported: str
    line: int


def module_name(path: Path, root: Path = ROOT) -> str:
    """Return the dotted name of a source file; ``__init__.py`` has the name of its package."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def source_files(root: Path = ROOT) -> dict[str, Path]:
    """Return the source files of the three packages by module name."""
    found = (path for package in PACKAGES for path in sorted((root / package).rglob("*.py")))
    return {module_name(path, root): path for path in found}


def imports(files: Mapping[str, Path]) -> Iterator[Import]:
    """Yield every import statement of the files, also inside functions, except those under TYPE_CHECKING.

    ``from package import name`` imports the module ``package.name`` if that is among the files, else ``package``.
    """
    for importer, path in files.items():
        for node in _run_time(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                yield from (Import(importer, alias.name, node.lineno) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                base = _absolute(node, importer, path)
                for alias in node.names:
                    full = f"{base}.{alias.name}"
                    yield Import(importer, full if full in files else base, node.lineno)


def _run_time(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield every node below, except the branches that only a type checker sees."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        yield node
        yield from _run_time(node)


def _absolute(node: ast.ImportFrom, importer: str, path: Path) -> str:
    """Return the absolute name of the module in a ``from`` statement, also of a relative one."""
    if not node.level:
        return node.module or ""
    package = importer.split(".") if path.name == "__init__.py" else importer.split(".")[:-1]
    parents = package[: len(package) - node.level + 1]
    return ".".join([*parents, *([node.module] if node.module else [])])


def room(module: str) -> str | None:
    """Return the room of a module: a package, or a folder or file at the top of `adapt`; None for other projects."""
    package, *rest = module.split(".")
    if package not in PACKAGES:
        return None
    return f"adapt.{rest[0]}" if package == "adapt" and rest else package


def folder(module: str, names: Iterable[str]) -> str | None:
    """Return the folder, among these names, that contains a module; None if there is none."""
    return next((name for name in names if f"{module}.".startswith(f"{name}.")), None)


def crossings(
    found: Iterable[Import], place: Callable[[str], str | None] = room
) -> dict[tuple[str, str], list[Import]]:
    """Group the imports that cross from one place into another by (importer's place, imported place)."""
    by_places: dict[tuple[str, str], list[Import]] = {}
    for one in found:
        ends = place(one.importer), place(one.imported)
        if ends[0] and ends[1] and ends[0] != ends[1]:
            by_places.setdefault((ends[0], ends[1]), []).append(one)
    return by_places


def purpose(name: str, files: Mapping[str, Path]) -> str:
    """Return the first line of a room's docstring."""
    text = ast.get_docstring(ast.parse(files[name].read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]
