"""What the numbers of a diagnosis rest on, a sentence each: noise, marks of the motions, effects not distinguished."""

from collections.abc import Collection, Mapping, Sequence

from adapt.diagnosis.fit.measurement_noise import NoiseEstimate
from adapt.diagnosis.gap_rotations import GapFractions
from adapt.diagnosis.result import EFFECT, Diagnosis, PredictedPower, Verdict
from adapt.diagnosis.wording import answer_text, listed
from models.effects.known import OPTION

_LEAST_NAMED = 3
"""Only so many effects that such data would least often name are listed."""

_SURELY = 0.8
"""Fractions above it need no word."""


def notes(diagnosis: Diagnosis) -> list[str]:
    """Say what the numbers of a diagnosis rest on."""
    answer = _answer(diagnosis.verdict)
    otherwise = [
        f"Were the noise {noise_deg:.2f} deg, the answer would be {answer_text(verdict)}."
        for noise_deg, verdict in sorted(diagnosis.at_other_noise.items())
        if _answer(verdict) != answer
    ]
    declared = [f"The motions are marked with {name}: likelier beforehand." for name in diagnosis.declared_effects]
    fractions = diagnosis.variance_fractions.all
    return [
        f"Parameter set {diagnosis.model}.",
        _noise(diagnosis.noise),
        *otherwise,
        *declared,
        *([_fractions(fractions)] if fractions else []),
        _predicted_power(diagnosis.predicted_power),
        *(_indistinguishable(names, diagnosis.smallest_detectable) for names in diagnosis.indistinguishable),
        *(f"Left out: {subject}: {why}." for subject, why in diagnosis.left_out.items()),
        *([_known(diagnosis)] if diagnosis.verdict.answer == EFFECT else []),
    ]


def _answer(verdict: Verdict) -> tuple[str, bool, frozenset[str]]:
    """What makes two verdicts the same, whatever their probabilities."""
    return verdict.answer, verdict.together, frozenset(verdict.effects)


def _noise(estimate: NoiseEstimate) -> str:
    angle = f"{estimate.noise.angle_deg:.2f} deg an angle"
    source = {
        "given": f"Noise: {angle}, as given",
        "estimated": f"Noise: {angle}, estimated from {estimate.freedom:.0f} degrees of freedom",
        "assumed": f"Noise: {angle}, assumed, for these data are too few to estimate it; give --noise-deg",
    }
    return f"{source[estimate.source]} (landmarks, where given: {estimate.noise.landmark_mm:.1f} mm)."


def _fractions(fractions: GapFractions) -> str:
    each = [
        f"{fractions.noise:.0%} is noise",
        f"{fractions.constant:.0%} constant in each subject",
        f"{fractions.systematic:.0%} a course over elevation",
        f"{fractions.left_over:.0%} none of these",
    ]
    return f"Of the squared gap after adaptation, {listed(each, 'and')}."


def _predicted_power(power: Mapping[str, PredictedPower]) -> str:
    """How often such data would name an effect rightly, and which ones they would least often."""
    often = {name: one.named for name, one in power.items()}
    least = sorted(often, key=often.__getitem__)[:_LEAST_NAMED]
    each = [f"{name} in {often[name]:.0%}" for name in least if often[name] < _SURELY]
    seldom = f", least {listed(each, 'and')}" if each else ""
    return f"Such data would name an effect of typical size in {sum(often.values()) / len(often):.0%} of cases{seldom}."


def _indistinguishable(effects: Sequence[str], all_effects: Collection[str]) -> str:
    which = f"any of the {len(effects)} effects" if len(effects) == len(all_effects) else listed(effects, "and")
    return f"These postures and this noise cannot tell apart {which}."


def _known(diagnosis: Diagnosis) -> str:
    """How the next adaptation takes the most probable effect, or the two together, into account."""
    options = " ".join(f"{OPTION} {diagnosis.amplitude[name].option}" for name in diagnosis.best)
    return f"To adapt with {listed(diagnosis.best, 'and')} as found here: girdle adapt ... {options}"
