"""Arithmetic of machine code against NumPy: operations, loops, memory, and independence of the problems of a batch."""

import re
from pathlib import Path

import jax
import numpy as np
import platformdirs
import pytest
from numpy.random import PCG64, Generator

from adapt.engine.axes import along, stacked
from adapt.engine.kernel import Kernel
from adapt.engine.trigonometry import half_pi_parts
from motions.arrays import repeat, repeat_while, xp

ULP = {np.float64: 2.3e-16, np.float32: 1.2e-7}
"""Relative size of one unit in the last place."""

TYPES = list(ULP)

SINE_ERROR = 2.0
"""Largest error of sine and cosine in units in the last place of 1; relative to the sine where the sine is small."""

PROBLEMS = 29
"""Batch size, not a multiple of the eight problems of a block."""


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    """Use an empty cache: the keys of the user's cache cover the source of the project, not that of tests."""
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda _: tmp_path)


def values(rows: int, seed: int = 1) -> np.ndarray:
    return Generator(PCG64(seed)).normal(size=(rows, PROBLEMS)) * 10.0


def machine(text, rows: int, given: int, *arrays: np.ndarray) -> np.ndarray:
    """Compile ``text``, a function of a list of ``rows`` components that returns ``given`` components, and run it."""
    return np.asarray(Kernel("tried", text, (str(rows),), str(given), 64).native(*arrays))


def arithmetic(x):
    a, b, c = x[0], x[1], x[2]
    return [
        a + b,
        a - b,
        2.0 - a,
        a * b,
        a / b,
        3.0 / a,
        -a,
        abs(a),
        a**3,
        xp.sqrt(abs(a)),
        xp.maximum(a, b),
        xp.minimum(a, 0.5),
        xp.clip(a, -1.0, 1.0),
        xp.where(((a < b) & ~(b >= c)) | (a > 10.0), a, c),
        xp.where((a <= b) & (b > c), xp.zeros_like(a), b),
    ]


@pytest.mark.parametrize("dtype", TYPES)
def test_arithmetic_is_that_of_numpy(dtype):
    x = values(3).astype(dtype)
    found = machine(arithmetic, 3, 15, x)
    assert found.dtype == dtype
    np.testing.assert_allclose(found, np.stack(arithmetic(x)), rtol=2 * ULP[dtype], atol=0.0)


def neutral(x):
    """Apply every operation with 0 and 1 on either side; some change nothing and need no instruction."""
    a, found = x[0], []
    for constant in (0.0, 1.0, xp.zeros_like(x[0]), xp.zeros_like(x[0]) + 1.0, xp.full_like(x[0], 1.0)):
        found += [a + constant, constant + a, a - constant, constant - a, a * constant, constant * a, constant / a]
    return [*found, a / 1.0, a**1]


@pytest.mark.parametrize("dtype", TYPES)
def test_zero_and_one_are_what_they_are_in_every_operation(dtype):
    x = values(1).astype(dtype)
    np.testing.assert_allclose(machine(neutral, 1, 37, x), np.stack(neutral(x)), rtol=2 * ULP[dtype], atol=0.0)


def test_what_is_0_by_construction_stays_so_whatever_it_is_multiplied_by():
    x = np.array([[np.nan, np.inf, 2.0]])
    found = machine(lambda q: [q[0] * xp.zeros_like(q[0]), 0.0 * q[0]], 1, 2, x)
    assert found.tolist() == [[0.0] * 3] * 2


def test_what_is_not_a_number_stays_so():
    """NaN as either operand: arithmetic gives NaN, a comparison is false."""
    x = np.array([[np.nan, 1.0, np.nan], [1.0, np.nan, np.nan], [2.0, 2.0, 2.0]])
    found = machine(arithmetic, 3, 15, x)
    expected = np.stack(arithmetic(x))
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    np.testing.assert_allclose(found, expected, rtol=2 * ULP[np.float64], atol=0.0)


@pytest.mark.parametrize(
    ("size", "dtype"),
    [*((size, np.float64) for size in (1e-9, 1.0, 100.0, 1e4)), (1e-9, np.float32), (1e3, np.float32)],
)
def test_sine_and_cosine(size, dtype):
    places = [values(1, 2)[0] * size / 10.0, [0.0, np.pi / 4, np.pi / 2, np.pi, -np.pi, 1.5 * np.pi]]
    x = np.concatenate(places).astype(dtype)[None]
    sine, cosine = machine(lambda q: [xp.sin(q[0]), xp.cos(q[0])], 1, 2, x)
    x, most = x[0].astype(float), SINE_ERROR * ULP[dtype]
    assert np.abs(cosine - np.cos(x)).max() <= most
    assert np.all(np.abs(sine - np.sin(x)) <= most * np.minimum(1.0, np.maximum(np.abs(x), 1e-300)))


def test_each_problem_iterates_for_itself():
    """Check that a converged problem keeps its result while others iterate, by Newton's square root."""

    def root(x):
        def better(carry):
            y, count = carry
            return 0.5 * (y + x / y), count + 1.0

        return list(repeat_while(lambda carry: abs(carry[0] ** 2 - x) > 1e-9 * x, better, (x, xp.zeros_like(x))))

    x = np.geomspace(1e-6, 1e6, PROBLEMS)
    found, steps = Kernel("root", root, ("",), "2", 64).native(x)
    alone = np.concatenate([Kernel("root", root, ("",), "2", 64).native(x[k : k + 1]) for k in range(PROBLEMS)], axis=1)
    np.testing.assert_allclose(found, np.sqrt(x), rtol=1e-9, atol=0.0)
    np.testing.assert_array_equal(np.stack([found, steps]), alone)
    assert len(set(steps)) > 5


def test_a_truth_goes_round_in_a_loop():
    """Check a mask as a loop variable: x is halved three times; the mask is true where x began above 7 or was below 1
    before a halving."""

    def text(x):
        y, below = repeat(3, lambda now: (now[0] / 2.0, now[1] | (now[0] < 1.0)), (x, x > 7.0))
        return [y, xp.where(below, 1.0, 0.0)]

    x = np.array([8.0, 7.0, 4.0, 3.9, 0.5])
    found = Kernel("below", text, ("",), "2", 64).native(x)
    np.testing.assert_array_equal(found, [x / 8.0, [1.0, 0.0, 0.0, 1.0, 1.0]])


def test_loops_over_places_sum_count_keep_and_replace():
    """Check ``along``: sums over postures, some of which are masked, and a second pass over kept values."""

    def text(x, counted):
        over = along(counted, counted)
        total, worst, kept = over.reduced(lambda row: (row[0] * row[1], abs(row[2]), [row[0] - row[2], row[1]]), x)

        def second(old, row):
            return old[0] * row[0], (), [old[0] + total, old[1] * 2.0]

        again, _, kept = over.advanced(total > 0.0, second, kept, x)
        (_, final), *_ = over.reduced(lambda row: ((row[0], row[1]), (), ()), kept)
        return [total, worst, again, final, repeat(3, lambda y: y + 1.0, total)]

    random = Generator(PCG64(5))
    for postures in (1, 3, 16):
        x, counted = random.normal(size=(3, postures, PROBLEMS)), random.random((postures, PROBLEMS)) < 0.7
        kernel = Kernel("passes", text, ("3 postures", "postures bool"), "5", 64)
        expected = jax.tree.map(np.asarray, np.stack(text(x, counted)))
        np.testing.assert_allclose(kernel.native(x, counted), expected, rtol=0.0, atol=1e-13)


def test_a_sum_of_ones_counts_the_places():
    """Check that a value that is constant over the places is summed like any other."""

    def text(x):
        total, worst, _ = along(x[0]).reduced(lambda row: (xp.full_like(row[0], 1.0), xp.full_like(row[0], 1.0), ()), x)
        return [total, worst]

    x = Generator(PCG64(5)).normal(size=(2, 5, PROBLEMS))
    found = Kernel("ones", text, ("2 points",), "2", 64).native(x)
    np.testing.assert_array_equal(found, [[5.0] * PROBLEMS, [1.0] * PROBLEMS])


def test_components_are_stacked_where_they_are_arrays():
    for count in (1, 3):
        x = values(count)
        np.testing.assert_array_equal(stacked(list(x)), x)
        np.testing.assert_array_equal(machine(stacked, count, count, x), x)
    assert stacked(x) is x


def test_operations_are_counted_where_they_are_done():
    """Check the counts: two operations in the loop, one after it; unused and repeated operations are left out."""

    def text(x):
        total, *_ = along(x[0]).reduced(lambda row: (row[0] * row[1], (), ()), x)
        xp.sqrt(total)
        return total / 3.0

    kernel = Kernel("counted", text, ("2 points",), "", 64)
    builder = kernel.build()
    assert "sqrt" not in builder.text()
    assert dict(builder.count_operations()) == {("block", "point"): 2, ("block",): 1}


@pytest.mark.parametrize(("dtype", "bits"), [(np.float64, 33), (np.float32, 13)])
def test_parts_of_a_turn_are_exact(dtype, bits):
    """Check that the first parts of pi/2 have so few bits that their products with whole numbers are exact."""
    parts = half_pi_parts(dtype)
    assert abs(sum(parts) - np.pi / 2) <= np.spacing(np.pi / 2)
    for part in parts[:2]:
        mantissa, _ = np.frexp(part)
        assert float(mantissa) * 2**bits == int(float(mantissa) * 2**bits)


def test_the_exit_rule_names_every_file_of_the_compiler():
    root = Path(__file__).parents[2]
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rule = text.split("## When to delete the compiler")[1].split("\n## ")[0]
    stays = {"__init__.py", "axes.py", "batching.py", "compilation_cache.py", "kernel.py"}
    files = {path.name for path in (root / "adapt" / "engine").glob("*.py")} - stays
    assert set(re.findall(r"`(\w+\.py)`", rule)) == files
