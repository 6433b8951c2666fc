"""How few measured shoulders are enough? Causes named and sized on some shoulders, and their gap on others.

A row says which data the diagnosis has: all persons but one, one person, one shoulder, or two kinds of motion of one
person; each in turn, with each parameter set. The other persons are then adapted with the named causes (``girdle adapt
--effect``): mean |simulated - measured| on held-out motions, and that gap as a share of the gap without causes, median
and maximum.
"""

import argparse
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from adapt.diagnosis import diagnose
from adapt.diagnosis.result import ALL
from models import ParameterSet, load_model
from models.effects.amplitudes import NO_EFFECTS
from motions import Motions
from scripts.reporting import bone_pins, markdown
from scripts.research.named_causes.measured_check import one_left_out, unseen_gaps_deg

REST, ONE, SHOULDER, LESS = "all persons but one", "one person", "one shoulder", "one person, two kinds of motion"


class Seen(NamedTuple):
    """Motions that a diagnosis sees, and the persons whose gap is reported."""

    what: str
    motions: Motions
    others: Motions


def main() -> None:
    """Diagnose parts of the motions with each set and print one table."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    motions, options = bone_pins(described)
    gaps: dict[str, list[tuple[float, float]]] = {}
    for name in options.model:
        model = load_model(name)
        for seen in track(list(parts(motions)), name, console=Console(stderr=True)):
            gaps.setdefault(seen.what, []).append(gaps_of_others_deg(model, seen))
    print(table(gaps))


def parts(motions: Motions) -> Iterator[Seen]:
    """Yield the parts to diagnose; none where there is only one person."""
    kinds = sorted(set(motions.motion.tolist()))
    for others, one in one_left_out(motions):
        yield Seen(REST, others, one)
        yield Seen(ONE, one, others)
        for subject in one.subjects:
            yield Seen(SHOULDER, one.select(one.subject == subject), others)
        for pair in combinations(kinds, 2):
            yield Seen(LESS, one.select(np.isin(one.motion, pair)), others)


def gaps_of_others_deg(model: ParameterSet, seen: Seen) -> tuple[float, float]:
    """Compute the mean held-out gap of the other persons, without causes and with the named ones."""
    found = diagnose(seen.motions, model)[model.name]
    with_causes = unseen_gaps_deg(seen.others, model, found.effects)[ALL]
    return unseen_gaps_deg(seen.others, model, NO_EFFECTS, own_bones=False)[ALL], with_causes


def table(gaps: dict[str, list[tuple[float, float]]]) -> str:
    """Tabulate the gaps, one row per kind of part, as Markdown."""
    rows = []
    for what, found in gaps.items():
        adapted, with_causes = np.array(found).T
        left = with_causes / adapted
        means = [f"{mean:.2f}" for mean in (adapted.mean(), with_causes.mean())]
        shares = [f"{np.median(left):.0%}", f"{left.max():.0%}"]
        rows.append([what, str(len(found)), *means, *shares, f"{np.sum(left > 1.0)} of {len(found)}"])
    return markdown(["seen", "diagnoses", "adapted, deg", "with the causes", "left", "at most", "larger"], rows)


if __name__ == "__main__":
    main()
