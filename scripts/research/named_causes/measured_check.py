"""Does the diagnosis name causes that predict measured shoulders? The gap on held-out motions and persons.

For each parameter set: the causes that `girdle diagnose` names by itself, and the mean |simulated - measured| of
scapula and clavicle, degrees, each motion held out: plain adaptation, own bones, own bones and causes (``girdle adapt
--own-bones --effect``), causes with population amplitudes of the other persons, and causes named and sized without the
person at all. '-' where there is no other motion, or no other person.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from adapt import adapt_subjects
from adapt.diagnosis import Diagnosis, diagnose
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.result import ALL, GapKind
from adapt.diagnosis.texts.wording import gap_text
from adapt.tables.folds import MOTION, motions_and_thirds
from models import ParameterSet, load_model
from models.effects.amplitudes import Amplitudes
from motions import Motions
from scripts.reporting import bone_pins

_BONES = ("scapula", "clavicle")

_NEVER_UNDER_PINS = ("skin_artefact", "clavicle_axial_estimate")
"""Effects that bone pins exclude."""


def main() -> None:
    """Diagnose the motions with each set and print one table."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    motions, options = bone_pins(described)
    unseen = "motion unseen | + causes, sizes of others | names and sizes without the person"
    print(f"| parameter set | causes named | adapted | own bones | + causes, {unseen} |")
    print("|---|---|---|---|---|---|---|")
    for name in options.model:
        model = load_model(name)
        print(_row(diagnose(motions, model)[name], named_without(motions, model)), flush=True)


def named_without(motions: Motions, model: ParameterSet) -> dict[str, float]:
    """Compute the mean held-out gaps of each person with the causes that a diagnosis of all other persons names.

    NaN with fewer than two persons or kinds of motion.
    """
    shoulders, _ = usable(motions)
    if shoulders.persons < 2 or len(shoulders.kinds) < 2:
        return dict.fromkeys(_BONES, np.nan)
    found = []
    for others, left_out in one_left_out(motions):
        of_others = diagnose(others, model)[model.name]
        unseen = unseen_gaps_deg(left_out, model, of_others.effects)
        found.append([unseen[bone] for bone in _BONES])
    return dict(zip(_BONES, known_mean(np.array(found).T).tolist(), strict=True))


def one_left_out(motions: Motions) -> Iterator[tuple[Motions, Motions]]:
    """Leave each person out in turn, left and right shoulder together: yield the others' motions and the person's own.

    Yields nothing for one person. Subjects with too few data are in neither part.
    """
    shoulders, _ = usable(motions)
    if shoulders.persons < 2:
        return
    of_subject = dict(zip(shoulders.subjects, shoulders.person.tolist(), strict=True))
    person = np.array([of_subject.get(subject, -1) for subject in motions.subject.tolist()])
    for one in range(shoulders.persons):
        yield motions.select((person >= 0) & (person != one)), motions.select(person == one)


def unseen_gaps_deg(
    motions: Motions, model: ParameterSet, effects: Amplitudes, own_bones: bool = True
) -> dict[str, float]:
    """Compute the mean held-out gap over motions, of all angles and by bone, with own bones or without.

    NaN where every subject has only one motion.
    """
    return mean_unseen_deg(motions, model, effects=effects, own_bones=own_bones)


def mean_unseen_deg(motions: Motions, model: ParameterSet, **options) -> dict[str, float]:
    """Compute the mean held-out gap over motions of an adaptation with any options."""
    table = adapt_subjects(motions, model, folds=motions_and_thirds, **options).heldout
    unseen = table[table["kind"] == MOTION]
    columns = {part: f"{'' if part == ALL else f'{part}_'}gap_unseen_deg" for part in (ALL, *_BONES)}
    return {part: float(np.mean(unseen[column])) if len(unseen) else np.nan for part, column in columns.items()}


def _row(diagnosis: Diagnosis, without: dict[str, float]) -> str:
    causes = ["/".join(cause.names) for cause in diagnosis.verdict.causes]
    wrong = [name for name in diagnosis.verdict.names if name in _NEVER_UNDER_PINS]
    seen, others = diagnosis.gaps.other_motion, diagnosis.gaps.other_person
    kinds: tuple[GapKind, ...] = ("adapted", "own_bones", "with_effect")
    cells = [_bones(seen[kind]) if seen else "-" for kind in kinds]
    cells.append(_bones(others["with_effect"]) if others else "-")
    cells.append(", ".join(gap_text(without[bone]) for bone in _BONES))
    said = ", ".join(causes) or diagnosis.verdict.answer
    return f"| {diagnosis.model} | {said}{' WRONG' if wrong else ''} | {' | '.join(cells)} |"


def _bones(gaps) -> str:
    return ", ".join(gap_text(gaps[bone].value) for bone in _BONES)


if __name__ == "__main__":
    main()
