"""Every script starts and prints its help, so its command line is consistent."""

import runpy
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"
RUN = sorted(
    path
    for path in SCRIPTS.rglob("*.py")
    if '\nif __name__ == "__main__"' in path.read_text(encoding="utf-8") and path.parent.name != "examples"
)
"""The examples are excluded: they take no options, and tests/scripts/test_examples.py runs them."""


@pytest.mark.parametrize("script", RUN, ids=lambda path: str(path.relative_to(SCRIPTS)))
def test_help_is_printed(script, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [script.name, "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(script), run_name="__main__")
    assert ended.value.code == 0
    assert "--help" in capsys.readouterr().out
