"""Notes on the data, assumptions and limits of a diagnosis, one sentence each."""

from collections.abc import Collection, Sequence

from adapt.diagnosis.fit.shoulders import MOST_POSTURES
from adapt.diagnosis.result import Diagnosis, Noise
from adapt.diagnosis.texts.wording import listed


def notes(diagnosis: Diagnosis) -> list[str]:
    """List all notes: basis and limits, probable causes that are not named, names not told apart, and how to adapt."""
    candidates = set(diagnosis.verdict.inclusion)
    return [
        *rests_on(diagnosis),
        *(f"{name} is probable and not named: {why}." for name, why in diagnosis.verdict.not_named.items()),
        *(_indistinguishable(names, candidates) for names in diagnosis.indistinguishable),
        *([_how_to_adapt(diagnosis)] if diagnosis.goes_further else []),
    ]


def rests_on(diagnosis: Diagnosis) -> list[str]:
    """List the data and assumptions on which the numbers of a diagnosis rest, and their limits."""
    too_large = [name for name, one in diagnosis.amplitude.items() if one.too_large]
    return [
        f"Parameter set {diagnosis.model}.",
        _noise(diagnosis.noise),
        *(f"The motion file says of its angles that {name} is active." for name in diagnosis.declared_effects),
        *([_AXIAL] if diagnosis.axial_is_computed else []),
        *([f"Positions: {diagnosis.positions.note}."] if diagnosis.positions.note else []),
        *_landmark_sizes(diagnosis),
        *_limits(diagnosis),
        *_sampled(diagnosis),
        *(f"{name}: larger than such an effect is: something that acts like it." for name in too_large),
        *(f"Left out: {subject}: {why}." for subject, why in diagnosis.left_out.items()),
        *(f"Left out: {outlier}." for outlier in diagnosis.outliers),
    ]


def _landmark_sizes(diagnosis: Diagnosis) -> list[str]:
    """Name the sizes that landmarks show to differ from the parameter set."""
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
    """List the conclusions that data of one motion, or of one person, do not allow."""
    one_motion, one_person = diagnosis.gaps.other_motion is None, diagnosis.persons == 1
    return [
        *(["One kind of motion: nothing can be said of held-out motions."] if one_motion else []),
        *(["One person: nothing can be said of held-out persons."] if one_person else []),
        *([] if diagnosis.can_test else ["Probabilities of candidates rest on postures between others: no answer."]),
    ]


def _sampled(diagnosis: Diagnosis) -> list[str]:
    """Give the number of postures that the search for causes used, if not all."""
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
    """Give the command that adapts with own bones and all causes at once."""
    names = [name for name, one in diagnosis.amplitude.items() if one.amplitude is not None]
    command = "girdle adapt ... --own-bones --effects-of FOLDER"
    return f"To adapt with {listed(names, 'and')}: {command}, the folder of this diagnosis."
