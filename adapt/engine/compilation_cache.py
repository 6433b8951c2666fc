"""Compiled programs are kept between runs."""

import jax
import platformdirs


def keep_compiled() -> None:
    """In the user's cache folder, every program."""
    jax.config.update("jax_compilation_cache_dir", str(platformdirs.user_cache_path("girdle") / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
