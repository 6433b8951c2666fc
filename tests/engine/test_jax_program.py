"""Compilation of JAX functions to machine code: every operation that it knows, and derivatives, against JAX."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import platformdirs
import pytest
from jax import lax
from jax.extend.core import Primitive
from jax.interpreters import batching, mlir
from programs import one_run

from adapt.engine import jax_program
from adapt.engine.function_builder import FunctionBuilder
from adapt.engine.jax_program import UnknownOperationError, per_problem
from adapt.engine.kernel import Kernel
from adapt.engine.simd_values import SimdValue

RELATIVE = 1e-12
"""Tolerance: a few roundings of sums of a few terms; absolute too, because terms, which are of size 1, may cancel."""

PROBLEMS = 21
"""Batch size, not a multiple of the eight problems of a block."""


_numbers = itertools.count()


@pytest.fixture(autouse=True)
def no_cache(tmp_path, monkeypatch):
    """Use an empty cache: keys cover names and the source of the project, so a changed test function would run its old
    code."""
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda _: tmp_path)


def kernel_of(function, inputs, outputs) -> Kernel:
    return Kernel(f"tried{next(_numbers)}", per_problem(function), inputs, outputs, 64)


def given(inputs: tuple[str, ...]) -> list[np.ndarray]:
    """Draw seeded numbers in (-2, 2), none near 0, and random masks."""
    generator, arrays = np.random.default_rng(8), []
    for words in inputs:
        shape = (*(int(word) for word in words.split() if word.isdigit()), PROBLEMS)
        if "bool" in words:
            arrays.append(generator.random(shape) > 0.5)
        else:
            arrays.append(generator.uniform(0.1, 2.0, shape) * generator.choice([-1.0, 1.0], shape))
    return arrays


def assert_same(function, inputs: tuple[str, ...], outputs, *arrays: np.ndarray) -> list[np.ndarray]:
    """Check machine code against StableHLO's interpreter, and return the results of the machine code."""
    arrays = arrays or tuple(given(inputs))
    found = jax.tree.leaves(kernel_of(function, inputs, outputs).native(*arrays))
    expected = jax.tree.leaves(one_run(jax.vmap(function, in_axes=-1, out_axes=-1))(*arrays))
    assert len(found) == len(expected) > 0
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=RELATIVE, atol=RELATIVE)
    return found


def built(function, *inputs: str) -> FunctionBuilder:
    return kernel_of(function, inputs, "").build()


def operations(function, *inputs: str) -> int:
    """Count the arithmetic operations in the compiled function."""
    return built(function, *inputs).count_operations().total()


# --- one operation --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b: a + b,
        lambda a, b: a - b,
        lambda a, b: a * b,
        lambda a, b: a / b,
        lambda a, b: -a + 0.0 * b,
        lambda a, b: 2.0 - a * 3.0 + 1.0 / b,
        lambda a, b: a**2 - b**3,
        lambda a, b: a**5 * b**-2 + a**0,
        lambda a, b: jnp.square(a) + b,
        lambda a, b: jnp.maximum(a, b),
        lambda a, b: jnp.minimum(a, 0.25) + jnp.clip(b, -1.0, 1.0),
        lambda a, b: jnp.abs(a) - jnp.sqrt(jnp.abs(b)),
        lambda a, b: jnp.sin(3.0 * a) + jnp.cos(40.0 * b),
        lambda a, b: jnp.arctan2(a, b),
        lambda a, b: jnp.log(jnp.abs(a)) + jnp.exp(b),
        lambda a, b: jnp.hypot(a, b),
        lambda a, b: lax.stop_gradient(a) + jnp.copy(b),
    ],
)
def test_arithmetic_and_functions(function):
    assert_same(function, ("", ""), "")
    assert_same(function, ("3", "3"), "3")


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b: a < b,
        lambda a, b: a <= b,
        lambda a, b: a > b,
        lambda a, b: a >= b,
        lambda a, b: a == b,
        lambda a, b: a != b,
        lambda a, b: (a > 0.0) & (b > 0.0),
        lambda a, b: (a > 0.0) | ~(b > 0.0),
        lambda a, b: (a > 0.0) == (b > 0.0),
        lambda a, b: (a > 0.0) != (b > 0.0),
        lambda a, b: (a > 0.0) ^ (b > 0.0),
        lambda a, b: jnp.where(a > 0.0, b > 0.0, True),
        lambda a, b: jnp.logical_not(jnp.logical_and(a > 0.0, True)),
        lambda a, b: (a - a + (b > 0.0)).astype(bool),
    ],
)
def test_comparisons_and_masks(function):
    a, b = given(("", ""))
    b[::3] = a[::3]
    (found,) = assert_same(function, ("", ""), "bool", a, b)
    assert found.dtype == bool
    assert set(found.tolist()) == {True, False}


def test_a_comparison_with_what_is_no_number_is_that_of_ieee():
    a, b = given(("", ""))
    a[::2] = np.nan
    assert_same(lambda a, b: (a < b, a == b, a != b, ~(a >= b)), ("", ""), ("bool",) * 4, a, b)


@pytest.mark.parametrize(
    "function",
    [
        lambda m, a, b: jnp.where(m, a, b),
        lambda m, a, b: jnp.where(m, a, 0.0) + jnp.where(m & (a > b), 1.0, b),
        lambda m, a, b: m.astype(float) * a + (~m).astype(int) * b,
        lambda m, a, b: lax.select_n(m, a, b),
        lambda m, a, b: lax.select_n(a > b, a, b) + jnp.where(jnp.array(True), a, b),
    ],
)
def test_masks_choose(function):
    assert_same(function, ("bool", "", ""), "")


def test_a_mask_chooses_whole_arrays_and_components():
    assert_same(lambda m, a, b: lax.select_n(m, a, b), ("bool", "3", "3"), "3")
    assert_same(lambda m, a, b: jnp.where(m, a, b), ("3 bool", "3", "3"), "3")


def test_whole_numbers_count():
    def function(a):
        return a * jnp.arange(3) + jnp.array([1, 2, 3]).astype(float) + jnp.asarray(2.75).astype(int)

    assert_same(function, ("3",), "3")


# --- arrays ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "function",
    [
        lambda a, b: jnp.concatenate([a[4:], b[:2], a[1:3]]),
        lambda a, b: jnp.concatenate([a[::2], b[1::2]]),
        lambda a, b: jnp.stack([a[0], b[1], a[2] * b[3], a[4], b[5], a[5]]),
        lambda a, b: jnp.stack([a[:3], b[3:]], axis=1).ravel(),
        lambda a, b: jnp.concatenate(jnp.split(a, [1, 3])[::-1]) + b,
        lambda a, b: jnp.stack([x * b[0] for x in a]),
        lambda a, b: jnp.concatenate([sum(a.reshape(2, 3)), sum(jnp.unstack(b.reshape(3, 2), axis=1))]),
        lambda a, b: lax.pad(a[:2], b[0], ((1, 2, 1),)),
        lambda a, b: lax.pad(a, 0.0, ((-1, 1, 0),)) + lax.pad(b[:4], 1.0, ((-1, -0, 1),)),
        lambda a, b: jnp.pad(a[2:4], (1, 3)) + b,
        lambda a, b: jnp.concatenate([(a.reshape(2, 3) @ b.reshape(3, 2)).ravel(), a[:2]]),
        lambda a, b: a.reshape(2, 3).T.ravel() + jnp.transpose(b.reshape(1, 2, 3), (2, 0, 1)).ravel(),
        lambda a, b: (
            jnp.outer(a, b[:1])[:, 0] + jnp.broadcast_to(b[2], (6,)) + jnp.broadcast_to(a[:2, None], (2, 3)).ravel()
        ),
        lambda a, b: jnp.einsum("ij,kj->ik", a.reshape(3, 2), b.reshape(3, 2))[:2].ravel(),
        lambda a, b: jnp.einsum("bij,bjk->bik", a.reshape(2, 3, 1), b.reshape(2, 1, 3))[0].ravel()[:6],
        lambda a, b: jnp.repeat(a.reshape(3, 2).sum(axis=1, keepdims=True), 2, axis=1).ravel() * b,
        lambda a, b: jnp.tile(jnp.expand_dims(a[:3], 0), (2, 1)).ravel() + jnp.squeeze(b[None]),
        lambda a, b: jnp.tile(jnp.cross(a[:3], b[:3]), 2),
        lambda a, b: (jnp.eye(6) * 2.0) @ a + jnp.tril(jnp.ones((6, 6))) @ b,
    ],
)
def test_arrays_are_taken_apart_and_put_together(function):
    assert_same(function, ("6", "6"), "6")


@pytest.mark.parametrize(
    "function",
    [
        lambda a: jnp.sum(a),
        lambda a: jnp.max(a) - jnp.min(a),
        lambda a: jnp.mean(a.reshape(2, 3), axis=0) @ a[:3],
        lambda a: jnp.max(jnp.sum(a.reshape(1, 2, 3), axis=(0, 2))),
        lambda a: jnp.where(jnp.any(a > 1.5), jnp.sum(a), 7.0) + jnp.where(jnp.all(a > -1.8), 1.0, 2.0),
        lambda a: a @ a,
        lambda a: jnp.linalg.norm(a),
        lambda a: jnp.sum(jnp.zeros((0,))) + a[0],
    ],
)
def test_reductions(function):
    assert_same(function, ("6",), "")


# --- loops ----------------------------------------------------------------------------------------


def root(x):
    """Compute sqrt|x| by Newton's method; return iterations, which differ between problems, and root."""

    def unfinished(state):
        number, guess, before = state
        return (number < 40) & (jnp.abs(guess - before) > 1e-9 * guess)

    def advance(state):
        number, guess, _ = state
        return number + 1, 0.5 * (guess + jnp.abs(x) / guess), guess

    number, guess, _ = lax.while_loop(unfinished, advance, (0, 1.0 + 0.0 * x, 0.0 * x))
    return jnp.asarray(number, float), guess


def test_every_problem_goes_its_own_number_of_rounds():
    x = np.geomspace(1e-3, 1e6, PROBLEMS)
    number, guess = assert_same(root, ("",), ("", ""), x)
    assert len(set(number.tolist())) > 5
    np.testing.assert_allclose(guess, np.sqrt(x), rtol=1e-12)


def test_a_loop_in_a_loop():
    """Sums of square roots whose number of terms differs between problems."""

    def function(x):
        def advance(state):
            k, total = state
            return k + 1.0, total + root(x[0] + k)[1] * x[1]

        return lax.while_loop(lambda state: state[0] < jnp.abs(3.0 * x[1]), advance, (jnp.zeros(()), jnp.zeros(())))

    assert_same(function, ("2",), ("", ""))


def test_a_loop_over_arrays_and_masks():
    def function(a):
        def advance(state):
            a, _, k = state
            a = 0.5 * a.reshape(2, 2).T.ravel()
            return a, jnp.abs(a) < 0.1, k + 1

        def unfinished(state):
            return ~jnp.all(state[1])

        a, done, k = lax.while_loop(unfinished, advance, (a, jnp.array([False] * 4), 0))
        return a, done, k * 1.0

    assert_same(function, ("4",), ("4", "4 bool", ""))


def test_a_loop_that_takes_no_round_and_one_of_constants():
    def function(a):
        unchanged = lax.while_loop(lambda x: jnp.array(False), lambda x: x + 1.0, a)
        eight = lax.while_loop(lambda x: x < 5.0, lambda x: 2.0 * x, jnp.asarray(1.0))
        return unchanged + eight

    (found,) = assert_same(function, ("",), "")
    np.testing.assert_array_equal(found, given(("",))[0] + 8.0)


# --- derivatives ----------------------------------------------------------------------------------


@jax.custom_jvp
def length(v):
    return jnp.sqrt(jnp.sum(v * v))


@length.defjvp
def _length_jvp(primals, tangents):
    """Derivative, with 0 at the zero vector."""
    (v,), (dv,) = primals, tangents
    value = length(v)
    return value, jnp.where(value > 0.0, v @ dv / jnp.where(value > 0.0, value, 1.0), 0.0)


@jax.custom_vjp
def doubled_backwards(x):
    return jnp.sin(x)


doubled_backwards.defvjp(lambda x: (jnp.sin(x), x), lambda x, g: (2.0 * g * jnp.cos(x),))


def curved(x):
    """Function of all differentiable operations."""
    A = jnp.stack([x[:3] * x[1], jnp.sin(x[3:]), x[::2] / (2.0 + x[1::2] ** 2)])
    v = jnp.concatenate([A @ x[:3], jnp.maximum(x[2:4], 0.3), jnp.arctan2(x[:1], x[1:2])])
    bent = jnp.where(x[0] > 0.0, jnp.exp(-v[0]), jnp.log(1.0 + v[1] ** 2))
    parts = jnp.split(v, [2])
    largest = jnp.max(v) + jnp.min(parts[1]) * jnp.cos(x[5])
    return length(v) + bent + largest + jnp.sum(jnp.pad(parts[0], (0, 4)) * x) + jnp.sqrt(jnp.abs(v[1] ** 2 + 0.1))


def test_functions_with_derivatives_of_their_own():
    assert_same(curved, ("6",), "")
    assert_same(jax.grad(curved), ("6",), "6")
    assert_same(jax.grad(lambda x: doubled_backwards(x[0]) * x[1]), ("2",), "2")


def test_a_gradient_at_zero_by_a_rule_of_its_own():
    (found,) = assert_same(jax.grad(length), ("3",), "3", np.zeros((3, PROBLEMS)))
    assert not found.any()


def test_slopes_forwards_and_backwards_and_of_slopes():
    assert_same(lambda x, dx: jax.jvp(curved, (x,), (dx,)), ("6", "6"), ("", ""))
    assert_same(lambda x: jax.hessian(curved)(x).ravel(), ("6",), "36")
    assert_same(lambda x: jax.jacfwd(lambda y: y[:3] * y[3:])(x).ravel(), ("6",), "18")

    def pulled(x):
        value, pull = jax.vjp(lambda y: jnp.stack([y[0] * y[1], jnp.sin(y[2:4]) @ y[4:], y[5] ** 3]), x)
        (rows,) = jax.vmap(pull)(jnp.eye(3))
        return value, rows.ravel()

    assert_same(pulled, ("6",), ("3", "18"))


@pytest.mark.parametrize(
    "function",
    [
        lambda x: jnp.sum(x[1:3] ** 2) + jnp.sum(x[::2] ** 3),
        lambda x: jnp.sum(jnp.stack(list(x)) * jnp.concatenate([x[3:], x[:3]])),
        lambda x: jnp.sum(lax.pad(x, 0.0, ((-1, 2, 1),)) ** 2),
        lambda x: jnp.max(x.reshape(2, 3).T @ x[:2]),
        lambda x: jnp.sum(jnp.sqrt(x**2) * jnp.minimum(x, 0.5)),
        lambda x: jnp.sum(jnp.hypot(x[:3], x[3:])),
        lambda x: jnp.sum(jnp.abs(x) ** 3),
        lambda x: sum(one @ one for one in jnp.split(x, 3)),
        lambda x: jnp.sum(x[:, None] * x[None, :] / (1.0 + x[:, None] ** 2)),
    ],
)
def test_gradients_of_slices_and_the_like(function):
    assert_same(jax.grad(function), ("6",), "6")


def test_a_tangent_through_a_loop():
    """Check d sqrt(x) = dx / (2 sqrt(x)), where one loop computes value and tangent together."""
    x = np.geomspace(1e-2, 1e2, PROBLEMS)

    def slope(x):
        return jax.jvp(lambda x: root(x)[1], (x,), (jnp.ones(()),))

    value, tangent = assert_same(slope, ("",), ("", ""), x)
    np.testing.assert_allclose(tangent, 0.5 / value, rtol=1e-8)


# --- constants ------------------------------------------------------------------------------------


def test_what_is_0_or_1_by_construction_takes_no_instruction():
    assert operations(lambda x: 0.0 * x + 1.0 * x - 0.0, "") == 0
    assert operations(lambda x: jnp.sum(jnp.eye(3)[1] * x), "3") == 0
    assert operations(lambda x: jnp.zeros(()) / x + jnp.where(jnp.array(True), x, jnp.sin(x)), "") == 0
    assert operations(lambda x: x + (jnp.arange(4.0) @ jnp.arange(4.0)), "") == 1
    assert operations(lambda x: x * x, "") == 1


def test_what_nobody_reads_takes_no_instruction_and_nothing_is_computed_twice():
    assert operations(lambda x: (jnp.sin(x), x + 1.0)[1], "") == 1
    assert operations(lambda x: (x + 2.0) * (x + 2.0), "") == 2


def test_0_by_construction_stays_so_whatever_it_is_multiplied_by():
    kernel = kernel_of(lambda x: 0.0 * x + 1.0, ("",), "")
    np.testing.assert_array_equal(kernel.native(np.full(PROBLEMS, np.nan)), 1.0)


def test_constants_that_are_no_number_are_those_of_ieee_and_may_be_left_unread():
    """1 / 0, log 0, sqrt -1 and exp 1e4 inside a jitted function, where JAX does not evaluate constants."""

    @jax.jit
    def inner(x, zero):
        unread = jnp.where(x > 1e9, 1.0 / zero + jnp.log(zero) + jnp.sqrt(zero - 1.0) + jnp.exp(1e4 + zero), x)
        return unread + jnp.where(jnp.maximum(jnp.nan + zero, 1.0) > 0.0, 5.0, 3.0) + 1.0 / (1.0 / zero)

    (found,) = assert_same(lambda x: inner(x, jnp.zeros(())), ("",), "")
    np.testing.assert_array_equal(found, given(("",))[0] + 3.0)


def test_constant_results():
    assert_same(lambda x: (x, jnp.ones(3), jnp.array(True)), ("",), ("", "3", "bool"))


def test_single_precision():
    kernel = kernel_of(curved, ("6",), "")
    (x,) = given(("6",))
    found = kernel.native(x.astype(np.float32))
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, kernel.by_jax(x), rtol=1e-4, atol=1e-4)


def test_trees_of_arguments_and_results():
    def function(tree, mask):
        return {"sum": tree["a"] + tree["b"][0], "mask": mask, "three": tree["b"] * tree["a"]}

    kernel = kernel_of(function, ({"a": "", "b": "3"}, "bool"), {"mask": "bool", "sum": "", "three": "3"})
    a, b, mask = given(("", "3", "bool"))
    found = kernel.native({"a": a, "b": b}, mask)
    np.testing.assert_array_equal(found["sum"], a + b[0])
    np.testing.assert_array_equal(found["three"], a * b)
    np.testing.assert_array_equal(found["mask"], mask)


# --- what it does not know ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "function",
    [
        lambda x: jnp.sort(x)[0],
        lambda x: jnp.sum(jnp.cumsum(x)),
        lambda x: lax.fori_loop(0, 3, lambda k, y: y + x[k], 0.0),
        lambda x: x[jnp.argmax(x)],
        lambda x: x[0].astype(int) * 1.0,
        lambda x: lax.div((x[0] > 0.0).astype(int), 2) * 1.0,
        lambda x: lax.select_n((x[0] > 0.0).astype(np.int32), x[0], x[1], x[2]),
        lambda x: lax.cond(x[0] > 0.0, jnp.sin, jnp.cos, x[1]),
    ],
)
def test_what_it_does_not_know_is_said(function):
    with pytest.raises(UnknownOperationError):
        built(function, "3")


ONE_AT_RANDOM = float(jax.random.uniform(jax.random.key(0)))

cubed = Primitive("cubed_by_a_later_version")
"""Primitive that the compiler does not know, as a later JAX may bring one."""
cubed.def_abstract_eval(lambda x: x)
batching.primitive_batchers[cubed] = lambda operands, places: (cubed.bind(*operands), places[0])
mlir.register_lowering(cubed, mlir.lower_fun(lambda x: x**3, multiple_results=False))


@pytest.mark.parametrize(
    ("function", "by_numpy"),
    [
        (cubed.bind, lambda x: x**3),
        (jnp.tan, np.tan),
        (jnp.sort, lambda x: np.sort(x, axis=0)),
        (lambda x: jnp.abs(jnp.sqrt(x.astype(complex))), lambda x: np.sqrt(np.abs(x))),
        (lambda x: x + jax.random.uniform(jax.random.key(0)), lambda x: x + ONE_AT_RANDOM),
    ],
)
def test_what_it_does_not_know_is_left_to_xla(function, by_numpy):
    """Check that XLA runs unknown operations: an effect of a user may contain any function of JAX."""
    (x,) = given(("3",))
    kernel = kernel_of(function, ("3",), "3")
    with pytest.raises(UnknownOperationError):
        kernel.native(x)
    np.testing.assert_allclose(kernel(x), by_numpy(x), rtol=RELATIVE)


def test_what_another_jax_writes_otherwise_is_left_to_xla(monkeypatch):
    (x,) = given(("3",))
    kernel = kernel_of(lambda x: x[1:], ("3",), "2")
    monkeypatch.setitem(jax_program._STRUCTURE, "slice", lambda params, x: params["of_another_version"])
    with pytest.raises(UnknownOperationError, match="KeyError: 'of_another_version'"):
        kernel.native(x)
    np.testing.assert_array_equal(kernel(x), x[1:])


def test_a_matrix_is_no_result():
    with pytest.raises(UnknownOperationError, match="matrix"):
        built(lambda x: x[:, None] * x, "3")


def test_without_simd_values_it_is_the_function_of_every_problem():
    (x,) = given(("6",))
    np.testing.assert_allclose(per_problem(curved)(x), jax.vmap(curved, in_axes=-1)(x), rtol=RELATIVE)
    assert not isinstance(per_problem(curved)(x), SimdValue)
