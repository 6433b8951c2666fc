"""All hidden effects, listed and outside the list: their sizes, and how they are drawn."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scripts.research.named_causes.synthetic_a.conventions import EFFECT_STREAM
from scripts.research.named_causes.synthetic_a.courses import Change, Draw
from scripts.research.named_causes.synthetic_a.effects_chain import (
    ac_translation,
    clavicle_length,
    conoid_strain,
    sc_translation,
    scapula_size,
    scapulothoracic_gap,
    thorax_asymmetry,
    thorax_shape,
    thorax_tilt,
)
from scripts.research.named_causes.synthetic_a.effects_measured import (
    clavicle_axial_estimate,
    scapula_landmark_bias,
    skin_artefact,
    thorax_extension,
)
from scripts.research.named_causes.synthetic_a.outside import (
    outside_breathing,
    outside_crosstalk,
    outside_drift,
    outside_gain,
    outside_hysteresis,
    outside_mid_winging,
    outside_sign_flip,
    outside_step,
    outside_swapped_columns,
)
from scripts.research.named_causes.synthetic_a.subjects import Postures

AMPLITUDE_SPREAD = 0.25


@dataclass(frozen=True)
class Effect:
    """An effect: its maker, its amplitude at size 1 with unit, and the rule for its sign."""

    make: Callable[[Draw], Change]
    scale: float
    unit: str
    sign: str = "drawn"
    """Rule for the sign. 'drawn': once per world; 'natural': positive; with mixed_sign either kind is drawn per subject
    instead. 'one-sided': always positive."""
    spread: float = AMPLITUDE_SPREAD


EFFECTS: dict[str, Effect] = {
    "scapulothoracic_gap": Effect(scapulothoracic_gap, 7.5, "mm"),
    "conoid_strain": Effect(conoid_strain, 3.0, "mm", "one-sided"),
    "ac_translation": Effect(ac_translation, 4.5, "mm"),
    "sc_translation": Effect(sc_translation, 5.5, "mm"),
    "thorax_tilt": Effect(thorax_tilt, 7.5, "deg"),
    "thorax_asymmetry": Effect(thorax_asymmetry, 7.5, "mm"),
    "thorax_shape": Effect(thorax_shape, 0.3, "1"),
    "clavicle_length": Effect(clavicle_length, 8.0, "%"),
    "scapula_size": Effect(scapula_size, 8.0, "%"),
    "scapula_landmark_bias": Effect(scapula_landmark_bias, 8.0, "deg"),
    "clavicle_axial_estimate": Effect(clavicle_axial_estimate, 17.0, "deg", "natural"),
    "skin_artefact": Effect(skin_artefact, 9.5, "deg", "natural"),
    "thorax_extension": Effect(thorax_extension, 9.5, "deg", "natural"),
    "outside_sign_flip": Effect(outside_sign_flip, 1.0, "1", "one-sided", 0.0),
    "outside_mid_winging": Effect(outside_mid_winging, 12.0, "deg", "natural"),
    "outside_swapped_columns": Effect(outside_swapped_columns, 1.0, "1", "one-sided", 0.0),
    "outside_hysteresis": Effect(outside_hysteresis, 9.0, "deg"),
    "outside_crosstalk": Effect(outside_crosstalk, 10.0, "deg"),
    "outside_step": Effect(outside_step, 10.0, "deg"),
    "outside_drift": Effect(outside_drift, 13.0, "deg"),
    "outside_breathing": Effect(outside_breathing, 9.0, "mm"),
    "outside_gain": Effect(outside_gain, 35.0, "%", "one-sided"),
}
LABELS = ("none", *EFFECTS)
"""Every single label; two effects at once are 'a+b'."""


def effects_of(label: str) -> list[str]:
    """Split a label into its effects, joined by '+'; 'none' has none."""
    names = [] if label == "none" else label.split("+")
    unknown = [name for name in names if name not in EFFECTS]
    if unknown or len(set(names)) != len(names):
        raise ValueError(f"no effect is called {label!r}. Take one of {', '.join(LABELS)}, or two joined by '+'")
    return names


def draw_effect(name: str, postures: Postures, size: float, seed: int, mixed_sign: bool) -> tuple[Change, Draw]:
    """Draw amplitudes and shapes of one effect; `size` scales the amplitudes and changes no other draw."""
    effect = EFFECTS[name]
    rng = np.random.default_rng([seed, EFFECT_STREAM, LABELS.index(name)])
    spread = np.maximum(1.0 + effect.spread * rng.standard_normal(postures.subjects), 0.3)
    world_sign, signs = rng.choice([-1.0, 1.0]), rng.choice([-1.0, 1.0], postures.subjects)
    if effect.sign == "one-sided":
        signs = np.ones(postures.subjects)
    elif not mixed_sign:
        signs = np.full(postures.subjects, world_sign if effect.sign == "drawn" else 1.0)
    draw = Draw(postures, size * effect.scale * spread * signs, rng)
    return effect.make(draw), draw
