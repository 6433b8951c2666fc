"""Is an effect missed because its true form is not a candidate? Evidence of the library's form and of the true form.

For worlds with one cause whose truth has the strength in every posture (`synthetic_b`): the log evidence, relative to
no cause, of the library's best basis, and of the true strengths of each subject times one amplitude. Where the true
strengths gain much and the library little, the library's form is too narrow. Where the true strengths gain little, no
candidate of any form can be found in such data.

    python -m scripts.research.named_causes.synthetic_b out/forms --condition several --seed 38
    python scripts/research/named_causes/study_forms.py out/forms
"""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from jaxtyping import Float

from adapt.cli import app as cli
from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.discrepancy import Belief
from adapt.diagnosis.fit.likeliest import likeliest
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import Node, Search, search_of
from models import load_model
from models.effects import EFFECTS, Effect
from models.effects.basis import Basis
from models.effects.effect import cause_of
from models.effects.prior import EffectPrior
from motions import Motions, read_motions
from scripts.reporting import markdown
from scripts.research.named_causes.external_worlds import MOTIONS, TRUTH, worlds

SHARE_SD = 0.3
"""SD of the factor on the true strengths, about 1. The factor is known: a hundredth of this SD would do as well."""

TRUE = "as it truly is"


@dataclass(frozen=True, eq=False)
class AsItIs(Basis):
    """A basis with one amplitude: a factor on strengths that are known in every posture."""

    word: str = TRUE
    known: Float[np.ndarray, "channels postures"] = field(kw_only=True)

    def channels(self, directions: int) -> int:
        """Return the number of channels of the known strengths."""
        return len(self.known)

    def columns(self, directions: int, motions: Motions) -> Float[np.ndarray, "amplitudes channels postures"]:
        """Return the known strengths."""
        return self.known[None]


app = typer.Typer(add_completion=False)


@app.command()
def study_forms(
    folder: Annotated[Path, typer.Argument(help="Folder of worlds.", exists=True, file_okay=False)],
) -> None:
    """Compare forms on every world of one cause below a folder; print a line per world and the means per effect."""
    rows = []
    print(f"| effect | world | {' | '.join(_HEADER)} |\n" + "|---" * (2 + len(_HEADER)) + "|")
    for world in worlds(folder):
        path = Path(world.folder)
        truth = json.loads((path / TRUTH).read_text(encoding="utf-8"))
        if told(truth):
            row = compared(truth, read_motions(path / MOTIONS))
            print(f"| {world.label} | {path.relative_to(folder)} | {' | '.join(cells(row))} |", flush=True)
            rows.append({"effect": world.label, **row})
    if not rows:
        raise typer.BadParameter(f"no world below {folder} has one cause with strengths that its {TRUTH} tells")
    means = []
    for name, own in pd.DataFrame(rows).groupby("effect"):
        means.append([str(name), str(len(own)), *cells(own.drop(columns="effect").mean())])
    print("\n" + markdown(["effect", "worlds", *_HEADER], means))


_HEADER = ("library, log evidence", "true")


def told(truth: dict) -> bool:
    """Check whether a world has one active cause with known strengths."""
    strengths = truth.get("strengths", {})
    return truth["label"] in EFFECTS and bool(strengths) and all(truth["label"] in one for one in strengths.values())


def cells(row) -> list[str]:
    """Format the gains in log evidence."""
    return [f"{row['library']:.0f}", f"{row['true']:.0f}"]


def compared(truth: dict, motions: Motions) -> dict[str, float]:
    """Compute the gains in log evidence over no cause: of the library's best basis, and of the true strengths.

    Every evidence uses the discrepancy that the true strengths leave unexplained.
    """
    label, model = truth["label"], load_model(truth["model"])
    shoulders, _ = usable(motions)
    effects = (*(one for one in EFFECTS.values() if cause_of(one.name) == label), true_effect(truth, shoulders.motions))
    first = search_of(model, shoulders, effects)
    left_over = likeliest(first.joint, fitted(first, (TRUE,)).posterior).discrepancy
    settled = Search(first.joint, first.folds, discrepancy=left_over, beliefs=(Belief("common", left_over),))
    none, *library, true = (log_evidence(settled, hypothesis) for hypothesis in ((), *((one.name,) for one in effects)))
    return {"library": max(library) - none, "true": true - none}


def true_effect(truth: dict, motions: Motions) -> Effect:
    """Make the effect with each subject's true strengths in the postures that the motions have."""
    effect = EFFECTS[truth["label"]]
    by_subject = {name: pd.DataFrame(one[effect.name]) for name, one in truth["strengths"].items()}
    kinds = list(dict.fromkeys(motions.motion.tolist()))
    postures = {name: len(one) // len(kinds) for name, one in by_subject.items()}
    strengths = [
        by_subject[subject].iloc[kinds.index(kind) * postures[subject] + int(posture) - 1]
        for subject, kind, posture in zip(motions.subject, motions.motion, motions.posture, strict=True)
    ]
    basis = AsItIs(known=np.transpose(strengths))
    size = float(np.hypot(1.0, SHARE_SD) * basis.rms(1, motions)[0])
    prior = EffectPrior(scale=(size,), mean=1.0 / SHARE_SD, source=TRUE)
    return replace(effect, name=TRUE, directions=("share",), basis=basis, prior=prior)


def fitted(search: Search, hypothesis: Hypothesis) -> Node:
    """Fit a hypothesis, starting from no cause."""
    none = search.fit((), None)
    return search.fit(hypothesis, none) if hypothesis else none


def log_evidence(search: Search, hypothesis: Hypothesis) -> float:
    """Compute the log evidence of a hypothesis."""
    return search.given(fitted(search, hypothesis).posterior, hypothesis).log_evidence


if __name__ == "__main__":
    cli.main(app)
