"""Does the diagnosis name causes that predict measured shoulders? The gap on motions and persons that were not fitted.

For each parameter set: what `girdle diagnose` names by itself, and the mean |simulated - measured| of scapula and
clavicle, degrees, adapted without each motion: without the causes, with them (``girdle adapt --effect``), and with
amplitudes that have seen neither the person nor the motion.
"""

import argparse
from pathlib import Path

from adapt.diagnosis import Diagnosis, diagnose
from models import load_model
from motions import read_motions

_SETS = ("breteler_dissection", "breteler_mri", "R2", "R4", "R6")

_NEVER_UNDER_PINS = ("skin_artefact", "clavicle_axial_estimate")
"""Bone pins exclude them."""


def main() -> None:
    """Diagnose the motions with each set and print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("motions", nargs="+", type=Path, help="motion files of bone-pin shoulders")
    parser.add_argument("--model", action="append", help=f"parameter sets; default: {', '.join(_SETS)}")
    options = parser.parse_args()
    motions = read_motions(*options.motions)
    print("| parameter set | causes named | adapted | + causes, motion unseen | + causes, person and motion unseen |")
    print("|---|---|---|---|---|")
    for name in options.model or _SETS:
        print(_row(diagnose(motions, load_model(name))[name]), flush=True)


def _row(diagnosis: Diagnosis) -> str:
    causes = ["/".join(cause.names) for cause in diagnosis.verdict.causes]
    wrong = [name for name in diagnosis.verdict.names if name in _NEVER_UNDER_PINS]
    seen, person = diagnosis.gaps.other_motion, diagnosis.gaps.other_person
    cells = [_bones(seen["adapted"]), _bones(seen["with_effect"])] if seen else ["-", "-"]
    cells.append(_bones(person["with_effect"]) if person else "-")
    said = ", ".join(causes) or diagnosis.verdict.answer
    return f"| {diagnosis.model} | {said}{' WRONG' if wrong else ''} | {' | '.join(cells)} |"


def _bones(gaps) -> str:
    return ", ".join(f"{gaps[bone].value:.2f}" for bone in ("scapula", "clavicle"))


if __name__ == "__main__":
    main()
