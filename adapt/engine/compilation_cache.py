"""Cache of programs that XLA compiled, kept between runs."""

import os
import sys
from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """Return the user's folder of all caches that girdle keeps between runs; removing the folder costs only time."""
    return platformdirs.user_cache_path("girdle")


def keep_compiled() -> None:
    """Make JAX cache every compiled program in the user's cache folder.

    JAX reads the environment variables when it is imported. A JAX that is imported already gets the same values through
    its configuration. The help of the command line therefore does not wait for the import.
    """
    options = {
        "jax_compilation_cache_dir": str(cache_folder() / "jax"),
        "jax_persistent_cache_min_compile_time_secs": 0.0,
    }
    for name, value in options.items():
        os.environ[name.upper()] = str(value)
        if "jax" in sys.modules:
            sys.modules["jax"].config.update(name, value)
