"""Run the notebooks of docs/notebooks and keep what each cell shows in out/notebooks, for the tests and the site.

A notebook runs once for each state of its page, the packages and their versions: whoever needs it first runs it, and
others wait.
"""

import ast
import base64
import contextlib
import fcntl
import hashlib
import html
import io
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt

from adapt.output.svg import STYLE
from motions.files import atomic_write
from scripts.notebooks import BLOCK, cells
from scripts.rooms import PACKAGES, ROOT

KEPT = ROOT / "out" / "notebooks"


def with_outputs(page: Path, text: str) -> str:
    """Return the text of a page with what each block of code shows below it, as Markdown of the site."""
    shown = iter(outputs(page))
    return BLOCK.sub(lambda block: f"{block.group().rstrip()}\n\n{_as_html(next(shown))}\n", text)


def _as_html(shown: str) -> str:
    return f"```{{raw}} html\n{shown}\n```\n" if shown else ""


def outputs(page: Path) -> list[str]:
    """Return the HTML that each cell of code of a page shows, from a run of this state; run it if there is none."""
    KEPT.mkdir(parents=True, exist_ok=True)
    kept = KEPT / f"{page.stem}-{_state(page)}.json"
    with _alone(page.stem):
        if not kept.exists():
            made = json.dumps(list(_run(page.read_text(encoding="utf-8"))))
            for old in KEPT.glob(f"{page.stem}-*.json"):
                old.unlink()
            atomic_write(kept, made)
        return json.loads(kept.read_text(encoding="utf-8"))


def _state(page: Path) -> str:
    """Return a hash of all that the outputs depend on."""
    files = [page, Path(__file__), ROOT / "requirements.lock"]
    files += [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*")) if path.is_file()]
    digest = hashlib.sha256()
    for path in files:
        if "__pycache__" not in path.parts:
            digest.update(f"{path.relative_to(ROOT)} ".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@contextlib.contextmanager
def _alone(name: str) -> Iterator[None]:
    """Let one process at a time run a notebook."""
    with (KEPT / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _run(text: str) -> Iterator[str]:
    """Run the cells of code of a page one after the other, in an empty folder; yield what each shows, as HTML."""
    names: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), mpl.rc_context({"backend": "agg", **STYLE}):
        plt.close("all")  # figures of who called
        for kind, code in cells(text):
            if kind == "code":
                yield _cell(code, names)


def _cell(code: str, names: dict[str, Any]) -> str:
    """Run a cell; return what it prints, then its figures, or else the value of its last line."""
    tree, value = ast.parse(code), None
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as said:
        exec(compile(tree, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    figures = [_figure(number) for number in plt.get_fignums()]
    return "".join([_text(said.getvalue()), *(figures or [_value(value)])])


def _figure(number: int) -> str:
    image = io.BytesIO()
    plt.figure(number).savefig(image, format="svg", metadata={"Date": None})
    plt.close(number)
    data = base64.b64encode(image.getvalue()).decode()
    return f'<img alt="Figure of the cell above" src="data:image/svg+xml;base64,{data}">'


def _value(value: Any) -> str:
    if hasattr(value, "_repr_html_"):
        return f'<div style="overflow-x: auto; font-size: 0.85em">{value._repr_html_()}</div>'
    return "" if value is None else _text(repr(value))


def _text(text: str) -> str:
    return f'<div class="highlight"><pre>{html.escape(text)}</pre></div>' if text else ""
