"""The documents of the project, and what stands in them as code."""

import re

import pytest

from scripts.rooms import ROOT

DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "research").glob("*.md")),
    *sorted((ROOT / "docs" / "notebooks").glob("*.md")),
    ROOT / "docs" / "site" / "api.md",
]
"""Not the changelog: it names what was."""

FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
"""A block of code: what stands behind its opening fence, and its text."""

documents = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
