"""The notebooks are up to date with their pages, and run from the first cell to the last."""

import json

import matplotlib as mpl
import pytest

from scripts import notebooks

PAGES = notebooks.pages()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_is_that_of_its_page(page):
    """If this fails, run `python -m scripts.notebooks`: the page has changed."""
    made = notebooks.notebook(page.read_text(encoding="utf-8"))
    assert page.with_suffix(".ipynb").read_text(encoding="utf-8") == made


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    with mpl.rc_context({"backend": "agg"}):
        for cell in json.loads(page.with_suffix(".ipynb").read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                exec("".join(cell["source"]), names)
