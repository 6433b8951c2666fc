"""The withheld-effect check: does the diagnosis name an effect that it has not been told of?

`scripts/blind_world` makes simulated subjects with a hidden effect; the diagnosis sees their motion file alone; the
truth is opened after the verdict. One line of JSON a case goes to FOLDER/cases.jsonl, and a rerun does only what is
missing there. Everything is simulated, from the same parameter set that the diagnosis is given.

    python scripts/blind_check.py --out out/blind                                       the reported study
    python scripts/blind_check.py --out out/blind --report                              its figures, once more
    python scripts/blind_check.py --out out/calibration --seeds 0:12                    cases to fit thresholds on
    python scripts/blind_check.py --out out/calibration --calibrate                     the thresholds that follow

With --keep-fits the fits of a case are kept too, and --weigh has the code as it is now weigh them anew: in seconds a
case one sees what another prior does. Nothing is fitted again, and no shrinkage realised again.
"""

import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Annotated

import typer

from adapt.diagnosis import diagnose
from adapt.diagnosis.result import EFFECT
from models import load_model
from models.effects import EFFECTS
from motions import read_motions
from scripts.blind.calibration import calibration
from scripts.blind.cases import (
    CALIBRATION_SEEDS,
    CONDITIONS,
    MOST_SEEDS,
    PAIRS,
    REPORTED_SEEDS,
    SHOWN_MOTIONS,
    SINGLE,
    UNSEEN_MOTION,
    Case,
    plan,
    world_of,
    written,
)
from scripts.blind.fits import Kept, keep, read_kept, weighed_anew
from scripts.blind.lines import line_of, observed, realised_gaps, single_ranking, with_truth
from scripts.blind.report import report as report_of
from scripts.blind.runs import Line, read_lines, run_missing
from scripts.reporting import check_known


def examine(case: Case, fits: Path | None) -> Line:
    """The verdict on a case's world, and only then the truth; the fits are kept in the folder, if there is one."""
    world, model, how = world_of(case), load_model(case.model), CONDITIONS[case.condition]
    effects = tuple(e for e in EFFECTS.values() if not (how.left_out and e.name == case.label))
    with tempfile.TemporaryDirectory() as folder:
        shown = written(world.table, SHOWN_MOTIONS, Path(folder) / "motions.csv")
        found = diagnose(read_motions(shown), model, effects=effects)[model.name]
        data = observed(shown, found.subjects)
        recorded = line_of(found, single_ranking(found, data))
        if UNSEEN_MOTION in set(world.table["motion"]) and found.verdict.answer == EFFECT:
            unseen = written(world.table, (SHOWN_MOTIONS[-1], UNSEEN_MOTION), Path(folder) / "unseen.csv")
            recorded["realised_deg"] = realised_gaps(found, model, observed(unseen, found.subjects))
    if fits:
        keep(Kept(found, data, world.truth), _kept_in(fits, case))
    return recorded | with_truth(found, world.truth)


def weigh(case: Case, fits: Path | None) -> Line:
    """The verdict of the code as it is now on the fits of a case that were kept."""
    kept = read_kept(_kept_in(fits or Path(), case))
    found = weighed_anew(kept)
    return line_of(found, single_ranking(found, kept.data)) | with_truth(found, kept.truth)


def _kept_in(fits: Path, case: Case) -> Path:
    return fits / f"{case.condition}_{case.label}_{case.seed}_{case.repeat}.pickle"


def _seeds(text: str) -> range:
    first, _, end = text.partition(":")
    if not (first.isdecimal() and end.isdecimal() and int(first) < int(end) <= MOST_SEEDS):
        raise typer.BadParameter(f"'{text}' is no range of seeds. Give the first and the one after the last, as 0:12")
    return range(int(first), int(end))


def _conditions(names: Sequence[str]) -> list[str]:
    check_known(names, [*CONDITIONS, "power"], "condition")
    chosen = [c for c in CONDITIONS if c in names or ("power" in names and c.startswith("power_"))]
    return chosen or list(CONDITIONS)


def _lines(path: Path, conditions: Sequence[str], seeds: range, labels: Sequence[str]) -> list[Line]:
    """The lines asked for."""
    found = (line for line in read_lines(path) if line["condition"] in conditions and line["seed"] in seeds)
    return [line for line in found if line["label"] in labels or not labels]


def main(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of cases.jsonl; made if it is not there.")],
    condition: Annotated[list[str] | None, typer.Option(help="Only this condition; repeatable. Default: all.")] = None,
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds A to B - 1. Default: the reported ones.")] = "",
    labels: Annotated[list[str] | None, typer.Option(help="Only this label; repeatable. Default: all.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    keep_fits: Annotated[bool, typer.Option("--keep-fits", help="Keep the fits in FOLDER/fits.")] = False,
    weigh_kept: Annotated[bool, typer.Option("--weigh", help="Weigh the kept fits anew; print the figures.")] = False,
    report: Annotated[bool, typer.Option("--report", help="Run nothing; print the figures.")] = False,
    calibrate: Annotated[bool, typer.Option("--calibrate", help="Run nothing; print fitted thresholds.")] = False,
    also: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="CASES.jsonl",
            exists=True,
            dir_okay=False,
            help="With --calibrate, also fit on these lines of scripts/check_elsewhere.py; repeatable.",
        ),
    ] = None,
) -> None:
    """Diagnose simulated subjects with withheld effects; print, as Markdown, how often the diagnosis is right."""
    path, fits = out / "cases.jsonl", out / "fits"
    chosen, of_labels = _conditions(condition or []), labels or []
    if calibrate:
        within = _seeds(seeds) if seeds else CALIBRATION_SEEDS
        if within.stop > CALIBRATION_SEEDS.stop:
            raise typer.BadParameter(f"thresholds are fitted on seeds below {CALIBRATION_SEEDS.stop} alone")
        lines = _lines(path, chosen if condition else ["standard"], within, of_labels)
        others = [line for file in also or [] for line in read_lines(file)]
        print(calibration([*lines, *others]))
        return
    within = _seeds(seeds) if seeds else REPORTED_SEEDS
    if not report:
        cases = plan(chosen, within, of_labels)
        if not cases:
            raise typer.BadParameter(f"no case has such a label. A label is one of {', '.join((*SINGLE, *PAIRS))}")
        how, kept_in = examine, fits if keep_fits else None
        if weigh_kept:
            path, how, kept_in = out / "weighed.jsonl", weigh, fits
            path.unlink(missing_ok=True)
            cases = [case for case in cases if _kept_in(fits, case).exists()]
        try:
            run_missing(path, cases, jobs, how, kept_in)
        except (KeyboardInterrupt, BrokenProcessPool) as error:
            why = "stopped" if isinstance(error, KeyboardInterrupt) else "a process ended, perhaps for want of memory"
            print(f"{why}; what is done is kept. Give the same command to go on.", file=sys.stderr)
            raise typer.Exit(1) from error
    print(report_of(_lines(path, chosen, within, of_labels)))


if __name__ == "__main__":
    typer.run(main)
