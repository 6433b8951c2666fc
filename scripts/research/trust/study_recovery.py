# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportGeneralTypeIssues=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Do the intervals of adapted parameters hold the truth? Simulated subjects with known parameters, noise, adaptation.

    python scripts/research/trust/study_recovery.py --out out/recovery

Everything is simulated: subjects have a set's girdle with parameters of their own, move as near to the published rhythm
as their chain allows, with independent noise on every angle; the thorax points are still those of the set. A 95 %
interval should hold the true value in 95 % of cases; 92-97 % is the aim. Worlds:

    as assumed          the spread of persons about the set is PERSON_SD_MM, as the intervals assume
    persons alike       half of that spread
    persons unlike      twice that spread
    noise 0.5, 3 deg    other noise, which the intervals estimate from the gap

For comparison: the coverage of the noise alone, without the spread of persons, and of the intervals +-1.96 SD alone.
Each set and world is one file of the folder. Existing files are kept, so an interrupted study can be resumed.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from adapt.cli import app as cli
from adapt.evaluation.covariance import NORMAL_95, sd, uncertainty
from adapt.evaluation.model_subjects import simulate_model_subjects
from adapt.output.run_files import prepare_folder, write_table
from adapt.solvers import status
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.problems import problems_of
from adapt.solvers.rows import posture_rows
from adapt.trust.assessment import intervals
from adapt.trust.flat_directions import FLAT_MM
from adapt.trust.profile import profile_intervals
from models import ParameterSet, load_model
from models.adapted_parameters import ADAPTED
from scripts.reporting import markdown, wilson

SEED = 20261121

app = typer.Typer(add_completion=False)


@dataclass(frozen=True)
class World:
    """Differences of the simulated subjects from the assumptions of the intervals."""

    name: str
    spread: float = 1.0
    noise_deg: float = 1.5


WORLDS = (
    World("as assumed"),
    World("persons alike", spread=0.5),
    World("persons unlike", spread=2.0),
    World("noise 0.5 deg", noise_deg=0.5),
    World("noise 3 deg", noise_deg=3.0),
)


def recovered(model: ParameterSet, world: World, subjects: int, seed: int, profiles: bool) -> pd.DataFrame:
    """Adapt simulated subjects; return error, SDs and the intervals' coverage, one row per subject and parameter."""
    made = simulate_model_subjects(model, None, subjects, world.noise_deg, seed, spread=world.spread)
    batch = posture_rows(made.motions)
    names = list(batch.subjects)
    data = problems_of(batch, [model])
    adapted = adapt_batch(data)
    found = uncertainty(data, adapted)
    truth = made.truth.set_index("subject").loc[names][[f"{name}_mm" for name in ADAPTED]].to_numpy().T
    ends, origin = intervals(data, adapted, found)
    profile = profile_intervals(data, adapted, found, (found.sd_mm > FLAT_MM) & profiles).ends_mm
    by_profile = np.where(np.isfinite(profile).all(axis=0), (profile[0] <= truth) & (truth <= profile[1]), np.nan)
    error = adapted.theta_mm - truth
    columns = {
        "parameter": np.repeat(ADAPTED, len(names)),
        "error_mm": error.ravel(),
        "sd_mm": found.sd_mm.ravel(),
        "covered": ((ends[0] <= truth) & (truth <= ends[1])).ravel(),
        "covered_by_profile": by_profile.ravel(),
        "covered_by_noise": (np.abs(error) <= NORMAL_95 * sd(found.noise_mm2)).ravel(),
        "width_mm": (ends[1] - ends[0]).ravel(),
        "interval": origin.ravel(),
        "noise_deg": np.tile(found.noise_deg, len(ADAPTED)),
        "ok": np.tile(adapted.status == status.OK, len(ADAPTED)),
    }
    return pd.DataFrame(columns).assign(model=model.name, world=world.name, made=subjects)


def by_parameter(table: pd.DataFrame) -> str:
    """Format as Markdown one line per set and parameter."""
    header = [
        "set",
        "parameter",
        "rms error, mm",
        "covered",
        "by the profile of E",
        "by the noise alone",
        "median width, mm",
    ]
    header.append("at a bound")
    lines = []
    for (model, name), rows in table.groupby(["model", "parameter"], sort=False):
        rms = np.sqrt((rows["error_mm"] ** 2).mean())
        cells = [f"{rms:.1f}", percent(rows["covered"])]
        profile = rows["covered_by_profile"].dropna().astype(bool)
        cells += [percent(profile) if len(profile) else "-", percent(rows["covered_by_noise"])]
        cells += [f"{rows['width_mm'].median():.1f}", f"{100 * (rows['interval'] == 'bounds').mean():.0f} %"]
        lines.append([str(model), str(name), *cells])
    return markdown(header, lines)


def by_world(table: pd.DataFrame) -> str:
    """Format as Markdown one line per world: all sets and parameters, then without those at a bound, then groups."""
    header = ["world", "subjects adapted ok", "covered", "not at a bound", "M_y, A_y", "the other four", "noise found"]
    lines = []
    for world, rows in table.groupby("world", sort=False):
        flat = rows["parameter"].isin(["M_y", "A_y"])
        parts = [rows, rows[rows["interval"] != "bounds"], rows[flat], rows[~flat]]
        cells = [percent(part["covered"]) for part in parts]
        lines.append([str(world), str(len(rows) // len(ADAPTED)), *cells, f"{rows['noise_deg'].median():.2f} deg"])
    return markdown(header, lines)


def percent(covered: pd.Series) -> str:
    """Format a share with its Wilson interval as '95.1 % (94-96)'."""
    share, (low, high) = covered.mean(), wilson(int(covered.sum()), len(covered), NORMAL_95)
    return f"{100 * share:.1f} % ({100 * low:.0f}-{100 * high:.0f})"


@app.command()
def main(
    out: Annotated[Path, typer.Option(help="Folder for the results, one file a set and world.")] = Path("out/recovery"),
    subjects: Annotated[int, typer.Option(min=2, help="Simulated subjects of each set in the first world.")] = 256,
    others: Annotated[int, typer.Option(min=2, help="The same in each other world.")] = 128,
    model: Annotated[list[str] | None, typer.Option(help="Parameter set; repeatable.")] = None,
    profiles: Annotated[bool, typer.Option(help="Check flat parameters by profiles of E, too.")] = True,
    seed: Annotated[int, typer.Option(help="Of the first world's subjects; each other world takes the next.")] = SEED,
) -> None:
    """Print, as Markdown, how often the intervals hold the truth. All subjects are simulated."""
    sets = [load_model(name) for name in model or ("R6", "R2", "breteler_dissection")]
    parts = []
    folder = prepare_folder(out)
    for number, world in enumerate(WORLDS):
        for one in sets:
            count = others if number else subjects
            name = f"{world.name.replace(' ', '_')}-{one.name}-{count}-{seed + number}"
            path = folder / f"{name}{'' if profiles else '-sd'}.csv"
            if not path.exists():
                print(f"{world.name}: {one.name}", file=sys.stderr, flush=True)
                write_table(recovered(one, world, count, seed + number, profiles), path)
            parts.append(pd.read_csv(path))
    report(pd.concat(parts, ignore_index=True))


def report(table: pd.DataFrame) -> None:
    """Print both tables, for the subjects whose adaptation has status ok."""
    failed = int((~table["ok"]).sum()) // len(ADAPTED)
    table = pd.DataFrame(table[table["ok"]])
    print(f"Simulated subjects. Not adapted: {failed}.\n")
    print(by_parameter(table[table["world"] == WORLDS[0].name]))
    print(f"\n{by_world(table)}")


if __name__ == "__main__":
    cli.main(app)
