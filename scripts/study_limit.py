"""The most that any diagnosis could tell of such motions: one that is told everything but which effect is at work.

    python scripts/study_limit.py                       all conditions and parameter sets
    python scripts/study_limit.py --condition three --model R2

Simulated, and linear about the model as it is (see ``adapt/diagnosis/design/predicted_power.py``): a subject shows

    y_s = X_s u_s + t_s A_s d + noise,   u_s ~ N(0, spread^2),   t_s ~ N(1, between^2),

with the direction and course d common to all. Told the noise, both spreads, the effect's exact size and how d was
drawn, the evidence of an effect is p(y | e) = E_d prod_s p(y_s | d): the mean over thousands of d, each with u and t
integrated out in closed form. Whoever takes the effect of the largest evidence is right most often (Bayes), so that a
diagnosis, which is told none of this, can hardly be right more often in such worlds.
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from jaxtyping import Float, Int
from numpy.random import default_rng

from adapt.cli import app as cli
from adapt.diagnosis.design.predicted_power import (
    SPREAD,
    draw,
    gram_matrices,
    matrix_roots,
    products_with,
    simulate_statistics,
    typical_amplitudes,
)
from adapt.diagnosis.design.separability import projected_onto_model
from adapt.diagnosis.fit.linear_evidence import log_sum
from adapt.diagnosis.fit.linear_model import BETWEEN_SUBJECTS
from adapt.diagnosis.fit.measurement_noise import Noise
from adapt.diagnosis.fit.observations import observe
from adapt.engine.batching import in_threads
from models import load_model
from models.adapted_parameters import ADAPTED
from models.effects import EFFECTS, Effect
from motions import read_motions
from scripts.blind.cases import CONDITIONS, MODELS, SHOWN_MOTIONS, Case, world_of, written
from scripts.reporting import check_known, markdown

STUDIED = ("standard", "three", "one", "half", "noise_3", "landmarks_three")

_DRAWS, _DIRECTIONS = 100, 20_000
"""Worlds of each effect, and of none; directions and courses that each evidence is the mean over. The rate over all
effects is known to 1 point."""

BLAMED, MISSED = 0.03, 0.03
"""Shares of worlds: without effect, in which one may be blamed; with one, in which it may be outside the set."""

_AT_A_TIME = 25
"""Worlds weighed at once: more do not fit in the caches."""

_SEED = 1999
"""Of the draws."""

_WORLD = 90_000
"""Seed of the first of the worlds whose postures are taken, one for each parameter set: none of those reported."""

_PAIRS_NAMED = 4
"""Of effects taken for each other."""

app = typer.Typer(add_completion=False)


@dataclass(frozen=True)
class Limit:
    """What one who is told everything else makes of worlds with one effect: shares of them, ``draws`` of each."""

    right: float
    """The most probable effect is at work."""
    first: float
    """And more probable than all but ``BLAMED`` of worlds without effect make one."""
    set_size: float
    """Names in a set, on average, if it is every name from the probability on that leaves the effect at work out in
    ``MISSED``: no sets of fewer names hold it as often."""
    claimed: float
    """Mean probability of the most probable effect: ``right``, if the evidence is that of these worlds."""
    confused_with: Counter[tuple[str, str]]
    """How often one of two effects was most probable when the other was at work."""


def limit_of(
    gram: Float[np.ndarray, "subjects columns columns"],
    own: list[Int[np.ndarray, " own"]],
    effects: tuple[Effect, ...],
    size: float = 1.0,
    draws: int = _DRAWS,
    directions: int = _DIRECTIONS,
) -> Limit:
    """Find the limit for subjects with these ``gram_matrices``; the effects have ``size`` of their typical size."""
    generator, root = default_rng(_SEED), matrix_roots(gram)
    drawn = (draw(gram, k, effect, draws, generator, size) for k, effect in zip(own, [None, *effects], strict=True))
    with_data = np.concatenate([simulate_statistics(gram, root, coefficients, generator) for coefficients in drawn])
    ways = [size * typical_amplitudes(effect, directions, 1, generator, between=0.0)[:, 0] for effect in effects]
    logs = np.array(in_threads(lambda k, d: log_evidence(gram, with_data, k, d), own[1:], ways))
    logs = logs.reshape(len(effects), 1 + len(effects), draws)
    any_effect = log_sum(logs)
    beyond = any_effect[1:] > np.quantile(any_effect[0], 1.0 - BLAMED)
    active_effects = np.arange(len(effects))[:, None]
    best = logs[:, 1:].argmax(axis=0)
    probability = np.exp(logs[:, 1:] - any_effect[1:])
    names = [effect.name for effect in effects]
    wrong = [(names[min(i, j)], names[max(i, j)]) for i, drawn in enumerate(best.tolist()) for j in drawn if i != j]
    return Limit(
        right=float((best == active_effects).mean()),
        first=float(((best == active_effects) & beyond).mean()),
        set_size=float((probability >= np.quantile(np.diagonal(probability), MISSED)).sum(axis=0).clip(1).mean()),
        claimed=float(probability.max(axis=0).mean()),
        confused_with=Counter(wrong),
    )


def log_evidence(
    gram: Float[np.ndarray, "subjects columns columns"],
    with_data: Float[np.ndarray, "draws subjects columns"],
    own: Int[np.ndarray, " own"],
    ways: Float[np.ndarray, "ways own"],
) -> Float[np.ndarray, " draws"]:
    """log p(y | e) over that of no effect, its direction and course one of ``ways``.

    With I = d' A' C^-1 A d and p = d' A' C^-1 y, C = 1 + spread^2 X X', a subject's t ~ N(1, b^2) integrated out leaves

        1/2 ((p + b^-2)^2 / (I + b^-2) - b^-2 - log(1 + b^2 I)).
    """
    statistics = products_with(gram, with_data, own).at(spread=np.full(len(ADAPTED), SPREAD))
    b2 = 1.0 / BETWEEN_SUBJECTS**2
    information = np.einsum("wa,sab,wb->sw", ways, statistics.information[0], ways) + b2
    constant = -0.5 * (b2 + np.log(information / b2)).sum(axis=0)
    logs = []
    for some in np.array_split(statistics.gradient, -(-len(with_data) // _AT_A_TIME)):
        of_way = (some @ ways.T + b2) ** 2 / information
        logs.append(log_sum(0.5 * of_way.sum(axis=1) + constant, axis=1) - np.log(len(ways)))
    return np.concatenate(logs)


def limit_in(condition: str, model_name: str) -> Limit:
    """That of the postures of a condition of the blind study, as people of the parameter set take them."""
    how, model, effects = CONDITIONS[condition], load_model(model_name), tuple(EFFECTS.values())
    world = world_of(Case(condition, "none", _WORLD + MODELS.index(model_name)))
    with tempfile.TemporaryDirectory() as folder:
        data = observe(read_motions(written(world.table, SHOWN_MOTIONS, Path(folder) / "motions.csv")))
    noise = Noise(how.noise_deg)
    gram, own = gram_matrices(model.girdle, effects, projected_onto_model(model.girdle, effects, data, noise), noise)
    return limit_of(gram, own, effects, how.size)


def row_of(condition: str, limits: Sequence[Limit]) -> list[str]:
    """Means over the parameter sets, and which effects are taken for each other most."""
    means = {
        name: np.mean([getattr(one, name) for one in limits]) for name in ("right", "claimed", "first", "set_size")
    }
    confused_with: Counter[tuple[str, str]] = Counter()
    for one in limits:
        confused_with += one.confused_with
    pairs = "; ".join(" - ".join(pair) for pair, _ in confused_with.most_common(_PAIRS_NAMED))
    rates = [f"{100.0 * means[name]:.0f} %" for name in ("right", "claimed", "first")]
    return [condition, *rates, f"{means['set_size']:.2f}", pairs]


@app.command()
def main(
    condition: Annotated[list[str] | None, typer.Option(help="Only this condition; repeatable.")] = None,
    model: Annotated[list[str] | None, typer.Option(help="Only this parameter set; repeatable.")] = None,
) -> None:
    """Print, as Markdown, the most that could be told in each condition of the blind study."""
    check_known(condition or [], CONDITIONS, "condition")
    check_known(model or [], MODELS, "parameter set")
    header = ["condition", "most probable = true", "as its probability says", "first, 3 % blamed", "97 % set", "pairs"]
    rows = []
    for name in condition or STUDIED:
        print(name, file=sys.stderr, flush=True)
        rows.append(row_of(name, [limit_in(name, one) for one in model or MODELS]))
    print(markdown(header, rows))


if __name__ == "__main__":
    cli.main(app)
