"""Would any other causes do as well? Named causes against random ones, on held-out persons.

For each person in turn and each parameter set: the causes named on the other persons, and equally many random
candidates, each with the largest number of amplitudes that it can have. Both get the population amplitudes of the other
persons, and the person left out is adapted with them: once with these amplitudes fixed, and once with subject-level
amplitudes about them, as `girdle adapt --effect` does with the result of `girdle diagnose`. Mean |simulated - measured|
on held-out motions; "as good" counts the random sets whose gap is no larger than that of the named causes. With
`--elsewhere` causes are named on all persons and tried on another laboratory's data.
"""

import argparse
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis, candidate_effects
from adapt.diagnosis.fit.joint_fit import THORAX_DOWNWEIGHTING
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import Search, search_of
from adapt.diagnosis.inference.selection import name_causes
from adapt.diagnosis.result import ALL
from models import ParameterSet, load_model
from models.effects.amplitudes import NO_EFFECTS, Amplitudes, PersonalSize
from motions import Motions
from scripts.reporting import bone_pins, markdown, measured
from scripts.research.named_causes.measured_check import mean_unseen_deg, one_left_out

SEED, DRAWN = 1, 20
"""Seed, and number of random sets for each person and parameter set."""


class Gaps(NamedTuple):
    """Held-out gaps of one person, degrees: with population amplitudes, and with subject-level amplitudes."""

    as_others: float
    own: float


LEFT_OUT = "each person left out"

Tried = dict[str, list[tuple[Motions, Motions]]]
"""For each label of the table: pairs of motions on which causes are named and motions on which they are tried."""


def main() -> None:
    """Adapt persons with causes named without them and with random causes; print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drawn", type=int, default=DRAWN, help=f"sets drawn for each person; default: {DRAWN}")
    parser.add_argument("--elsewhere", action="append", type=Path, help="motions that another laboratory measured")
    motions, options = bone_pins(parser)
    every = tried(motions, measured(parser, options.elsewhere) if options.elsewhere else None)
    rows, generator = [], np.random.default_rng(SEED)
    for name, who in track(list(product(options.model, every)), console=Console(stderr=True)):
        model = load_model(name)
        found = [_compared(seen, unseen, model, options.drawn, generator) for seen, unseen in every[who]]
        rows.append([name, who, *cells(found)])
    sizes = [f"{of}: {which}" for of in ("sizes of others", "own sizes") for which in ("named", "at random", "as good")]
    print(markdown(["parameter set", "tried on", "adapted, deg", "thorax points down-weighted", *sizes], rows))


def tried(motions: Motions, elsewhere: Motions | None) -> Tried:
    """Choose the people on whom causes are tried: each person in turn, or each subject measured elsewhere."""
    if elsewhere is None:
        return {LEFT_OUT: list(one_left_out(motions))}
    return {one: [(motions, elsewhere.select(elsewhere.subject == one))] for one in elsewhere.subjects}


def _compared(seen: Motions, unseen: Motions, model: ParameterSet, draws: int, generator: np.random.Generator) -> tuple:
    """Compute the gaps of the motions ``unseen``: adapted, with thorax down-weighting, with the causes named on the
    motions ``seen``, and with each random set."""
    (shoulders, _) = usable(seen)

    def gaps(effects: Amplitudes, downweighting: float) -> dict[str, float]:
        return mean_unseen_deg(unseen, model, effects=effects, thorax_downweighting=downweighting)

    search = search_of(model, shoulders, candidate_effects(model, shoulders.subjects)).run()
    named = name_causes(search).hypothesis
    drawn = [drawn_at_random(search.joint.candidates, len(named), generator) for _ in range(draws)]
    without = (gaps(NO_EFFECTS, downweighting)[ALL] for downweighting in (1.0, THORAX_DOWNWEIGHTING))
    return *without, *(_gaps(search, one, gaps) for one in (named, *drawn))


def drawn_at_random(candidates: Candidates, causes: int, generator: np.random.Generator) -> Hypothesis:
    """Draw so many different causes, each with the basis that has the most amplitudes."""
    richest = {one.cause: one.name for one in sorted(candidates.effects, key=lambda one: one.amplitudes)}
    return candidates.ordered(generator.choice(list(richest.values()), causes, replace=False).tolist())


def cells(found: list) -> list[str]:
    """Format the table's cells: mean gaps over the persons, adapted and with thorax down-weighting; then, for either
    kind of amplitude, the mean gap of the named causes, the median of the random ones, and how many random sets leave
    no larger gap on the same person than the named causes."""
    texts = [f"{np.mean([one[k] for one in found]):.2f}" for k in range(2)]
    for kind in Gaps._fields:
        named = np.array([getattr(one[2], kind) for one in found])
        drawn = np.array([[getattr(other, kind) for other in one[3:]] for one in found])
        as_good = int((drawn <= named[:, None]).sum())
        texts += [f"{named.mean():.2f}", f"{np.median(drawn):.2f}", f"{as_good} of {drawn.size}"]
    return texts


def _gaps(search: Search, hypothesis: Hypothesis, gaps: Callable[[Amplitudes, float], dict[str, float]]) -> Gaps:
    """Compute the gaps of a hypothesis with the population amplitudes of the search's persons."""
    candidates = search.joint.candidates
    given = search.given(search.mode(hypothesis), hypothesis)
    per_deg = search.discrepancy.between_shoulders / search.discrepancy.noise_deg
    sd = per_deg * candidates.scale[candidates.where(hypothesis)]
    sizes = {one.name: (given.amplitude[own], sd[own]) for one, own in candidates.slices(hypothesis)}
    fixed = {name: tuple(a) for name, (a, _) in sizes.items()}
    personal = {name: PersonalSize(tuple(a), tuple(sd)) for name, (a, sd) in sizes.items()}
    return Gaps(*(gaps(effects, THORAX_DOWNWEIGHTING)[ALL] for effects in (fixed, personal)))


if __name__ == "__main__":
    main()
