"""Programs that XLA compiled are kept between runs."""

import jax
import platformdirs


def keep_compiled() -> None:
    """Keep every program in the user's cache folder."""
    jax.config.update("jax_compilation_cache_dir", str(platformdirs.user_cache_path("girdle") / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
