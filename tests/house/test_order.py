"""No code iterates over a set: the order differs between processes, and with it the rounding of sums."""

import ast
from collections.abc import Iterator

from scripts import rooms

_MAKE_SETS = {"set", "frozenset", "difference", "intersection", "symmetric_difference", "union"}


def is_set(node: ast.expr) -> bool:
    """Check whether an expression is visibly a set."""
    match node:
        case ast.Set() | ast.SetComp():
            return True
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name in _MAKE_SETS
        case ast.BinOp(left, ast.BitAnd() | ast.BitOr() | ast.BitXor() | ast.Sub(), right):
            return is_set(left) or is_set(right)
    return False


def loops_over_sets(source: str) -> Iterator[int]:
    """Yield the lines of loops and comprehensions over a set, except those that make a set again."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.For(iter=gone_through):
                every = [gone_through]
            case ast.ListComp() | ast.DictComp() | ast.GeneratorExp():
                every = [one.iter for one in node.generators]
            case _:
                every = []
        yield from (one.lineno for one in every if is_set(one))


def test_no_module_goes_through_a_set():
    found = {name: list(loops_over_sets(path.read_text("utf-8"))) for name, path in rooms.source_files().items()}
    assert {name: lines for name, lines in found.items() if lines} == {}


def test_a_loop_over_a_set_is_noticed():
    lines = ["for a in set(x) & y: pass", "[b for b in {1, 2}]", "{c for c in set(x)}", "[d for d in sorted(set(x))]"]
    assert list(loops_over_sets("\n".join(lines))) == [1, 2]
