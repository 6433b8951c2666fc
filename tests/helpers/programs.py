"""Programs that a test runs a few times: most of their time is compilation."""

from collections.abc import Callable
from typing import Any

import jax

_OPTIONS = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
}
"""Half the compilation of a derivative of a posture fit (28 s of a core to 15), and as exact: what is left out makes
code faster. For what a test makes itself; what the project compiles is tested as it is."""


def few_runs(function: Callable[..., Any]) -> Callable[..., Any]:
    """``jax.jit``, compiled in half the time. It cannot be part of another program."""
    return jax.jit(function, compiler_options=_OPTIONS)
