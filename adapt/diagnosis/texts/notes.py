"""What the numbers of a diagnosis rest on, a sentence each."""

import math
from collections.abc import Collection, Sequence

from adapt.diagnosis.fit.joint_fit import THORAX_DOWNWEIGHTING
from adapt.diagnosis.fit.shoulders import MOST_POSTURES
from adapt.diagnosis.result import ALL, THORAX_OPTION, THORAX_POINTS, Diagnosis, Noise
from adapt.diagnosis.texts.wording import DOWN_WEIGHTED, gap_text, listed, unseen_text
from models.effects.amplitudes import OPTION


def notes(diagnosis: Diagnosis) -> list[str]:
    """Say what the numbers of a diagnosis rest on, what they do not say, and how to adapt with the causes."""
    candidates = set(diagnosis.verdict.inclusion)
    too_large = [name for name, one in diagnosis.amplitude.items() if one.too_large]
    return [
        f"Parameter set {diagnosis.model}.",
        _noise(diagnosis.noise),
        *(f"The motion file says of its angles that {name} is at work." for name in diagnosis.declared_effects),
        *([_AXIAL] if diagnosis.axial_is_computed else []),
        *_landmark_sizes(diagnosis),
        *_limits(diagnosis),
        *_sampled(diagnosis),
        *_thorax(diagnosis),
        *_carried_over(diagnosis),
        *(f"{name}: larger than such an effect is: something that acts like it." for name in too_large),
        *(_indistinguishable(names, candidates) for names in diagnosis.indistinguishable),
        *(f"Left out: {subject}: {why}." for subject, why in diagnosis.left_out.items()),
        *(f"Left out: {slip}." for slip in diagnosis.slips),
        *([_how_to_adapt(diagnosis)] if diagnosis.goes_further else []),
    ]


def _thorax(diagnosis: Diagnosis) -> list[str]:
    """What another person's points on the thorax do; nothing of the person's own."""
    gaps_deg = [step.gap_deg.value for step in diagnosis.budget if step.step == THORAX_POINTS]
    if not gaps_deg:
        return []
    count_less = f"with {THORAX_OPTION} {THORAX_DOWNWEIGHTING:g} they count 1/{THORAX_DOWNWEIGHTING:g}"
    return [
        f"The points on the thorax are prior, another person's: {count_less}, and the gap on "
        f"{unseen_text(diagnosis.gaps)} is {gap_text(gaps_deg[0])} deg. Better measure the person's own (girdle model "
        "--points)."
    ]


def _carried_over(diagnosis: Diagnosis) -> list[str]:
    """Whether a new person can have the sizes of others."""
    carried = diagnosis.carried_over
    if carried is None or not math.isfinite(carried.share):
        return []
    others, own, none = (
        gap_text(gaps[ALL].value) for gaps in (carried.sizes_of_others, carried.own_sizes, carried.without_causes)
    )
    said = f"to {carried.share:.0%}" if carried.share > 0.0 else "not at all: adapt each person"
    return [
        f"Sizes carry over to other persons {said}. On unseen motions a person keeps {others} deg with those of others "
        f"as they are, {own} with its own, {none} without these causes."
    ]


def _landmark_sizes(diagnosis: Diagnosis) -> list[str]:
    """What landmarks show to be of another size than in the set."""
    other = [
        f"{name}={','.join(f'{one.value:.3g}' for one in sizes.values())}"
        for name, sizes in diagnosis.landmark_sizes.items()
        if any(one.low > 0.0 or one.high < 0.0 for one in sizes.values())
    ]
    if not other:
        return []
    return [f"Landmarks show bones unlike the set's: {listed(other, 'and')}. girdle model makes a set of each person."]


_AXIAL = "The clavicle's axial rotation is computed from the other angles: an estimate, no measurement."


def _noise(noise: Noise) -> str:
    source = {
        "given": "as given",
        "estimated": f"estimated from {noise.freedom:.0f} degrees of freedom",
        "assumed": "assumed, for these data are too few to estimate it; give --noise-deg",
    }
    return f"Noise: {noise.angle_deg:.2f} deg an angle, {source[noise.source]}."


def _limits(diagnosis: Diagnosis) -> list[str]:
    """What data of one motion, or of one person, cannot say."""
    one_motion, one_person = diagnosis.gaps.other_motion is None, diagnosis.persons == 1
    return [
        *(["One kind of motion: nothing can be said of unseen motions."] if one_motion else []),
        *(["One person: nothing can be said of unseen persons."] if one_person else []),
        *([] if diagnosis.can_test else ["Probabilities of candidates rest on postures between others: no answer."]),
    ]


def _sampled(diagnosis: Diagnosis) -> list[str]:
    """Say how many postures the search for causes took, if not all."""
    given, taken = diagnosis.postures, diagnosis.searched_postures
    if taken == given:
        return []
    return [
        f"Causes were searched in {taken} of {given} postures, at most {MOST_POSTURES} of a motion; gaps are of all."
    ]


def _indistinguishable(names: Sequence[str], candidates: Collection[str]) -> str:
    which = f"any of the {len(names)} candidates" if len(names) == len(candidates) else listed(names, "and")
    return f"These data cannot tell apart {which}."


def _how_to_adapt(diagnosis: Diagnosis) -> str:
    """How the next adaptation takes all of it into account at once."""
    names = [name for name, one in diagnosis.amplitude.items() if one.amplitude is not None]
    options = [f"{OPTION} {one}" for one in diagnosis.options]
    if thorax := diagnosis.prior_thorax:
        names.append(DOWN_WEIGHTED)
        options.append(f"{THORAX_OPTION} {thorax.downweighting:g}")
    return f"To adapt with {listed(names, 'and')}: girdle adapt ... {' '.join(options)}"
