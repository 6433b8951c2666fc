"""The withheld-effect check on external worlds: does the diagnosis name effects that other authors have hidden?

Every folder below FOLDER with a `motions.csv` and a `truth.json` is a case. The truth needs two keys: `label`, the
active effect (several joined by `+`; `none...`; `outside_...` for an effect that is not in the list), and `model`, the
parameter set, which is all that the diagnosis is told. Lines and figures are as in `blind_check.py`. Where the truth
has `strengths` (for each subject, effect and direction of `girdle effects` one number per posture), intervals of sizes
are checked. A `without_causes.csv` beside them, the same motions without any active cause, gives the true share of the
gap that no cause explains.

    python scripts/research/named_causes/external_worlds.py worlds --out out/external

With `--at-work` the library holds the active causes alone: a cause that is missed then could not have been found.
"""

import json
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from adapt.diagnosis import diagnose
from adapt.diagnosis.inference.unexplained import unexplained_share
from adapt.diagnosis.result import ALL, NONE, Diagnosis
from models import ParameterSet, load_model
from models.effects import EFFECTS, Effect
from models.effects.amplitudes import NO_EFFECTS
from models.effects.effect import cause_of
from motions import Motions, read_motions
from scripts.research.named_causes.blind.cases import Case
from scripts.research.named_causes.blind.lines import line_of
from scripts.research.named_causes.blind.report import confusion_matrix, report
from scripts.research.named_causes.blind.runs import Line, read_lines, run_missing
from scripts.research.named_causes.blind.several import several_report
from scripts.research.named_causes.measured_check import unseen_gaps_deg

MOTIONS, TRUTH, WITHOUT_CAUSES = "motions.csv", "truth.json", "without_causes.csv"


@dataclass(frozen=True)
class ExternalWorld(Case):
    """A world made by other authors."""

    parameter_set: str = ""
    folder: str = ""

    @property
    def model(self) -> str:
        """Parameter set that the truth names."""
        return self.parameter_set


def worlds(folder: Path) -> list[ExternalWorld]:
    """List all worlds below a folder, by name; worlds of one label are its repeats."""
    found, count = [], Counter()
    for path in sorted(folder.rglob(TRUTH)):
        if not path.with_name(MOTIONS).exists():
            continue
        truth = json.loads(path.read_text(encoding="utf-8"))
        label = NONE if truth["label"].startswith(NONE) else truth["label"]
        found.append(ExternalWorld("external", label, 0, count[label], truth["model"], str(path.parent)))
        count[label] += 1
    return found


def examine(case: ExternalWorld, only_at_work: bool) -> Line:
    """Diagnose a world, then add the true sizes to the line."""
    model = load_model(case.model)
    folder = Path(case.folder)
    true = set(case.label.split("+"))
    library = [effect for effect in EFFECTS.values() if cause_of(effect.name) in true] if only_at_work else None
    motions = read_motions(folder / MOTIONS)
    found = diagnose(motions, model, effects=library)[model.name]
    truth = json.loads((folder / TRUTH).read_text(encoding="utf-8"))
    line = line_of(found) | {"true_directions": true_sizes(truth, motions, found)}
    if (folder / WITHOUT_CAUSES).exists():
        line["true_left_over_share"] = _true_share(found, model, read_motions(folder / WITHOUT_CAUSES))
    return line


def true_sizes(truth: dict[str, Any], motions: Motions, found: Diagnosis) -> dict[str, dict[str, float]]:
    """Return the true size by active effect and direction, where both diagnosis and truth have it.

    The library's basis is fitted to the true strengths of each subject by least squares; the size is the first
    amplitude of each direction, averaged over the subjects.
    """
    bases = {cause_of(name): EFFECTS.get(name) for name in found.effects}
    of_subjects: dict[str, list[dict[str, float]]] = {}
    for subject, effects in truth.get("strengths", {}).items():
        if subject in found.subjects:
            own = motions.select(motions.subject == subject)
            for name in bases.keys() & effects:
                if (effect := bases[name]) and effects[name].keys() >= set(effect.directions):
                    of_subjects.setdefault(name, []).append(_nearest_amplitudes(effect, effects[name], own))
    return {name: pd.DataFrame(each).mean().to_dict() for name, each in of_subjects.items()}


def _nearest_amplitudes(effect: Effect, strength: dict[str, list[float]], own: Motions) -> dict[str, float]:
    columns = effect.columns(own)
    by_posture = np.array([strength[direction] for direction in effect.directions])
    amplitude, *_ = np.linalg.lstsq(columns.reshape(len(columns), -1).T, by_posture.ravel(), rcond=None)
    return dict(zip(effect.directions, amplitude[:: len(effect.basis.sd)].tolist(), strict=True))


def _true_share(found: Diagnosis, model: ParameterSet, without_causes: Motions) -> float:
    """Compute the true unexplained share: the part of the adapted gap beyond noise left by own bones, no causes."""
    levels = found.gaps.hardest
    left_deg = unseen_gaps_deg(without_causes, model, NO_EFFECTS)[ALL]
    return unexplained_share(levels["adapted"][ALL].value, left_deg, levels["noise_floor"][ALL].value)


def main(
    folder: Annotated[Path, typer.Argument(help="Folder of worlds.", exists=True, file_okay=False)],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of cases.jsonl; made if it is not there.")],
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    only_at_work: Annotated[
        bool, typer.Option("--at-work", help="Leave all other causes out of the library, and worlds without a cause.")
    ] = False,
) -> None:
    """Diagnose external worlds; print, as Markdown, how often the diagnosis is right."""
    cases = worlds(folder)
    if not cases:
        raise typer.BadParameter(f"no folder below {folder} has a {MOTIONS} and a {TRUTH}")
    if only_at_work:
        cases = [case for case in cases if case.label != NONE]
    run_missing(out / "cases.jsonl", cases, jobs, partial(examine, only_at_work=only_at_work))
    lines = read_lines(out / "cases.jsonl")
    print(report(lines))
    print("\n## Confusion matrix\n\n" + confusion_matrix([x for x in lines if "failed" not in x]))
    print("\n## Causes\n\n" + several_report(lines))


if __name__ == "__main__":
    typer.run(main)
