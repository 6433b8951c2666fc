"""Ways to run JAX programs that a test uses a few times, where compilation takes most of the time."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.extend.mlir import ir
from jax.extend.mlir.dialects import stablehlo
from jax.extend.mlir.passmanager import PassManager

from adapt.engine.batching import QUICK_TO_COMPILE

stablehlo.register_stablehlo_passes()

_WHAT_THE_INTERPRETER_KNOWS = "builtin.module(func.func(chlo-legalize-to-stablehlo))"
"""Passes to StableHLO operations: on an operation that the interpreter does not know, it ends the process."""


def few_runs(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile by ``jax.jit`` in half the time; the results are as exact. The program cannot be part of another one.

    It is for functions of tests; functions that the project compiles are tested as compiled there.
    """
    return jax.jit(function, compiler_options=QUICK_TO_COMPILE)


def one_run(function: Callable[..., Any]) -> Callable[..., Any]:
    """Run a function once without a compiler: StableHLO's reference interpreter runs the operations that JAX traces.

    It is for a large program on few numbers: the interpreter takes a tenth of the time in which XLA would compile it.
    The results are NumPy arrays. Raises RuntimeError where LAPACK is called.
    """

    def run(*arguments: Any) -> Any:
        arrays = jax.tree.map(lambda x: np.asarray(x, order="C"), arguments)
        lowered = jax.jit(function, keep_unused=True).lower(*arrays)
        module: Any = lowered.compiler_ir("stablehlo")
        with module.context:
            PassManager.parse(_WHAT_THE_INTERPRETER_KNOWS).run(module.operation)
            module.operation.walk(_refuse_foreign_code)
            given = [ir.DenseElementsAttr.get(x) for x in jax.tree.leaves(arrays)]
            found = stablehlo.eval_module(module, given)
        return jax.tree.unflatten(lowered.out_tree, [np.array(x) for x in found])

    return run


def _refuse_foreign_code(operation: Any) -> Any:
    if operation.name == "stablehlo.custom_call":
        raise NotImplementedError("the interpreter has no LAPACK: use few_runs")
    return ir.WalkResult.ADVANCE
