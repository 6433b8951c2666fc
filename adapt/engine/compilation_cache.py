"""Programs that XLA compiled are kept between runs."""

from pathlib import Path

import jax
import platformdirs


def cache_folder() -> Path:
    """Return the user's folder of everything that is kept between runs; removing it costs only time."""
    return platformdirs.user_cache_path("girdle")


def keep_compiled() -> None:
    """Keep every program in the user's cache folder."""
    jax.config.update("jax_compilation_cache_dir", str(cache_folder() / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
