"""Result of a diagnosis as plain typed data, from which sentences, tables, figures, pages and JSON are made.

Unknown numbers are NaN or None, as each field says; JSON has null for both.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis import keys
from adapt.diagnosis.keys import ALL, Answer
from adapt.diagnosis.location.where import Where
from adapt.diagnosis.texts.wording import answer_text, gap_text, sentence, step_text
from adapt.tables.in_notebook import notebook_html
from models.effects.amplitudes import Amplitude, as_option
from motions.table import Motions, counted

NONE, EFFECT, UNKNOWN = keys.NONE, keys.EFFECT, keys.UNKNOWN
BASE, ADAPTED_STEP, OWN_BONES, NOISE = keys.BASE, keys.ADAPTED_STEP, keys.OWN_BONES, keys.NOISE
"""Keys for readers of a result; this module imports the sentences, which need them too."""


class Interval(NamedTuple):
    """Value with its 95 % interval; NaN where unknown."""

    value: float
    low: float
    high: float


POSITIONS = "positions"
"""Measured positions, as the data that confirm a cause."""


@dataclass(frozen=True)
class Cause:
    """Active cause, with the names that it may have."""

    names: tuple[str, ...]
    """Credible set: names that these data cannot distinguish. First the name in the chosen set of causes, whose size is
    given; then the other names, the most probable first."""
    shares: tuple[float, ...]
    """Probability of each name in place of this cause."""
    gain: float
    """Share of the held-out gap of own bones beyond noise that the cause takes away, with its size from other persons;
    NaN where no gap shows the cause."""
    t: float
    """Difference of the gaps, paired by person, in standard errors."""
    tested_on: tuple[str, ...]
    """Data that confirm the cause: "positions" that measured it; "other_motion" and "other_person", held-out postures
    that own bones do not predict; "evidence" for what all persons have in common, though own bones predict as well;
    "angles" for a computed axial rotation."""


@dataclass(frozen=True)
class Verdict:
    """Answer of the diagnosis, and its probabilities."""

    answer: Answer
    causes: tuple[Cause, ...]
    """Named causes, the cause that takes away most of the held-out gap first; then a computed axial rotation."""
    inclusion: dict[str, float]
    """Inclusion probability of every candidate: of being active, alone or with others; the most probable first."""
    probability: dict[str, float]
    """Probability of every candidate, of none, and of unknown (the unexplained share of the gap); sums to 1. Causes
    that are active together have equal parts."""
    not_named: Mapping[str, str] = field(default_factory=dict)
    """Reason against each probable cause that is not named."""

    def inclusion_of(self, name: str) -> float:
        """Look up the inclusion probability of a name; NaN if the name is no candidate."""
        return self.inclusion.get(name, math.nan)

    @property
    def rests_on_positions(self) -> bool:
        """True where measured positions confirm every named cause."""
        return all(cause.tested_on == (POSITIONS,) for cause in self.causes)

    @property
    def names(self) -> tuple[str, ...]:
        """First name of every cause."""
        return tuple(cause.names[0] for cause in self.causes)


_HAS_IT = 0.5
"""Smallest share of the mean size with which a subject counts as having a cause."""


ELEVATION = "elevation"
"""Elevation of the arm, as the quantity that a cause follows."""


@dataclass(frozen=True)
class Extent:
    """Extent of a cause, with its population amplitudes, over the measured postures; as in the size, a cause that
    varies counts from each subject's mean."""

    largest: float
    """Largest strength in any posture, over all directions together."""
    directions: Mapping[str, float]
    """Share of each main direction in the sum of squares, negative where the cause acts the other way."""
    follows: str
    """Bone angle or ELEVATION with which the strength goes most; empty for a constant, or where none explains half of
    it."""


@dataclass(frozen=True)
class CauseAmplitude:
    """Size of a cause: root mean square over the postures of its effect beyond a constant of each subject, over all
    directions together; a constant cause counts in full."""

    effect: str
    """Name of the effect, including its basis."""
    what: str
    """Description of the change by the cause, one line."""
    basis: str
    """Basis of the strength: 'elevation of the arm', 'posture of the bones'; empty for a constant."""
    unit: str
    size: Interval
    typical: float
    """Typical size of such an effect by the same measure, from its prior."""
    directions: dict[str, Interval]
    """Amplitude per direction, in the unit of the effect."""
    amplitude: Amplitude | None
    """Amplitude as an adaptation takes it, rounded to the printed digits; None where no gap shows the size."""
    by_subject: Mapping[str, float] = field(default_factory=dict)
    """Share of the mean size in each subject; where a subject's data do not determine it, the mean is used."""
    extent: Extent | None = None
    """Extent over the postures; None where no gap shows the size."""

    @property
    def option(self) -> str:
        """Write the cause as ``girdle adapt --effect`` takes it; empty without an amplitude."""
        return "" if self.amplitude is None else as_option(self.effect, self.amplitude)

    @property
    def shown_by(self) -> tuple[str, ...]:
        """Subjects with at least half of the mean size, in the same direction."""
        return tuple(name for name, share in self.by_subject.items() if share >= _HAS_IT)

    @property
    def too_large(self) -> bool:
        """True where the size is over twice the typical size: then something else acts like this cause."""
        return self.size.value > 2.0 * self.typical

    @property
    def may_be_0(self) -> bool:
        """True where the interval of the size holds 0."""
        return not self.size.low > 0.0  # also where it is NaN


@dataclass(frozen=True)
class Step:
    """Step of the gap budget: mean absolute gap on held-out motions, degrees."""

    step: str
    """BASE, ADAPTED_STEP, OWN_BONES, the name of an added cause, or NOISE."""
    gap_deg: Interval


BoneGaps = Mapping[str, Interval]
"""Gaps by bone (ALL, then ``motions.table.BONES``), in degrees, with 95 % intervals over persons."""

GapKind = Literal["noise_floor", "base", "adapted", "own_bones", "with_effect"]
"""Gap of noise alone, of the model as it is, adapted, adapted with own bones, and with own bones and the causes."""

GapLevels = Mapping[GapKind, BoneGaps]


@dataclass(frozen=True)
class Gaps:
    """Gaps of ``girdle adapt``, with ``--own-bones``, and with own bones and the causes, in sample and held out."""

    in_sample: GapLevels
    other_postures: GapLevels
    """Gaps on every third posture in turn, adapted to the other postures."""
    other_motion: GapLevels | None
    """Gaps on each motion in turn, adapted to the other motions; None with a single motion."""
    other_person: GapLevels | None
    """Gaps as ``other_motion``, with the amplitudes of the causes from other persons; None with a single person or
    motion."""

    @property
    def hardest(self) -> GapLevels:
        """Gaps with the most data held out."""
        return self.other_person or self.other_motion or self.other_postures

    @property
    def shrinkage(self) -> float:
        """Fraction of the adapted gap in ``hardest`` that own bones and causes take away; NaN where unknown."""
        adapted, with_effect = self.hardest["adapted"][ALL].value, self.hardest["with_effect"][ALL].value
        return (adapted - with_effect) / adapted if adapted else 0.0


@dataclass(frozen=True)
class Noise:
    """SD of one measured angle, and its source."""

    angle_deg: float
    source: str
    """'estimated', 'given' or 'assumed'."""
    freedom: float
    """Degrees of freedom of the estimate."""


@dataclass(frozen=True)
class ParameterMeans:
    """Mean of an adapted parameter over the subjects, mm, without and with the causes."""

    adapted_mm: float
    with_effect_mm: float


TWICE_AS_MANY = "twice as many persons"
POSITIONS_OF = "positions of "
"""Words of a proposal: its end or whole, and its begin."""


@dataclass(frozen=True)
class Proposal:
    """Proposed measurement and its expected benefit."""

    what: str
    between: tuple[str, str]
    """The two names that the measurement is to distinguish."""
    separation_now: float
    separation_then: float
    """Expected log evidence, nats, of the first name over the second: now, and after the measurement."""
    apart_deg: float
    """Root mean square difference of an angle between the two names in these postures: the benefit of knowing."""

    @property
    def kind(self) -> Literal["persons", "motion", "positions"]:
        """Kind of measurement: more persons, one motion of more persons, or positions of landmarks."""
        if self.what.startswith(POSITIONS_OF):
            return "positions"
        return "persons" if self.what == TWICE_AS_MANY else "motion"

    @property
    def probabilities(self) -> tuple[float, float]:
        """Expected probability of the right name, now and after the measurement."""
        return 1.0 / (1.0 + math.exp(-self.separation_now)), 1.0 / (1.0 + math.exp(-self.separation_then))


PositionUse = Literal["use", "check", "ignore"]
"""Use of measured positions of landmarks: as data of the inference, for comparison only, or not at all."""

StateGaps = Mapping[str, float]
"""Root mean square distance over landmarks and postures, mm, by state (``adapt.tables.positions_table``)."""


@dataclass(frozen=True)
class Positions:
    """Comparison of measured with simulated positions of landmarks, with constants of each person."""

    used: bool
    """True where positions were data of the inference."""
    note: str
    """Reason why positions to be used were not, or what contradicts them; or empty."""
    noise_mm: float
    """SD of one coordinate; NaN where unknown."""
    in_sample: StateGaps
    """Distances on fitted postures; NaN without measured positions."""
    other_motion: StateGaps | None
    """Distances on motions held out of adaptation and constants; None with a single motion."""
    other_person: StateGaps | None
    """Distances as ``other_motion``, with the person held out of the sizes of the causes; None with a single person or
    motion."""
    not_told: tuple[str, ...]
    """Landmarks whose place in the bone these positions do not determine."""
    motions: Motions
    """Motions with the measured postures."""
    measured_mm: Mapping[str, Float[np.ndarray, "3 rows"]]
    simulated_mm: Mapping[str, Mapping[str, Float[np.ndarray, "3 rows"]]]
    """Simulated positions by state and landmark."""


def can_test(kinds: Sequence[str], persons: int) -> bool:
    """Check whether a cause can be tested on held-out data: another kind of motion, or another person."""
    return len(kinds) > 1 or persons > 1


@dataclass(frozen=True, repr=False)
class Diagnosis:
    """Diagnosis of the gap of all given subjects by one model."""

    model: str
    subjects: tuple[str, ...]
    left_out: dict[str, str]
    """Subjects with too little data, each with the reason."""
    outliers: tuple[str, ...]
    """Postures left out because of a landmark outlier, one phrase each."""
    persons: int
    """Number of persons; left and right shoulder of one person count once."""
    kinds: tuple[str, ...]
    """Kinds of motion."""
    postures: int
    searched_postures: int
    """Number of postures in the search for causes, which takes only some of a motion with very many."""
    highest_elevation_deg: float
    noise: Noise
    declared_effects: tuple[str, ...]
    """Effects with which the motions are marked."""
    axial_is_computed: bool
    """True where the clavicle's axial rotation is a function of the other angles: an estimate, no measurement."""
    verdict: Verdict
    amplitude: dict[str, CauseAmplitude]
    """Size of each cause, by its first name."""
    landmark_sizes: dict[str, dict[str, Interval]]
    """Sizes by landmarks relative to the set, by candidate and direction; the diagnosis starts from them. Empty without
    landmarks."""
    budget: tuple[Step, ...]
    """Gap budget on held-out motions: model as it is, adapted, own bones, one cause after the other, noise alone."""
    left_over_share: float
    """Share of the adapted gap beyond noise that stays unexplained; NaN where there is no such gap."""
    gaps: Gaps
    parameters: dict[str, ParameterMeans]
    where: Where
    indistinguishable: list[list[str]]
    """Groups of candidates with the same effect on these data, whatever is active."""
    lacking: tuple[str, ...]
    """Measurements that the data lack, whatever is active."""
    next_measurement: list[Proposal]
    """Measurements that would distinguish the names of a cause."""
    positions: Positions

    def __repr__(self) -> str:
        return f"Diagnosis({self.model}, {counted(len(self.subjects), 'subject')}: {answer_text(self.verdict)})"

    def _repr_html_(self) -> str:
        """Return the verdict and the gap budget, degrees, as a notebook shows them."""
        rows = [(step_text(one.step), *map(gap_text, one.gap_deg)) for one in self.budget]
        return notebook_html(sentence(self), ("step", "gap_deg", "low", "high"), rows)

    @property
    def effects(self) -> dict[str, Amplitude]:
        """Amplitudes of all causes whose size a gap shows, as ``adapt_subjects`` takes them."""
        return {one.effect: one.amplitude for one in self.amplitude.values() if one.amplitude is not None}

    @property
    def options(self) -> tuple[str, ...]:
        """Amplitudes as in ``effects``, in the form of ``girdle adapt --effect``."""
        return tuple(as_option(name, amplitude) for name, amplitude in self.effects.items())

    @property
    def goes_further(self) -> bool:
        """True where a named cause has an amplitude, in addition to own bones."""
        return bool(self.effects)

    @property
    def can_test(self) -> bool:
        """True where there is another motion or person, on which a cause can be tested."""
        return can_test(self.kinds, self.persons)


@dataclass(frozen=True)
class Diagnoses:
    """Diagnoses of the same motions by several models."""

    by_model: Mapping[str, Diagnosis]

    @property
    def closest(self) -> Diagnosis:
        """Diagnosis with the smallest held-out gap after adaptation."""
        return min(self.by_model.values(), key=_adapted_gap_deg)


def _adapted_gap_deg(diagnosis: Diagnosis) -> float:
    value = diagnosis.gaps.hardest["adapted"][ALL].value
    return value if math.isfinite(value) else math.inf
