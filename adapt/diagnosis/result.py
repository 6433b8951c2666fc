"""What a diagnosis says, as plain typed data: all that sentences, tables, figures, pages and JSON are made from.

Numbers that are not known are NaN or None, as each field says; JSON has null for both.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from adapt.diagnosis.fit.measurement_noise import NoiseEstimate
from adapt.diagnosis.gap_location import Cell, ConstraintResidual, Profile
from adapt.diagnosis.gap_rotations import VarianceFractions

Answer = Literal["none", "effect", "unknown"]
NONE: Answer = "none"
EFFECT: Answer = "effect"
UNKNOWN: Answer = "unknown"

TOLD_APART = 3.0
"""Expected log evidence (odds of 20 to 1) from which two hypotheses are distinguished."""

ALL = "all"
"""Both bones together, where gaps go by bone."""

HELD_OUT = "every third posture"
"""What ``HeldOutGaps.unseen`` holds out."""


@dataclass(frozen=True)
class Verdict:
    """The answer and the probabilities behind it."""

    answer: Answer
    effects: tuple[str, ...]
    """Names that cannot be distinguished, most probable first. Where two act together: the most probable two, then
    those that may be there in place of one of them. If the answer is unknown: those that explain part of the gap, alone
    or together, and leave something systematic."""
    together: bool
    """True where the first two of the effects act together."""
    probability: dict[str, float]
    """Of every effect, none and unknown; sums to 1. A pair gives half of its own to each of its two."""
    pairs: dict[str, float]
    """Of the pairs tried, as 'a+b'."""

    @property
    def named(self) -> tuple[str, ...]:
        """The answers that the verdict names, among those that have a probability."""
        return self.effects if self.answer == EFFECT else (self.answer,)

    @property
    def ranked(self) -> tuple[str, ...]:
        """The effects, the most probable one first, then the answers that are none."""
        effects = [name for name in self.probability if name not in (NONE, UNKNOWN)]
        return (*sorted(effects, key=lambda name: -self.probability[name]), NONE, UNKNOWN)


@dataclass(frozen=True)
class UnknownTests:
    """What the probability of 'unknown' follows from."""

    discrepancy_gain: float
    """Log evidence of the best hypothesis with an unlisted discrepancy, less that of the best without."""
    excess: float
    """log(chi square / degrees of freedom) of the best hypothesis, in standard deviations."""
    amplitude_excess: float
    """How far the amplitudes of an effect of the best hypothesis lie beyond their prior, in standard deviations."""


@dataclass(frozen=True)
class ChannelAmplitude:
    """One channel of an effect: its mean over the subjects, with a 95 % interval; with elevation, at the highest."""

    channel: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class EffectAmplitude:
    """How large an effect is: its channel, or the length of several, with a 95 % interval, in its unit."""

    what: str
    """What the effect changes, one line."""
    unit: str
    value: float
    low: float
    high: float
    channels: tuple[ChannelAmplitude, ...]
    option: str
    """The effect as ``girdle adapt --effect`` takes it."""


@dataclass(frozen=True)
class DetectableAmplitude:
    """The smallest amplitude of an effect, all directions together, that these data would show."""

    value: float
    unit: str


@dataclass(frozen=True)
class MeanGap:
    """Mean absolute difference of the angles, degrees, with its 95 % interval over subjects; NaN where unknown."""

    value: float
    low: float
    high: float


BoneGaps = Mapping[str, MeanGap]
"""By bone: ALL, then those of ``motions.table.BONES``."""

GapKind = Literal["noise_floor", "base", "adapted", "with_effect"]
"""What noise alone leaves, and what the model leaves as it is, adapted, and adapted with the effects."""

GapLevels = Mapping[GapKind, BoneGaps]


@dataclass(frozen=True)
class HeldOutGaps:
    """Gaps on what a model was fitted to, and on what it has not seen."""

    in_sample: GapLevels
    unseen: GapLevels
    """Of every third posture in turn, after the others. Of simulated subjects it tells better than a motion held out,
    which leaves half of the data to fit to, how far the gap shrinks on a new motion after all of these."""
    other_motion: GapLevels | None
    """Of each motion in turn, after the others; None where there is but one."""

    @property
    def shrinkage(self) -> float:
        """How much of the adapted gap the effects take away, held out: a fraction; NaN where unknown."""
        adapted, with_effect = self.unseen["adapted"][ALL].value, self.unseen["with_effect"][ALL].value
        return (adapted - with_effect) / adapted if adapted else 0.0


@dataclass(frozen=True)
class ParameterMeans:
    """An adapted parameter's mean over the subjects, mm, without and with the effect."""

    adapted_mm: float
    with_effect_mm: float


@dataclass(frozen=True)
class PredictedPower:
    """What a diagnosis of such data would make of an effect of its typical size: fractions of simulated cases."""

    named: float
    """The effect would be the first name."""
    none: float
    """Nothing would be blamed."""
    confused_with: dict[str, float]
    """Another effect would be the first name, the most frequent first."""


@dataclass(frozen=True)
class Proposal:
    """A measurement and what it is expected to bring."""

    what: str
    separation_now: float
    separation_then: float
    """Expected log evidence, nats, of the right candidate over the other."""
    probability_then: float
    """Expected probability of the right one of the two."""

    @property
    def separates(self) -> bool:
        """Whether it would tell the two candidates apart."""
        return self.separation_then >= TOLD_APART


@dataclass(frozen=True)
class Diagnosis:
    """What one model says of the gap of all subjects given."""

    model: str
    subjects: tuple[str, ...]
    left_out: dict[str, str]
    """Subjects that say too little, each with its reason."""
    postures: int
    highest_elevation_deg: float
    """Elevation of the highest posture, at which the amplitudes hold."""
    noise: NoiseEstimate
    declared_effects: tuple[str, ...]
    """Effects that the motions are marked with: as probable beforehand as all others together."""
    verdict: Verdict
    at_other_noise: dict[float, Verdict]
    """The verdict had the noise been otherwise, by its SD in degrees."""
    tests: UnknownTests
    amplitude: dict[str, EffectAmplitude]
    """Of the effects in the verdict; where that is unknown, of the best there is."""
    best: tuple[str, ...]
    """The effects of the most probable hypothesis of the list, enough or not; empty for none."""
    gaps: HeldOutGaps
    parameters: dict[str, ParameterMeans]
    cells: list[Cell]
    profile: Profile
    variance_fractions: VarianceFractions
    constraints: list[ConstraintResidual]
    indistinguishable: list[list[str]]
    smallest_detectable: dict[str, DetectableAmplitude | None]
    """Of each effect; None where no size tried would show."""
    predicted_power: dict[str, PredictedPower]
    """Of each effect, before any residual is seen."""
    next_measurement: list[Proposal]


@dataclass(frozen=True)
class Diagnoses:
    """The diagnosis by each of several models, of the same motions."""

    by_model: Mapping[str, Diagnosis]

    @property
    def closest(self) -> Diagnosis:
        """The one with the smallest held-out gap after adaptation."""
        return min(self.by_model.values(), key=_adapted_gap_deg)


def _adapted_gap_deg(diagnosis: Diagnosis) -> float:
    value = diagnosis.gaps.unseen["adapted"][ALL].value
    return value if math.isfinite(value) else math.inf
