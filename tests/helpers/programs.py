"""Programs that a test runs a few times: most of their time is compilation."""

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
"""Written with nothing else: of an operation that it does not know it ends the process."""


def few_runs(function: Callable[..., Any]) -> Callable[..., Any]:
    """``jax.jit``, compiled in half the time, and as exact. It cannot be part of another program.

    For what a test makes itself; what the project compiles is tested as it is.
    """
    return jax.jit(function, compiler_options=QUICK_TO_COMPILE)


def one_run(function: Callable[..., Any]) -> Callable[..., Any]:
    """``few_runs`` without a compiler: StableHLO's reference interpreter runs what JAX traces.

    For a large program of a few numbers that a test runs once: it is done in a tenth of the time in which XLA compiles
    it. The results are numpy's. RuntimeError where LAPACK is called.
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
