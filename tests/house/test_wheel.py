"""The sdist and the wheel built from it, installed in a clean environment and run outside the repository."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

PACKAGES = ("adapt", "models", "motions")

NEEDED = ("motions/data/simulated_subjects.csv", "models/sets/R2.toml", "adapt/report/templates/report.html")
"""Files other than Python, one of each kind."""

WHERE = f"import {', '.join(PACKAGES)}; print(*(package.__file__ for package in ({', '.join(PACKAGES)})), sep='\\n')"


def run(*command: object, cwd: Path) -> str:
    """Return the output of a command, run in a folder without the import path of the tests."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ended = subprocess.run([*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Install the wheel built from the sdist in a new environment that shares the tests' own libraries.

    A ``.pth`` file adds their folder to the import path, so that an editable install in it is not followed.
    """
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder, cwd=ROOT)
    (sdist,) = folder.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    unpacked = folder / sdist.name.removesuffix(".tar.gz")
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=unpacked)
    (wheel,) = folder.glob("*.whl")
    environment = folder / "environment"
    run(sys.executable, "-m", "venv", "--without-pip", environment, cwd=folder)
    python = environment / "bin" / "python"
    offline = ("--disable-pip-version-check", "--no-index", "--no-deps", "--quiet")
    run(sys.executable, "-m", "pip", "--python", python, "install", *offline, wheel, cwd=folder)
    (packages,) = environment.glob("lib/python*/site-packages")
    (packages / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return environment


def test_every_package_comes_from_the_wheel_with_its_files(installed, tmp_path):
    found = [Path(line) for line in run(installed / "bin" / "python", "-c", WHERE, cwd=tmp_path).splitlines()]
    (packages,) = installed.glob("lib/python*/site-packages")
    assert found == [packages / name / "__init__.py" for name in PACKAGES]
    for name in NEEDED:
        assert (packages / name).read_bytes() == (ROOT / name).read_bytes()
    in_wheel, in_tree = (
        {path.relative_to(root) for name in PACKAGES for path in (root / name).rglob("*") if _is_source(path)}
        for root in (packages, ROOT)
    )
    assert in_wheel == in_tree


def test_the_command_finds_what_it_needs(installed, tmp_path):
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert run(installed / "bin" / "girdle", "--version", cwd=tmp_path) == f"girdle {version}\n"
    said = run(installed / "bin" / "girdle", "doctor", cwd=tmp_path)
    assert said.splitlines()[-1] == "girdle can work."


def _is_source(path: Path) -> bool:
    return path.is_file() and "__pycache__" not in path.parts


def test_the_shipped_subjects_are_adapted_outside_the_repository(installed, tmp_path):
    (packages,) = installed.glob("lib/python*/site-packages")
    motion, out = packages / "motions" / "data" / "simulated_subjects.csv", tmp_path / "out"
    run(installed / "bin" / "girdle", "adapt", motion, "--model", "R2", "--out", out, cwd=tmp_path)
    written = {path.name for path in out.iterdir()}
    assert {"fits.csv", "parameters.csv", "summary.csv", "run.json", "report.html"} <= written
    rows = (out / "parameters.csv").read_text().splitlines()
    assert len(rows) == 1 + 10
