"""Which shipped set should supply the unmeasured numbers of a person (`girdle model --model`)? Three rules compared.

Simulated persons have a cadaver's girdle with other sizes. Sets are made of their landmarks with every other shipped
set as base, and adapted. The rules choose the base (a) at random, (b) as the one with TS and AI nearest to the thorax,
but not inside it, (c) as the one with the smallest held-out gap.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np
import pandas as pd

from adapt import adapt_subjects
from adapt.tables.held_out import by_subject
from models import load_model, model_names
from models.person.family import PersonalSets, load_personal_sets
from models.person.sizes import DEEPEST_MM
from motions import Motions
from scripts.research.person.simulated_persons import landmark_table, simulate_persons
from scripts.research.person.study_person import girdle


def main() -> None:
    """Simulate persons, make their sets with every base, adapt them, and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--persons", type=int, default=30)
    parser.add_argument("--truth", nargs="+", default=list(model_names()), help="the cadavers that persons are like")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/base_set"))
    given = parser.parse_args()
    print("| persons are like | inside, own base | inside, others | at random | nearest outside | least held out |")
    print("|---|---|---|---|---|---|")
    for truth in given.truth:
        shutil.rmtree(given.out / truth, ignore_errors=True)
        gaps_deg, nearest_mm = with_every_base(truth, given.persons, given.seed, given.out / truth)
        print(f"| {truth} | {row(gaps_deg, nearest_mm, truth)} |", flush=True)


def with_every_base(truth: str, count: int, seed: int, folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return held-out gap, degrees, and smaller distance of TS and AI, mm: a row per person, a column per base."""
    folder.mkdir(parents=True)
    persons = simulate_persons(load_model(truth), count, 1.5, seed)
    landmark_table(persons).to_csv(folder / "landmarks.csv", index=False)
    for base in model_names():
        girdle("model", str(folder / "landmarks.csv"), "--model", base, "--out", str(folder / base))
    sets = [load_personal_sets(folder / base) for base in model_names()]
    gaps_deg = held_out_gaps(persons.motions, sets)
    return gaps_deg, pd.DataFrame({one.name: nearest(one) for one in sets}).reindex(gaps_deg.index)


def held_out_gaps(motions: Motions, sets: list[PersonalSets]) -> pd.DataFrame:
    """Adapt all sets; return the mean held-out gap, one row per subject, one column per set."""
    gaps = by_subject(adapt_subjects(motions, sets).heldout)
    return gaps.pivot_table("gap_unseen_deg", "subject", "model")


def nearest(sets: PersonalSets) -> pd.Series:
    """Return the smaller distance of TS and AI to the thorax, mm, by subject."""
    girdles = {name: one.girdle for name, one in sets.by_subject.items()}
    return pd.Series({name: min(float(g.ts_distance_mm), float(g.ai_distance_mm)) for name, g in girdles.items()})


def row(gaps_deg: pd.DataFrame, nearest_mm: pd.DataFrame, truth: str) -> str:
    """Format how often a base has TS or AI inside the thorax, and the mean held-out gap with the base of each rule."""
    inside = nearest_mm < DEEPEST_MM
    others, near = gaps_deg.drop(columns=truth), nearest_mm.drop(columns=truth)
    outside = near.where(near >= DEEPEST_MM, np.inf)
    cells = [f"{100.0 * share:.0f} %" for share in (inside[truth].mean(), inside[others.columns].to_numpy().mean())]
    ways = (others.mean(axis=1), taken(others, outside), taken(others, others))
    return " | ".join([*cells, *(f"{gaps.mean():.2f}" for gaps in ways)])


def taken(gaps_deg: pd.DataFrame, by: pd.DataFrame) -> pd.Series:
    """Return the gap of each person with the base that has the least value in ``by``."""
    return pd.Series({person: gaps_deg.loc[person, base] for person, base in by.idxmin(axis=1).items()})


if __name__ == "__main__":
    main()
