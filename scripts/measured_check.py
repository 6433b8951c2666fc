"""Does the diagnosis name causes that predict measured shoulders? The gap on motions and persons that were not fitted.

For each parameter set: what `girdle diagnose` names by itself, and the mean |simulated - measured| of scapula and
clavicle, degrees, adapted without each motion: without the causes, with them (``girdle adapt --effect``), with the
sizes that other persons have, as they are, and with causes that were named and sized without the person at all; '-'
where there is no other motion, or no other person.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from adapt.diagnosis import Diagnosis, diagnose
from adapt.diagnosis.adapted_gaps import adapted_gaps
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.intervals import known_mean
from adapt.diagnosis.wording import gap_text
from adapt.tables.held_out import MOTION
from models import ParameterSet, load_model
from models.effects.known import read_amplitudes
from motions import Motions
from scripts.reporting import bone_pins

_BONES = ("scapula", "clavicle")

_NEVER_UNDER_PINS = ("skin_artefact", "clavicle_axial_estimate")
"""Bone pins exclude them."""


def main() -> None:
    """Diagnose the motions with each set and print one table."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    motions, options = bone_pins(described)
    unseen = "motion unseen | sizes of others as they are | names and sizes without the person"
    print(f"| parameter set | causes named | adapted | + causes, {unseen} |")
    print("|---|---|---|---|---|---|")
    for name in options.model:
        model = load_model(name)
        print(_row(diagnose(motions, model)[name], named_without(motions, model)), flush=True)


def named_without(motions: Motions, model: ParameterSet) -> dict[str, float]:
    """Compute the mean gaps of persons on unseen motions, with causes that the diagnosis of all others names; NaN where
    nothing is unseen."""
    shoulders, _ = usable(motions)
    if shoulders.persons < 2 or len(shoulders.kinds) < 2:
        return dict.fromkeys(_BONES, np.nan)
    found = []
    for others, left_out in one_left_out(motions):
        known = read_amplitudes(diagnose(others, model)[model.name].options)
        unseen = adapted_gaps(left_out, model, known, dict.fromkeys(left_out.subjects, 0)).unseen
        found.append([unseen[MOTION][bone].value if MOTION in unseen else np.nan for bone in _BONES])
    return dict(zip(_BONES, known_mean(np.array(found).T).tolist(), strict=True))


def one_left_out(motions: Motions) -> Iterator[tuple[Motions, Motions]]:
    """Leave each person out in turn, left and right together: the motions of all others, and the person's."""
    shoulders, _ = usable(motions)
    for person in range(shoulders.persons):
        own = [name for name, one in zip(shoulders.subjects, shoulders.person, strict=True) if one == person]
        of_person = np.isin(motions.subject, own)
        yield motions.select(~of_person), motions.select(of_person)


def _row(diagnosis: Diagnosis, without: dict[str, float]) -> str:
    causes = ["/".join(cause.names) for cause in diagnosis.verdict.causes]
    wrong = [name for name in diagnosis.verdict.names if name in _NEVER_UNDER_PINS]
    seen, carried = diagnosis.gaps.other_motion, diagnosis.carried_over
    cells = [_bones(seen["adapted"]), _bones(seen["with_effect"])] if seen else ["-", "-"]
    cells.append(_bones(carried.sizes_of_others) if carried else "-")
    cells.append(", ".join(gap_text(without[bone]) for bone in _BONES))
    said = ", ".join(causes) or diagnosis.verdict.answer
    return f"| {diagnosis.model} | {said}{' WRONG' if wrong else ''} | {' | '.join(cells)} |"


def _bones(gaps) -> str:
    return ", ".join(gap_text(gaps[bone].value) for bone in _BONES)


if __name__ == "__main__":
    main()
