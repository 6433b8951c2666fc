"""The diagnosis: location of the gap, causes that predict held-out data, and the gap with these causes."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from adapt.api import Adaptations, adapt_with_every_fold
from adapt.diagnosis.adapted_gaps import AdaptedGaps, BaseGaps, base_gaps, gaps_of
from adapt.diagnosis.beyond_own_bones import BudgetStep, OwnBonesNull
from adapt.diagnosis.fit.candidates import candidate_effects
from adapt.diagnosis.fit.noise import ASSUMED, estimate_noise, floor_deg
from adapt.diagnosis.fit.shoulders import Shoulders, sampled, usable
from adapt.diagnosis.inference.alternatives import with_what_does_as_well
from adapt.diagnosis.inference.amplitude import amplitude_without_size, amplitudes, of_landmarks
from adapt.diagnosis.inference.computed_axial_rotation import ESTIMATE, axial_is_computed
from adapt.diagnosis.inference.intervals import by_bone, interval, known_mean
from adapt.diagnosis.inference.next_measurement import indistinguishable, lacking, propose
from adapt.diagnosis.inference.not_named import CONTRADICTED, UNEXPLAINED, why_not_named
from adapt.diagnosis.inference.search import search_of
from adapt.diagnosis.inference.selection import (
    REJECTED,
    contradiction_deg,
    name_causes,
    nothing_named,
    probable,
    standing,
)
from adapt.diagnosis.inference.unexplained import more_than_noise, unexplained_share
from adapt.diagnosis.inference.weights import Weights, weigh
from adapt.diagnosis.location.observations import observe
from adapt.diagnosis.location.where import Where, locate
from adapt.diagnosis.marks import declared_effects, without_outliers
from adapt.diagnosis.position_findings import PositionTask, judge_positions
from adapt.diagnosis.result import (
    ADAPTED_STEP,
    ALL,
    BASE,
    EFFECT,
    NOISE,
    NONE,
    OWN_BONES,
    UNKNOWN,
    Answer,
    BoneGaps,
    Cause,
    CauseAmplitude,
    Diagnosis,
    GapLevels,
    Gaps,
    Noise,
    ParameterMeans,
    Step,
    Verdict,
    can_test,
)
from adapt.tables.folds import MOTION, PERSON, POSTURES
from models.adapted_parameters import ADAPTED
from models.effects import Effect
from models.effects.effect import cause_of
from models.effects.own_effects import check_own_effects
from models.person.family import AnyModel, as_list, unique_sets
from motions.motion_csv.typed_motions import check_motions
from motions.table import Motions

Progress = Callable[[str], None]


def diagnose(
    motions: Motions,
    models: AnyModel | Sequence[AnyModel],
    noise_deg: float | None = None,
    effects: Sequence[Effect] | None = None,
    progress: Progress = lambda _: None,
    adaptations: Adaptations | None = None,
    positions: str = "use",
    position_noise_mm: float | None = None,
) -> dict[str, Diagnosis]:
    """Diagnose the gap of all subjects together, with each model separately; return the diagnoses by model name.

    Postures that are marked with a landmark outlier are left out.

    ``noise_deg``: SD of one measured angle; by default it is estimated. ``effects``: the candidates; by default all
    listed effects and the doubtful numbers of each model. ``adaptations``: known adaptations of these models to these
    motions (``adapt.api.adapt_with_every_fold``); they are recomputed if a posture is left out.
    ``positions``: use of landmark positions in the motions. "use": positions are data of the search, as angles are, and
    determine the sizes in each person of the causes that they show. "check": the search does not use positions; the
    constants of each person are fitted to them, and the remaining distances are reported. "ignore": as if the motions
    had no positions. ``position_noise_mm``: SD of one coordinate; by default it is estimated.

    Raises InputError if ``motions`` has no postures or no subject has enough of them. Raises ValueError if there is no
    candidate, or a user-defined effect changes nothing or does not vanish at amplitude 0.
    """
    motions = check_motions(motions)
    if effects is not None and not effects:
        raise ValueError("effects: give one candidate or more")
    models = as_list(models)
    clean, outliers = without_outliers(motions)
    every, left_out = usable(clean)
    for one in unique_sets(models, every.subjects)[0]:
        check_own_effects(effects or (), one.girdle)
    task = PositionTask.of(every.motions, positions, position_noise_mm)
    every = replace(every, motions=task.seen)
    declared = declared_effects(clean)
    computed = axial_is_computed(every)
    if adaptations is None or len(every.motions.posture) < len(motions.posture):
        adaptations = adapt_with_every_fold(every.motions, models, progress=progress)
    with threadpool_limits(1, "blas"):  # matrices are small: threads would mostly wait
        return {
            model.name: _Study(
                model,
                every,
                adaptations,
                candidate_effects(model, every.subjects) if effects is None else tuple(effects),
                computed,
                task,
                lambda stage, name=model.name: progress(f"{name}: {stage}"),
            ).diagnose(left_out, outliers, declared, noise_deg)
            for model in models
        }


class _Study:
    """Diagnosis by one model, whose steps share the search."""

    def __init__(
        self,
        model: AnyModel,
        every: Shoulders,
        plain: Adaptations,
        effects: tuple[Effect, ...],
        computed: bool,
        task: PositionTask,
        progress: Progress,
    ):
        self.plain, self.task = plain, task
        self.model, self.motions, self.computed, self.progress = model, every.motions, computed, progress
        self.shoulders, self.nearest = sampled(every)
        self.library = {one.name: one for one in effects}  # the caller's own among them
        known = tuple(name for name in self.library if name == ESTIMATE and computed)
        self.search = search_of(model, self.shoulders, effects, known, task.searched_sd_mm, bool(task.note), progress)
        self.person = dict(zip(self.shoulders.subjects, self.shoulders.person.tolist(), strict=True))

    def diagnose(
        self,
        left_out: dict[str, str],
        outliers: tuple[str, ...],
        declared: tuple[str, ...],
        noise_deg: float | None,
    ) -> Diagnosis:
        """Search sets of causes, weigh and name them, and test the named causes against own bones."""
        search, shoulders = self.search.run(), self.shoulders
        candidates = search.joint.candidates
        none = search.without_causes
        noise = estimate_noise(shoulders, search.best.posterior.y, noise_deg)
        floor = floor_deg(noise, shoulders, none.B)
        mean_floor = float(np.nanmean(floor))
        tested = can_test(shoulders.kinds, shoulders.persons)
        named = name_causes(search) if tested else nothing_named(search)
        weights = weigh(search)  # of all sets fitted so far
        self.progress("own bones")
        other = named.hypothesis
        null = OwnBonesNull(search, self.model, self.motions, self.library, self.person, seen=named.seen)
        own_bones = null.adapted()
        kept = probable(null.beyond(other, mean_floor), weights.inclusion, candidates.causes)
        off_deg = contradiction_deg(search)
        doubt = CONTRADICTED if off_deg else UNEXPLAINED if weights.unexplained >= REJECTED else ""
        if doubt:
            stand = standing(search, kept, named.seen, weights.inclusion, contradicted=off_deg > 0.0)
            kept = null.tested(stand, other, mean_floor)
        weights = weights.beyond(null.probability_beyond(kept, other, mean_floor), null.is_held)
        of_causes = null.budget(kept, other)
        gains = null.gains(of_causes, other, mean_floor)
        order = [step.added for step in of_causes[1:]]
        sizes = amplitudes(search, kept, named.seen)
        sizes = {name: sizes[name] for name in order}
        known = {name: one.amplitude for name, one in sizes.items() if one.amplitude is not None}
        with_causes = null.adapted(known) if known else own_bones
        self.progress("gaps of girdle adapt")
        plain = self.plain.of(self.model.name)
        base = base_gaps(self.motions, self.plain.before[self.model.name], plain.held_out.folds, self.person)
        adapted = gaps_of(plain, self.person)
        gaps = self._gaps((base, adapted, own_bones, with_causes), null, of_causes, floor)
        budget = self._budget(gaps, null, of_causes)
        sets = {name: named.sets[name] for name in order}
        sets = with_what_does_as_well(sets, candidates.causes, self.task.only_angles)
        causes = [
            Cause(*sets[name], gains[name].share, gains[name].t, null.tested_on(name, kept, other, mean_floor))
            for name in order
        ]
        constants = tuple(filter(null.is_constant, other))
        against = why_not_named(weights.inclusion, candidates.causes, other, kept, constants, doubt, search.known)
        answer = EFFECT if causes else UNKNOWN if doubt else self._without_cause(gaps, null, noise, tested)
        verdict = self._verdict(answer, causes, weights, gaps, against)
        others = null.held_out(kept, other) if gaps.other_person else None
        before, used = self.plain.before[self.model.name], search.joint.positions is not None
        return Diagnosis(
            model=self.model.name,
            subjects=shoulders.subjects,
            left_out=left_out,
            outliers=outliers,
            persons=shoulders.persons,
            kinds=shoulders.kinds,
            postures=len(self.motions.posture),
            searched_postures=len(shoulders.subject),
            highest_elevation_deg=float(np.nan_to_num(self.motions.humerus_elevation_deg).max()),
            noise=noise,
            declared_effects=declared,
            axial_is_computed=self.computed,
            verdict=verdict,
            amplitude=self._amplitude(verdict, sizes),
            landmark_sizes={name: of_landmarks(candidates.effect(name), one) for name, one in candidates.sizes.items()},
            budget=budget,
            left_over_share=_unexplained(gaps),
            gaps=gaps,
            parameters=_changes(adapted, with_causes),
            where=self._where(adapted, with_causes, floor, noise),
            indistinguishable=indistinguishable(none),
            lacking=lacking(len(shoulders.kinds), shoulders.persons),
            next_measurement=propose(search, self.model, named.chosen, [sets[name].names for name in order]),
            positions=judge_positions(self.task, self.model, before, adapted, with_causes, others, used, off_deg),
        )

    def _where(self, adapted: AdaptedGaps, with_causes: AdaptedGaps, floor, noise: Noise) -> Where:
        """Locate the gap; ``floor`` is the mean gap of noise alone in each posture of the search."""
        noise_deg2 = np.nan_to_num(floor[self.nearest].T[:, adapted.rows.place]) ** 2 * (np.pi / 2.0)
        data, chains = observe(self.motions, adapted.rows), (adapted.chain, with_causes.chain)
        return locate(data, adapted.adapted.angles, noise_deg2, chains, noise.angle_deg)

    def _amplitude(self, verdict: Verdict, sizes: dict[str, CauseAmplitude]) -> dict[str, CauseAmplitude]:
        """Return the sizes by the first name of each cause; a cause that no gap shows has no size."""
        found = {cause.names[0]: one for cause, one in zip(verdict.causes, sizes.values(), strict=False)}
        for cause in verdict.causes[len(sizes) :]:
            effect = self.search.joint.candidates.effect(cause.names[0])
            found[effect.name] = amplitude_without_size(effect)
        return found

    def _verdict(
        self, answer: Answer, causes: list[Cause], weights: Weights, gaps: Gaps, against: dict[str, str]
    ) -> Verdict:
        """Assemble the verdict."""
        for name in self.search.known:
            if not any(cause.names[0] == name for cause in causes):
                causes.append(Cause((name,), (1.0,), 0.0, np.nan, ("angles",)))
        probability = _probability(weights, weights.inclusion, answer, _unexplained(gaps))
        against = {name: why for name, why in against.items() if name not in self.search.known}
        return Verdict(answer, tuple(causes), weights.inclusion, probability, against)

    def _without_cause(self, gaps: Gaps, null: OwnBonesNull, noise: Noise, tested: bool) -> Answer:
        """Choose the answer without a cause.

        If the noise is only assumed, a gap above the noise floor gives unknown, never none. Where nothing can be
        ``tested``, own bones explain nothing: one person's could take any shape of one motion.
        """
        within = gaps.hardest["adapted"][ALL].value <= gaps.hardest["noise_floor"][ALL].value
        beyond = more_than_noise(*null.misfit(noise.angle_deg, own_bones=tested), noise)
        return NONE if (noise.source != ASSUMED or within) and not beyond else UNKNOWN

    def _gaps(
        self,
        found: tuple[BaseGaps, AdaptedGaps, AdaptedGaps, AdaptedGaps],
        null: OwnBonesNull,
        of_causes: list[BudgetStep],
        floor,
    ) -> Gaps:
        """Collect each kind of gap for the model as it is, adapted, with own bones, and with the causes."""
        person = self.shoulders.person
        of_subject = np.array([known_mean(floor[self.shoulders.rows_of(s)].T) for s in range(len(person))])
        noise_floor = by_bone(of_subject, person)

        def levels(kind: str) -> GapLevels | None:
            return _levels(noise_floor, *(one.held_out[kind] for one in found)) if kind in found[0].held_out else None

        other_motion = levels(MOTION)
        other_person: GapLevels | None = None
        if null.folds[0].kind == PERSON and other_motion:
            with_effect = by_bone(of_causes[-1].gaps_deg, null.persons)
            other_person = {**other_motion, "with_effect": with_effect}
        in_sample = _levels(noise_floor, *(one.in_sample for one in found))
        return Gaps(in_sample, levels(POSTURES) or in_sample, other_motion, other_person)

    def _budget(self, gaps: Gaps, null: OwnBonesNull, of_causes: list[BudgetStep]) -> tuple[Step, ...]:
        seen = gaps.other_motion or gaps.other_postures
        steps = [Step(BASE, seen["base"][ALL]), Step(ADAPTED_STEP, seen["adapted"][ALL])]
        steps.append(Step(OWN_BONES, seen["own_bones"][ALL]))
        for one in of_causes[1:]:
            steps.append(Step(cause_of(one.added), interval(known_mean(one.gaps_deg), null.persons)))
        return (*steps, Step(NOISE, seen["noise_floor"][ALL]))


def _unexplained(gaps: Gaps) -> float:
    levels = gaps.hardest
    return unexplained_share(*(levels[kind][ALL].value for kind in ("adapted", "with_effect", "noise_floor")))


def _levels(
    noise_floor: BoneGaps, base: BoneGaps, adapted: BoneGaps, own_bones: BoneGaps, with_effect: BoneGaps
) -> GapLevels:
    return {
        "noise_floor": noise_floor,
        "base": base,
        "adapted": adapted,
        "own_bones": own_bones,
        "with_effect": with_effect,
    }


def _probability(weights: Weights, inclusion: dict[str, float], answer: str, over: float) -> dict[str, float]:
    """Divide the probability of each set equally between its causes, and give the unexplained share to unknown."""
    found = dict.fromkeys(inclusion, 0.0)
    none = 0.0
    for hypothesis, p in weights.probability.items():
        names = {weights.cause[name] for name in hypothesis}
        none += 0.0 if names else p
        for name in names:
            found[name] += p / len(names)
    unknown = 1.0 if answer == UNKNOWN else 0.0 if answer == NONE or not np.isfinite(over) else over
    if answer == NONE:
        none = max(none, 0.5)
    total = sum(found.values()) + none
    found = {name: p * (1.0 - unknown) / total for name, p in found.items()}
    return found | {NONE: none * (1.0 - unknown) / total, UNKNOWN: unknown}


def _changes(adapted: AdaptedGaps, with_causes: AdaptedGaps) -> dict[str, ParameterMeans]:
    pairs = zip(ADAPTED, adapted.adapted.theta_mm.mean(axis=1), with_causes.adapted.theta_mm.mean(axis=1), strict=True)
    return {name: ParameterMeans(float(a), float(b)) for name, a, b in pairs}
