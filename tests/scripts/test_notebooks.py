"""The notebooks are up to date with their pages, and run from the first cell to the last."""

import matplotlib.pyplot as plt
import pytest

from scripts import notebooks, run_notebooks

PAGES = notebooks.pages()

MOST_LETTERS = 84
"""Width of a line of code in the column of the site, from a screenshot."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_is_that_of_its_page(page):
    """If this fails, run `python -m scripts.notebooks`: the page has changed."""
    made = notebooks.notebook(page.read_text(encoding="utf-8"))
    assert page.with_suffix(".ipynb").read_text(encoding="utf-8") == made


SHOWN = {
    "first_adaptation": ["Motions(7 postures of 1 subject, 1 motion)", "scapula_held_out_deg", "its bound", "<img "],
    "gradients_and_vmap": ["Array(", "True"],
    "why_it_does_not_fit": ["Motions(84 postures", "effect&#x27;, (", "<img ", "Adaptations(6 subjects, R2)"],
}
"""Parts of the outputs, in order."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_notebook_runs_and_the_site_shows_its_outputs(page):
    text = run_notebooks.with_outputs(page, page.read_text(encoding="utf-8"))
    at = [text.find(part, text.find("{raw} html")) for part in SHOWN[page.stem]]
    assert at == sorted(at)
    assert min(at) > 0


def test_a_cell_shows_what_it_prints_and_its_last_value():
    plt.close("all")  # figures of other tests
    names = {}
    assert run_notebooks._cell("print('<1>')\nx = 2\nx", names) == "".join(
        f'<div class="highlight"><pre>{text}</pre></div>' for text in ("&lt;1&gt;\n", "2")
    )
    assert run_notebooks._cell("y = x + 1", names) == ""
    with pytest.raises(ZeroDivisionError):
        run_notebooks._cell("1 / 0", names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_lines_of_code_fit_into_a_page(page):
    code = [text for kind, text in notebooks.cells(page.read_text(encoding="utf-8")) if kind == "code"]
    assert [line for text in code for line in text.splitlines() if len(line) > MOST_LETTERS] == []
