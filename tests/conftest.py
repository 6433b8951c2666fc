"""Double precision for every test, and the measured motions, which are not part of the project."""

from pathlib import Path

import pytest

import motions  # noqa: F401  (switches JAX to double precision before any test makes an array)

MEASURED_FOLDER = Path(__file__).parents[2] / "shared" / "motions"
"""Bone-pin shoulders and published means in this project's form; under GPL-3.0, so not shipped."""


@pytest.fixture(scope="session")
def measured_files() -> tuple[Path, ...]:
    """The measured motion files, or a skip that says what is missing."""
    files = tuple(sorted(MEASURED_FOLDER.glob("*.csv")))
    if not files:
        pytest.skip(f"no measured motions in {MEASURED_FOLDER}: they are licensed apart from the project")
    return files
