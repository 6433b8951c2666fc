# pyright: reportAttributeAccessIssue=false, reportIndexIssue=false, reportArgumentType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Does a person's own parameter set fit better than a cadaver's? Simulated persons; prints the table of docs/person.md.

    .venv/bin/python scripts/research/person/study_person.py --persons 40 --out out/person

Each person's clavicle, scapula and thorax differ from the cadaver's. Their landmarks are palpated with noise,
``girdle model`` makes their own sets, and both sets are adapted to their (noisy) motions.
"""

import argparse
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pandas as pd

from models import load_model
from motions import write_motions
from scripts.research.person.simulated_persons import landmark_table, point_table, simulate_persons


def main() -> None:
    """Simulate persons, make their sets, adapt, and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--persons", type=int, default=40)
    parser.add_argument("--model", default="R2", help="the cadaver whose sizes they do not have")
    parser.add_argument("--truth", help="the cadaver that they are like but for their sizes; by default the same")
    parser.add_argument("--points", action="store_true", help="points on their thorax are palpated too")
    parser.add_argument("--landmarks", action="store_true", help="adapt with TS and AI of every posture, and without")
    parser.add_argument("--noise-deg", type=float, default=1.5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("out/person"))
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    given.out.mkdir(parents=True)
    persons = simulate_persons(load_model(given.truth or given.model), given.persons, given.noise_deg, given.seed)
    motions, landmarks, sets = given.out / "motions.csv", given.out / "landmarks.csv", given.out / "own"
    moved = replace(persons.motions, landmarks_mm=persons.landmarks_mm) if given.landmarks else persons.motions
    write_motions(moved, motions)
    landmark_table(persons).to_csv(landmarks, index=False)
    point_table(persons).to_csv(given.out / "points.csv", index=False)
    points = ["--points", str(given.out / "points.csv")] if given.points else []
    girdle("model", str(landmarks), "--model", given.model, "--out", str(sets), *points)
    models = ["--model", given.model, "--models-of", str(sets)]
    girdle("adapt", str(motions), *models, "--out", str(given.out / "adapted"))
    print(compared(given.out / "adapted", given.model, given.persons))
    if given.landmarks:
        seen = ["--reading", "mm2_deg2_landmarks", "--out", str(given.out / "with_landmarks")]
        girdle("adapt", str(motions), *models, *seen)
        print(f"\n{with_landmarks(given.out / 'adapted', given.out / 'with_landmarks')}")


def girdle(*arguments: str) -> None:
    """Run a command of this project; exit with its output where it fails (status 3: some subjects were left out)."""
    ended = subprocess.run([sys.executable, "-m", "adapt", *arguments], capture_output=True, text=True, check=False)
    if ended.returncode not in (0, 3):
        sys.exit(ended.stdout + ended.stderr)


def with_landmarks(without: Path, seen: Path) -> str:
    """Tabulate held-out gaps per set, adapted without and with TS and AI, and the number of subjects that gain."""
    lines = ["| set | held out | held out, with landmarks | smaller |", "|---|---|---|---|"]
    before, after = (held_out(folder) for folder in (without, seen))
    for model in before.index.unique("model"):
        one, other = before[model].align(after[model], join="inner")
        lines.append(f"| {model} | {one.mean():.2f} | {other.mean():.2f} | {int((other < one).sum())} of {len(one)} |")
    return "\n".join(lines)


def held_out(folder: Path) -> pd.Series:
    """Compute the mean held-out gap, degrees, by model and subject."""
    unseen = pd.read_csv(folder / "heldout.csv")
    return pd.Series(unseen[unseen["status"] == "ok"].groupby(["model", "subject"])["gap_unseen_deg"].mean())


def compared(folder: Path, cadaver: str, persons: int) -> str:
    """Tabulate the gaps of both sets before and after adaptation and held out, and the number of subjects that gain."""
    fits, held = pd.read_csv(folder / "fits.csv"), held_out(folder)
    fits["gap"] = fits.filter(regex=r"_difference_deg$").abs().mean(axis=1)
    seen = fits[fits["status"] == "ok"].groupby(["model", "adapted", "subject"])["gap"].mean()
    lines = [
        f"{persons} simulated persons: mean gap, degrees",
        "",
        "| gap | cadaver's set | own set | own is smaller |",
    ]
    lines.append("|---|---|---|---|")
    for what, of in (
        ("as it is", lambda model: seen[model, 0]),
        ("adapted", lambda model: seen[model, 1]),
        ("held out", lambda model: held[model]),
    ):
        theirs, own = of(cadaver).align(of("own"), join="inner")
        lines.append(f"| {what} | {theirs.mean():.2f} | {own.mean():.2f} | {int((own < theirs).sum())} of {len(own)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
