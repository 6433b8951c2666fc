"""The diagnosis: where the gap lies, which causes predict what was not fitted, how far they take it down."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from adapt.api import Adaptations, adapt_with_every_fold
from adapt.diagnosis.adapted_gaps import AdaptedGaps, BaseGaps, adapted_gaps, base_gaps, gaps_of
from adapt.diagnosis.fit.candidates import Hypothesis, candidate_effects
from adapt.diagnosis.fit.noise import ASSUMED, estimate_noise, floor_deg
from adapt.diagnosis.fit.shoulders import Shoulders, sampled, usable
from adapt.diagnosis.inference.amplitude import amplitudes, of_landmarks, unseen_amplitude
from adapt.diagnosis.inference.budget import Rung, alone_deg
from adapt.diagnosis.inference.computed_axial_rotation import ESTIMATE, axial_is_computed
from adapt.diagnosis.inference.intervals import by_bone, interval, known_mean
from adapt.diagnosis.inference.left_over import left_over_share, more_than_noise
from adapt.diagnosis.inference.next_measurement import indistinguishable, lacking, propose
from adapt.diagnosis.inference.search import search_of
from adapt.diagnosis.inference.selection import name_causes, nothing_named
from adapt.diagnosis.inference.weights import Weights, weigh
from adapt.diagnosis.location.observations import observe
from adapt.diagnosis.location.where import Where, locate
from adapt.diagnosis.marks import declared_effects, without_slips
from adapt.diagnosis.position_findings import PositionTask, adapted_with_sizes_of_others, judge_positions
from adapt.diagnosis.result import (
    ADAPTED_STEP,
    ALL,
    BASE,
    EFFECT,
    NOISE,
    NONE,
    THORAX_POINTS,
    UNKNOWN,
    Answer,
    BoneGaps,
    CarriedOver,
    Cause,
    CauseAmplitude,
    Diagnosis,
    GapLevels,
    Gaps,
    Noise,
    ParameterMeans,
    Positions,
    PriorThorax,
    Step,
    Verdict,
    can_test,
)
from adapt.evaluation.held_out import HeldOut
from adapt.tables.folds import MOTION, PERSON, POSTURES
from models.adapted_parameters import ADAPTED
from models.effects import Effect
from models.effects.effect import cause_of
from models.effects.own_effects import check_own_effects
from models.person.family import AnyModel, as_list, unique_sets
from motions.table import Motions, check_motions

Progress = Callable[[str], None]

_LEAST_WORTH = 0.05
"""Share of the unseen gap beyond noise that down-weighting the prior thorax points takes away where that is listed
without a cause."""


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
    """Diagnose the gap of all subjects together, with every model on its own; by name of the model.

    ``noise_deg`` is the SD of one measured angle; without it, it is estimated. ``effects``: the candidates; by default
    all that are listed and the doubtful numbers of each model. Postures that are marked with a slip are left out.
    ``adaptations``: of these models to these motions (``adapt.api.adapt_with_every_fold``), where they are known; they
    are computed anew where a posture is left out.
    ``positions``: of landmarks, in the motions. "use" is "check" so far: the constants of each person are fitted to
    them, and the distances that are left are reported; sizes of bones that they measure are taken into the search.
    "check": the search does not see them. "ignore": motions without them. ``position_noise_mm``: the SD of one
    coordinate; without it, it is estimated.
    Raises InputError where ``motions`` are none or no subject has enough postures, ValueError for an effect of one's
    own that does nothing, or something at amplitude 0.
    """
    check_motions(motions)
    models = as_list(models)
    clean, slips = without_slips(motions)
    every, left_out = usable(clean)
    for one in unique_sets(models, every.subjects)[0]:
        check_own_effects(effects or (), one.girdle)
    task = PositionTask.of(every.motions, positions, position_noise_mm)
    every = replace(every, motions=task.seen)
    declared = declared_effects(clean)
    computed = axial_is_computed(every)
    if adaptations is None or len(every.motions.posture) < len(motions.posture):
        adaptations = adapt_with_every_fold(every.motions, models, progress=progress)
    with threadpool_limits(1, "blas"):  # of small matrices, more threads wait for each other longer than they work
        return {
            model.name: _Study(
                model,
                every,
                adaptations,
                candidate_effects(model, every.subjects) if effects is None else tuple(effects),
                computed,
                task,
                lambda stage, name=model.name: progress(f"{name}: {stage}"),
            ).diagnose(left_out, slips, declared, noise_deg)
            for model in models
        }


class _Study:
    """One model and the subjects: the steps of its diagnosis share the search."""

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
        self.search = search_of(model, self.shoulders, effects, known, progress)
        self.person = dict(zip(self.shoulders.subjects, self.shoulders.person.tolist(), strict=True))

    def diagnose(
        self,
        left_out: dict[str, str],
        slips: tuple[str, ...],
        declared: tuple[str, ...],
        noise_deg: float | None,
    ) -> Diagnosis:
        """Search, weigh, name, and measure what the names are worth."""
        search, shoulders = self.search.run(), self.shoulders
        candidates = search.joint.candidates
        none = search.without_causes
        noise = estimate_noise(shoulders, search.best.posterior.y, noise_deg)
        floor = floor_deg(noise, shoulders, none.B)
        tested = can_test(shoulders.kinds, shoulders.persons)
        named = name_causes(search, float(np.nanmean(floor))) if tested else nothing_named(search)
        weights = weigh(search)  # of all that was fitted on the way
        sizes = amplitudes(search, named.hypothesis)
        order = [rung.added for rung in named.rungs[1:]]
        sizes = {name: sizes[name] for name in order}
        self.progress("gaps of girdle adapt")
        plain = self.plain.of(self.model.name)
        base = base_gaps(self.motions, self.plain.before[self.model.name], plain.held_out.folds, self.person)
        adapted = gaps_of(plain, self.person)
        with_causes = self._with_causes(sizes) if sizes or self.has_prior_thorax else adapted
        gaps = self._gaps(base, adapted, with_causes, named.rungs, floor)
        worth = 1.0 - _left_over(gaps) >= _LEAST_WORTH  # False where there is no gap beyond noise
        if not order and not worth:
            with_causes = adapted
            gaps = self._gaps(base, adapted, adapted, named.rungs, floor)
        budget = self._budget(gaps, named.rungs)
        causes = [Cause(*named.sets[name], named.gains[name].share, named.gains[name].t) for name in order]
        verdict = self._verdict(causes, weights, gaps, noise)
        prior_thorax = self._prior_thorax(budget) if self.has_prior_thorax and (order or worth) else None
        return Diagnosis(
            model=self.model.name,
            subjects=shoulders.subjects,
            left_out=left_out,
            slips=slips,
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
            prior_thorax=prior_thorax,
            landmark_sizes={name: of_landmarks(candidates.effect(name), one) for name, one in candidates.sizes.items()},
            budget=budget,
            alone_deg=alone_deg(search),
            left_over_share=_left_over(gaps),
            gaps=gaps,
            carried_over=self._carried_over(named.rungs) if gaps.other_person else None,
            parameters=_changes(adapted, with_causes),
            where=self._where(adapted, with_causes, floor, noise),
            indistinguishable=indistinguishable(none),
            lacking=lacking(len(shoulders.kinds), shoulders.persons, prior_thorax is not None),
            next_measurement=propose(search, named.chosen, [named.sets[name].names for name in order]),
            positions=self._positions(adapted, with_causes, named.hypothesis if order else ()),
        )

    def _with_causes(self, sizes: Mapping[str, CauseAmplitude]) -> AdaptedGaps:
        known = {name: one.amplitude for name, one in sizes.items() if one.amplitude is not None}
        downweighting = self.search.joint.model.thorax_downweighting
        return adapted_gaps(self.motions, self.model, known, self.person, self.library, downweighting)

    def _positions(self, adapted: AdaptedGaps, with_causes: AdaptedGaps, named: Hypothesis) -> Positions:
        """Hold simulated positions against measured ones."""
        downweighting = self.search.joint.model.thorax_downweighting

        def of_others() -> HeldOut | None:
            with_sizes = self.search, named, self.motions, self.model, self.library
            return adapted_with_sizes_of_others(*with_sizes, downweighting)

        before = self.plain.before[self.model.name]
        return judge_positions(self.task, self.model, before, adapted, with_causes, of_others)

    def _where(self, adapted: AdaptedGaps, with_causes: AdaptedGaps, floor, noise: Noise) -> Where:
        """Locate the gap; ``floor`` is what noise leaves of it, on average, in each posture of the search."""
        noise_deg2 = np.nan_to_num(floor[self.nearest].T[:, adapted.rows.place]) ** 2 * (np.pi / 2.0)
        data, chains = observe(self.motions, adapted.rows), (adapted.chain, with_causes.chain)
        return locate(data, adapted.adapted.angles, noise_deg2, chains, noise.angle_deg)

    @property
    def has_prior_thorax(self) -> bool:
        """Whether the points on the thorax are another person's, and down-weighted."""
        return self.search.joint.model.thorax_downweighting > 1.0

    def _prior_thorax(self, budget: tuple[Step, ...]) -> PriorThorax:
        level = {step.step: step.gap_deg.value for step in budget}
        beyond = level[ADAPTED_STEP] - level[NOISE]
        gain = (level[ADAPTED_STEP] - level[THORAX_POINTS]) / beyond if beyond > 0 else np.nan
        return PriorThorax(self.search.joint.model.thorax_downweighting, gain)

    def _amplitude(self, verdict: Verdict, sizes: dict[str, CauseAmplitude]) -> dict[str, CauseAmplitude]:
        """Sizes by the first name of each cause; one that no gap shows has none."""
        found = {cause.names[0]: one for cause, one in zip(verdict.causes, sizes.values(), strict=False)}
        for cause in verdict.causes[len(sizes) :]:
            effect = self.search.joint.candidates.effect(cause.names[0])
            found[effect.name] = unseen_amplitude(effect)
        return found

    def _verdict(self, causes: list[Cause], weights: Weights, gaps: Gaps, noise: Noise) -> Verdict:
        answer = self._answer(causes, gaps, noise)
        for name in self.search.known:
            if not any(cause.names[0] == name for cause in causes):
                causes.append(Cause((name,), (1.0,), 0.0, np.nan))
        probability = _probability(weights, weights.inclusion, answer, _left_over(gaps))
        return Verdict(answer, tuple(causes), weights.inclusion, probability)

    def _answer(self, causes: list[Cause], gaps: Gaps, noise: Noise) -> Answer:
        """Noise that was assumed shows nothing that is larger."""
        if causes:
            return EFFECT
        left = gaps.hardest["with_effect"][ALL].value
        shown = noise.source != ASSUMED or left <= gaps.hardest["noise_floor"][ALL].value
        beyond = more_than_noise(self.search.without_causes.y, self.search.folds, noise)
        return NONE if shown and not beyond else UNKNOWN

    def _gaps(self, base: BaseGaps, adapted: AdaptedGaps, with_effect: AdaptedGaps, rungs: list[Rung], floor) -> Gaps:
        """The four levels of each kind of gap."""
        folds, person = self.search.folds, self.shoulders.person
        of_subject = np.array([known_mean(floor[self.shoulders.rows_of(s)].T) for s in range(len(person))])
        noise_floor = by_bone(of_subject, person)

        def levels(kind: str) -> GapLevels | None:
            if kind not in base.unseen:
                return None
            return _levels(noise_floor, base.unseen[kind], adapted.unseen[kind], with_effect.unseen[kind])

        other_motion = levels(MOTION)
        other_person = None
        if PERSON in folds.kinds and other_motion:
            chosen = folds.of_kind(PERSON)
            unseen = by_bone(rungs[-1].gaps_deg[chosen], person[folds.subject])
            with_causes = unseen if len(rungs) > 1 else other_motion["with_effect"]
            other_person = _levels(noise_floor, other_motion["base"], other_motion["adapted"], with_causes)
        in_sample = _levels(noise_floor, base.in_sample, adapted.in_sample, with_effect.in_sample)
        return Gaps(in_sample, levels(POSTURES) or in_sample, other_motion, other_person)

    def _carried_over(self, rungs: list[Rung]) -> CarriedOver | None:
        """Predict persons who were not seen with the sizes of the others as they are."""
        folds, person, search = self.search.folds, self.shoulders.person, self.search
        if len(rungs) == 1:
            return None
        chosen, named = folds.of_kind(PERSON), rungs[-1].hypothesis
        every = rungs[0].gaps_deg[chosen], search.unseen_gaps_deg(named, own_sizes=False), rungs[-1].gaps_deg[chosen]
        return CarriedOver(*(by_bone(one, person[folds.subject]) for one in every))

    def _budget(self, gaps: Gaps, rungs: list[Rung]) -> tuple[Step, ...]:
        folds, person = self.search.folds, self.shoulders.person
        seen = gaps.other_motion or gaps.unseen
        steps = [Step(BASE, seen["base"][ALL]), Step(ADAPTED_STEP, seen["adapted"][ALL])]
        chosen = folds.of_kind(MOTION)
        for rung in rungs if self.has_prior_thorax else rungs[1:]:
            gap = interval(known_mean(rung.gaps_deg[chosen]), person[folds.subject])
            steps.append(Step(cause_of(rung.added) or THORAX_POINTS, gap))
        return (*steps, Step(NOISE, seen["noise_floor"][ALL]))


def _left_over(gaps: Gaps) -> float:
    levels = gaps.hardest
    return left_over_share(*(levels[kind][ALL].value for kind in ("adapted", "with_effect", "noise_floor")))


def _levels(noise_floor: BoneGaps, base: BoneGaps, adapted: BoneGaps, with_effect: BoneGaps) -> GapLevels:
    return {"noise_floor": noise_floor, "base": base, "adapted": adapted, "with_effect": with_effect}


def _probability(weights: Weights, inclusion: dict[str, float], answer: str, over: float) -> dict[str, float]:
    """Share the probability of each set of causes between its causes; what is left over goes to unknown."""
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
