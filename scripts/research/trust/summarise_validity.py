# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false
# pyright: reportOperatorIssue=false, reportReturnType=false, reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""How does an adaptation change forces and arms, per parameter set? The tables of docs/validity.md.

Reads the folders of ``girdle trust`` and ``girdle muscles``. Directions and arms: means over the postures of each
motion, then over the motions of each subject, then over subjects; in brackets the largest subject. Forces: means of
postures.
"""

import argparse
from pathlib import Path

import pandas as pd

from adapt.tables.before_after import subject_means
from adapt.tables.muscle_tables import JOINTS
from adapt.trust.thorax_plausibility import WARNING
from models.muscles.contact import FORCES

KEYS = ["model", "subject"]


def directions(trust: Path) -> pd.DataFrame:
    """Tabulate the rotation of each force, degrees, and the number of subjects beyond the limits."""
    turned = subject_means(pd.read_csv(trust / "contact.csv"), [f"{force}_turned_deg" for force in FORCES])
    checks = pd.read_csv(trust / "plausibility.csv")
    checks = checks[checks["check"].str.startswith(("direction", "serratus"))]
    warned = checks.groupby(["model", "check"], sort=False)["verdict"].agg(lambda x: int((x == WARNING).sum()))
    table = {}
    for force in FORCES:
        by_model = turned.groupby("model", sort=False)[f"{force}_turned_deg"]
        table[force] = by_model.mean().map("{:.1f}".format) + " (" + by_model.max().map("{:.1f}".format) + ")"
    return pd.DataFrame(table).join(warned.unstack())


def arms(muscles: Path) -> pd.DataFrame:
    """Tabulate the arms about SC, AC and GH of each muscle, mm, before -> after."""
    found = pd.read_csv(muscles / "muscle_arms.csv")
    table = found.groupby(["model", "muscle"], sort=False).mean(numeric_only=True)
    return pd.DataFrame({joint: _change(table, f"about_{joint}_{{}}_mm", ".0f") for joint in JOINTS})


def forces(muscles: Path) -> pd.DataFrame:
    """Tabulate contact and muscle forces, N, before -> after, the share that moved, and postures without a solution."""
    found = pd.read_csv(muscles / "balance.csv")
    table = found.groupby("model", sort=False).mean(numeric_only=True)
    columns = {name: _change(table, f"{name}_{{}}_N", ".0f") for name in (*FORCES, "GH", "muscles")}
    columns["moved, %"] = (100.0 * table["moved_share"]).round(0)
    for state in ("before", "after"):
        failed = found[f"status_{state}"] != "ok"
        columns[f"no balance {state}"] = failed.groupby(found["model"], sort=False).sum()
    return pd.DataFrame(columns)


def _change(table: pd.DataFrame, name: str, form: str) -> pd.Series:
    before, after = (table[name.format(word)].map(f"{{:{form}}}".format) for word in ("before", "after"))
    return before + " -> " + after


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trust", type=Path, help="folder that girdle trust wrote")
    parser.add_argument("muscles", type=Path, help="folder that girdle muscles wrote")
    folders = parser.parse_args()
    for table in (directions(folders.trust), arms(folders.muscles), forces(folders.muscles)):
        print(table.to_string(), end="\n\n")


if __name__ == "__main__":
    main()
