"""How much the choices that the thesis leaves open matter: E, its weight, the thorax points and the bounds.

Eq. 6.3-6.5 fix neither the form of D nor the units of E; the thorax points of R2, R4 and R6 are not printed; bounds are
not mentioned. Each choice is varied alone, the others as shipped, and every adaptation is compared with the published
ones (Tables 6.1-6.6). Prints Markdown.

The score of a variant, over R2, R4 and R6, is S + G; 0 is the thesis:

    S = rms over set and parameter of ln(SD / SD of Table 6.5), each SD over subjects and at least 0.5 mm
    G = rms of ln(r / 3.8/7.2) and ln(r_max / 10.2/28.5), r = scapular gap after / before, mean and max

Beside it, not in it, stands the shift of the mean from the geometric parameters: rms of
(shift - that from Table 6.6 to 6.5) / SD of Table 6.5.
"""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

import jax.numpy as jnp
import numpy as np
import pandas as pd
import typer
from jaxtyping import Bool, Float

from adapt import fit_postures
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.objective import DEFAULT_READING, READINGS, WEIGHT
from adapt.solvers.padded_batch import pack
from adapt.solvers.problem_batch import ProblemBatch, problem_batch
from adapt.tables.results import ALL_MOTIONS
from models import ParameterSet, load_model
from models.parameter_sets import SHORTEST_MM
from motions import ANGLES, InputError, Motions, read_motions
from motions.rotations import DEG
from scripts.completion import POINT_AZIMUTHS_DEG

THESIS_SETS = ("R2", "R4", "R6")
SETS = (*THESIS_SETS, "breteler_dissection")
"""Always adapted together, so that one compiled shape serves the whole study."""

PUBLISHED_SD_MM = {"R2": (31, 6, 3, 24, 17, 2), "R4": (21, 6, 2, 13, 15, 1), "R6": (8, 7, 2, 13, 17, 2)}
"""Table 6.5, SD of ten subjects in the order of ADAPTED, printed to 1 mm."""

PUBLISHED_SHIFT_MM = {"R2": (23, -3, -4, -1, -15, 0), "R4": (11, -10, -1, 2, -18, -3), "R6": (2, 1, -1, 8, -2, -1)}
"""Mean of Table 6.5 less Table 6.6, printed to 1 mm."""

PUBLISHED_GAP_RATIO, PUBLISHED_MAX_RATIO = 3.8 / 7.2, 10.2 / 28.5
"""Scapular gap after / before adaptation: mean, and max over subjects and angles (6.4, Tables 6.2 and 6.4)."""

LEAST_SD_MM = 0.5
"""Half of the last printed digit: below it a ratio of SDs means nothing."""

WEIGHTS = (1.0, 3.0, 10.0, 30.0, 100.0)

POINTS = {
    "all": POINT_AZIMUTHS_DEG,
    "under the scapula": POINT_AZIMUTHS_DEG[2:],
    "serratus origins and wrap": POINT_AZIMUTHS_DEG[:2],
    "all, on both sides": POINT_AZIMUTHS_DEG,
}
"""Columns of thorax points that count, by their azimuth from lateral toward backward (scripts.completion)."""

BOTH_SIDES = "all, on both sides"

BOUNDS = {"half": 0.5, "as shipped": 1.0, "double": 2.0, "none": None}
"""Factors of the half widths; None is ``NO_BOUND_MM``."""

NO_BOUND_MM = 1e6

PARAMETERS = ("M_y", "M_z", "A_x", "A_y", "A_z", "conoid")


@dataclass(frozen=True)
class Variant:
    """One choice of everything; as shipped where nothing is said."""

    reading: str = DEFAULT_READING
    weight: float = WEIGHT
    points: str = "all"
    bounds: str = "as shipped"


@dataclass(frozen=True)
class Outcome:
    """One set adapted to S subjects."""

    shift_mm: Float[np.ndarray, "6 subjects"]
    """Adapted parameters less the set's own, in the order of ADAPTED."""
    own_mm: Float[np.ndarray, "6 1"]
    before_deg: Float[np.ndarray, "6 subjects"]
    """Mean |simulated - measured| of each angle over the postures of a subject."""
    after_deg: Float[np.ndarray, "6 subjects"]
    D_mm2: Float[np.ndarray, " subjects"]
    at_bound: Bool[np.ndarray, " subjects"]
    """At least one parameter is at its bound."""
    ok: Bool[np.ndarray, " subjects"]

    def converged(self) -> "Outcome":
        """The same without the subjects that did not converge."""
        return Outcome(**{f.name: _kept(getattr(self, f.name), self.ok) for f in fields(self)})

    @property
    def sd_mm(self) -> Float[np.ndarray, " 6"]:
        """Standard deviation over subjects (n - 1)."""
        return np.std(self.shift_mm, axis=1, ddof=1)


def _kept(values: np.ndarray, ok: np.ndarray) -> np.ndarray:
    return values[..., ok] if values.shape[-1] == len(ok) else values


@dataclass(frozen=True)
class Study:
    """The subjects with every set: what no variant changes."""

    motions: Motions
    data: ProblemBatch
    """As shipped; the points doubled by their mirror images, which have no share."""
    width: int
    """Problems of a set."""
    before_deg: dict[str, Float[np.ndarray, "6 subjects"]]


def with_mirrored_points(data: ProblemBatch) -> ProblemBatch:
    """The points and, without a share, their images in the midsagittal plane."""
    mirrored = data.points_mm * jnp.array([-1.0, 1.0, 1.0])[:, None, None]
    points = jnp.concatenate([data.points_mm, mirrored], axis=1)
    return replace(
        data, points_mm=points, point_weights=jnp.concatenate([data.point_weights, jnp.zeros_like(data.point_weights)])
    )


def azimuth_deg(data: ProblemBatch) -> Float[np.ndarray, "points problems"]:
    """Azimuth of each point about the ellipsoid's centre, of the parameter, from lateral toward backward."""
    scaled = np.asarray((data.points_mm - data.girdle.centre_mm[:, None]) / data.girdle.semi_axes_mm[:, None])
    return np.degrees(np.arctan2(scaled[2], scaled[0]))


def with_points(data: ProblemBatch, name: str) -> ProblemBatch:
    """Equal shares for the named columns of points, none for the others."""
    columns = np.array(POINT_AZIMUTHS_DEG)
    nearest = columns[np.argmin(np.abs(azimuth_deg(data)[..., None] - columns), axis=-1)]
    right_side = np.asarray(data.points_mm[0]) > 0.0
    # The azimuth of a mirror image is 180 degrees less that of its point: it counts with its point or not at all.
    counts = np.ones_like(right_side) if name == BOTH_SIDES else right_side & np.isin(nearest, POINTS[name])
    return replace(data, point_weights=jnp.asarray(counts / counts.sum(axis=0)))


def with_bounds(data: ProblemBatch, factor: float | None) -> ProblemBatch:
    """Bounds at a multiple of their distance, or none, but semi-axes and conoid at least ``SHORTEST_MM``."""
    own = data.girdle.adapted_mm
    away = data.bounds_mm - own if factor is not None else NO_BOUND_MM * jnp.array([-1.0, 1.0])[:, None, None]
    bounds = own + (1.0 if factor is None else factor) * away
    return replace(data, bounds_mm=bounds.at[0, 2:].max(SHORTEST_MM))


def prepare(motions: Motions, sets: list[ParameterSet]) -> Study:
    """Pack the subjects and fit every posture with every set as it is."""
    batch = pack(motions)
    summary = fit_postures(motions, sets).summary
    before = {model.name: gap_before_deg(summary, model.name, motions.subjects) for model in sets}
    return Study(motions, with_mirrored_points(problem_batch(batch, sets)), batch.angles.shape[-1], before)


def gap_before_deg(summary: pd.DataFrame, model: str, subjects: tuple[str, ...]) -> Float[np.ndarray, "6 subjects"]:
    """Tables 6.1 and 6.2 of one set, without their statistics."""
    mine = summary[(summary["model"] == model) & (summary["motion"] == ALL_MOTIONS)].head(len(subjects))
    return np.asarray(mine[[f"{angle}_deg" for angle in ANGLES]]).T


def gap_after_deg(data: ProblemBatch, adapted: Adapted) -> Float[np.ndarray, "6 problems"]:
    """Mean |simulated - measured| of each angle over the postures that count."""
    known = np.asarray(data.measured & data.counted)
    gap = np.where(known, np.abs(adapted.angles - np.asarray(data.angles)), 0.0) * DEG
    return gap.sum(axis=1) / known.sum(axis=1)


def outcomes(study: Study, variant: Variant) -> dict[str, Outcome]:
    """Every set adapted to every subject in one way."""
    data = with_bounds(with_points(study.data, variant.points), BOUNDS[variant.bounds])
    adapted = adapt_batch(data, variant.weight, variant.reading)
    after = gap_after_deg(data, adapted)
    own = np.asarray(data.girdle.adapted_mm)
    subjects = len(study.motions.subjects)

    def outcome(number: int, name: str) -> Outcome:
        mine = slice(number * study.width, number * study.width + subjects)
        return Outcome(
            shift_mm=(adapted.theta_mm - own)[:, mine],
            own_mm=own[:, mine][:, :1],
            before_deg=study.before_deg[name],
            after_deg=after[:, mine],
            D_mm2=adapted.D_mm2[mine],
            at_bound=np.asarray(adapted.at_bound[:, mine].any(axis=0)),
            ok=adapted.status[mine] == status.OK,
        )

    return {name: outcome(number, name) for number, name in enumerate(SETS)}


def sd_score(found: dict[str, Outcome]) -> float:
    """S of the score."""
    ours = np.array([np.maximum(found[name].converged().sd_mm, LEAST_SD_MM) for name in THESIS_SETS])
    return rms(np.log(ours / np.array([PUBLISHED_SD_MM[name] for name in THESIS_SETS])))


def gap_ratios(found: dict[str, Outcome]) -> tuple[float, float]:
    """Scapular gap after / before over the thesis's sets: mean, and max over subjects and angles."""
    good = [found[name].converged() for name in THESIS_SETS]
    before = np.concatenate([one.before_deg[3:] for one in good], axis=1)
    after = np.concatenate([one.after_deg[3:] for one in good], axis=1)
    return float(after.mean() / before.mean()), float(after.max() / before.max())


def gap_score(found: dict[str, Outcome]) -> float:
    """G of the score."""
    mean, most = gap_ratios(found)
    return rms(np.log([mean / PUBLISHED_GAP_RATIO, most / PUBLISHED_MAX_RATIO]))


def shift_distance(found: dict[str, Outcome]) -> float:
    """How far the mean shifts are from the published ones, in published standard deviations."""
    ours = np.array([found[name].converged().shift_mm.mean(axis=1) for name in THESIS_SETS])
    published = np.array([PUBLISHED_SHIFT_MM[name] for name in THESIS_SETS])
    return rms((ours - published) / np.array([PUBLISHED_SD_MM[name] for name in THESIS_SETS]))


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def markdown(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table; the first two columns are names, the others numbers."""
    header = list(header)
    ruler = ["---" if k < 2 else "---:" for k in range(len(header))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (header, ruler, *rows))


def gap_cell(before_deg: np.ndarray, after_deg: np.ndarray) -> str:
    """Mean (max) of one bone, before -> after."""
    return " -> ".join(f"{gap.mean():.1f} ({gap.max():.1f})" for gap in (before_deg, after_deg))


def outcome_row(label: str, name: str, outcome: Outcome) -> list[str]:
    """One line of the table of a choice."""
    good = outcome.converged()
    means = (good.own_mm + good.shift_mm).mean(axis=1)
    return [
        label,
        name,
        *(f"{mean:.0f} ({sd:.0f})" for mean, sd in zip(means[:5], good.sd_mm[:5], strict=True)),
        f"{means[5]:.1f} ({good.sd_mm[5]:.1f})",
        gap_cell(good.before_deg[3:], good.after_deg[3:]),
        gap_cell(good.before_deg[:3], good.after_deg[:3]),
        f"{np.sqrt(good.D_mm2).mean():.1f}",
        str(int(outcome.at_bound.sum())),
        str(int((~outcome.ok).sum())),
    ]


def choice_table(label: str, variants: dict[str, dict[str, Outcome]], sets: tuple[str, ...]) -> str:
    """One choice: a line a variant and set."""
    header = [label, "set", *PARAMETERS, "scapula, deg", "clavicle, deg", "points rms", "at a bound", "not converged"]
    return markdown(header, (outcome_row(v, s, found[s]) for v, found in variants.items() for s in sets))


def score_table(choices: dict[str, dict[str, dict[str, Outcome]]]) -> str:
    """All variants against the thesis, the best first, each once: as shipped, it stands under the first choice."""
    header = ["choice", "variant", "S + G", "S", "G", "gap ratio", "max ratio", "shift"]
    thesis = ["thesis", "", "0", "0", "0", f"{PUBLISHED_GAP_RATIO:.2f}", f"{PUBLISHED_MAX_RATIO:.2f}", "0"]
    once = {id(found): (c, v, found) for c, variants in reversed(choices.items()) for v, found in variants.items()}
    scored = sorted(once.values(), key=lambda one: sd_score(one[2]) + gap_score(one[2]))
    return markdown(header, [thesis, *(score_row(*one) for one in scored)])


def score_row(choice: str, variant: str, found: dict[str, Outcome]) -> list[str]:
    """One line of the table of scores."""
    S, G = sd_score(found), gap_score(found)
    numbers = (S + G, S, G, *gap_ratios(found), shift_distance(found))
    return [choice, variant, *(f"{number:.2f}" for number in numbers)]


def sd_table(variants: dict[str, dict[str, Outcome]]) -> str:
    """SD over subjects and mean shift of each parameter beside Tables 6.5 and 6.6."""
    rows = []
    for name in THESIS_SETS:
        rows.append(["thesis", name, *published_cells(name)])
        for variant, found in variants.items():
            good = found[name].converged()
            shift = good.shift_mm.mean(axis=1)
            rows.append([variant, name, *(f"{s:.1f} / {m:+.1f}" for s, m in zip(good.sd_mm, shift, strict=True))])
    return markdown(["reading", "set", *PARAMETERS], rows)


def published_cells(name: str) -> list[str]:
    """SD / shift as printed."""
    return [f"{sd} / {shift:+}" for sd, shift in zip(PUBLISHED_SD_MM[name], PUBLISHED_SHIFT_MM[name], strict=True)]


def choices() -> dict[str, dict[str, Variant]]:
    """The variants of each choice by their label."""
    return {
        "reading": {name: Variant(reading=name) for name in READINGS},
        "weight": {f"w = {weight:g}": Variant(weight=weight) for weight in WEIGHTS},
        "thorax points": {name: Variant(points=name) for name in POINTS},
        "bounds": {name: Variant(bounds=name) for name in BOUNDS},
    }


def run(study: Study, progress: Callable[[str], None]) -> dict[str, dict[str, dict[str, Outcome]]]:
    """Choice, variant, set: each variant is adapted once, however many choices it stands in."""
    known: dict[Variant, dict[str, Outcome]] = {}
    for choice, variants in choices().items():
        for label, variant in variants.items():
            if variant not in known:
                progress(f"{choice}: {label}")
                known[variant] = outcomes(study, variant)
    return {c: {label: known[variant] for label, variant in variants.items()} for c, variants in choices().items()}


def report(study: Study, found: dict[str, dict[str, dict[str, Outcome]]]) -> str:
    """The whole study as Markdown."""
    count, postures = len(study.motions.subjects), len(study.motions.posture)
    parts = [
        f"{count} subjects, {postures} postures. mm; mean (SD) over subjects. Gaps: mean (max over subjects and "
        "angles) of |simulated - measured|, degrees, before -> after. As shipped unless the table says otherwise: "
        f"reading {DEFAULT_READING}, w = {WEIGHT:g}, all points, bounds of the set. Points on both sides change "
        "nothing: with M_x = 0 a point and its mirror image are equally far from the ellipsoid."
    ]
    for choice, variants in found.items():
        sets = SETS if choice == "reading" else THESIS_SETS
        parts += [f"## By {choice}", choice_table(choice, variants, sets)]
    parts += ["## SD / mean shift against Tables 6.5 and 6.6, mm", sd_table(found["reading"])]
    parts += ["## Against the thesis, the best first", score_table(found)]
    return "\n\n".join(parts)


def selected(motions: Motions, names: list[str]) -> Motions:
    """The named motions alone, or all."""
    for name in names:
        if name not in motions.motion:
            known = ", ".join(sorted(set(motions.motion.tolist())))
            raise InputError("--motion", None, f"no subject has a motion '{name}'", f"The motions are {known}")
    return motions.select(np.isin(motions.motion, names)) if names else motions


def main(
    files: Annotated[list[Path], typer.Argument(metavar="MOTION.csv...", help="Motion files.")],
    motion: Annotated[list[str] | None, typer.Option(help="Only this motion; repeatable. Default: all.")] = None,
) -> None:
    """Vary the objective of the adaptation, one choice at a time, and compare with Tables 6.1-6.6. Markdown."""
    try:
        motions = selected(read_motions(*files), motion or [])
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        raise typer.Exit(2) from error
    for error in motions.rejected:
        print(f"left out: {error}", file=sys.stderr)
    study = prepare(motions, [load_model(name) for name in SETS])
    print(report(study, run(study, lambda stage: print(stage, file=sys.stderr, flush=True))))


if __name__ == "__main__":
    typer.run(main)
