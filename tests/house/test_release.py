"""Release files agree with pyproject.toml: the citation, the licences, the conda recipe, the changelog."""

import re
import tomllib
from importlib.metadata import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = PYPROJECT["project"]
PAGE = (ROOT / "docs" / "release.md").read_text()

CONDA_NAMES = {"matplotlib": "matplotlib-base"}
"""Packages with another name in conda; ``matplotlib`` there includes window toolkits, ``matplotlib-base`` does not."""

REQUIRED_OF_CITATION = {"cff-version", "message", "title", "authors"}
"""Required keys of the Citation File Format 1.2.0."""


def run_time() -> list[Requirement]:
    """List the packages that a user may need: dependencies and extras, except `dev`, `docs` and `peers`."""
    extras = PROJECT["optional-dependencies"]
    of_extras = [one for name, packages in extras.items() if name not in ("dev", "docs", "peers") for one in packages]
    return [Requirement(one) for one in (*PROJECT["dependencies"], *of_extras)]


def rows(heading: str) -> dict[str, list[str]]:
    """Return the rows of the table with this first heading, by their first cell."""
    table = PAGE[PAGE.index(f"| {heading} |") :].partition("\n\n")[0].splitlines()[2:]
    cells = ([cell.strip() for cell in line.strip("|").split("|")] for line in table)
    return {first.strip("`"): rest for first, *rest in cells}


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert set(citation) >= REQUIRED_OF_CITATION
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == PROJECT["version"]
    for work in (citation, *citation["references"]):
        assert work["title"]
        assert all("name" in author or "family-names" in author for author in work["authors"])
        assert "type" in work


def test_the_changelog_begins_with_this_version():
    headings = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert re.fullmatch(rf"{re.escape(PROJECT['version'])}, (unreleased|\d{{4}}-\d{{2}}-\d{{2}})", headings[0])


def test_every_package_has_its_licence():
    assert list(rows("package")) == [one.name for one in run_time()]


def brought_along() -> dict[str, str]:
    """Return the licence of every package that is installed because another one needs it."""
    table = rows("licence of what is brought along")
    return {name.split()[0]: licence for licence, (names,) in table.items() for name in names.split(", ")}


def test_everything_that_is_installed_has_its_licence():
    locked = set(re.findall(r"^([\w.-]+)==", (ROOT / "requirements.lock").read_text(), re.MULTILINE))
    assert locked - set(rows("package")) == set(brought_along())


@pytest.mark.parametrize("package", sorted({*rows("package"), *brought_along()} - {"colorama"}))
def test_the_licence_is_the_one_that_the_package_states(package):
    """Checked where the package states an SPDX expression; older metadata have words, or a file."""
    stated = metadata(package).get_all("License-Expression")
    if not stated:
        pytest.skip(f"{package} states no SPDX expression")
    said = rows("package")[package][0] if package in rows("package") else brought_along()[package]
    assert said == stated[0]


def test_every_shipped_table_of_numbers_has_its_source():
    packages = PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    files = {
        str(path.relative_to(ROOT))
        for package in packages
        for path in (ROOT / package).rglob("*")
        if path.suffix in {".toml", ".csv", ".json", ".npz"}
    }
    assert set(rows("file")) == files


OF_DAS3 = ("models/muscles/delft_lines.toml", "models/sets/das3.toml", "docs/release.md", "NOTICE")


@pytest.mark.parametrize("file", OF_DAS3)
def test_where_numbers_of_das3_stand_their_licence_is_said(file):
    """No licence of DAS3 is known, and no Apache licence was found. Files of numbers state this in their head."""
    said = " ".join((ROOT / file).read_text().partition('name = "')[0].replace("#", "").replace("`", "").split())
    assert "dasproject/DAS3 has no licence file" in said
    assert "reserves all rights" in said or "all rights reserved" in said


def recipe() -> dict:
    return yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text())


def as_pairs(lines: list[str]) -> dict[str, SpecifierSet]:
    """Return names and versions of a recipe's ``name >=1,<2`` lines."""
    return {name: SpecifierSet(asked) for name, _, asked in (line.partition(" ") for line in lines)}


def test_the_recipe_needs_what_the_package_needs():
    dependencies = [Requirement(one) for one in PROJECT["dependencies"]]
    expected = {CONDA_NAMES.get(one.name, one.name): one.specifier for one in dependencies}
    assert as_pairs(recipe()["requirements"]["run"]) == expected | {"python": SpecifierSet(PROJECT["requires-python"])}


def test_the_recipe_builds_the_package():
    found, (backend,) = recipe(), map(Requirement, PYPROJECT["build-system"]["requires"])
    assert found["context"]["version"] == PROJECT["version"]
    assert found["package"]["name"] == PROJECT["name"]
    host = as_pairs(found["requirements"]["host"])
    assert host[backend.name] == backend.specifier
    assert host["python"] == SpecifierSet(PROJECT["requires-python"])
    scripts = [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]
    assert found["build"]["python"]["entry_points"] == scripts
    assert found["about"]["summary"] == PROJECT["description"]
