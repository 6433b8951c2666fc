"""Which rule should complete the unpublished numbers of R2, R4 and R6? Rules of scripts/completion.py compared.

    python scripts/research/thesis/study_completion.py ../shared/motions/*.csv \
        --mean mean_ludewig2009 --mean mean_oki2012

Every rule makes the three sets anew; each set is fitted to measured shoulders, adapted, and adapted again without each
motion in turn. Prints Markdown: gaps of every rule, mean |simulated - measured| in degrees over the sets; the adapted
parameters beside Tables 6.5 and 6.6; and folds: the rule of a grid that is best for all persons but one is scored on
that person, beside the shipped and the earlier rule. Left and right shoulder of a cadaver count as one person, and so
does a group mean (--mean). Tables that are compared with the thesis leave out group means.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Bool, Float

from adapt.cli import app as cli
from adapt.evaluation.held_out import held_out
from adapt.solvers import status
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems, problems_of
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.tables.folds import Fold, motions_or_thirds
from adapt.trust.thesis.printed import SETS
from models import ParameterSet, load_model
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle, constraint_residuals_mm
from motions import InputError, Motions, read_motions
from motions.rotations import DEG
from motions.table import BONES, person_of
from scripts.completion import SHIPPED, Completed, Rule, table_sets
from scripts.reporting import check_known, markdown

OTHER_SETS = ("breteler_dissection", "breteler_mri", "das3")

PUBLISHED_SHIFT_MM = {"R2": (23, -3, -4, -1, -15, 0), "R4": (11, -10, -1, 2, -18, -3), "R6": (2, 1, -1, 8, -2, -1)}
PUBLISHED_SD_MM = {"R2": (31, 6, 3, 24, 17, 2), "R4": (21, 6, 2, 13, 15, 1), "R6": (8, 7, 2, 13, 17, 2)}
"""Mean of Table 6.5 less Table 6.6, and SD of Table 6.5, in the order of ADAPTED."""

PUBLISHED_BEFORE_DEG = {"R2": 7.0, "R4": 8.6, "R6": 5.9}
"""Scapula gap before adaptation, mean of Table 6.2 (abduction)."""

EARLIER_ON_CLAVICLE = (0.653985, 0.098593, -0.023317)
EARLIER_ON_SCAPULA_MM = {
    "R2": (-29.124573, 9.006646, -32.457071),
    "R4": (-25.944935, 10.070332, -32.794601),
    "R6": (-28.302972, 11.381305, -36.525447),
}
"""Conoid attachments of the sets before this study. Clavicle: read as if DAS3's clavicle frame went through its "AC",
which is AA. Scapula: at 40 deg from the line to AC."""

EARLIER = Rule(least_mm=None, on_clavicle=EARLIER_ON_CLAVICLE)
EARLIER_NAME = "earlier sets: mean rest posture, conoid 40 deg from the line to AC"
SHIPPED_NAME = "as shipped: conoid hangs, TS and AI not inside, own rest postures"

MEAN_REST = Rule(least_mm=None)

TURNS_DEG = (-60.0, -30.0, -15.0, 15.0, 30.0, 60.0)

LEAST_MM = {"5": (5.0, 5.0), "10": (10.0, 10.0), "20": (20.0, 20.0), "TS 20, AI 10": (20.0, 10.0)}
LEAST_MM |= {"TS 34.8, AI 26.0 (Tables 4.2, 4.5: dissection)": (34.8, 26.0), "TS 45.7, AI 21.0 (MRI)": (45.7, 21.0)}


def _moved(axis: int, mm: float) -> tuple[float, float, float]:
    x, y, z = np.asarray(SHIPPED.sc_mm) + mm * np.eye(3)[axis]
    return float(x), float(y), float(z)


def _placed(along: float) -> tuple[float, float, float]:
    _, above, behind = SHIPPED.on_clavicle
    return along, float(above), float(behind)


RULES: Mapping[str, Rule] = {
    EARLIER_NAME: EARLIER,
    "(a) conoid as in DAS3, mean rest posture": replace(MEAN_REST, hangs=False),
    "(a) conoid hangs, mean rest posture": MEAN_REST,
    SHIPPED_NAME: SHIPPED,
    "(a) shipped, conoid as in DAS3": replace(SHIPPED, hangs=False),
    **{f"(a) shipped, {turn:+g} deg forward": replace(SHIPPED, forward_deg=turn) for turn in TURNS_DEG},
    **{f"(a) shipped, at {f:g} of the clavicle": replace(SHIPPED, on_clavicle=_placed(f)) for f in (0.6, 0.85)},
    **{
        f"(b) shipped, SC {'xyz'[axis]} {mm:+d} mm": replace(SHIPPED, sc_mm=_moved(axis, mm))
        for axis, mm in itertools.product(range(3), (-10, 10))
    },
    **{f"(c, d) shipped, at least {name} mm": replace(SHIPPED, least_mm=least) for name, least in LEAST_MM.items()},
}
"""Rules to try by their names in the tables: one choice after the other, and together."""

GRID: Sequence[Rule] = [
    replace(SHIPPED, least_mm=least, forward_deg=turn)
    for least, turn in itertools.product((SHIPPED.least_mm, *LEAST_MM.values()), (-30.0, -15.0, 0.0, 15.0, 30.0))
]
"""Rules that the folds choose from."""

app = typer.Typer(add_completion=False)


@dataclass(frozen=True)
class Outcome:
    """Adaptations of M models to S subjects."""

    gaps_deg: Mapping[str, Float[np.ndarray, "2 models subjects"]]
    """Gaps of clavicle and scapula by state: before, after, ``unseen`` (each motion held out in turn)."""
    abduction_deg: Float[np.ndarray, " models subjects"]
    """Gap of the scapula in abduction before adaptation."""
    shift_mm: Float[np.ndarray, "6 models subjects"]
    at_bound: Bool[np.ndarray, "6 models subjects"]
    ok: Bool[np.ndarray, "models subjects"]
    reached: Bool[np.ndarray, "models subjects"]
    """True where every posture was reached before adaptation."""

    def of(self, models: slice) -> "Outcome":
        """Select some models."""
        return Outcome(
            {state: gaps[:, models] for state, gaps in self.gaps_deg.items()},
            self.abduction_deg[models],
            self.shift_mm[:, models],
            self.at_bound[:, models],
            self.ok[models],
            self.reached[models],
        )


@dataclass(frozen=True)
class Shoulders:
    """The subjects, the person that each belongs to, and which are group means."""

    motions: Motions
    rows: PostureRows
    folds: list[Fold]
    person: np.ndarray
    is_mean: np.ndarray


def shoulders(motions: Motions, means: Sequence[str]) -> Shoulders:
    """Pack the shoulders; left and right of one name are one person."""
    rows = posture_rows(motions)
    person = np.array([person_of(name) for name in rows.subjects])
    return Shoulders(motions, rows, motions_or_thirds(motions), person, np.isin(rows.subjects, means))


def outcome(models: Sequence[ParameterSet], of: Shoulders) -> Outcome:
    """Fit, adapt and hold out every model with every subject, as one batch."""
    data, subjects = problems_of(of.rows, list(models)), len(of.rows.subjects)
    own = np.repeat(np.stack([np.asarray(model.girdle.adapted_mm) for model in models], axis=-1), subjects, axis=-1)
    before, reached = gaps_before_deg(data, own)
    adapted = adapt_batch(data)
    ok = adapted.status == status.OK
    after = np.where(_known(data) & ok, np.abs(adapted.angles - data.angles) * DEG, np.nan)
    unseen = held_out(data, of.rows, of.folds).gaps_deg
    by_fold = [np.stack(unseen[k :: len(of.folds)], axis=-1) for k in range(len(of.folds))]  # (6, tested, models)
    of_subject = [
        np.concatenate([by_fold[k] for k, fold in enumerate(of.folds) if fold.subject == s], axis=1)
        for s in range(subjects)
    ]
    split = (-1, len(models), subjects)
    abduction = of.rows.packed(of.motions.motion == "frontal_elevation")
    in_abduction = np.where(np.tile(abduction, len(models)), before, np.nan)
    return Outcome(
        gaps_deg={
            "before": _by_bone(before).reshape(split),
            "after": _by_bone(after).reshape(split),
            "unseen": np.stack([_by_bone(gap) for gap in of_subject], axis=-1),
        },
        abduction_deg=_by_bone(in_abduction).reshape(split)[1],
        shift_mm=(adapted.theta_mm - own).reshape(split),
        at_bound=np.asarray(adapted.at_bound).reshape(split),
        ok=ok.reshape(split[1:]),
        reached=reached.reshape(split[1:]),
    )


def gaps_before_deg(data: Problems, theta_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute |simulated - measured| of the unadapted sets, (6, postures, problems), and whether all postures are
    reached."""
    posture, problem = np.nonzero(data.counted)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    found = fit_batch(data.girdles_at(theta_mm, posture, problem), angles, measured)
    good = found.status == status.OK
    gaps = np.full(data.angles.shape, np.nan)
    gaps[:, posture, problem] = np.where(measured & good, np.abs(found.angles - angles) * DEG, np.nan)
    return gaps, np.bincount(problem[~good], minlength=data.counted.shape[1]) == 0


def _known(data: Problems) -> np.ndarray:
    return np.asarray(data.measured & data.counted)


def _by_bone(gaps_deg: Float[np.ndarray, "6 postures problems"]) -> Float[np.ndarray, "2 problems"]:
    """Average over the angles of a bone and the known postures; NaN where there is none."""
    means = []
    for angles in BONES.values():
        there = np.isfinite(gaps_deg[angles])
        total = np.where(there, gaps_deg[angles], 0.0).sum(axis=(0, 1))
        means.append(total / np.where(there.any(axis=(0, 1)), there.sum(axis=(0, 1)), np.nan))
    return np.stack(means)


def sets_by(rule: Rule) -> list[ParameterSet]:
    """Make R2, R4 and R6 by a rule, ready to adapt."""
    return [as_model(completed, rule is EARLIER) for completed in table_sets(rule)]


def as_model(completed: Completed, earlier: bool) -> ParameterSet:
    """Return the shipped set with another girdle; ellipsoid, points and bounds stay."""
    girdle = completed.girdle
    if earlier:
        girdle = replace(girdle, scapula_conoid_mm=np.asarray(EARLIER_ON_SCAPULA_MM[completed.name]))
    return replace(load_model(completed.name), girdle=girdle)


def open_at_rest_mm(rule: Rule) -> float:
    """Compute the largest residual of A1-A3 over the sets in their rest postures."""
    parts = [(as_model(one, rule is EARLIER).girdle, one.rest_deg) for one in table_sets(rule)]
    return max(float(np.abs(_residuals_mm(girdle, rest)).max()) for girdle, rest in parts)


def _residuals_mm(girdle: Girdle, rest_deg: np.ndarray) -> np.ndarray:
    return np.asarray(constraint_residuals_mm(girdle, jnp.asarray(rest_deg) / DEG))


def mean_deg(gaps: np.ndarray) -> float:
    """Average the known gaps."""
    return float(np.nanmean(gaps))


def gap_cells(found: Outcome, shoulders_: Bool[np.ndarray, " subjects"]) -> list[str]:
    """Format 'before -> after (held out)' of scapula and clavicle, over models and some subjects."""
    cells = []
    for bone in (1, 0):
        gap = {state: mean_deg(gaps[bone][:, shoulders_]) for state, gaps in found.gaps_deg.items()}
        cells.append(f"{gap['before']:.2f} -> {gap['after']:.2f} ({gap['unseen']:.2f})")
    return cells


def bound_cell(found: Outcome, shoulders_: Bool[np.ndarray, " subjects"]) -> str:
    """Count the conoids at a bound, and the adaptations with any parameter at a bound."""
    bounds = found.at_bound[:, :, shoulders_]
    return f"{bounds[-1].sum()}, {bounds.any(axis=0).sum()} of {bounds[0].size}"


def rule_row(name: str, rule: Rule, found: Outcome, of: Shoulders) -> list[str]:
    """Format one line of the table of rules, over the three sets."""
    persons = ~of.is_mean
    girdles = [model.girdle for model in sets_by(rule)]
    least = min(float(x) for g in girdles for x in (g.ts_distance_mm, g.ai_distance_mm))
    return [
        name,
        *gap_cells(found, persons),
        ", ".join(_unseen_cell(found, of.person == mean) for mean in of.person[of.is_mean]),
        ", ".join(f"{mean_deg(found.abduction_deg[k][persons]):.1f}" for k in range(len(SETS))),
        ", ".join(f"{x:+.0f}" for x in found.shift_mm[:, :, persons].mean(axis=(1, 2))),
        bound_cell(found, persons),
        f"{least:.1f}",
        f"{open_at_rest_mm(rule):.1f}",
        f"{(~found.ok).sum()}, {(~found.reached).sum()}",
    ]


def rules_table(found: Mapping[str, Outcome], of: Shoulders) -> str:
    """Tabulate the rules, one line each."""
    header = ["rule", "scapula", "clavicle", f"unseen: {', '.join(of.person[of.is_mean])}"]
    header += ["scapula before, abduction: R2, R4, R6", f"mean shift of {', '.join(ADAPTED)}, mm"]
    header += ["at a bound: conoid, any", "least distance, mm", "open at rest, mm", "not adapted, not reached"]
    thesis = ", ".join(f"{x:.1f}" for x in PUBLISHED_BEFORE_DEG.values())
    mean_shift = ", ".join(f"{x:+.0f}" for x in np.mean(list(PUBLISHED_SHIFT_MM.values()), axis=0))
    lines = [["thesis, ten other subjects", "7.2 -> 3.8", "5.9 -> 6.1", "", thesis, mean_shift, "", "", "", ""]]
    return markdown(header, [*lines, *(rule_row(name, RULES[name], found[name], of) for name in found)])


def parameters_table(found: Mapping[str, Outcome], of: Shoulders) -> str:
    """Tabulate mean shift (SD) of the adapted parameters per set: Tables 6.5 and 6.6, earlier and shipped sets."""
    lines = []
    for k, name in enumerate(SETS):
        cells = zip(PUBLISHED_SHIFT_MM[name], PUBLISHED_SD_MM[name], strict=True)
        lines.append([name, "thesis", *(f"{shift:+d} ({sd})" for shift, sd in cells)])
        for rule in (EARLIER_NAME, SHIPPED_NAME):
            mine = found[rule].shift_mm[:, k, ~of.is_mean]
            cells = zip(mine.mean(axis=1), mine.std(axis=1, ddof=1), strict=True)
            lines.append([name, rule.split(":")[0], *(f"{shift:+.0f} ({sd:.0f})" for shift, sd in cells)])
    return markdown(["set", "rule", *(f"{name}, mm" for name in ADAPTED)], lines)


def folds_table(found: Mapping[str, Outcome], of: Shoulders) -> str:
    """Tabulate for each person the grid's best rule for the others, and the person's gaps with it and fixed rules."""
    grid = outcome([model for rule in GRID for model in sets_by(rule)], of)
    each = [grid.of(slice(k, k + len(SETS))) for k in range(0, len(GRID) * len(SETS), len(SETS))]
    persons = list(dict.fromkeys(of.person.tolist()))
    scores = np.array([[mean_deg(one.gaps_deg["unseen"][:, :, of.person == name]) for name in persons] for one in each])
    lines = []
    for k, person in enumerate(persons):
        best = int(np.argmin(np.delete(scores, k, axis=1).mean(axis=1)))
        fixed = (found[name] for name in (SHIPPED_NAME, EARLIER_NAME))
        cells = [_unseen_cell(one, of.person == person) for one in (each[best], *fixed)]
        lines.append([person, _named(GRID[best]), *cells])
    return markdown(["person", "best for the others", "scapula, clavicle with it", "shipped", "earlier"], lines)


def _named(rule: Rule) -> str:
    ts, ai = rule.least_mm or (np.nan, np.nan)
    return f"TS at least {ts:g}, AI {ai:g} mm, {rule.forward_deg:+g} deg forward"


def _unseen_cell(one: Outcome, here: np.ndarray) -> str:
    clavicle, scapula = (mean_deg(one.gaps_deg["unseen"][bone][:, here]) for bone in (0, 1))
    return f"{scapula:.2f}, {clavicle:.2f}"


def others_table(of: Shoulders) -> str:
    """Tabulate the shipped sets of the cadaver that the thesis prints in full."""
    lines, persons = [], ~of.is_mean
    for name in OTHER_SETS:
        one = outcome([load_model(name)], of)
        shifts = ", ".join(f"{x:+.0f}" for x in one.shift_mm[:, 0, persons].mean(axis=1))
        lines.append([name, *gap_cells(one, persons), shifts, bound_cell(one, persons)])
    return markdown(["set", "scapula", "clavicle", f"mean shift of {', '.join(ADAPTED)}, mm", "at a bound"], lines)


@app.command()
def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files.")],
    mean: Annotated[list[str] | None, typer.Option(help="Subject that is a mean motion; repeatable.")] = None,
) -> None:
    """Print, as Markdown, the gaps on measured shoulders with each rule that completes R2, R4 and R6."""
    motions = read_motions(*files)
    check_known(mean or [], motions.subjects, "subject")
    of = shoulders(motions, mean or [])
    persons = dict.fromkeys(of.person.tolist())
    if len(persons) < 2:
        raise InputError("motions", None, "folds need two persons", "Name the motions of more")
    every = outcome([model for rule in RULES.values() for model in sets_by(rule)], of)
    found = {name: every.of(slice(k * len(SETS), (k + 1) * len(SETS))) for k, name in enumerate(RULES)}
    print(f"Persons: {', '.join(persons)}. Gaps: before -> after adaptation (unseen motion).\n")
    for table in (rules_table(found, of), parameters_table(found, of), folds_table(found, of), others_table(of)):
        print(table, end="\n\n")


if __name__ == "__main__":
    cli.main(app)
