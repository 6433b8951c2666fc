"""The withheld-effect check: does the diagnosis name an effect that is hidden from it?

`synthetic_a` makes simulated subjects with a hidden effect. The diagnosis sees their motion file alone, and the truth
is opened after the verdict. Each case appends one line of JSON to FOLDER/cases.jsonl; a rerun does only the missing
cases. Everything is simulated, with the same parameter set that the diagnosis is given.

    python scripts/research/named_causes/blind_check.py --out out/blind                 the reported study
    python scripts/research/named_causes/blind_check.py --out out/blind --report        its figures, once more
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
from scripts.reporting import check_known
from scripts.research.named_causes.blind.cases import (
    CONDITIONS,
    MOST_SEEDS,
    PAIRS,
    REPORTED_SEEDS,
    SHOWN_MOTIONS,
    SINGLE,
    UNSEEN_MOTION,
    Case,
    Condition,
    plan,
    world_of,
    written,
)
from scripts.research.named_causes.blind.lines import cause_of, line_of, realised_gaps, with_truth
from scripts.research.named_causes.blind.report import report as report_of
from scripts.research.named_causes.blind.runs import Line, read_lines, run_missing


def examine(case: Case) -> Line:
    """Diagnose the world of a case, and only then add the truth to the line."""
    world, model, how = world_of(case), load_model(case.model), CONDITIONS[case.condition]
    effects = tuple(e for e in EFFECTS.values() if _in_library(how, at_work=cause_of(e.name) == case.label))
    with tempfile.TemporaryDirectory() as folder:
        shown = written(world.table, SHOWN_MOTIONS, Path(folder) / "motions.csv")
        found = diagnose(read_motions(shown), model, effects=effects)[model.name]
        recorded = line_of(found)
        if UNSEEN_MOTION in set(world.table["motion"]) and found.verdict.answer == EFFECT:
            every = written(world.table, (*SHOWN_MOTIONS, UNSEEN_MOTION), Path(folder) / "every.csv")
            recorded["realised_deg"] = realised_gaps(found, model, read_motions(every))
    return recorded | with_truth(found, world.truth)


def _in_library(how: Condition, at_work: bool) -> bool:
    return how.library == "all" or at_work == (how.library == "alone")


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
    """Read the lines of these conditions, seeds and labels."""
    found = (line for line in read_lines(path) if line["condition"] in conditions and line["seed"] in seeds)
    return [line for line in found if line["label"] in labels or not labels]


def main(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of cases.jsonl; made if it is not there.")],
    condition: Annotated[list[str] | None, typer.Option(help="Only this condition; repeatable. Default: all.")] = None,
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds A to B - 1. Default: the reported ones.")] = "",
    labels: Annotated[list[str] | None, typer.Option(help="Only this label; repeatable. Default: all.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    report: Annotated[bool, typer.Option("--report", help="Run nothing; print the figures.")] = False,
) -> None:
    """Diagnose simulated subjects with withheld effects; print, as Markdown, how often the diagnosis is right."""
    path = out / "cases.jsonl"
    chosen, of_labels = _conditions(condition or []), labels or []
    within = _seeds(seeds) if seeds else REPORTED_SEEDS
    if not report:
        cases = plan(chosen, within, of_labels)
        if not cases:
            raise typer.BadParameter(f"no case has such a label. A label is one of {', '.join((*SINGLE, *PAIRS))}")
        try:
            run_missing(path, cases, jobs, examine)
        except (KeyboardInterrupt, BrokenProcessPool) as error:
            why = "stopped" if isinstance(error, KeyboardInterrupt) else "a process ended, perhaps for want of memory"
            print(f"{why}; what is done is kept. Give the same command to go on.", file=sys.stderr)
            raise typer.Exit(1) from error
    print(report_of(_lines(path, chosen, within, of_labels)))


if __name__ == "__main__":
    typer.run(main)
