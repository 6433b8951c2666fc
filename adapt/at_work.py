"""Effects that are known to be at work, by the numbers a caller gives."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from models.effects import EFFECTS, AtWork, Effect
from motions.errors import InputError

Amplitudes = Mapping[str, Sequence[float]]
"""By name of the effect, the amplitude of each of its directions in its unit (``girdle effects``): one that goes with
elevation grows to it along the first term of its course (``Effect.course``), without details."""

NO_EFFECTS: Amplitudes = MappingProxyType({})


def at_work(amplitudes: Amplitudes, elevation_deg: Float[np.ndarray, "*postures"]) -> AtWork:
    """The effects at these elevations; InputError where there is no such effect or its numbers do not fit it."""
    effects = [_effect(name) for name in amplitudes]
    strengths = (
        effect.at(_amplitude(effect, given).reshape(-1, *(1,) * elevation_deg.ndim), elevation_deg)
        for effect, given in zip(effects, amplitudes.values(), strict=True)
    )
    shape = elevation_deg.shape
    return AtWork(tuple(np.broadcast_to(one, (len(one), *shape)) for one in strengths), tuple(effects))


def _effect(name: str) -> Effect:
    if name not in EFFECTS:
        raise InputError("effects", None, f"there is no effect '{name}'", f"Use one of {', '.join(EFFECTS)}")
    return EFFECTS[name]


def _amplitude(effect: Effect, given: Sequence[float]) -> Float[np.ndarray, " amplitudes"]:
    values = np.asarray(given, float)
    if values.shape != (len(effect.directions),) or not np.isfinite(values).all():
        cause = f"{effect.name} has {list(given)}"
        remedy = f"Give {len(effect.directions)}, in {effect.unit}: {', '.join(effect.directions)}"
        raise InputError("effects", None, cause, remedy)
    amplitude = np.zeros(effect.amplitudes)
    amplitude[effect.firsts] = values
    return amplitude
