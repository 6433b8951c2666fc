"""Amplitudes of effects that are known to be active: input of fits, and their form on the command line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Float

from models.effects import EFFECTS, ActiveEffects, Effect
from models.effects.basis import CONSTANT, OverElevation
from models.effects.measurement.skin_artefact import MeasuredLag
from models.person.positions.measured_movement import MEASURED, measurable, measured_movement_mm
from motions.errors import InputError, did_you_mean, warn_input
from motions.table import Motions


@dataclass(frozen=True)
class PersonalSize:
    """Amplitudes of an effect that differ between persons: an adaptation fits subject-level amplitudes a beside theta.

        E = D + w (mean(J_p) + 1 / (6 n) sum ((a - mean) / sd)^2)

    for n postures with six angles. A deviation of one ``sd`` from ``mean`` (the population amplitudes) counts as much
    as a residual of one degree in one angle of one posture.
    """

    mean: Sequence[float]
    sd: Sequence[float]


Amplitude = Sequence[float] | PersonalSize | str
"""Amplitudes of an effect in its unit (``girdle effects``): one per direction, or all terms of each direction in turn.
One per direction is the amplitude of the first term of the basis; over elevation, this is the strength at
``FULL_ELEVATION_DEG``. ``MEASURED``, for SC or AC, stands for the movement that landmark positions have measured
(``models.person.positions.measured_movement``)."""

Amplitudes = Mapping[str, Amplitude]
"""Amplitudes by name of the effect."""

NO_EFFECTS: Amplitudes = MappingProxyType({})

OPTION = "--effect"
"""Command-line option, for error messages."""


def active_effects(amplitudes: Amplitudes, motions: Motions, library: Mapping[str, Effect] = EFFECTS) -> ActiveEffects:
    """Return the effects at every posture of the motions, in the order in which they act (the order of the library).

    ``library``: effects by name. InputError where it lacks an effect, or where the amplitudes do not fit the effect.
    """
    effects = _in_order(amplitudes, library)
    given: list[Amplitude] = [amplitudes[effect.name] for effect in effects]
    for effect, one in zip(effects, given, strict=True):
        _check(effect, one, "effects")
    strengths = (_strengths(effect, one, motions) for effect, one in zip(effects, given, strict=True))
    own = tuple(_own(effect, one, motions) for effect, one in zip(effects, given, strict=True))
    return ActiveEffects(tuple(strengths), tuple(effects), own if any(map(len, own)) else ())


def _in_order(amplitudes: Amplitudes, library: Mapping[str, Effect]) -> list[Effect]:
    if not isinstance(amplitudes, Mapping):
        remedy = 'Give amplitudes by name, as in {"thorax_tilt": (0, 5, 0)}'
        raise InputError("effects", None, f"this is a {type(amplitudes).__name__}", remedy)
    named = (effect_named(name, "effects", library=library) for name in amplitudes)
    return sorted(named, key=list(library.values()).index)


def sizes_of_persons(
    amplitudes: Amplitudes, sizes: Float[np.ndarray, "sizes persons"], library: Mapping[str, Effect] = EFFECTS
) -> dict[str, Float[np.ndarray, " persons"]]:
    """Convert deviations from the mean in SDs (``ActiveEffects.own``) into amplitudes, by effect, direction and, if a
    basis has several terms, term."""
    found: dict[str, Float[np.ndarray, " persons"]] = {}
    for effect in _in_order(amplitudes, library):
        given = amplitudes[effect.name]
        if isinstance(given, PersonalSize):
            mean, sd = _amplitude(effect, given.mean), _amplitude(effect, given.sd)
            terms = len(effect.basis.sd)
            for k in np.flatnonzero(sd > 0.0).tolist():
                term = f" term {k % terms + 1}" if terms > 1 else ""
                found[f"{effect.name} {effect.directions[k // terms]}{term}"] = mean[k] + sd[k] * sizes[len(found)]
    return found


def _strengths(effect: Effect, given: Amplitude, motions: Motions) -> Float[np.ndarray, "channels postures"]:
    if isinstance(given, str):
        return measured_movement_mm(effect.name, motions)
    return effect.strengths(_amplitude(effect, _mean(given)), motions)


def as_measured(amplitudes: Amplitudes) -> list[str]:
    """List the effects whose movement is taken from measured landmark positions."""
    return [name for name, one in amplitudes.items() if isinstance(one, str)]


def _mean(given: Sequence[float] | PersonalSize) -> Sequence[float]:
    return given.mean if isinstance(given, PersonalSize) else given


def _own(effect: Effect, given: Amplitude, motions: Motions) -> Float[np.ndarray, "sizes channels rows"]:
    """Compute the strengths that a deviation of one SD adds, for every amplitude in which persons differ."""
    columns = effect.columns(motions)
    if not isinstance(given, PersonalSize):
        return columns[:0]
    sd = _amplitude(effect, given.sd)
    return (sd[:, None, None] * columns)[sd > 0.0]


def read_amplitudes(words: Sequence[str], library: Mapping[str, Effect] = EFFECTS) -> dict[str, Amplitude]:
    """Read amplitudes from the command line: each word is ``NAME=A,B,C``, ``NAME=A,B,C~D,E,F`` with the SDs of a
    ``PersonalSize``, or ``NAME=measured``. InputError for any other word."""
    found: dict[str, Amplitude] = {}
    for word in words:
        name, _, numbers = (part.strip() for part in word.partition("="))
        effect = effect_named(name, OPTION, library=library)
        if name in found:
            raise InputError(OPTION, None, f"{name} is there twice", "Give each effect once")
        found[name] = MEASURED if numbers == MEASURED else _numbers(effect, numbers)
        _check(effect, found[name], OPTION)
    return found


FAR_CONSTANT, FAR_OVER_ELEVATION = 10.0, 30.0
"""Multiples of the typical size, for a constant effect and for one over elevation, from which on the amplitude was more
likely given in another unit. Over elevation, an amplitude is some 3 times the size."""

NEAR_NOTHING = 0.05
"""Multiple of the typical size below which, in every direction, an amplitude has no measurable effect and is probably
in another unit: a share for percent, or radians."""


def warn_of_sizes(amplitudes: Amplitudes, place: str = "effects") -> None:
    """Warn of amplitudes far above or below the typical size of their effect. InputError where they do not fit it."""
    for effect in _in_order(amplitudes, EFFECTS):
        _check(effect, amplitudes[effect.name], place)
        _doubt(effect, amplitudes[effect.name], place)


def _doubt(effect: Effect, given: Amplitude, place: str) -> None:
    over, share = isinstance(effect.basis, OverElevation), isinstance(effect.basis, MeasuredLag)
    if isinstance(given, str) or not (over or share or effect.basis == CONSTANT):
        return
    if len(mean := _mean(given)) != len(effect.directions):  # several terms per direction
        return
    sd = given.sd if isinstance(given, PersonalSize) else (0.0,) * len(mean)
    scales = (1.0,) * len(mean) if share else effect.prior.scale  # a share relates to the whole lag
    largest = max((max(abs(a), s) / scale for a, s, scale in zip(mean, sd, scales, strict=True)), default=0.0)
    if 0.0 < largest < NEAR_NOTHING:
        cause = f"{effect.name} of {_vector(mean)}{_unit(effect.name)} is at most {largest:.1%} of its typical size"
        warn_input(InputError(place, None, cause, "Check its unit (girdle effects)"))
    for direction, value, scale in zip(effect.directions, mean, scales, strict=True):
        if abs(value) >= (FAR_OVER_ELEVATION if over else FAR_CONSTANT) * scale:
            times = f"{abs(value) / scale:.0f} times its typical size"
            cause = f"{direction} of {effect.name} is {value:g}{_unit(effect.name)}, {times}"
            warn_input(InputError(place, None, cause, "Check its unit and digits (girdle effects)"))


def _numbers(effect: Effect, numbers: str) -> tuple[float, ...] | PersonalSize:
    try:
        mean, *sd = (tuple(float(number) for number in part.split(",")) for part in numbers.split("~", 1))
        return PersonalSize(mean, *sd) if sd else mean
    except ValueError:
        measured = f", or {effect.name}={MEASURED}" if measurable(effect.name) else ""
        remedy = f"Give {effect.name}={','.join('0' * len(effect.directions))} with numbers of your own{measured}"
        raise InputError(OPTION, None, f"'{numbers}' is not a list of numbers", remedy) from None


_DIGITS = 4
"""Significant digits of a printed amplitude: an error of at most 0.05 %."""


def rounded(values: Sequence[float]) -> tuple[float, ...]:
    """Round amplitudes to the digits that ``as_option`` writes, so that the option repeats an adaptation exactly."""
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)


def as_option(name: str, amplitude: Amplitude) -> str:
    """Format amplitudes as ``NAME=A,B,C`` or ``NAME=A,B,C~D,E,F``; ``read_amplitudes`` returns them as ``rounded``."""
    if isinstance(amplitude, str):
        return f"{name}={amplitude}"
    parts = (amplitude.mean, amplitude.sd) if isinstance(amplitude, PersonalSize) else (amplitude,)
    return f"{name}={'~'.join(','.join(f'{value:.{_DIGITS}g}' for value in part) for part in parts)}"


def described(amplitudes: Amplitudes) -> str:
    """Describe the amplitudes, as in 'scapula_landmark_bias of (0, 12, 0) deg'; empty without effects."""
    return ", ".join(_described(name, size) for name, size in amplitudes.items())


def _described(name: str, size: Amplitude) -> str:
    if isinstance(size, str):
        return f"{name} as {size}"
    return f"{name} of {_vector(_mean(size))}{_unit(name)}{' on average' * isinstance(size, PersonalSize)}"


def _unit(name: str) -> str:
    return f" {EFFECTS[name].unit}" if name in EFFECTS and EFFECTS[name].unit != "1" else ""


def _vector(size: Sequence[float]) -> str:
    numbers = ", ".join(f"{value:g}" for value in size)
    return numbers if len(size) == 1 else f"({numbers})"


def effect_named(name: str, place: str, *others: str, library: Mapping[str, Effect] = EFFECTS) -> Effect:
    """Return the effect of this name.

    InputError where there is none; it names ``place``, and the ``others`` that are allowed there beside effects.
    """
    if name not in library:
        known = [*others, *library]
        remedy = f"{did_you_mean(name, known)}Use one of {', '.join(known)}"
        raise InputError(place, None, f"there is no effect '{name}'", remedy)
    return library[name]


def _check(effect: Effect, given: Amplitude, place: str) -> None:
    if isinstance(given, str):
        if given != MEASURED or not measurable(effect.name):
            remedy = f"Give numbers; sc_translation and ac_translation may be '{MEASURED}'"
            raise InputError(place, None, f"{effect.name} has no movement '{given}'", remedy)
        return
    if isinstance(given, PersonalSize):
        _check(effect, given.mean, place)
        sd = np.asarray(given.sd, float)
        if sd.shape != np.shape(given.mean) or not ((sd >= 0.0) & np.isfinite(sd)).all():
            cause = f"{effect.name} has {len(given.mean)} sizes and the SDs {list(given.sd)}"
            raise InputError(place, None, cause, "Give one SD of 0 or more for each size")
        return
    values = np.asarray(given, float)
    if values.shape not in {(len(effect.directions),), (effect.amplitudes,)} or not np.isfinite(values).all():
        cause = f"{effect.name} has {given if np.ndim(given) == 0 else list(given)}"
        remedy = f"Give {len(effect.directions)}, in {effect.unit}: {', '.join(effect.directions)}"
        raise InputError(place, None, cause, remedy)


def _amplitude(effect: Effect, given: Sequence[float]) -> Float[np.ndarray, " amplitudes"]:
    """Return all amplitudes; if only one per direction is given, the later terms of the basis are zero."""
    if len(given) == effect.amplitudes:
        return np.asarray(given, float)
    amplitude = np.zeros((len(effect.directions), len(effect.basis.sd)))
    amplitude[:, 0] = given
    return amplitude.ravel()
