"""Would any other causes do as well? Named causes against as many drawn at random, on measured persons left out.

Of each person in turn and with each parameter set: what is named on the other persons, and as many candidates drawn at
random, each with all numbers that it can have. Both get the sizes that the other persons show, and the person left out
is adapted with them: once with these sizes as they are, and once with sizes of its own about them, as `girdle adapt
--effect` does with what `girdle diagnose` says. Mean |simulated - measured| on motions that it was not adapted to;
"as good" counts the sets at random that leave no more than what is named.
"""

import argparse
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis, candidate_effects
from adapt.diagnosis.fit.joint_fit import RELIEF
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.naming import name_causes
from adapt.diagnosis.inference.search import Search, search_of
from adapt.diagnosis.result import ALL
from adapt.diagnosis.thorax_points import thorax_option
from models import load_model
from models.effects.known import NO_EFFECTS, Amplitudes, PersonalSize, read_amplitudes
from scripts.measured_check import one_left_out, unseen_gaps_deg
from scripts.reporting import bone_pins, markdown

SEED, DRAWN = 1, 20
"""Sets drawn for each person and parameter set."""


class Gaps(NamedTuple):
    """Of one person on unseen motions, degrees: with sizes as those of others, and of its own."""

    as_others: float
    own: float


def main() -> None:
    """Adapt each person with what is named without it and with sets drawn at random; print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drawn", type=int, default=DRAWN, help=f"sets drawn for each person; default: {DRAWN}")
    motions, options = bone_pins(parser)
    rows, generator = [], np.random.default_rng(SEED)
    for name in options.model:
        model, found = load_model(name), []
        for others, left_out in track(list(one_left_out(motions)), name, console=Console(stderr=True)):
            gaps, (shoulders, _) = partial(unseen_gaps_deg, left_out, model), usable(others)
            search = search_of(model, shoulders, candidate_effects(model, shoulders.subjects)).run()
            named = name_causes(search, 0.0).hypothesis
            drawn = [drawn_at_random(search.joint.candidates, len(named), generator) for _ in range(options.drawn)]
            without = [gaps(effects)[ALL] for effects in (NO_EFFECTS, _RELIEVED)]
            found.append((*without, *(_gaps(search, one, gaps) for one in (named, *drawn))))
        rows.append([name, *cells(found)])
    sizes = [f"{of}: {which}" for of in ("sizes of others", "own sizes") for which in ("named", "at random", "as good")]
    print(markdown(["parameter set", "adapted, deg", "+ thorax_points", *sizes], rows))


def drawn_at_random(candidates: Candidates, causes: int, generator: np.random.Generator) -> Hypothesis:
    """Draw so many different causes, each with the course that has the most numbers."""
    richest = {one.cause: one.name for one in sorted(candidates.effects, key=lambda one: one.amplitudes)}
    return candidates.ordered(generator.choice(list(richest.values()), causes, replace=False).tolist())


def cells(found: list) -> list[str]:
    """Write the means over the persons: adapted, relieved; then of each kind of size named, the median at random, and
    how many of those at random leave as little on the same person as what is named."""
    texts = [f"{np.mean([one[k] for one in found]):.2f}" for k in range(2)]
    for kind in Gaps._fields:
        named = np.array([getattr(one[2], kind) for one in found])
        drawn = np.array([[getattr(other, kind) for other in one[3:]] for one in found])
        as_good = int((drawn <= named[:, None]).sum())
        texts += [f"{named.mean():.2f}", f"{np.median(drawn):.2f}", f"{as_good} of {drawn.size}"]
    return texts


_RELIEVED = read_amplitudes([thorax_option(RELIEF)])


def _gaps(search: Search, hypothesis: Hypothesis, gaps: Callable[[Amplitudes], dict[str, float]]) -> Gaps:
    """With the sizes of a set that the search's persons have in common."""
    candidates = search.joint.candidates
    given = search.given(search.mode(hypothesis), hypothesis)
    sd = search.discrepancy.between_per_deg * candidates.scale[candidates.where(hypothesis)]
    sizes = {one.name: (given.amplitude[own], sd[own]) for one, own in candidates.slices(hypothesis)}
    fixed = {name: tuple(a) for name, (a, _) in sizes.items()}
    personal = {name: PersonalSize(tuple(a), tuple(sd)) for name, (a, sd) in sizes.items()}
    return Gaps(*(gaps({**_RELIEVED, **effects})[ALL] for effects in (fixed, personal)))


if __name__ == "__main__":
    main()
