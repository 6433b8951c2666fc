"""The cases of the withheld-effect check: conditions, labels, seeds, and the world of each case.

A third motion, held out from the diagnosis, checks the predicted shrinkage of the gap. The random numbers of a world
depend on its number of motions (directions and noise do), so a world that needs the third motion is made with all
three, and the diagnosis is given the first two.
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
"""Parameter sets; the seed selects the one that makes a world and is given to the diagnosis."""

CALIBRATION_SEEDS = range(100_000)
"""Seeds of the worlds for tuning."""

REPORTED_SEEDS = range(200_000, 200_012)
"""Seeds that tuning never used, nor any later seed. docs/research/blind_check.md names the seeds of its figures."""

NONE_WORLDS = 8
"""Worlds without an effect per seed: they alone determine how often an effect is blamed on nothing."""

MOST_SEEDS = 1_000_000
"""Distance between the world seeds of one case seed: larger than any case seed."""

_MOST_REPEATS = 100
"""More than the repeats of any label, so that worlds of different labels have their own subjects and noise."""

SHOWN_MOTIONS = ("abduction", "forward_flexion")
UNSEEN_MOTION = "scapular_plane"


def kind(label: str) -> str:
    """Classify a label: 'none', 'effect', 'pair', 'several' or 'outside'."""
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
    """Settings of the worlds of one condition, and their labels."""

    labels: tuple[str, ...]
    subjects: int = 10
    noise_deg: float = 1.5
    size: float = 1.0
    mixed_sign: bool = False
    landmarks: bool = False
    library: Literal["all", "without", "alone"] = "all"
    """All candidates, all without the active effect, or the active effect alone. With "alone", a diagnosis that misses
    the effect could not have found it among all candidates either."""
    third_motion: bool = False
    """True where worlds with one listed effect get a third motion."""


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
    "landmarks_one": Condition(SINGLE, subjects=1, landmarks=True),
}
ALONE = "alone_"
CONDITIONS = {
    **_COMMON,
    **{ALONE + name: replace(how, labels=LISTED, library="alone") for name, how in _COMMON.items()},
    "loo": Condition(LISTED, library="without", third_motion=True),
    "landmarks_pairs": Condition(PAIRS, landmarks=True),
    "mixed": Condition((*LISTED, *OUTSIDE), mixed_sign=True),
    "power_0.25": Condition(LISTED, size=0.25),
    "power_1.5": Condition(LISTED, size=1.5),
    "power_2": Condition(LISTED, size=2.0),
}
"""`loo` has the worlds of `standard`, `alone_half` those of `half`, and so on. Conditions that change only size or sign
have no worlds without an effect, because these would be the same. `power` selects all three conditions of that name;
the other two sizes of the power curve are `half` and `standard`."""


@dataclass(frozen=True)
class Case:
    """One world to diagnose."""

    condition: str
    label: str
    seed: int
    repeat: int = 0

    @property
    def model(self) -> str:
        """Parameter set of the world and of the diagnosis."""
        return MODELS[self.seed % len(MODELS)]


def plan(conditions: Sequence[str], seeds: Sequence[int], labels: Sequence[str] = ()) -> list[Case]:
    """List the cases, seed by seed, so that the finished part of a study is a smaller study."""
    return [
        Case(condition, label, seed, repeat)
        for seed in seeds
        for condition in conditions
        for label in CONDITIONS[condition].labels
        for repeat in range(NONE_WORLDS if label == "none" else 1)
        if label in labels or not labels
    ]


def world_seed(case: Case) -> int:
    """Compute the seed of the world of a case."""
    return case.seed + MOST_SEEDS * (case.repeat + _MOST_REPEATS * (*LABELS, *PAIRS).index(case.label))


def world_of(case: Case) -> World:
    """Make the world of a case; the diagnosis may see the first two of three motions."""
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
    """Write the rows of some motions as a motion file."""
    table[table["motion"].isin(motions)].to_csv(path, index=False, float_format="%.4f")
    return path
