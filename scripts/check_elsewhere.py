"""The withheld-effect check on worlds made elsewhere: does the diagnosis name what others have hidden?

Every folder below FOLDER with a `motions.csv` and a `truth.json` is a case. The truth needs two keys: `label`, the
effect at work (two joined by `+`; `none...`; `outside_...` for one that is not in the list), and `model`, the parameter
set; the diagnosis is told nothing else of it. Lines and figures are those of `scripts/blind_check.py`.

    python scripts/check_elsewhere.py worlds --out out/elsewhere
"""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from adapt.diagnosis import diagnose
from adapt.diagnosis.result import NONE
from models import load_model
from motions import read_motions
from scripts.blind.cases import Case
from scripts.blind.lines import line_of
from scripts.blind.report import confusion_matrix, report
from scripts.blind.runs import Line, read_lines, run_missing
from scripts.blind.several import several_report

MOTIONS, TRUTH = "motions.csv", "truth.json"


@dataclass(frozen=True)
class Elsewhere(Case):
    """A world that others made."""

    parameter_set: str = ""
    folder: str = ""

    @property
    def model(self) -> str:
        """The parameter set that the truth names."""
        return self.parameter_set


def worlds(folder: Path) -> list[Elsewhere]:
    """All worlds below a folder, by name; those of one label are its repeats."""
    found, count = [], Counter()
    for path in sorted(folder.rglob(TRUTH)):
        if not path.with_name(MOTIONS).exists():
            continue
        truth = json.loads(path.read_text(encoding="utf-8"))
        label = NONE if truth["label"].startswith(NONE) else truth["label"]
        found.append(Elsewhere("elsewhere", label, 0, count[label], truth["model"], str(path.parent)))
        count[label] += 1
    return found


def examine(case: Elsewhere) -> Line:
    """The verdict on a world; what its effects' sizes mean, others know."""
    model = load_model(case.model)
    found = diagnose(read_motions(Path(case.folder) / MOTIONS), model)[model.name]
    return line_of(found) | {"true_directions": {}}


def main(
    folder: Annotated[Path, typer.Argument(help="Folder of worlds.", exists=True, file_okay=False)],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of cases.jsonl; made if it is not there.")],
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    """Diagnose worlds made elsewhere; print, as Markdown, how often the diagnosis is right."""
    cases = worlds(folder)
    if not cases:
        raise typer.BadParameter(f"no folder below {folder} has a {MOTIONS} and a {TRUTH}")
    run_missing(out / "cases.jsonl", cases, jobs, examine)
    lines = read_lines(out / "cases.jsonl")
    print(report(lines))
    print("\n## Confusion matrix\n\n" + confusion_matrix([x for x in lines if "failed" not in x]))
    print("\n## Causes\n\n" + several_report(lines))


if __name__ == "__main__":
    typer.run(main)
