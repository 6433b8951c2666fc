"""Values of ``--effect`` and ``--thorax-downweighting``, in the form that the fits take."""

import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from adapt.cli.inputs import load_models
from adapt.cli.options import EFFECTS_OF_OPTION, THORAX_OPTION, console
from adapt.cli.terminal.print_verdict import print_folded
from adapt.solvers.objective import WEIGHT, down_weighted
from models.effects.amplitudes import OPTION, Amplitudes, described, read_amplitudes
from motions.errors import InputError, InputWarning, warn_input
from motions.files import read_text

THORAX_POINTS = "thorax_points"
"""Name under which ``--effect`` takes the value of ``THORAX_OPTION``."""

DOWN_WEIGHTED = "prior thorax points down-weighted"


@dataclass(frozen=True)
class Known:
    """Known properties of the subjects: active effects, and the down-weighting factor of the prior thorax points."""

    effects: Amplitudes
    thorax_downweighting: float = 1.0

    @property
    def texts(self) -> list[str]:
        """Known properties in words, one phrase each: 'with thorax_asymmetry of 5 mm'."""
        effects, k = described(self.effects), self.thorax_downweighting
        return [*([f"with {effects}"] if effects else []), *([f"{DOWN_WEIGHTED} {k:g} times"] if k != 1.0 else [])]


def read_known(words: Sequence[str], thorax_downweighting: float = 1.0, weight: float = WEIGHT) -> Known:
    """Read the values of ``--effect`` and ``--thorax-downweighting``; raise an InputError for an invalid value.

    ``--effect thorax_points=30``, as written in diagnosis.json, means ``--thorax-downweighting 30``.
    """
    as_effect = [word for word in words if _is_thorax(word)]
    if len(as_effect) + (thorax_downweighting != 1.0) > 1:
        raise InputError(THORAX_OPTION, None, f"it is there twice, {OPTION} {as_effect[0]} is the same", "Give it once")
    effects = read_amplitudes([word for word in words if not _is_thorax(word)])
    known = Known(effects, _number(as_effect[0]) if as_effect else thorax_downweighting)
    down_weighted(weight, known.thorax_downweighting, THORAX_OPTION)  # raises for an invalid factor, before any fit
    return known


_GIVE_A_DIAGNOSIS = "Give the folder that `girdle diagnose --out FOLDER` has written"


def effects_of(folder: Path | None, models: Sequence[str] = (), out: Path | None = None) -> list[str]:
    """Read the causes of a diagnosis in the form of ``--effect``; without a folder there are none.

    ``models``: the models to adapt, as asked for. A single model gets the causes of its own diagnosis, several those
    of the model with the smallest gap; warn of models that get the causes of another one.
    Raise an InputError where the folder has no diagnosis, or the diagnosis has no causes to adapt with, or where the
    results in ``out`` would replace it.
    """
    if folder is None:
        return []
    path = folder / "diagnosis.json"
    if out is not None and folder.resolve() == out.resolve():
        cause = f"the results would replace the diagnosis that {EFFECTS_OF_OPTION} reads"
        raise InputError(str(out), None, cause, "Give another folder with --out")
    if not path.is_file():
        raise InputError(str(path), None, "there is no such file", _GIVE_A_DIAGNOSIS)
    try:
        closest = json.loads(read_text(path, _GIVE_A_DIAGNOSIS))
        by_model = {name: _options(one) for name, one in closest.get("by_model", {}).items()}
        source, named = str(closest.get("model", "")), _options(closest)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(str(path), None, "this is not a diagnosis.json", _GIVE_A_DIAGNOSIS) from error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # the command reads the models again, and warns of them
        names = [model.name for model in load_models([*models])]
    if len(names) == 1 and names[0] in by_model:
        source, named = names[0], by_model[names[0]]
    if others := [name for name in names if named and source and by_model.get(name) != named and name != source]:
        cause = f"these amplitudes were found with {source}, and {', '.join(others)} may need others"
        warn_input(InputError(str(path), None, cause, "Diagnose and adapt each model by itself"))
    if not named:
        cause = "this diagnosis names no cause whose size a gap shows"
        raise InputError(
            str(path), None, cause, f"Adapt without {EFFECTS_OF_OPTION}, with --own-bones if people differ"
        )
    return named


def _options(diagnosis: dict[str, object]) -> list[str]:
    """Return the options of the diagnosis of one model. Raise TypeError where they are no list of texts."""
    found = diagnosis["options"]
    if not isinstance(found, list) or not all(isinstance(option, str) for option in found):
        raise TypeError
    return found


def say_known(known: Known) -> None:
    """Print the active effects and the down-weighting of the prior thorax points."""
    if effects := described(known.effects):
        print_folded(console, f"With {effects} active in every subject.")
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
