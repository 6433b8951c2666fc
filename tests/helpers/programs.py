"""Programs that a test runs a few times: most of their time is compilation."""

from collections.abc import Callable
from typing import Any

import jax

from adapt.engine.batching import QUICK_TO_COMPILE


def few_runs(function: Callable[..., Any]) -> Callable[..., Any]:
    """``jax.jit``, compiled in half the time, and as exact. It cannot be part of another program.

    For what a test makes itself; what the project compiles is tested as it is.
    """
    return jax.jit(function, compiler_options=QUICK_TO_COMPILE)
