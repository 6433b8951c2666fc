"""The documentation site: Sphinx reads README, CONTRIBUTING, CHANGELOG and docs where they are (`make docs`).

Sphinx rather than MkDocs: MkDocs 1 has had no release since 2024, and the Material theme ends in May 2027.
"""

import importlib
import pkgutil
import re
import sys
from pathlib import Path

from latex2mathml.converter import convert
from numpy.typing import DTypeLike
from sphinx.application import Sphinx
from sphinx.util.docutils import nodes
from sphinx.util.typing import stringify_annotation

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from models.effects.amplitudes import Amplitudes  # noqa: E402
from models.effects.effect import Adjust  # noqa: E402
from models.person.family import AnyModel  # noqa: E402
from scripts.reference import documented_names  # noqa: E402
from scripts.run_notebooks import with_outputs  # noqa: E402

project = "girdle"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
root_doc = "README"
include_patterns = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/*.md",
    "docs/research/*.md",
    "docs/notebooks/*.md",
    "docs/site/*.md",
]
exclude_patterns = [".venv", "out", "docs/site/navigation.md"]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
"""As GitHub makes them, so that one link serves both."""

html_theme = "furo"
html_title = "girdle"
html_copy_source = False
html_show_copyright = False
html_extra_path = ["index.html"]

default_role = "code"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
pygments_style = "default"
highlight_language = "text"
"""Of blocks without a language: commands and what they print."""

NAVIGATION = Path(__file__).with_name("navigation.md")

MARKED = re.compile(r"(?P<code>``?[^`]+``?)|(?P<role>:\w+:(?=`))|(?P<mark>[*|_\\])")
"""What of a docstring reStructuredText would read as markup: only code and roles are meant."""

NAMED = {"DTypeLike": DTypeLike, "AnyModel": AnyModel, "Amplitudes": Amplitudes, "Adjust": Adjust}
ALIASES = {stringify_annotation(alias, "smart"): name for name, alias in NAMED.items()}
"""Types that have a name, which a signature spells out."""


DOTTED = re.compile(r"`((?:adapt|models|motions)(?:\.\w+)+)`")
"""A name in a page."""


def directive(name: str) -> str:
    """Write what documents a function, class, method or module of this name."""
    try:
        found, kind = importlib.import_module(name), "automodule"
    except ModuleNotFoundError:
        owner, _, last = name.rpartition(".")
        found = getattr(pkgutil.resolve_name(owner), last)
        in_class = isinstance(pkgutil.resolve_name(owner), type)
        kind = "autoclass" if isinstance(found, type) else "automethod" if in_class else "autofunction"
    return f".. {kind}:: {name}\n"


def add_functions(app: Sphinx, page: str, source: list[str]) -> None:
    """Document what the page with the equations names, but for what the reference of the API has."""
    if page == "docs/site/functions":
        text = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
        names = sorted(set(DOTTED.findall(text)) - documented_names())
        source[0] += f"\n```{{eval-rst}}\n{''.join(map(directive, names))}```\n"


def add_outputs(app: Sphinx, page: str, source: list[str]) -> None:
    """Show below each cell of a notebook what it prints, returns or draws."""
    if page.startswith("docs/notebooks/"):
        source[0] = with_outputs(ROOT / f"{page}.md", source[0])


def link_names(app: Sphinx, tree: nodes.document, page: str) -> None:
    """Make a link of each name in a text that is documented here."""
    known = app.env.get_domain("py").objects
    for literal in list(tree.findall(nodes.literal)):
        entry = known.get(literal.astext())
        if entry and not isinstance(literal.parent, nodes.reference) and entry.docname != page:
            target = f"{app.builder.get_relative_uri(page, entry.docname)}#{entry.node_id}"
            literal.replace_self(nodes.reference("", "", literal.deepcopy(), internal=True, refuri=target))


def add_navigation(app: Sphinx, page: str, source: list[str]) -> None:
    """Append the navigation to the first page, which GitHub shows without it."""
    if page == root_doc:
        source[0] += "\n" + NAVIGATION.read_text(encoding="utf-8")


def plain(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Escape what only looks like markup in a docstring, and keep indented formulas as they are."""
    text: list[str] = []
    for line in lines:
        formula = line.startswith("    ")
        if formula and not (text and text[-1].startswith("    ")):
            text += ["::", ""]
        text.append(line if formula else MARKED.sub(lambda m: f"\\{m['mark']}" if m["mark"] else m[0], line))
    lines[:] = text


def named_types(
    app: Sphinx, what: str, name: str, thing: object, options: object, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Write the name of a type in a signature where it has one, and of a function that is a default."""
    signature = signature and re.sub(r"<function (\w+)>", r"\1", signature)
    for spelled_out, alias in ALIASES.items():
        signature = signature and signature.replace(spelled_out, alias)
    return signature, returned


def write_formula(translator, node: nodes.math | nodes.math_block) -> None:
    """Write MathML, which browsers draw by themselves: no script, no network."""
    block = isinstance(node, nodes.math_block)
    formula = convert(node.astext(), display="block" if block else "inline")
    translator.body.append(
        f'<div class="math" style="margin: 1em 0; overflow-x: auto">{formula}</div>' if block else formula
    )
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register what this site does beyond its extensions."""
    app.connect("source-read", add_navigation)
    app.connect("source-read", add_functions)
    app.connect("source-read", add_outputs)
    app.connect("doctree-resolved", link_names)
    app.connect("autodoc-process-docstring", plain)
    app.connect("autodoc-process-signature", named_types)
    app.add_node(nodes.math, override=True, html=(write_formula, None))
    app.add_node(nodes.math_block, override=True, html=(write_formula, None))
