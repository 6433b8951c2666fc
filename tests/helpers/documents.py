"""The documents of the project, and a pattern for their code blocks."""

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
"""All documents but the changelog, which names files that no longer exist."""

FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
"""Code block; the groups are the words behind the opening fence and the code."""

documents = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
