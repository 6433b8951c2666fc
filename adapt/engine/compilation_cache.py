"""Programs that XLA compiled are kept between runs."""

import os
import sys
from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """Return the user's folder of everything that is kept between runs; removing it costs only time."""
    return platformdirs.user_cache_path("girdle")


def keep_compiled() -> None:
    """Keep every program in the user's cache folder.

    JAX reads the environment when it is imported, and is told where it is there already: the command line's help does
    not wait for it.
    """
    options = {
        "jax_compilation_cache_dir": str(cache_folder() / "jax"),
        "jax_persistent_cache_min_compile_time_secs": 0.0,
    }
    for name, value in options.items():
        os.environ[name.upper()] = str(value)
        if "jax" in sys.modules:
            sys.modules["jax"].config.update(name, value)
