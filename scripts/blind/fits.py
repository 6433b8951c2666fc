"""Fits of the withheld-effect check that are kept, so that another way to weigh them needs no new fits."""

import pickle
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from adapt.diagnosis.diagnosis import RankedDiagnosis, conclude
from adapt.diagnosis.fit.observations import Observed
from adapt.diagnosis.inference.ranking import rank
from models.effects import EFFECTS, Effect


@dataclass(frozen=True)
class Kept:
    """A diagnosis, what it saw, and the truth."""

    found: RankedDiagnosis
    data: Observed
    truth: dict[str, Any]


def keep(kept: Kept, path: Path) -> None:
    """Write it whole or not at all; it is read by the code that wrote it, or by what has the same fields."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_bytes(pickle.dumps(kept))
    partial.replace(path)


def read_kept(path: Path) -> Kept:
    """What ``keep`` wrote."""
    return pickle.loads(path.read_bytes())


def tried(found: RankedDiagnosis) -> tuple[Effect, ...]:
    """The effects that the diagnosis was given."""
    names = {name for hypothesis in found.ranking.hypotheses for name in hypothesis}
    return tuple(effect for effect in EFFECTS.values() if effect.name in names)


def weighed_anew(kept: Kept) -> RankedDiagnosis:
    """The same fits, weighed by the code as it is now: pairs are those that were tried then, gaps those found then."""
    found, effects = kept.found, tried(kept.found)
    ranking = rank(found.ranking.fitted, effects, kept.data, found.noise)
    concluded = conclude(ranking, effects, kept.data, found.declared_effects)
    return replace(
        found,
        ranking=ranking,
        verdict=concluded.verdict,
        amplitude=concluded.amplitude,
        best=concluded.explained.hypothesis,
    )
