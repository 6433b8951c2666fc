"""The cases of the withheld-effect check: conditions, labels, seeds, and the world of each case.

How far the gap shrinks on a motion that nobody has seen is checked on a third motion. A world's random numbers depend
on its number of motions (directions and noise do), so where it is needed the world has all three, and the diagnosis is
shown the first two.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import pandas as pd

from adapt.diagnosis.result import NONE
from scripts.research.named_causes.synthetic_a import LABELS, World, make_world

ROOT = Path(__file__).parents[4]
MODELS = ("R2", "R4", "R6", "breteler_dissection")
"""Which of them makes a world and is given to the diagnosis goes by the seed."""

CALIBRATION_SEEDS = range(100_000)
"""Of worlds that everything was tried out on."""

REPORTED_SEEDS = range(200_000, 200_012)
"""Nothing was ever tried out on these or on any after them. docs/research/blind_check.md names those of its figures."""

NONE_WORLDS = 8
"""Worlds without an effect a seed: all that says how often an effect is blamed on nothing."""

MOST_SEEDS = 1_000_000
"""Between the seeds of the worlds of one seed: more than any seed."""

_MOST_REPEATS = 100
"""More than any label is repeated: worlds of different labels have subjects and noise of their own."""

SHOWN_MOTIONS = ("abduction", "forward_flexion")
UNSEEN_MOTION = "scapular_plane"


def kind(label: str) -> str:
    """'none', 'effect', 'pair', 'several' or 'outside'."""
    if "+" in label:
        return "pair" if label.count("+") == 1 else "several"
    return "none" if label == NONE else "outside" if label.startswith("outside_") else "effect"


LISTED = tuple(label for label in LABELS if kind(label) == "effect")
OUTSIDE = tuple(label for label in LABELS if kind(label) == "outside")
PAIRS = (
    "conoid_strain+scapula_landmark_bias",
    "scapulothoracic_gap+clavicle_axial_estimate",
    "ac_translation+skin_artefact",
    "sc_translation+scapula_landmark_bias",
    "thorax_tilt+clavicle_axial_estimate",
    "thorax_asymmetry+skin_artefact",
    "thorax_shape+conoid_strain",
    "clavicle_length+scapulothoracic_gap",
    "scapula_size+thorax_extension",
    "scapula_landmark_bias+clavicle_axial_estimate",
    "sc_translation+skin_artefact",
    "ac_translation+thorax_extension",
)


@dataclass(frozen=True)
class Condition:
    """How the worlds of a condition are made, and what is in them."""

    labels: tuple[str, ...]
    subjects: int = 10
    noise_deg: float = 1.5
    size: float = 1.0
    mixed_sign: bool = False
    landmarks: bool = False
    library: Literal["all", "without", "alone"] = "all"
    """All candidates; without the effect at work; or that alone: who misses it then could not have found it."""
    third_motion: bool = False
    """Of worlds with one listed effect."""


SINGLE = ("none", *LISTED, *OUTSIDE)
_COMMON = {
    "standard": Condition((*SINGLE, *PAIRS), third_motion=True),
    "half": Condition((*LISTED, *OUTSIDE), size=0.5),
    "three": Condition(SINGLE, subjects=3),
    "one": Condition(SINGLE, subjects=1),
    "noise_3": Condition(SINGLE, noise_deg=3.0),
    "two_motions": Condition(SINGLE),
    "landmarks": Condition(SINGLE, landmarks=True),
    "landmarks_three": Condition(SINGLE, subjects=3, landmarks=True),
}
ALONE = "alone_"
CONDITIONS = {
    **_COMMON,
    **{ALONE + name: replace(how, labels=LISTED, library="alone") for name, how in _COMMON.items()},
    "loo": Condition(LISTED, library="without", third_motion=True),
    "mixed": Condition((*LISTED, *OUTSIDE), mixed_sign=True),
    "power_0.25": Condition(LISTED, size=0.25),
    "power_1.5": Condition(LISTED, size=1.5),
    "power_2": Condition(LISTED, size=2.0),
}
"""`loo` has the worlds of `standard`, `alone_half` those of `half`, and so on. Without an effect, its size and sign
change nothing. `power` means all three; the power curve's other two sizes are `half` and `standard`."""


@dataclass(frozen=True)
class Case:
    """One world to diagnose."""

    condition: str
    label: str
    seed: int
    repeat: int = 0

    @property
    def model(self) -> str:
        """The parameter set of world and diagnosis."""
        return MODELS[self.seed % len(MODELS)]


def plan(conditions: Sequence[str], seeds: Sequence[int], labels: Sequence[str] = ()) -> list[Case]:
    """The cases, seed by seed, so that what is done of a study is a smaller study."""
    return [
        Case(condition, label, seed, repeat)
        for seed in seeds
        for condition in conditions
        for label in CONDITIONS[condition].labels
        for repeat in range(NONE_WORLDS if label == "none" else 1)
        if label in labels or not labels
    ]


def world_seed(case: Case) -> int:
    """The seed of the world of a case."""
    return case.seed + MOST_SEEDS * (case.repeat + _MOST_REPEATS * (*LABELS, *PAIRS).index(case.label))


def world_of(case: Case) -> World:
    """The world of a case; the first two of three motions are what the diagnosis may see."""
    how = CONDITIONS[case.condition]
    three = how.third_motion and kind(case.label) == "effect"
    return make_world(
        case.label,
        ROOT / "models" / "sets" / f"{case.model}.toml",
        subjects=how.subjects,
        noise_deg=how.noise_deg,
        size=how.size,
        seed=world_seed(case),
        motions=(*SHOWN_MOTIONS, UNSEEN_MOTION) if three else SHOWN_MOTIONS,
        mixed_sign=how.mixed_sign,
        landmarks=how.landmarks,
    )


def written(table: pd.DataFrame, motions: Sequence[str], path: Path) -> Path:
    """The rows of some motions as a motion file."""
    table[table["motion"].isin(motions)].to_csv(path, index=False, float_format="%.4f")
    return path
