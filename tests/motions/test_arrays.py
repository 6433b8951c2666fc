"""Code shared by all array engines: each value selects its engine's functions and loops."""

import jax.numpy as jnp
import numpy as np

from motions.arrays import ByType, is_jax, repeat, repeat_while, xp


class Names:
    """A namespace that returns the name of the function called."""

    def __getattr__(self, name: str):
        return lambda *_, **__: name


class Foreign:
    """A value of an unknown type."""

    def __array_namespace__(self, *, api_version: str | None = None) -> Names:
        return Names()


def test_a_value_brings_its_own_functions_and_loops():
    x = Foreign()
    assert xp.sqrt(x) == xp.where(True, 0.0, x).replace("where", "sqrt") == "sqrt"
    assert xp.stack([np.ones(2), x]) == "stack"
    assert repeat_while(lambda _: True, lambda y: y, (np.ones(2), {"deep": x})) == "repeat_while"
    assert repeat(3, lambda y: y, [x]) == "repeat"


def test_numpy_stays_numpy_and_jax_stays_jax():
    for array, traced in ((np.ones(2), False), (np.float32(1.0), False), (1.0, False), (jnp.ones(2), True)):
        assert is_jax(array) == is_jax([np.ones(2), (array,)]) == traced
        for found in (
            xp.maximum(0.0, array),
            xp.zeros_like(array, np.float64),
            repeat(2, lambda y: y + 1.0, array),
            repeat_while(lambda y: xp.all(y < 5.0), lambda y: y + 1.0, array),
        ):
            assert is_jax(found) == traced
    assert xp.inf == np.inf


def test_a_tolerance_is_that_of_the_type_of_number():
    tolerance = ByType(1e-9, 1e-4)
    assert tolerance.for_dtype_of(np.ones(1)) == 1e-9
    assert tolerance.for_dtype_of(jnp.ones(1, jnp.float32)) == 1e-4
