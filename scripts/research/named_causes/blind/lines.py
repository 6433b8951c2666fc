"""The result line of a diagnosis, and the true values that are added to it once the truth is opened.

A cause has one name here, whatever its basis: `conoid_strain:posture` is `conoid_strain`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from adapt import adapt_subjects
from adapt.diagnosis.result import ALL, Diagnosis, GapLevels
from adapt.tables.folds import MOTION
from models import ParameterSet
from models.effects import EFFECTS
from models.effects.amplitudes import NO_EFFECTS, Amplitudes
from models.effects.effect import cause_of
from motions import Motions
from scripts.research.named_causes.blind.cases import SHOWN_MOTIONS, UNSEEN_MOTION
from scripts.research.named_causes.blind.runs import Line


def _causes(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(map(cause_of, names)))


def line_of(found: Diagnosis) -> Line:
    """Reduce a diagnosis to its result line."""
    verdict = found.verdict
    named = verdict.causes
    probability = dict.fromkeys(_causes(verdict.probability), 0.0)
    inclusion = dict.fromkeys(_causes(verdict.inclusion), 0.0)
    for name, value in verdict.probability.items():
        probability[cause_of(name)] += value
    for name, value in verdict.inclusion.items():
        inclusion[cause_of(name)] = max(inclusion[cause_of(name)], value)

    def gaps(levels: GapLevels | None) -> dict[str, Any]:
        return {k: levels[k][ALL]._asdict() for k in ("noise_floor", "adapted", "with_effect")} if levels else {}

    return {
        "answer": verdict.answer,
        "causes": [_causes(cause.names) for cause in named],
        "courses": [cause.names[0] for cause in named],
        "gains": [cause.gain for cause in named],
        "t": [cause.t for cause in named],
        "probability": probability,
        "inclusion": inclusion,
        "left_over_share": found.left_over_share,
        "noise": asdict(found.noise),
        "amplitude": {
            name: {direction: one._asdict() for direction, one in size.directions.items()}
            for name, size in found.amplitude.items()
        },
        "options": list(found.options),
        "unseen_deg": gaps(found.gaps.other_postures),
        "other_motion_deg": gaps(found.gaps.other_motion),
        "hardest_deg": gaps(found.gaps.hardest),
        "indistinguishable": [_causes(group) for group in found.indistinguishable],
        "subjects": list(found.subjects),
        "left_out": found.left_out,
    }


def realised_gaps(found: Diagnosis, model: ParameterSet, motions: Motions) -> dict[str, float]:
    """Compute the mean absolute gap on the held-out motion, deg, of shoulders adapted to the other motions.

    Two gaps: adapted without causes, and adapted with own bones and all named causes.
    """
    mine = motions.select(np.isin(motions.subject, found.subjects))

    def gap(effects: Amplitudes, own_bones: bool) -> float:
        table = adapt_subjects(mine, model, held_out=found.subjects, effects=effects, own_bones=own_bones).heldout
        unseen = table[(table["kind"] == MOTION) & (table["held_out"] == UNSEEN_MOTION)]
        return float(np.mean(unseen["gap_unseen_deg"]))

    return {"adapted": gap(NO_EFFECTS, False), "with_effect": gap(found.effects, True)}


def with_truth(found: Diagnosis, truth: dict[str, Any]) -> Line:
    """Return the true values for the line: amplitudes of the effects, and the number of dropped postures."""
    means = {name: float(np.mean(list(effect["amplitude"].values()))) for name, effect in truth["effects"].items()}
    directions = {
        name: true_directions(name, truth["effects"][name], found.subjects)
        for name in sorted(found.amplitude.keys() & means)  # amplitudes of another basis are not comparable
    }
    return {
        "true_mean_amplitude": means,
        "true_directions": {name: values for name, values in directions.items() if values},
        "open_postures": len(truth["dropped"]),
    }


def true_directions(name: str, effect: dict[str, Any], subjects: Sequence[str]) -> dict[str, float]:
    """Average the true amplitude in each direction over subjects and shown motions, in the library's units.

    Amplitudes are those at full elevation. Empty for the skin artefact: its lag in the world is not a share of the
    measured lag, as in the library.
    """
    if name == "skin_artefact":
        return {}
    chosen = [list(effect["amplitude"]).index(subject) for subject in subjects]
    amplitude = np.array(list(effect["amplitude"].values()))[chosen, None]
    drawn = effect["parameters"]
    by_motion = drawn.get("factor_by_motion", {})
    over_motions = np.mean([by_motion.get(motion, 1.0) for motion in SHOWN_MOTIONS])
    if name == "scapulothoracic_gap":
        each = np.column_stack([np.array(drawn["ts_fraction_by_subject"])[chosen], np.ones(len(chosen))])
    else:
        each = np.array(drawn["direction_by_subject"])[chosen] if "direction_by_subject" in drawn else np.ones((1, 1))
    values = (over_motions * amplitude * each).mean(axis=0).tolist()
    return dict(zip(EFFECTS[name].directions, values, strict=True))
