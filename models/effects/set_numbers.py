"""Effects that change a number of a parameter set: the true value differs from the value in the set.

The sources in the set decide which of these effects a diagnosis tries, and their ranges: numbers with the source
``assumed`` or ``derived`` are tried (:func:`doubtful_numbers`).
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from models.effects.effect import Adjust, Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.sets.number_sources import DOUBTFUL, begins_with
from motions.arrays import xp

_ATTACHMENT_MM, _BONE_MM, _DISTANCE_MM = 8.0, 6.0, 10.0

_NUMBERS = {
    "clavicle.sc_mm": ("sc_mm", "SC joint elsewhere on the thorax", "xyz", _DISTANCE_MM),
    "clavicle.conoid_mm": ("clavicle_conoid_mm", "conoid attached elsewhere on the clavicle", "xyz", _ATTACHMENT_MM),
    "scapula.conoid_mm": ("scapula_conoid_mm", "conoid attached elsewhere on the scapula", "xyz", _ATTACHMENT_MM),
    "scapula.ts_mm": ("ts_mm", "TS elsewhere on the scapula", "x", _BONE_MM),
    "scapula.ai_mm": ("ai_mm", "AI elsewhere on the scapula", "xy", _BONE_MM),
    "constraint.ts_distance_mm": ("ts_distance_mm", "TS at another distance from the thorax", "", _DISTANCE_MM),
    "constraint.ai_distance_mm": ("ai_distance_mm", "AI at another distance from the thorax", "", _DISTANCE_MM),
}
"""Numbers with such an effect, by key in the file: field of the girdle, plain name of an error in the number,
components that the bone's frame leaves free, and prior SD where the set states no range (the shipped sets differ by
about as much). Ellipsoid and conoid length are missing because they are adapted, and the clavicle's length because
``clavicle_length`` is an effect already."""

_SIZES = {"clavicle_length": ("clavicle.length_mm",), "scapula_size": ("scapula.ts_mm", "scapula.ai_mm")}
"""Effects of a bone's size, and the numbers of the set that depend on it."""


def _adjust(field: str, axes: str) -> Adjust:
    def adjusted(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
        value = getattr(girdle, field)
        if not axes:
            return replace(girdle, **{field: value + mm[0]}), rotations
        places = ["xyz".index(axis) for axis in axes]
        zero = xp.zeros_like(mm[0])
        moved = xp.stack([mm[places.index(k)] if k in places else zero for k in range(3)])
        return replace(girdle, **{field: value + moved}), rotations

    return adjusted


def _number(key: str, field: str, plain_name: str, axes: str, scale_mm: float) -> Effect:
    return Effect(
        name=f"{field.removesuffix('_mm')}_offset",
        plain_name=plain_name,
        what=f"{key} is not the set's",
        unit="mm",
        directions=tuple(axes) or ("outward",),
        adjust=_adjust(field, axes),
        prior=EffectPrior(scale=(scale_mm,) * max(1, len(axes)), source="spread between the shipped parameter sets"),
    )


NUMBER_EFFECTS: Mapping[str, Effect] = MappingProxyType({key: _number(key, *rest) for key, rest in _NUMBERS.items()})
"""Effects by the key of their number in the file of a parameter set."""


def doubtful_numbers(model: ParameterSet) -> dict[str, Effect]:
    """Return the effects of this set's numbers that were not measured, by name, with the stated ranges as prior SDs."""
    found = {}
    for key, effect in NUMBER_EFFECTS.items():
        source = model.source.get(key, "")
        if begins_with(source, DOUBTFUL):
            stated = model.range_mm(key)
            if stated is not None:
                prior = EffectPrior((stated,) * len(effect.directions), f"the set: {source}")
                effect = replace(effect, prior=prior)
            found[effect.name] = effect
    return found


def with_sizes_of(model: ParameterSet, effects: Iterable[Effect]) -> Iterator[Effect]:
    """Drop the effects of bone sizes that this set has measured; narrow the priors of those with a stated range.

    A range in mm is converted to percent of the bone: of the clavicle's length, or of |AC-TS|.
    """
    length_mm = {"clavicle_length": model.girdle.ac_mm, "scapula_size": model.girdle.ts_mm}
    for effect in effects:
        keys = _SIZES.get(effect.name, ())
        if keys and all(model.is_measured(key) for key in keys):
            continue
        stated = [model.range_mm(key) for key in keys]
        ranges_mm = [found for found in stated if found is not None]
        if ranges_mm:
            percent = 100.0 * max(ranges_mm) / float(np.linalg.norm(length_mm[effect.name]))
            prior = EffectPrior((min(percent, *effect.prior.scale),), f"the set: {model.source[keys[0]]}")
            effect = replace(effect, prior=prior)
        yield effect
