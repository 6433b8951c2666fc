"""Effects that are known to be at work, by the numbers that a caller or a command line gives."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from models.effects import EFFECTS, ActiveEffects, Effect
from motions.errors import InputError, did_you_mean
from motions.table import Motions

Amplitudes = Mapping[str, Sequence[float]]
"""By name of the effect, the amplitude of each of its directions in its unit (``girdle effects``). That of one that
goes with elevation holds at ``FULL_ELEVATION_DEG``: it follows the first term of its course; or all terms of each
direction in turn."""

NO_EFFECTS: Amplitudes = MappingProxyType({})

OPTION = "--effect"
"""Of the command line, where an error names it."""

THORAX_POINTS = "thorax_points"
"""Known beside the effects of the chain: the points on the thorax are another person's. ``{"thorax_points": (k,)}``
lets them count 1/k: D / k + w mean(J) has its minimum where D + k w mean(J) has it, so w is multiplied by k."""

THORAX_POINTS_WHAT = "points on the thorax are another person's: D counts 1/k"


def active_effects(amplitudes: Amplitudes, motions: Motions, library: Mapping[str, Effect] = EFFECTS) -> ActiveEffects:
    """Return the effects at every posture of the motions, in the order in which they act, that of the library.

    library: by name. InputError where there is no such effect in it or its numbers do not fit it.
    """
    named = (effect_named(name, "effects", library=library) for name in amplitudes if name != THORAX_POINTS)
    effects = sorted(named, key=list(library.values()).index)
    for effect in effects:
        _check(effect, amplitudes[effect.name], "effects")
    strengths = (effect.strengths(_amplitude(effect, amplitudes[effect.name]), motions) for effect in effects)
    return ActiveEffects(tuple(strengths), tuple(effects))


def read_amplitudes(words: Sequence[str], library: Mapping[str, Effect] = EFFECTS) -> dict[str, tuple[float, ...]]:
    """Read the amplitudes that a command line gives, each word as ``NAME=A,B,C``; InputError where one is not that."""
    found: dict[str, tuple[float, ...]] = {}
    for word in words:
        name, _, numbers = (part.strip() for part in word.partition("="))
        effect = None if name == THORAX_POINTS else effect_named(name, OPTION, THORAX_POINTS, library=library)
        if name in found:
            raise InputError(OPTION, None, f"{name} is there twice", "Give each effect once")
        try:
            found[name] = tuple(float(number) for number in numbers.split(","))
        except ValueError:
            remedy = f"Give {name}={','.join('0' * (len(effect.directions) if effect else 1))} with numbers of your own"
            raise InputError(OPTION, None, f"'{numbers}' is not a list of numbers", remedy) from None
        if effect:
            _check(effect, found[name], OPTION)
    weight_factor(found)
    return found


def weight_factor(amplitudes: Amplitudes) -> float:
    """Give what w of E is multiplied by: k of ``thorax_points``, else 1; InputError where it is no positive number."""
    given = amplitudes.get(THORAX_POINTS, (1.0,))
    if np.shape(given) != (1,) or not np.isfinite(given[0]) or given[0] <= 0.0:
        remedy = f"Give one positive number, as (30,) or {THORAX_POINTS}=30: the points then count a thirtieth"
        raise InputError(OPTION, None, f"{THORAX_POINTS} has {given if np.ndim(given) == 0 else list(given)}", remedy)
    return float(given[0])


_DIGITS = 4
"""Of a number in an option: to 0.01 % of what is at work."""


def as_option(effect: Effect, amplitude: Sequence[float]) -> str:
    """Write ``NAME=A,B,C`` with all amplitudes of the effect, rounded: the reverse of ``read_amplitudes``."""
    return f"{effect.name}={','.join(f'{value:.{_DIGITS}g}' for value in amplitude)}"


def described(amplitudes: Amplitudes) -> str:
    """Describe the amplitudes as 'scapula_landmark_bias of (0, 12, 0) deg'; empty without any."""
    return ", ".join(f"{name} of {_vector(size)}{_unit(name)}" for name, size in amplitudes.items())


def _unit(name: str) -> str:
    return f" {EFFECTS[name].unit}" if name in EFFECTS else ""


def _vector(size: Sequence[float]) -> str:
    numbers = ", ".join(f"{value:g}" for value in size)
    return numbers if len(size) == 1 else f"({numbers})"


def effect_named(name: str, place: str, *others: str, library: Mapping[str, Effect] = EFFECTS) -> Effect:
    """Find the effect of this name.

    InputError that names the place where there is none, and what else than an effect would do there.
    """
    if name not in library:
        known = [*others, *library]
        remedy = f"{did_you_mean(name, known)}Use one of {', '.join(known)}"
        raise InputError(place, None, f"there is no effect '{name}'", remedy)
    return library[name]


def _check(effect: Effect, given: Sequence[float], place: str) -> None:
    values = np.asarray(given, float)
    if values.shape not in {(len(effect.directions),), (effect.amplitudes,)} or not np.isfinite(values).all():
        cause = f"{effect.name} has {given if np.ndim(given) == 0 else list(given)}"
        remedy = f"Give {len(effect.directions)}, in {effect.unit}: {', '.join(effect.directions)}"
        raise InputError(place, None, cause, remedy)


def _amplitude(effect: Effect, given: Sequence[float]) -> Float[np.ndarray, " amplitudes"]:
    """All amplitudes; where only one a direction is given, the later terms of its course are zero."""
    if len(given) == effect.amplitudes:
        return np.asarray(given, float)
    amplitude = np.zeros((len(effect.directions), len(effect.course.sd)))
    amplitude[:, 0] = given
    return amplitude.ravel()
