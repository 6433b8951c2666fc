"""``girdle doctor``: installed packages, cached files, and missing packages with the command that installs them."""

import os
import shlex
import subprocess
import sys
import tomllib
from functools import partial
from importlib.metadata import version
from pathlib import Path

import platformdirs
import pytest
from command import girdle

from adapt.cli import doctor
from adapt.engine import object_cache
from adapt.engine.machine_code import MachineCodeError

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    """Use a separate cache folder of the user for this test."""
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda _: tmp_path / "cache")
    return tmp_path / "cache"


@pytest.fixture
def declared(monkeypatch) -> list[str]:
    """Take the requirements from the current source, because the metadata of the installed package may be older."""
    extras = PROJECT["optional-dependencies"].items()
    found = [*PROJECT["dependencies"], *(f'{one.split(";")[0]}; extra == "{e}"' for e, all_ in extras for one in all_)]
    said = doctor.said_of
    monkeypatch.setattr(
        doctor, "said_of", lambda package, field: found if field == "Requires-Dist" else said(package, field)
    )
    return found


def test_all_is_well(cache, declared):
    ended = girdle("doctor")
    assert (ended.status, ended.err) == (0, "")
    rows = [line.split() for line in ended.out.splitlines()]
    for name in ("numpy", "jax", "llvmlite", "scipy"):
        assert any(row and row[0].startswith(name) and version(name) in row and row[-1] == "ok" for row in rows)
    assert ended.out.splitlines()[-1] == "girdle can work."
    assert not any(row and row[0].startswith(("pytest", "ruff")) for row in rows)


@pytest.mark.parametrize("not_kept", [False, True])
def test_python_that_compiles_everything_anew_is_said(cache, declared, monkeypatch, not_kept):
    monkeypatch.setattr(sys, "dont_write_bytecode", not_kept)
    ended = girdle("doctor")
    assert ended.status == 0
    assert ("unset PYTHONDONTWRITEBYTECODE" in ended.out) is not_kept


def test_what_is_needed_and_missing_ends_with_1_and_the_command(cache, declared):
    declared += ["nosuchpackage>=2", "numpy>=99"]
    ended = girdle("doctor")
    assert ended.status == 1
    lines = ended.out.splitlines()
    install = f"{shlex.quote(sys.executable)} -m pip install"
    assert f"nosuchpackage>=2: {install} 'nosuchpackage>=2'" in lines
    assert f"numpy>=99: {install} 'numpy>=99'" in lines
    assert lines[-1] == "girdle needs nosuchpackage>=2, numpy>=99"


def test_an_extra_that_is_missing_is_no_failure(cache, declared):
    declared += ['nosuchpackage>=2; extra == "contour"']
    ended = girdle("doctor")
    assert ended.status == 0
    assert "nosuchpackage>=2 (extra contour): for girdle contour: " in ended.out


def test_a_python_that_is_too_old_is_named(monkeypatch):
    assert doctor.python_found().state == doctor.OK
    monkeypatch.setattr(doctor, "python_version", lambda: "3.10.2")
    assert doctor.python_found().state == doctor.MISSING


def test_every_extra_of_a_user_has_its_use():
    assert set(doctor.USE_OF_EXTRA) == set(PROJECT["optional-dependencies"]) - {"dev", "docs", "peers"}


def test_a_compiler_that_fails_is_no_failure(cache, declared, monkeypatch):
    """Without the compiler XLA runs the fits."""

    def fail(text):
        raise MachineCodeError("as LLVM says it")

    monkeypatch.setattr(object_cache, "emit_object", fail)
    ended = girdle("doctor")
    assert ended.status == 0
    assert "none: as LLVM says it" in ended.out
    assert "machine code: XLA runs the fits, more slowly, as exactly" in ended.out.splitlines()


def test_the_trial_is_compiled_once(cache, monkeypatch):
    """The second check takes the trial from the cache, without JAX, whose import takes a second."""
    assert doctor.machine_code_found().state == doctor.OK
    monkeypatch.setitem(sys.modules, "jax.numpy", None)  # an import would fail
    assert doctor.machine_code_found().state == doctor.OK


def test_it_answers_without_slow_imports(tmp_path):
    """The second call imports neither JAX nor the command line with the library that checks its options."""
    code = (
        "import atexit, sys; sys.argv[1:] = ['doctor']; from adapt.cli.entry import main; "
        "atexit.register(lambda: print({'jax', 'pandas', 'pydantic'} & set(sys.modules), file=sys.stderr)); main()"
    )
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    run = partial(subprocess.run, env=environment, capture_output=True, text=True, check=True)
    run([sys.executable, "-c", code])
    ended = run([sys.executable, "-c", code])
    assert ended.stdout.splitlines()[-1] == "girdle can work."
    assert ended.stderr == "set()\n"


def test_what_is_kept_is_counted(cache):
    def found() -> dict[str, doctor.Finding]:
        return {one.what: one for one in doctor.cache_found(cache)}

    assert not cache.exists()
    doctor.machine_code_found()  # whose trial is no result that a fit uses
    empty = found()["machine code of this version"]
    assert (empty.found, empty.state) == ("0 files, 0.0 MB", doctor.OPTIONAL)
    object_cache.object_code("add", lambda: "define double @add(double %a) {\n  ret double %a\n}\n")
    assert found()["machine code of this version"].found.startswith("1 files, ")
    assert found()["machine code of other versions"].remedy == ""

    old = cache / "machine" / "add-of_another_version"
    old.write_bytes(bytes(2_000_000))
    stale = found()["machine code of other versions"]
    assert stale.found == "1 files, 2.0 MB"
    subprocess.run(shlex.split(stale.remedy, comments=True), check=True)
    assert not old.exists()


def test_files_are_counted_without_a_compiler(cache, monkeypatch):
    def fail():
        raise MachineCodeError("no llvmlite")

    (cache / "machine").mkdir(parents=True)
    (cache / "machine" / "add-of_some_version").write_bytes(b"x")
    object_cache._key.cache_clear()
    monkeypatch.setattr(object_cache, "describe_target", fail)
    assert {one.what: one for one in doctor.cache_found(cache)}["machine code of other versions"].found[:2] == "1 "


def test_a_cache_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("no folder")
    (only,) = doctor.cache_found(tmp_path / "file")
    assert only.state == doctor.OPTIONAL
    assert "XDG_CACHE_HOME" in only.remedy
