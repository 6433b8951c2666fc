"""Checks of ``girdle doctor``: what is installed, kept between runs or missing, and the remedies."""

import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from platform import python_version

from packaging.requirements import Requirement

from adapt.cli.options import console
from adapt.cli.terminal.console import folding_table
from adapt.engine.compilation_cache import cache_folder
from adapt.engine.machine_code import MachineCodeError
from adapt.engine.object_cache import machine_folder, object_code, of_this_version
from motions.errors import pip_install

EXIT_NEEDED_IS_MISSING = 1

OK, MISSING, OPTIONAL = "ok", "MISSING", "optional"

USE_OF_EXTRA = {
    "app": "girdle app",
    "contour": "girdle contour",
    "dask": "girdle adapt --dask",
    "parquet": "girdle convert TABLE.csv TABLE.parquet",
    "surface": "girdle transfer with surfaces",
}
"""Command that cannot be used without an extra of the package, by name of the extra."""


@dataclass(frozen=True)
class Finding:
    """One line of the output of ``girdle doctor``. ``remedy``: advice or command; empty if none is needed."""

    what: str
    found: str
    state: str = OK
    remedy: str = ""


def print_findings() -> int:
    """Print the findings and their remedies; return the exit status, ``EXIT_NEEDED_IS_MISSING`` or 0."""
    findings = [
        python_found(),
        compiled_found(),
        *packages_found(said_of("girdle", "Requires-Dist")),
        machine_code_found(),
        *cache_found(cache_folder()),
    ]
    table = folding_table(f"girdle {_version('girdle')} in {Path(__file__).parents[2]}", ("what", "found", "state"))
    for one in findings:
        table.add_row(one.what, one.found, one.state)
    console.print(table)
    for one in findings:
        if one.remedy:
            console.print(f"{one.what}: {one.remedy}", soft_wrap=True)
    missing = [one.what for one in findings if one.state == MISSING]
    console.print(f"girdle needs {', '.join(missing)}" if missing else "girdle can work.", soft_wrap=True)
    return EXIT_NEEDED_IS_MISSING if missing else 0


def python_found() -> Finding:
    """Compare the version of this Python with the version that the package requires."""
    (asked,) = said_of("girdle", "Requires-Python")
    right = Requirement(f"python{asked}").specifier.contains(python_version(), prereleases=True)
    remedy = "" if right else f"make a new environment with Python {asked}"
    return Finding(f"Python {asked}", python_version(), OK if right else MISSING, remedy)


def compiled_found() -> Finding:
    """Check whether Python keeps its compiled source files."""
    what = "compiled Python files"
    if not sys.dont_write_bytecode:
        return Finding(what, "kept")
    return Finding(what, "not kept", OPTIONAL, "every command starts 3 s later; unset PYTHONDONTWRITEBYTECODE")


def packages_found(requirements: Sequence[str]) -> Iterator[Finding]:
    """Look for every package that the installed metadata names: required packages, then those of each extra.

    ``requirements`` have the form of ``Requires-Dist`` in that metadata. Packages for developers are left out.
    """
    by_extra: dict[str, list[Requirement]] = {}
    for one in map(Requirement, requirements):
        for extra in ("", *USE_OF_EXTRA):
            if one.marker is None or one.marker.evaluate({"extra": extra}):
                by_extra.setdefault(extra, []).append(one)
                break
    for extra in sorted(by_extra):
        for one in by_extra[extra]:
            yield _package(one, extra)


def _package(one: Requirement, extra: str) -> Finding:
    what = f"{one.name}{one.specifier}" + (f" (extra {extra})" if extra else "")
    found = _version(one.name)
    if found and one.specifier.contains(found, prereleases=True):
        return Finding(what, found)
    command = pip_install(f"{one.name}{one.specifier}")
    remedy = f"for {USE_OF_EXTRA[extra]}: {command}" if extra else command
    return Finding(what, found or "not installed", OPTIONAL if extra else MISSING, remedy)


def _version(package: str) -> str:
    """Return the installed version of a package, or nothing."""
    return " ".join(said_of(package, "Version"))


def said_of(package: str, field: str) -> list[str]:
    """Return the values of a field of the metadata of an installed package, one per line.

    ``importlib.metadata.metadata`` would parse the README below the fields too, for ten times as long.
    """
    try:
        text = distribution(package).read_text("METADATA") or ""
    except PackageNotFoundError:
        return []
    fields = text.partition("\n\n")[0].splitlines()
    return [value for name, _, value in (line.partition(": ") for line in fields) if name == field]


def machine_code_found() -> Finding:
    """Check whether a function of this JAX compiles to machine code on this processor; if not, say why.

    The cache keeps the trial, so that only the first check of a version on a processor compiles.
    """
    try:
        object_code(_TRIAL, _trial)
    except MachineCodeError as error:
        return Finding("machine code", f"none: {error}", OPTIONAL, "XLA runs the fits, more slowly, as exactly")
    return Finding("machine code", f"by llvmlite {_version('llvmlite')}, of JAX {_version('jax')}")


_TRIAL = "tried"
"""Name of the function that is compiled as a trial, in the cache."""


def _trial() -> str:
    import jax.numpy as jnp  # slow import: JAX

    from adapt.engine.jax_program import per_problem
    from adapt.engine.kernel import Kernel

    return Kernel(_TRIAL, per_problem(jnp.sin), ("",), "", 1).build().text()


def cache_found(folder: Path) -> Iterator[Finding]:
    """Count the files in the cache folder: machine code of this version and of other versions, and programs of XLA."""
    if not _can_be_written(folder):
        remedy = "every run compiles anew; set XDG_CACHE_HOME to a folder of your own"
        yield Finding("cache folder", f"{folder} cannot be written to", OPTIONAL, remedy)
        return
    machine, xla = _files(machine_folder()), _files(folder / "jax")
    machine = [path for path in machine if not path.name.startswith(f"{_TRIAL}-")]
    mine: list[Path] = []
    with suppress(MachineCodeError):  # without a compiler there is no version to compare with
        mine = [path for path in machine if of_this_version(path)]
    others = [path for path in machine if path not in mine]
    yield Finding("cache folder", str(folder))
    empty = "" if mine else "the first `girdle adapt` makes it, which takes seconds, and keeps it"
    yield Finding("machine code of this version", _counted(mine), OK if mine else OPTIONAL, empty)
    free = f"rm -r {shlex.quote(str(machine_folder()))}  # to free the space; what is needed is made anew"
    yield Finding("machine code of other versions", _counted(others), remedy=free if others else "")
    yield Finding("programs of XLA", _counted(xla))


def _can_be_written(folder: Path) -> bool:
    """Check whether files can be made in the folder, or the folder itself where it does not exist yet."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _counted(files: Sequence[Path]) -> str:
    return f"{len(files)} files, {sum(path.stat().st_size for path in files) / 1e6:.1f} MB"
