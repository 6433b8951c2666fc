"""Comparison with measured positions: gaps in mm of the model as it is, adapted, and with the causes."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from adapt.diagnosis.adapted_gaps import AdaptedGaps
from adapt.diagnosis.fit.noise import FEWEST, variances
from adapt.diagnosis.fit.positions.position_rows import PALPATED_MM
from adapt.diagnosis.fit.shoulders import shoulders_of
from adapt.diagnosis.marks import angles_are_of_landmarks
from adapt.diagnosis.result import Positions, PositionUse
from adapt.evaluation.held_out import HeldOut
from adapt.evaluation.person_constants import Chains
from adapt.evaluation.position_check import (
    Judge,
    adapted_to_all,
    adapted_to_folds,
    as_they_are,
    in_folds,
    of_motions,
)
from adapt.solvers.rows import posture_rows
from adapt.solvers.solution import PostureSolution
from adapt.tables.positions_table import ADAPTED, BASE, WITH_CAUSES
from models.person.family import AnyModel
from models.person.positions.landmark_positions import POSITIONS
from motions.errors import InputError, did_you_mean
from motions.landmarks.sampled_postures import measured_places_mm
from motions.table import Motions

USES: tuple[PositionUse, ...] = ("use", "check", "ignore")

LEAST_MM, MOST_MM = 0.01, 30.0
"""Limits of the noise of a position; values beyond are mistyped. The lower limit is the rounding of a file; with more
noise than the upper limit a landmark could be anywhere."""

_CONTRADICTED = (
    "angles and landmarks contradict each other by {:.1f} deg along the motions: check the signs, "
    "factors and columns of the angles, and what carries the landmarks"
)

_SAME_ERRORS = (
    "the angles were computed from these landmarks and have the same errors: of the positions, the path of SC and the "
    "length of the clavicle are data, and the rest is held against the diagnosis"
)


@dataclass(frozen=True)
class PositionTask:
    """Use of the positions in these motions."""

    way: PositionUse
    motions: Motions
    """Motions of the diagnosis, with the positions for the comparison."""
    given_mm: float | None = None
    """SD of one coordinate as given by the user."""

    @staticmethod
    def of(motions: Motions, way: str, noise_mm: float | None) -> "PositionTask":
        """Check the arguments; raise InputError for invalid ones, and for those that need positions without any."""
        chosen = check_use(way, noise_mm)
        check_there(motions, way, noise_mm)
        return PositionTask(chosen, without_positions(motions) if chosen == "ignore" else motions, noise_mm)

    @property
    def seen(self) -> Motions:
        """Motions as the search uses them."""
        return self.motions if self.way == "use" else without_positions(self.motions)

    @cached_property
    def coordinate_sd_mm(self) -> float:
        """SD of one measured coordinate: given, estimated, or NaN."""
        return self.given_mm or position_noise_mm(self.motions)

    @property
    def searched_sd_mm(self) -> float | None:
        """SD of a coordinate for the search; None where positions are no data of the search."""
        if self.way != "use" or self.only_angles:
            return None
        return self.coordinate_sd_mm if np.isfinite(self.coordinate_sd_mm) else PALPATED_MM

    @property
    def only_angles(self) -> bool:
        """True where the search uses no position of a joint."""
        return not {"SC", "AC", "AA"} & set(self.seen.landmarks_mm)

    @property
    def note(self) -> str:
        """Reason why some of the positions to be used are not; empty otherwise."""
        both = self.way == "use" and bool(self.motions.landmarks_mm) and angles_are_of_landmarks(self.motions)
        return _SAME_ERRORS if both else ""


def check_there(motions: Motions, way: str, noise_mm: float | None) -> None:
    """Raise InputError where positions are to be checked, or have a given noise, and none was measured."""
    if way != "check" and noise_mm is None:
        return
    measured = (place for name, place in measured_places_mm(motions).items() if name in POSITIONS)
    if not any(np.isfinite(place).any() for place in measured):
        option = "--positions check" if way == "check" else "--position-noise-mm"
        cause = f"the motions have no position of {', '.join(POSITIONS)}"
        raise InputError(option, None, cause, f"Leave {option} out, or add their columns")


def check_use(way: str, noise_mm: float | None) -> PositionUse:
    """Check ``way`` and the noise; raise InputError for words not in USES, impossible noise, and noise of positions
    that are ignored."""
    if noise_mm is not None and not LEAST_MM <= noise_mm <= MOST_MM:
        cause = f"{noise_mm:g} is not between {LEAST_MM:g} and {MOST_MM:g} mm"
        remedy = "Give the SD of one coordinate in mm, or leave it to be estimated"
        raise InputError("--position-noise-mm", None, cause, remedy)
    if way == "ignore" and noise_mm is not None:
        cause = "--positions ignore takes the positions, whose noise is given, out"
        raise InputError("--position-noise-mm", None, cause, "Leave one of the two out")
    for one in USES:
        if one == way:
            return one
    cause, remedy = f"there is no '{way}'", f"{did_you_mean(way, USES)}Use one of {', '.join(USES)}"
    raise InputError("--positions", None, cause, remedy)


def without_positions(motions: Motions) -> Motions:
    """Remove the positions of landmarks from the motions."""
    return replace(motions, landmarks_mm={})


def judge_positions(
    task: PositionTask,
    model: AnyModel,
    before: PostureSolution,
    adapted: AdaptedGaps,
    with_causes: AdaptedGaps,
    others: HeldOut | None,
    used: bool,
    off_deg: float,
) -> Positions:
    """Compare simulated with measured positions, in sample and on motions held out of adaptations and constants.

    ``others``: adaptations with the person also held out of the sizes of causes; None with a single person or motion.
    ``used``: whether positions were data of the search. ``off_deg``: amount by which angles contradict the
    landmarks; 0 without contradiction.
    """
    rows = posture_rows(task.motions)
    judge = Judge.of(model, rows)
    base = as_they_are(model, rows, before)
    chains = {BASE: base, ADAPTED: adapted_to_all(adapted.found), WITH_CAUSES: adapted_to_all(with_causes.found)}
    other_motion, other_person = _held_out(judge, base, adapted, with_causes, others)
    return Positions(
        used=used,
        note="; ".join(filter(None, [task.note, _CONTRADICTED.format(off_deg) if off_deg else ""])),
        noise_mm=task.coordinate_sd_mm,
        in_sample={state: judge.gap_mm(one) for state, one in chains.items()},
        other_motion=other_motion,
        other_person=other_person,
        not_told=judge.not_told(chains[ADAPTED]) if judge.measured_mm else (),
        motions=task.motions,
        measured_mm=judge.measured_mm,
        simulated_mm={state: judge.simulated_mm(one) for state, one in chains.items()},
    )


def _held_out(
    judge: Judge,
    base: Chains,
    adapted: AdaptedGaps,
    with_causes: AdaptedGaps,
    others: HeldOut | None,
) -> tuple[dict[str, float] | None, dict[str, float] | None]:
    """Compute the gaps of other motions, and of other persons."""
    plain, named = of_motions(adapted.found.held_out), of_motions(with_causes.found.held_out)
    if not plain.folds or not judge.measured_mm:
        return None, None
    motion = {
        BASE: judge.gap_mm(in_folds(base, plain.folds), plain.folds),
        ADAPTED: judge.gap_mm(adapted_to_folds(adapted.found.rows, plain), plain.folds),
        WITH_CAUSES: judge.gap_mm(adapted_to_folds(with_causes.found.rows, named), named.folds),
    }
    if others is None:
        return motion, None
    return motion, motion | {WITH_CAUSES: judge.gap_mm(adapted_to_folds(adapted.found.rows, others), others.folds)}


def position_noise_mm(motions: Motions) -> float:
    """Estimate the SD of one measured coordinate from deviations from a smooth path of the landmark.

    The estimate is at least ``LEAST_MM``, because computed positions have no noise. NaN with too few postures.
    """
    places = [place for name, place in measured_places_mm(motions).items() if name in POSITIONS]
    every = variances(shoulders_of(motions), np.concatenate([np.zeros((0, len(motions.posture))), *places]).T)
    known = every[np.isfinite(every)]
    return max(LEAST_MM, float(np.sqrt(known.mean()))) if len(known) >= FEWEST else float("nan")
