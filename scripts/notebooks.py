"""Make the notebooks of docs/notebooks from its pages: text and Python blocks become cells.

python -m scripts.notebooks        # after a change of a page
"""

import json
import re
from pathlib import Path

import typer

from scripts.rooms import ROOT

FOLDER = ROOT / "docs" / "notebooks"

BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```\n?", re.MULTILINE | re.DOTALL)


def cells(page: str) -> list[tuple[str, str]]:
    """Split a page into ('markdown' | 'code', text), in order."""
    parts = BLOCK.split(page)  # text, code, text, code, ..., text
    kinds = [("code" if k % 2 else "markdown", part.strip("\n")) for k, part in enumerate(parts)]
    return [(kind, text) for kind, text in kinds if text]


def notebook(page: str) -> str:
    """Convert a page to a notebook without outputs (nbformat 4.5)."""
    made = []
    for number, (kind, text) in enumerate(cells(page)):
        cell = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": text.splitlines(keepends=True)}
        made.append(cell | ({"execution_count": None, "outputs": []} if kind == "code" else {}))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    content = {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(content, indent=1) + "\n"


def pages() -> list[Path]:
    """List the pages of docs/notebooks."""
    return sorted(FOLDER.glob("*.md"))


def main() -> None:
    """Write every notebook beside its page."""
    for page in pages():
        page.with_suffix(".ipynb").write_text(notebook(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
