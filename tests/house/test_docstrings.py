"""Public docstrings begin with a verb."""

import ast
import re
from pathlib import Path

import pytest

from scripts.rooms import source_files

PROPERTIES = {"property", "cached_property"}

MIRRORED = {"function_builder.py"}
"""Files whose methods are numpy's functions under numpy's names."""

NO_VERBS = {
    "A",
    "All",
    "An",
    "As",
    "At",
    "By",
    "Each",
    "Every",
    "For",
    "From",
    "How",
    "If",
    "In",
    "It",
    "Its",
    "No",
    "None",
    "Of",
    "On",
    "One",
    "Only",
    "Some",
    "That",
    "The",
    "These",
    "They",
    "This",
    "Those",
    "To",
    "What",
    "When",
    "Where",
    "Whether",
    "Which",
    "Who",
    "With",
}
"""First words of sentences that say what something is, instead of what a function does."""


def is_property(function: ast.FunctionDef) -> bool:
    return any(isinstance(one, ast.Name) and one.id in PROPERTIES for one in function.decorator_list)


def public_functions(tree: ast.AST) -> list[ast.FunctionDef]:
    """Collect the public functions and methods that do something: no properties, no stubs of protocols."""
    found = []
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            found += public_functions(node)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not is_property(node):
            stub = isinstance(node.body[0], ast.Expr) and ast.unparse(node.body[0]) == "..."
            found += [] if stub else [node]
    return found


@pytest.mark.parametrize("path", source_files().values(), ids=lambda path: Path(*path.parts[-3:]).as_posix())
def test_public_docstrings_begin_with_a_verb(path):
    wrong = []
    for function in public_functions(ast.parse(path.read_text(encoding="utf-8"))):
        words = (ast.get_docstring(function) or "").split()
        if not words and path.name in MIRRORED:
            continue
        if not words or words[0] in NO_VERBS or not re.fullmatch(r"[A-Z][a-z]+", words[0].rstrip(".,:;")):
            wrong.append(f"{function.name}: {' '.join(words[:5])}")
    assert not wrong
