"""Does a longer search find better causes? The diagnosis of measured motions by the shipped search and by a longer one.

The longer search takes two or three causes whose loss costs little out of the best set, bans them, and adds up to three
of the best-fitting other causes; it starts again from the best set of all until that no longer changes. The angles
times 1 + 1e-13 noise show what depends on rounding.

    python scripts/research/named_causes/study_search.py ../shared/motions_positions/bonepin_*.csv --model breteler_mri
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from adapt.diagnosis import diagnose
from adapt.diagnosis.fit.candidates import without
from adapt.diagnosis.inference.search import Node, Search
from models import load_model
from motions import read_motions

_CHEAP = 15.0
"""Loss of log evidence V below which a cause is cheap to take out."""

_MOST_TAKEN_OUT, _MOST_TRIED, _GROWS, _FITTED = 3, 10, 3, 3

_ROUNDING = 1e-13


def study(
    paths: Annotated[list[Path], typer.Argument(metavar="MOTIONS", help="Motion files with positions of SC and AA.")],
    model: str = "breteler_dissection",
    perturbed: Annotated[
        int, typer.Option(help="How often the angles are perturbed by rounding, beside as they are.")
    ] = 1,
) -> None:
    """Print V, the best set, the named causes and the error of predicted positions, by both searches."""
    motions, as_it_is = read_motions(*paths), Search.run
    print("| angles | search | V | best set | named | positions of motions held out, of other persons, mm |")
    print("|---|---|---|---|---|---|")
    for seed in range(1 + perturbed):
        noise = np.random.default_rng(seed).standard_normal(motions.angles_deg.shape) if seed else 0.0
        seen = replace(motions, angles_deg=motions.angles_deg * (1.0 + _ROUNDING * noise))
        for name, run in (("as it is", as_it_is), ("gone on", _gone_on(as_it_is))):
            searches: list[Search] = []
            Search.run = _recorded(run, searches)
            found = diagnose(seen, load_model(model), positions="use")[model]
            best = searches[0].best
            named = ", ".join("/".join(one.names) for one in found.verdict.causes)
            mm = ", ".join(
                f"{kind['with_causes']:.2f}"
                for kind in (found.positions.other_motion, found.positions.other_person)
                if kind
            )
            print(f"| {seed} | {name} | {best.value:.1f} | {', '.join(best.hypothesis)} | {named} | {mm} |", flush=True)
    Search.run = as_it_is


def _recorded(run, searches: list[Search]):
    def recorded(self: Search) -> Search:
        searches.append(self)
        return run(self)

    return recorded


def _gone_on(run):
    def gone_on(self: Search) -> Search:
        run(self)
        before = None
        while self.best is not before:
            before = self.best
            for taken in _taken_out(self, before):
                left = tuple(name for name in before.hypothesis if name not in taken)
                _grown(self, self.fit(left, before), taken)
            self.around()
        return self

    return gone_on


def _taken_out(search: Search, node: Node) -> Sequence[tuple[str, ...]]:
    own = [name for name in node.hypothesis if name not in search.known]
    cheap = [
        name for name in own if node.value - search._value(node.posterior, without(node.hypothesis, name)) < _CHEAP
    ]
    sizes = range(2, _MOST_TAKEN_OUT + 1)
    return [one for size in sizes for one in itertools.combinations(cheap, size)][:_MOST_TRIED]


def _grown(search: Search, node: Node, taken: tuple[str, ...]) -> None:
    """Add the best cause repeatedly, as long as the set gets better."""
    causes = search.joint.candidates.causes
    forbidden = {causes[name] for name in taken}
    for _ in range(_GROWS):
        hopes = [
            (one.hypothesis, one.start)
            for one in search.widened(node)
            if not forbidden.intersection(causes[name] for name in set(one.hypothesis).difference(node.hypothesis))
        ]
        best = max(search.fit_all(hopes[:_FITTED]), key=lambda one: one.value)
        if best.value <= node.value:
            return
        node = best


if __name__ == "__main__":
    typer.run(study)
