"""Functions of JAX as kernel functions: whatever JAX traces, including its derivatives, becomes machine code.

The function is for one problem. JAX traces it once to a jaxpr; each array in the jaxpr, small and of known shape, is
split into its numbers, one SIMD value each. JAX's operations on whole arrays (slice, transpose, stack, broadcast) are
then bookkeeping at compile time, and additions of a constant 0 and products with a constant 0 or 1 are left out. Where
there is no machine code, XLA runs the same function over all problems by ``jax.vmap``.
"""

import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.core import Literal

from adapt.engine.machine_code import MachineCodeError
from adapt.engine.simd_values import SimdValue

ClosedJaxpr = Any
"""JAX's class of that name, which not every version of JAX declares public."""

Numbers = np.ndarray
"""Array of SIMD values, or of Python numbers where the program has constants."""


class UnknownOperationError(MachineCodeError):
    """Operation of JAX that the compiler does not know, or not in this form; XLA runs such a function."""


def per_problem(function: Callable[..., Any]) -> Callable[..., Any]:
    """Turn a function of one problem into a kernel function, for arrays with the problems last or for SIMD values.

    Arguments and results are trees of arrays. An array of SIMD values is a list of its components, or a single value.
    """

    def kernel_function(*trees: Any) -> Any:
        leaves, tree = jax.tree.flatten(trees, is_leaf=_is_array)
        builder = next((x.builder for x in map(_first, leaves) if isinstance(x, SimdValue)), None)
        if builder is None:
            return jax.vmap(function, in_axes=-1, out_axes=-1)(*trees)
        shapes = [jax.ShapeDtypeStruct(_numbers(x).shape, _dtype(_first(x), builder.dtype)) for x in leaves]
        traced, result = jax.make_jaxpr(function, return_shape=True)(*jax.tree.unflatten(tree, shapes))
        found = _understood(traced, [_numbers(x) for x in leaves])
        if any(x.ndim > 1 for x in found):
            raise UnknownOperationError("a result may be a number or a vector, no matrix")
        every = [_each(builder.broadcast, x).tolist() for x in found]
        return jax.tree.unflatten(jax.tree.structure(result), every)

    return kernel_function


def _dtype(x: Any, number: np.dtype) -> np.dtype:
    is_mask = x.is_mask if isinstance(x, SimdValue) else isinstance(x, bool)
    return np.dtype(bool) if is_mask else number


def _is_array(x: Any) -> bool:
    return isinstance(x, list)


def _first(x: Any) -> Any:
    return x[0] if isinstance(x, list) else x


def _numbers(x: Any) -> Numbers:
    """Return the values of an argument as an object array."""
    array = np.empty(len(x) if isinstance(x, list) else (), object)
    array[...] = x
    return array


def _constant(x: Any) -> Numbers:
    x = np.asarray(x)
    array = np.empty(x.size, object)
    array[:] = x.ravel().tolist()
    return array.reshape(x.shape)


def _understood(program: ClosedJaxpr, arguments: Sequence[Numbers]) -> list[Numbers]:
    """Evaluate a jaxpr. Raises UnknownOperationError for every failure: JAX has traced the program, so XLA can run it.

    A version of JAX may write a known operation otherwise (other parameters, operands of another type).
    """
    try:
        return _run(program, arguments)
    except MachineCodeError:
        raise
    except Exception as error:
        raise UnknownOperationError(f"JAX's program is not understood: {type(error).__name__}: {error}") from error


def _run(program: ClosedJaxpr, arguments: Sequence[Numbers]) -> list[Numbers]:
    """Evaluate the equations of a jaxpr one after the other."""
    jaxpr = program.jaxpr
    known: dict[Any, Numbers] = dict(zip(jaxpr.constvars, map(_constant, program.consts), strict=True))
    known |= zip(jaxpr.invars, arguments, strict=True)

    def read(atom: Any) -> Numbers:
        return _constant(atom.val) if isinstance(atom, Literal) else known[atom]

    for equation in jaxpr.eqns:
        name = equation.primitive.name
        operands = [read(atom) for atom in equation.invars]
        if name in _OF_REALS and _would_round(equation, operands):
            raise UnknownOperationError(f"JAX's '{name}' to whole numbers")
        results = _do(name, equation.params, operands)
        for variable, value in zip(equation.outvars, results, strict=True):
            if value.shape != variable.aval.shape:
                raise UnknownOperationError(f"{name}: shape {value.shape} where JAX has {variable.aval.shape}")
            known[variable] = value
    return [read(atom) for atom in jaxpr.outvars]


_OF_REALS = ("div", "convert_element_type")
"""Operations that round if their result is an integer; SIMD values cannot round, because all of them are numbers of one
type."""


def _would_round(equation: Any, operands: Sequence[Numbers]) -> bool:
    """Check whether an equation rounds to integers: a division does, and a conversion of SIMD values that may be
    fractional."""
    (before, *_), after = (atom.aval.dtype for atom in equation.invars), equation.outvars[0].aval.dtype
    if not np.issubdtype(after, np.integer):
        return False
    is_simd = _builder_of(*(x for one in operands for x in one.ravel())) is not None
    return equation.primitive.name == "div" or (is_simd and np.issubdtype(before, np.floating))


def _do(name: str, params: dict[str, Any], operands: list[Numbers]) -> list[Numbers]:
    if name == "integer_pow":
        return [_each(lambda x: _power(x, params["y"]), operands[0])]
    if name in _ELEMENTWISE:
        return [_each(_ELEMENTWISE[name], *operands)]
    if name in _REDUCTIONS:
        return [_reduced(_REDUCTIONS[name], operands[0], params["axes"])]
    if name in _INNER:
        return _run(_INNER[name](params), operands)
    if name in _STRUCTURE:
        found = _STRUCTURE[name](params, *operands)
        return found if isinstance(found, list) else [found]
    raise UnknownOperationError(f"there is no instruction for JAX's '{name}'")


def _each(function: Callable[..., Any], *operands: Numbers) -> Numbers:
    shape = np.broadcast_shapes(*(x.shape for x in operands))
    result = np.empty(math.prod(shape), object)
    result[:] = [function(*values) for values in zip(*(np.broadcast_to(x, shape).flat for x in operands), strict=True)]
    return result.reshape(shape)


def _reduced(function: Callable[[Any, Any], Any], operand: Numbers, axes: Sequence[int]) -> Numbers:
    kept = [axis for axis in range(operand.ndim) if axis not in axes]
    moved = operand.transpose(*kept, *axes)
    shape = moved.shape[: len(kept)]
    flat = moved.reshape(math.prod(shape), math.prod(moved.shape[len(kept) :]))
    start = (0.0,) if function is _add else ()
    result = np.empty(len(flat), object)
    result[:] = [functools.reduce(function, values, *start) for values in flat.tolist()]
    return result.reshape(shape)


def _builder_of(*values: Any) -> Any:
    return next((x.builder for x in values if isinstance(x, SimdValue)), None)


def _add(a: Any, b: Any) -> Any:
    return b if _is(a, 0.0) else a if _is(b, 0.0) else a + b


def _subtract(a: Any, b: Any) -> Any:
    return a if _is(b, 0.0) else a - b


def _multiply(a: Any, b: Any) -> Any:
    if _is(a, 0.0) or _is(b, 0.0):
        return 0.0  # by construction, even where the other factor is NaN
    return b if _is(a, 1.0) else a if _is(b, 1.0) else a * b


def _divide(a: Any, b: Any) -> Any:
    if _is(a, 0.0):
        return 0.0
    if _builder_of(a, b) is None:
        return _eagerly(np.divide)(a, b)
    return a if _is(b, 1.0) else a / b


def _is(x: Any, value: float) -> bool:
    return not isinstance(x, SimdValue) and x == value


def _eagerly(function: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a numpy function for constants, by IEEE arithmetic: 1 / 0 is infinite, whether or not the value is used."""

    def call(*values: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*values).item()

    return call


def _function(name: str, eager: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a function of numpy's namespace: numpy's for constants; for SIMD values the builder's, else LLVM's."""

    def call(*values: Any) -> Any:
        builder = _builder_of(*values)
        if builder is None:
            return _eagerly(eager)(*values)
        return getattr(builder, name, functools.partial(builder.call_intrinsic, name))(*values)

    return call


def _comparison(word: str, eager: Callable[[Any, Any], bool]) -> Callable[[Any, Any], Any]:
    def call(a: Any, b: Any) -> Any:
        builder = _builder_of(a, b)
        if builder is None:
            return eager(a, b)
        if not builder.broadcast(a).is_mask:
            return builder.compare(word, a, b)
        if word not in ("oeq", "une"):
            raise UnknownOperationError("an order of truths")
        unequal = builder.combine_masks("xor", a, b)
        return unequal if word == "une" else ~unequal

    return call


def _logic(word: str, eager: Callable[[Any, Any], bool]) -> Callable[[Any, Any], Any]:
    def call(a: Any, b: Any) -> Any:
        builder = _builder_of(a, b)
        return eager(a, b) if builder is None else builder.combine_masks(word, a, b)

    return call


def _select(which: Any, *cases: Any) -> Any:
    if not isinstance(which, SimdValue):
        return cases[int(which)]
    if not which.is_mask:
        raise UnknownOperationError("JAX's 'select_n' by a number")
    no, yes = cases
    return which.builder.where(which, yes, no)


def _power(x: Any, exponent: int) -> Any:
    if exponent < 0:
        return _divide(1.0, _power(x, -exponent))
    result = 1.0
    for _ in range(exponent):
        result = _multiply(result, x)
    return result


def _as_number(x: Any) -> Any:
    if isinstance(x, SimdValue):
        return x.builder.where(x, 1.0, 0.0) if x.is_mask else x
    return float(x)


def _as_truth(x: Any) -> Any:
    if isinstance(x, SimdValue):
        return x if x.is_mask else x.builder.compare("une", x, 0.0)
    return bool(x)


def _as_whole(x: Any) -> Any:
    """Convert to an integer: a mask to 1 or 0; other SIMD values pass unchanged, as only whole ones come here
    (``_would_round``)."""
    return _as_number(x) if isinstance(x, SimdValue) else int(x)


_ELEMENTWISE: dict[str, Callable[..., Any]] = {
    "add": _add,
    "add_any": _add,
    "sub": _subtract,
    "mul": _multiply,
    "div": _divide,
    "neg": operator.neg,
    "max": _function("maximum", np.maximum),
    "min": _function("minimum", np.minimum),
    "square": lambda x: _multiply(x, x),
    "sqrt": _function("sqrt", np.sqrt),
    "sin": _function("sin", np.sin),
    "cos": _function("cos", np.cos),
    "abs": abs,
    "atan2": _function("atan2", np.arctan2),
    "log": _function("log", np.log),
    "exp": _function("exp", np.exp),
    "eq": _comparison("oeq", operator.eq),
    "ne": _comparison("une", operator.ne),
    "lt": _comparison("olt", operator.lt),
    "le": _comparison("ole", operator.le),
    "gt": _comparison("ogt", operator.gt),
    "ge": _comparison("oge", operator.ge),
    "and": _logic("and", operator.and_),
    "or": _logic("or", operator.or_),
    "xor": _logic("xor", operator.xor),
    "not": lambda x: ~x if isinstance(x, SimdValue) else not x,
    "select_n": _select,
    "stop_gradient": lambda x: x,
    "copy": lambda x: x,
}

_REDUCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "reduce_sum": _add,
    "reduce_max": _ELEMENTWISE["max"],
    "reduce_min": _ELEMENTWISE["min"],
    "reduce_or": _ELEMENTWISE["or"],
    "reduce_and": _ELEMENTWISE["and"],
}

_INNER: dict[str, Callable[[dict[str, Any]], ClosedJaxpr]] = {
    "jit": lambda params: params["jaxpr"],
    "custom_jvp_call": lambda params: params["call_jaxpr"],
    "custom_vjp_call": lambda params: params["call_jaxpr"],
}
"""Equations that contain a jaxpr, which is evaluated in place."""


def _broadcast_in_dim(params: dict[str, Any], x: Numbers) -> Numbers:
    shape, places = params["shape"], params["broadcast_dimensions"]
    widened = [1] * len(shape)
    for own, place in enumerate(places):
        widened[place] = x.shape[own]
    return np.broadcast_to(x.reshape(widened), shape)


def _slice(params: dict[str, Any], x: Numbers) -> Numbers:
    strides = params["strides"] or (1,) * x.ndim
    return x[tuple(map(slice, params["start_indices"], params["limit_indices"], strides))]


def _pad(params: dict[str, Any], x: Numbers, value: Numbers) -> Numbers:
    """Pad an array; negative padding, as in the derivative of a padding, removes elements."""
    configuration = params["padding_config"]
    sizes = zip(x.shape, configuration, strict=True)
    spread = np.empty([n + max(0, n - 1) * inner for n, (_, _, inner) in sizes], object)
    spread[...] = value.item()
    spread[tuple(slice(None, None, inner + 1) for _, _, inner in configuration)] = x
    wider = np.pad(
        spread, [(max(0, low), max(0, high)) for low, high, _ in configuration], constant_values=value.item()
    )
    sizes = zip(wider.shape, configuration, strict=True)
    return wider[tuple(slice(max(0, -low), max(0, n + min(0, high))) for n, (low, high, _) in sizes)]


def _dot(params: dict[str, Any], a: Numbers, b: Numbers) -> Numbers:
    (contract_a, contract_b), (batch_a, batch_b) = params["dimension_numbers"]
    free_a = [k for k in range(a.ndim) if k not in (*contract_a, *batch_a)]
    free_b = [k for k in range(b.ndim) if k not in (*contract_b, *batch_b)]
    a = a.transpose(*batch_a, *free_a, *contract_a)
    b = b.transpose(*batch_b, *free_b, *contract_b)
    batch, contracted = len(batch_a), len(contract_a)
    shape_a, shape_b = a.shape[: a.ndim - contracted], b.shape[: b.ndim - contracted]
    a = a.reshape(*shape_a[:batch], -1, 1, math.prod(a.shape[a.ndim - contracted :]))
    b = b.reshape(*shape_b[:batch], 1, -1, math.prod(b.shape[b.ndim - contracted :]))
    summed = _reduced(_add, _each(_multiply, *np.broadcast_arrays(a, b)), (a.ndim - 1,))
    return summed.reshape((*shape_a, *shape_b[batch:]))


def _unstacked(params: dict[str, Any], x: Numbers) -> list[Numbers]:
    return [_as_array(one) for one in np.moveaxis(x, params["axis"], 0)]


def _as_array(x: Any) -> Numbers:
    return x if isinstance(x, np.ndarray) else _numbers(x)


def _split(params: dict[str, Any], x: Numbers) -> list[Numbers]:
    return np.split(x, np.cumsum(params["sizes"])[:-1], params["axis"])


def _converted(params: dict[str, Any], x: Numbers) -> Numbers:
    kind = np.dtype(params["new_dtype"])
    if kind.kind == "c":
        raise UnknownOperationError("complex numbers")
    convert = _as_truth if kind.kind == "b" else _as_whole if np.issubdtype(kind, np.integer) else _as_number
    return _each(convert, x)


def _iota(params: dict[str, Any]) -> Numbers:
    shape, axis = params["shape"], params["dimension"]
    return _constant(
        np.broadcast_to(np.expand_dims(np.arange(shape[axis]), tuple(k for k in range(len(shape)) if k != axis)), shape)
    )


def _while(params: dict[str, Any], *operands: Numbers) -> list[Numbers]:
    of_condition, of_body = params["cond_nconsts"], params["body_nconsts"]
    fixed, state = operands[: of_condition + of_body], operands[of_condition + of_body :]
    builder = _builder_of(*(v for x in operands for v in x.ravel()))
    if builder is None:
        return _while_of_constants(params, fixed, state)
    shapes = [x.shape for x in state]
    ends = np.cumsum([math.prod(shape) for shape in shapes])

    def arrays(values: Sequence[Any]) -> list[Numbers]:
        pieces = np.split(_numbers(list(values)), ends[:-1])
        return [piece.reshape(shape) for piece, shape in zip(pieces, shapes, strict=True)]

    def unfinished(values: Sequence[Any]) -> Any:
        return builder.broadcast(_run(params["cond_jaxpr"], [*fixed[:of_condition], *arrays(values)])[0].item())

    def advance(values: Sequence[Any]) -> list[Any]:
        new = _run(params["body_jaxpr"], [*fixed[of_condition:], *arrays(values)])
        return [v for x in new for v in x.ravel()]

    flat = [builder.broadcast(v) for x in state for v in x.ravel()]
    return arrays(builder.repeat_while(unfinished, advance, flat))


def _while_of_constants(params: dict[str, Any], fixed: Sequence[Numbers], state: Sequence[Numbers]) -> list[Numbers]:
    of_condition = params["cond_nconsts"]
    while _run(params["cond_jaxpr"], [*fixed[:of_condition], *state])[0].item():
        state = _run(params["body_jaxpr"], [*fixed[of_condition:], *state])
    return list(state)


_STRUCTURE: dict[str, Callable[..., Any]] = {
    "broadcast_in_dim": _broadcast_in_dim,
    "tile": lambda params, x: np.tile(x, tuple(params["reps"])),
    "squeeze": lambda params, x: _as_array(np.squeeze(x, tuple(params["dimensions"]))),
    "expand_dims": lambda params, x: np.expand_dims(x, tuple(params["dimensions"])),
    "reshape": lambda params, x: x.reshape(params["new_sizes"]),
    "transpose": lambda params, x: x.transpose(params["permutation"]),
    "slice": _slice,
    "pad": _pad,
    "concatenate": lambda params, *x: np.concatenate(x, params["dimension"]),
    "stack": lambda params, *x: np.stack(x, params["axis"]),
    "unstack": _unstacked,
    "split": _split,
    "dot_general": _dot,
    "convert_element_type": _converted,
    "iota": _iota,
    "while": _while,
}
