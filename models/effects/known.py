"""Effects that are known to be at work, by the numbers that a caller or a command line gives."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from models.effects import EFFECTS, ActiveEffects, Effect
from motions.errors import InputError

Amplitudes = Mapping[str, Sequence[float]]
"""By name of the effect, the amplitude of each of its directions in its unit (``girdle effects``); no details. That of
one that goes with elevation holds at ``FULL_ELEVATION_DEG``: it follows the first term of ``Effect.course``."""

NO_EFFECTS: Amplitudes = MappingProxyType({})

OPTION = "--effect"
"""Of the command line, where an error names it."""


def active_effects(amplitudes: Amplitudes, elevation_deg: Float[np.ndarray, "*postures"]) -> ActiveEffects:
    """Return the effects at these elevations; InputError where there is no such effect or its numbers do not fit it."""
    effects = [effect_named(name, "effects") for name in amplitudes]
    for effect in effects:
        _check(effect, amplitudes[effect.name], "effects")
    strengths = (
        effect.at(_amplitude(effect, amplitudes[effect.name]).reshape(-1, *(1,) * elevation_deg.ndim), elevation_deg)
        for effect in effects
    )
    shape = elevation_deg.shape
    return ActiveEffects(tuple(np.broadcast_to(one, (len(one), *shape)) for one in strengths), tuple(effects))


def read_amplitudes(words: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Read the amplitudes that a command line gives, each word as ``NAME=A,B,C``; InputError where one is not that."""
    found: dict[str, tuple[float, ...]] = {}
    for word in words:
        name, _, numbers = word.partition("=")
        effect = effect_named(name.strip(), OPTION)
        if effect.name in found:
            raise InputError(OPTION, None, f"{effect.name} is there twice", "Give each effect once")
        try:
            found[effect.name] = tuple(float(number) for number in numbers.split(","))
        except ValueError:
            remedy = f"Give {effect.name}={','.join('0' * len(effect.directions))} with numbers of your own"
            raise InputError(OPTION, None, f"'{numbers}' is not a list of numbers", remedy) from None
        _check(effect, found[effect.name], OPTION)
    return found


def as_option(effect: Effect, size: Sequence[float], elevation_deg: float) -> str:
    """Write ``NAME=A,B,C`` for the size of each direction at this elevation, to three digits: the reverse of
    ``read_amplitudes``, as if the first term of ``Effect.course`` were all of it."""
    height = effect.course(np.asarray(elevation_deg))[0]
    return f"{effect.name}={','.join(f'{value:.3g}' for value in np.asarray(size) / height)}"


def described(amplitudes: Amplitudes) -> str:
    """Describe the amplitudes as 'scapula_landmark_bias of (0, 12, 0) deg'; empty without any."""
    return ", ".join(f"{name} of {_vector(size)} {EFFECTS[name].unit}" for name, size in amplitudes.items())


def _vector(size: Sequence[float]) -> str:
    numbers = ", ".join(f"{value:g}" for value in size)
    return numbers if len(size) == 1 else f"({numbers})"


def effect_named(name: str, place: str, *others: str) -> Effect:
    """Find the effect of this name.

    InputError that names the place where there is none, and what else than an effect would do there.
    """
    if name not in EFFECTS:
        raise InputError(place, None, f"there is no effect '{name}'", f"Use one of {', '.join([*others, *EFFECTS])}")
    return EFFECTS[name]


def _check(effect: Effect, given: Sequence[float], place: str) -> None:
    values = np.asarray(given, float)
    if values.shape != (len(effect.directions),) or not np.isfinite(values).all():
        cause = f"{effect.name} has {list(given)}"
        remedy = f"Give {len(effect.directions)}, in {effect.unit}: {', '.join(effect.directions)}"
        raise InputError(place, None, cause, remedy)


def _amplitude(effect: Effect, given: Sequence[float]) -> Float[np.ndarray, " amplitudes"]:
    amplitude = np.zeros(effect.amplitudes)
    amplitude[effect.firsts] = given
    return amplitude
