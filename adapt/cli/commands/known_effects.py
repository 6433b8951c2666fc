"""What ``--effect`` and ``--thorax-downweighting`` say, as the fits take it."""

from collections.abc import Sequence
from dataclasses import dataclass

from adapt.cli.options import THORAX_OPTION, console
from adapt.solvers.objective import WEIGHT, down_weighted
from models.effects.amplitudes import OPTION, Amplitudes, described, read_amplitudes
from motions.errors import InputError

THORAX_POINTS = "thorax_points"
"""The same setting of E as ``THORAX_OPTION``, as ``--effect`` takes it."""

DOWN_WEIGHTED = "prior thorax points down-weighted"


@dataclass(frozen=True)
class Known:
    """What is known of the subjects: effects at work, and how many times less the prior thorax points count."""

    effects: Amplitudes
    thorax_downweighting: float = 1.0

    @property
    def texts(self) -> list[str]:
        """Describe what is known, a phrase each: 'with thorax_asymmetry of 5 mm'."""
        effects, k = described(self.effects), self.thorax_downweighting
        return [*([f"with {effects}"] if effects else []), *([f"{DOWN_WEIGHTED} {k:g} times"] if k != 1.0 else [])]


def read_known(words: Sequence[str], thorax_downweighting: float = 1.0) -> Known:
    """Read the words of ``--effect`` and the number of ``--thorax-downweighting``; InputError where one cannot be.

    ``--effect thorax_points=30``, as diagnosis.json has it, is ``--thorax-downweighting 30``.
    """
    as_effect = [word for word in words if _is_thorax(word)]
    if len(as_effect) + (thorax_downweighting != 1.0) > 1:
        raise InputError(THORAX_OPTION, None, f"it is there twice, {OPTION} {as_effect[0]} is the same", "Give it once")
    effects = read_amplitudes([word for word in words if not _is_thorax(word)])
    known = Known(effects, _number(as_effect[0]) if as_effect else thorax_downweighting)
    down_weighted(WEIGHT, known.thorax_downweighting, THORAX_OPTION)  # refuses a number that cannot be, before any fit
    return known


def say_known(known: Known) -> None:
    """Print which effects are at work, and how much less the prior thorax points count."""
    if effects := described(known.effects):
        console.print(f"With {effects} at work in every subject.", soft_wrap=True)
    if known.thorax_downweighting != 1.0:
        console.print(f"{DOWN_WEIGHTED.capitalize()} {known.thorax_downweighting:g} times.", soft_wrap=True)


def _is_thorax(word: str) -> bool:
    return word.partition("=")[0].strip() == THORAX_POINTS


def _number(word: str) -> float:
    text = word.partition("=")[2].strip()
    try:
        return float(text)
    except ValueError:
        cause, remedy = f"{THORAX_POINTS} has '{text}', which is not a number", f"Give {THORAX_OPTION} 30"
        raise InputError(OPTION, None, cause, remedy) from None
