"""What a diagnosis says, as plain typed data: all that sentences, tables, figures, pages and JSON are made from.

Numbers that are not known are NaN or None, as each field says; JSON has null for both.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.location.where import Where
from models.effects.amplitudes import Amplitude, as_option
from motions.table import Motions

Answer = Literal["none", "effect", "unknown"]
NONE: Answer = "none"
EFFECT: Answer = "effect"
UNKNOWN: Answer = "unknown"

ALL = "all"
"""Both bones together, where gaps go by bone."""

BASE, ADAPTED_STEP, NOISE = "base", "adapted", "noise"
"""Steps of the gap budget beside the causes."""

OWN_BONES = "own_bones"
"""The step of the budget that gives each person bones and frames of its own: the null of every cause."""


class Interval(NamedTuple):
    """A value with its 95 % interval; NaN where unknown."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Cause:
    """One active cause: the names it may have."""

    names: tuple[str, ...]
    """Names that these data cannot tell apart, a credible set: that in the set of causes that is chosen, whose size is
    given, then the most probable first."""
    shares: tuple[float, ...]
    """Probability of each name in this place."""
    gain: float
    """Share of what own bones leave of the gap on held-out motions, beyond noise, that it takes away,
    its size from other persons; NaN of what no gap shows."""
    t: float
    """That difference, paired by person, in its standard errors."""
    tested_on: tuple[str, ...]
    """What was not fitted to it and shows it: "positions" that measured it; "other_motion" and "other_person", of what
    own bones do not predict. A constant that all have alike: "evidence". An axial rotation that is computed:
    "angles"."""


@dataclass(frozen=True)
class Verdict:
    """The answer and the probabilities behind it."""

    answer: Answer
    causes: tuple[Cause, ...]
    """Those that predict motions and persons that were not fitted, the one that takes most of the gap first; then an
    estimate that the angles show themselves."""
    inclusion: dict[str, float]
    """Probability of every candidate of being active, alone or with others; the most probable first."""
    probability: dict[str, float]
    """Of every candidate, none, and unknown, the unexplained share of the gap; sums to 1. Causes active together
    have equal parts."""
    not_named: Mapping[str, str] = field(default_factory=dict)
    """What speaks against each cause that is probable, and no name."""

    def inclusion_of(self, name: str) -> float:
        """Look up the probability of a name of being active; NaN of what is no candidate."""
        return self.inclusion.get(name, math.nan)

    @property
    def names(self) -> tuple[str, ...]:
        """The first name of every cause."""
        return tuple(cause.names[0] for cause in self.causes)


_HAS_IT = 0.5
"""Share of the mean size from which a subject has a cause."""


@dataclass(frozen=True)
class CauseAmplitude:
    """How large a cause is: the root mean square over the postures of what it does beyond a constant of each subject,
    all directions together; of a constant cause, all of it."""

    effect: str
    """Its name with that of its course."""
    what: str
    """What it changes, one line."""
    course: str
    """What its strength goes with: 'elevation of the arm', 'posture of the bones'; empty for a constant."""
    unit: str
    size: Interval
    typical: float
    """How large such an effect typically is, by the same measure: its prior."""
    directions: dict[str, Interval]
    """Its amplitudes, in the unit of the effect."""
    amplitude: Amplitude | None
    """As an adaptation takes it, in the digits that are printed; None where no gap shows how large it is."""
    by_subject: Mapping[str, float] = field(default_factory=dict)
    """Share of the mean size that it has in each subject; what a subject's data do not say is taken from the mean."""

    @property
    def option(self) -> str:
        """Write the cause as ``girdle adapt --effect`` takes it; empty without an amplitude."""
        return "" if self.amplitude is None else as_option(self.effect, self.amplitude)

    @property
    def shown_by(self) -> tuple[str, ...]:
        """The subjects that have it: at least half of the mean, the same way."""
        return tuple(name for name, share in self.by_subject.items() if share >= _HAS_IT)

    @property
    def too_large(self) -> bool:
        """Whether it is larger than such an effect is: something that acts like it."""
        return self.size.value > 2.0 * self.typical


@dataclass(frozen=True)
class Step:
    """One step of the gap budget: the mean absolute gap on held-out motions, degrees."""

    step: str
    """BASE, ADAPTED_STEP, OWN_BONES, the name of a cause that is added, or NOISE."""
    gap_deg: Interval


BoneGaps = Mapping[str, Interval]
"""By bone: ALL, then those of ``motions.table.BONES``; degrees, with 95 % intervals over persons."""

GapKind = Literal["noise_floor", "base", "adapted", "own_bones", "with_effect"]
"""What noise alone leaves, and what the model leaves as it is, adapted, adapted with own bones, and
with the causes beside them."""

GapLevels = Mapping[GapKind, BoneGaps]


@dataclass(frozen=True)
class Gaps:
    """Gaps of `girdle adapt`, with `--own-bones`, and with the causes beside them, on what was fitted and what not."""

    in_sample: GapLevels
    other_postures: GapLevels
    """Every third posture in turn, after the others."""
    other_motion: GapLevels | None
    """Each motion in turn, after the others; None where there is but one."""
    other_person: GapLevels | None
    """The same, and the amplitudes of the causes fitted to other persons; None where there is but one person."""

    @property
    def hardest(self) -> GapLevels:
        """The gaps of which most was held out."""
        return self.other_person or self.other_motion or self.other_postures

    @property
    def shrinkage(self) -> float:
        """How much of the adapted gap the causes take away of the hardest: a fraction; NaN where unknown."""
        adapted, with_effect = self.hardest["adapted"][ALL].value, self.hardest["with_effect"][ALL].value
        return (adapted - with_effect) / adapted if adapted else 0.0


@dataclass(frozen=True)
class Noise:
    """SD of one measured angle, and what it rests on."""

    angle_deg: float
    source: str
    """'estimated', 'given' or 'assumed'."""
    freedom: float
    """Degrees of freedom of the estimate."""


@dataclass(frozen=True)
class ParameterMeans:
    """An adapted parameter's mean over the subjects, mm, without and with the causes."""

    adapted_mm: float
    with_effect_mm: float


@dataclass(frozen=True)
class Proposal:
    """A measurement and what it is expected to bring."""

    what: str
    between: tuple[str, str]
    """The two names that it is to tell apart."""
    separation_now: float
    separation_then: float
    """Expected log evidence, nats, of the first name over the second."""
    apart_deg: float
    """How far what the two say is apart in these postures, root mean square of an angle: what is gained by knowing."""

    @property
    def probabilities(self) -> tuple[float, float]:
        """Expected probability of the right one of the two, now and then."""
        return 1.0 / (1.0 + math.exp(-self.separation_now)), 1.0 / (1.0 + math.exp(-self.separation_then))


PositionUse = Literal["use", "check", "ignore"]
"""What is done with measured positions of landmarks: taken into the inference, held against it, or left out."""

StateGaps = Mapping[str, float]
"""By state (``adapt.tables.positions_table``): root mean square distance over landmarks and postures, mm."""


@dataclass(frozen=True)
class Positions:
    """What measured positions of landmarks say of the simulated ones, each person with its own constants."""

    used: bool
    """Whether they were data of the inference."""
    note: str
    """Why not, where they were to be used; what contradicts them; or empty."""
    noise_mm: float
    """SD of one coordinate; NaN where unknown."""
    in_sample: StateGaps
    """NaN without measured positions."""
    other_motion: StateGaps | None
    """Of motions held out of adaptation and constants; None where there is but one."""
    other_person: StateGaps | None
    """The same, with the person held out of the sizes of the causes; None where there is but one."""
    not_told: tuple[str, ...]
    """Landmarks whose place in a person these positions do not tell."""
    motions: Motions
    """The postures."""
    measured_mm: Mapping[str, Float[np.ndarray, "3 rows"]]
    simulated_mm: Mapping[str, Mapping[str, Float[np.ndarray, "3 rows"]]]
    """By state and landmark."""


def can_test(kinds: Sequence[str], persons: int) -> bool:
    """Tell whether a cause can be tested on what it was not fitted to: another kind of motion, or another person."""
    return len(kinds) > 1 or persons > 1


@dataclass(frozen=True)
class Diagnosis:
    """What one model says of the gap of all subjects given."""

    model: str
    subjects: tuple[str, ...]
    left_out: dict[str, str]
    """Subjects that say too little, each with its reason."""
    slips: tuple[str, ...]
    """Postures that are left out because a landmark slipped in them, a phrase each."""
    persons: int
    """Left and right shoulders of one person count once."""
    kinds: tuple[str, ...]
    """Kinds of motion."""
    postures: int
    searched_postures: int
    """Of them, those that the search for causes took: of a motion with very many not all."""
    highest_elevation_deg: float
    noise: Noise
    declared_effects: tuple[str, ...]
    """Effects that the motions are marked with."""
    axial_is_computed: bool
    """Whether the clavicle's axial rotation is a function of the other angles: an estimate, no measurement."""
    verdict: Verdict
    amplitude: dict[str, CauseAmplitude]
    """By the first name of each cause."""
    landmark_sizes: dict[str, dict[str, Interval]]
    """By name and direction, what landmarks say of the sizes that candidates change, against the set: the diagnosis
    starts from it. Empty without landmarks."""
    budget: tuple[Step, ...]
    """The gap on held-out motions: as it is, adapted, with one cause after the other, from noise alone."""
    left_over_share: float
    """Share of the adapted gap beyond noise that the causes leave over; NaN where there is none."""
    gaps: Gaps
    parameters: dict[str, ParameterMeans]
    where: Where
    indistinguishable: list[list[str]]
    """Candidates that do the same to these data, whatever is active."""
    lacking: tuple[str, ...]
    """What to measure first, whatever is active."""
    next_measurement: list[Proposal]
    """What would tell names of a cause apart."""
    positions: Positions

    @property
    def effects(self) -> dict[str, Amplitude]:
        """All causes whose size a gap shows, as ``adapt_subjects`` takes them."""
        return {one.effect: one.amplitude for one in self.amplitude.values() if one.amplitude is not None}

    @property
    def options(self) -> tuple[str, ...]:
        """The same, as ``girdle adapt --effect`` takes them."""
        return tuple(as_option(name, amplitude) for name, amplitude in self.effects.items())

    @property
    def goes_further(self) -> bool:
        """Whether there are causes beside own bones."""
        return bool(self.effects)

    @property
    def can_test(self) -> bool:
        """Whether there is another motion, or person, to test a cause on that it was not fitted to."""
        return can_test(self.kinds, self.persons)


@dataclass(frozen=True)
class Diagnoses:
    """The diagnosis by each of several models, of the same motions."""

    by_model: Mapping[str, Diagnosis]

    @property
    def closest(self) -> Diagnosis:
        """The one with the smallest held-out gap after adaptation."""
        return min(self.by_model.values(), key=_adapted_gap_deg)


def _adapted_gap_deg(diagnosis: Diagnosis) -> float:
    value = diagnosis.gaps.hardest["adapted"][ALL].value
    return value if math.isfinite(value) else math.inf
