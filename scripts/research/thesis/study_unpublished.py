"""Which single unpublished number of R2, R4 and R6 decides the thesis's tables most?

    python scripts/research/thesis/study_unpublished.py ../shared/motions/*.csv \
        --mean mean_ludewig2009 --mean mean_oki2012

Derivatives of the cells of Tables 3.4, 3.5 and 6.1-6.5 in each number that the thesis does not print, through the fits
and the adaptation (``adapt.differentiable``), times the range that the set states. Beside them the change when the
number is moved by its range, up and down, and everything is fitted and adapted anew (the compiled fits). Then the
numbers within their ranges that come closest to the printed means, and what they leave. Prints Markdown.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Float
from scipy.optimize import lsq_linear

from adapt.cli import app as cli
from adapt.differentiable import adapt_subject, fit_posture
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems, problems_of
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.trust.thesis import printed
from models import ParameterSet, load_model
from models.girdle import COUNT_OF_NUMBERS, NUMBERS, Girdle
from motions import Motions
from motions.landmarks.girdle_angles import CLAVICLE_X
from motions.rotations import DEG
from scripts.completion import POINT_AZIMUTHS_DEG
from scripts.reporting import check_known, markdown
from scripts.research.thesis.outcomes import ABDUCTION, ADAPTED_TO, FLEXION, persons

PLACES = {
    "SC": ("sc_mm", 10.0),
    "conoid on the clavicle": ("clavicle_conoid_mm", 8.0),
    "conoid on the scapula": ("scapula_conoid_mm", 8.0),
    "distance of TS": ("ts_distance_mm", 10.0),
    "distance of AI": ("ai_distance_mm", 10.0),
}
"""Numbers of a girdle that are not printed, and their range in mm: that which the set's source states."""

POINTS_AROUND, POINTS_UP, AXIAL_ZERO = "thorax points, around", "thorax points, up", "zero of the axial rotation"
OTHERS = {POINTS_AROUND: (10.0, "deg"), POINTS_UP: (20.0, "mm"), AXIAL_ZERO: (10.0, "deg")}
"""As the sets state; the zero of the clavicle's axial rotation is assumed: data sets differ by up to 8 degrees."""

XYZ = "xyz"

TABLES = ("3.4, 3.5", "6.1, 6.2", "6.3, 6.4", "6.5")

app = typer.Typer(add_completion=False)


@dataclass(frozen=True)
class Unpublished:
    """One number that is not printed."""

    name: str
    reach: float
    unit: str
    place: int | None = None
    """In ``Girdle.numbers_mm``."""


def unpublished() -> list[Unpublished]:
    """List them: eleven of the girdle, where the thorax points lie, and the zero of one measured angle."""
    found = []
    for name, (field, reach) in PLACES.items():
        places = range(COUNT_OF_NUMBERS)[NUMBERS[field]]
        axes = [f", {axis}" for axis in XYZ] if len(places) == len(XYZ) else [""]
        found += [Unpublished(name + axis, reach, "mm", place) for axis, place in zip(axes, places, strict=True)]
    return found + [Unpublished(name, reach, unit) for name, (reach, unit) in OTHERS.items()]


NUMBERS_MOVED = unpublished()

REACH = np.array([one.reach for one in NUMBERS_MOVED])


def moved(model: ParameterSet, angles, step) -> tuple[Girdle, jax.Array, jax.Array]:
    """Move every number by its step (of NUMBERS_MOVED): the girdle, the thorax points, the measured angles (6, p)."""
    shifts, others = jnp.zeros(COUNT_OF_NUMBERS), dict[str, jax.Array]()
    for one, by in zip(NUMBERS_MOVED, step, strict=True):
        if one.place is None:
            others[one.name] = by
        else:
            shifts = shifts.at[one.place].add(by)
    girdle = Girdle.of_numbers(jnp.asarray(model.girdle.numbers_mm) + shifts)
    points = points_at(model.girdle, others[POINTS_AROUND], others[POINTS_UP])
    return girdle, points, jnp.asarray(angles).at[CLAVICLE_X].add(others[AXIAL_ZERO] / float(DEG))


def points_at(girdle: Girdle, around_deg, up_mm) -> jax.Array:
    """Place the points of the rule (``scripts.completion.thorax_points_mm``) elsewhere on the set's own ellipsoid."""
    (_, M_y, M_z), (A_x, A_y, A_z) = np.asarray(girdle.centre_mm), np.asarray(girdle.semi_axes_mm)
    azimuth, y = (grid.ravel() for grid in np.meshgrid(np.radians(POINT_AZIMUTHS_DEG), HEIGHTS_MM))
    azimuth, y = azimuth + around_deg / float(DEG), y + up_mm
    width = jnp.sqrt(1.0 - ((y - M_y) / A_y) ** 2)
    return jnp.stack([A_x * width * jnp.cos(azimuth), y, M_z + A_z * width * jnp.sin(azimuth)])


HEIGHTS_MM = np.linspace(-20.0, -200.0, 8)


@dataclass(frozen=True)
class Data:
    """Persons with both motions, and mean motions; postures with all six angles."""

    rows: PostureRows
    abduction: np.ndarray
    """(postures, subjects): those that the gaps are of."""
    mean_motions: Mapping[str, list[np.ndarray]]
    """By motion: the angles of each mean motion, (6, postures), rad."""


def prepare(motions: Motions, means: Sequence[str]) -> Data:
    """Pack abduction and flexion of who has both."""
    motions = motions.select(np.isin(motions.motion, ADAPTED_TO) & np.isfinite(motions.angles_deg).all(axis=1))
    is_mean = np.isin(motions.subject, list(means))
    both = [name for name in motions.subjects if {*ADAPTED_TO} <= {*motions.motion[motions.subject == name]}]
    rest = motions.select(np.isin(motions.subject, both) & ~is_mean)
    rows = posture_rows(rest)
    group = {
        motion: [
            motions.angles_deg[(motions.subject == name) & (motions.motion == motion)].T / float(DEG) for name in means
        ]
        for motion in ADAPTED_TO
    }
    return Data(rows, rows.counted & rows.packed(rest.motion == ABDUCTION), group)


def mean_gap(fitted, angles, counted) -> jax.Array:
    """Mean |simulated - measured| of each angle over the postures that count, degrees."""
    off = jnp.where(counted, jnp.abs(fitted - angles), 0.0) * DEG
    return off.sum(axis=1) / counted.sum()


def of_means(model: ParameterSet, data: Data, step) -> jax.Array:
    """Compute the cells of Tables 3.4 and 3.5, means over the mean motions: (2 motions x 6 angles,)."""
    cells = []
    for motion in (ABDUCTION, FLEXION):
        parts = []
        for angles in data.mean_motions[motion]:
            girdle, _, there = moved(model, angles, step)
            parts.append(mean_gap(fit_posture(girdle, there).angles, there, np.ones(angles.shape[1], bool)))
        cells.append(jnp.mean(jnp.stack(parts), axis=0))
    return jnp.concatenate(cells)


def of_subject(model: ParameterSet, angles, measured, abduction, theta_mm, step) -> jax.Array:
    """Compute a subject's cells: six gaps before, six after, six adapted parameters (mm).

    theta_mm: of the compiled adaptation, from which the search starts; its minimum is the same.
    """
    girdle, points, there = moved(model, angles, step)
    before = fit_posture(girdle, there, measured).angles
    found = adapt_subject(girdle, points, model.bounds_mm, there, measured, start=theta_mm)
    gaps = [mean_gap(fitted, there, abduction) for fitted in (before, found.postures.angles)]
    return jnp.concatenate([*gaps, found.theta_mm])


FAST = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
"""A third of the compilation; each subject is run once."""


@dataclass(frozen=True)
class Cells:
    """Cells of one set: 12 of Tables 3.4 and 3.5, 6 before, 6 after, 6 parameters, means over subjects."""

    value: Float[np.ndarray, " 30"]
    slope: Float[np.ndarray, "30 numbers"]
    """In degrees and mm a range of the number."""


PARTS = dict(zip(TABLES, (slice(0, 12), slice(12, 18), slice(18, 24), slice(24, 30)), strict=True))


def by_derivatives(model: ParameterSet, data: Data, progress: Callable[[str], None]) -> Cells:
    """Compute all cells of a set with their derivatives in every number that is not printed."""
    problems = problems_of(data.rows, [model])
    theta = adapt_batch(problems).theta_mm
    rest = jnp.zeros(len(REACH))

    def both(function):
        return jax.jit(lambda *args: (function(*args, rest), jax.jacfwd(function, len(args))(*args, rest)),
                       compiler_options=FAST)  # fmt: skip

    subject = both(lambda *args: of_subject(model, *args))
    found = []
    for k, name in enumerate(data.rows.subjects):
        progress(f"{model.name}, {name}")
        parts = (np.asarray(x)[..., k] for x in (problems.angles, problems.measured, data.abduction, theta))
        found.append(subject(*parts))
    progress(f"{model.name}, mean motions")
    means = both(lambda step: of_means(model, data, step))()
    value, slope = (
        np.concatenate([np.asarray(mean), np.mean([np.asarray(one[part]) for one in found], axis=0)])
        for part, mean in enumerate(means)
    )
    return Cells(value, slope * REACH)


def by_fits(model: ParameterSet, data: Data, steps: Float[np.ndarray, "cases numbers"]) -> Float[np.ndarray, "cases 30"]:
    """Compute the cells with the compiled fits, the numbers moved by each row of ``steps``; NaN where one did not end."""
    return np.array([_fitted(model, data, step) for step in steps])


def _fitted(model: ParameterSet, data: Data, step: np.ndarray) -> np.ndarray:
    girdle, points, _ = moved(model, np.zeros((6, 1)), step)
    other = replace(model, girdle=jax.tree.map(np.asarray, girdle), points_mm=np.asarray(points))
    problems = problems_of(data.rows, [other])
    turned = np.array(problems.angles)
    turned[CLAVICLE_X] += step[-1] / float(DEG)
    problems = replace(problems, angles=turned)
    adapted = adapt_batch(problems)
    before = _before(problems, np.asarray(other.girdle.adapted_mm))
    gaps = [
        np.mean([mean_gap(at[..., k], turned[..., k], data.abduction[:, k]) for k in range(turned.shape[2])], axis=0)
        for at in (before, adapted.angles)
    ]
    means = [
        np.mean([_mean_motion(other.girdle, angles, step) for angles in data.mean_motions[motion]], axis=0)
        for motion in (ABDUCTION, FLEXION)
    ]
    return np.concatenate([*means, *gaps, adapted.theta_mm.mean(axis=1)])


def _mean_motion(girdle: Girdle, angles: np.ndarray, step: np.ndarray) -> np.ndarray:
    turned = np.array(angles)
    turned[CLAVICLE_X] += step[-1] / float(DEG)
    count = turned.shape[1]
    fits = fit_batch(girdle.repeated(count), turned, np.ones(turned.shape, bool))
    return np.asarray(mean_gap(fits.angles, turned, np.ones(count, bool)))


def _before(problems: Problems, own_mm: np.ndarray) -> np.ndarray:
    posture, problem = np.nonzero(problems.counted)
    theta = np.repeat(own_mm[:, None], problems.counted.shape[1], axis=1)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (problems.angles, problems.measured))
    found = np.zeros(problems.angles.shape)
    found[:, posture, problem] = fit_batch(problems.girdles_at(theta, posture, problem), angles, measured).angles
    return found


def printed_cells(name: str) -> Float[np.ndarray, " 30"]:
    """The same cells as printed, means over the thesis's ten subjects."""
    k = printed.SETS.index(name)
    means = [printed.tables()[table].values[:, 2 * k] for table in ("Table 3.4", "Table 3.5")]
    gaps = [printed.gaps_deg(adapted)[k].mean(axis=1) for adapted in (False, True)]
    return np.concatenate([*means, *gaps, printed.adapted_mm()[k]])


def rms(values: np.ndarray) -> float:
    """Root of the mean square of what is there."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def decide_table(cells: Mapping[str, Cells], fitted: Mapping[str, np.ndarray]) -> str:
    """A line a number: rms change of the cells of each table over its range, linear, and when fitted anew."""
    lines = []
    for k, one in enumerate(NUMBERS_MOVED):
        row = []
        for part in PARTS.values():
            linear = rms(np.stack([found.slope[part, k] for found in cells.values()]))
            changed = [fitted[name][[2 * k + 1, 2 * k + 2]][:, part] - fitted[name][0, part] for name in cells]
            row.append(f"{linear:.1f} ({rms(np.stack(changed)):.1f})")
        lines.append([one.name, f"{one.reach:g} {one.unit}", *row])
    lines.sort(key=lambda row: -sum(float(cell.split()[0]) for cell in row[2:5]))
    return markdown(["number", "range, +-", *(f"Tables {name}" for name in TABLES)], lines)


def closest_steps(found: Cells, name: str) -> Float[np.ndarray, " numbers"]:
    """Find the numbers within their ranges that bring the gaps, linearly, closest to the printed ones, in ranges."""
    gaps = slice(0, 24)
    off = printed_cells(name)[gaps] - found.value[gaps]
    return lsq_linear(found.slope[gaps], off, bounds=(-1.0, 1.0)).x


def reach_table(cells: Mapping[str, Cells], closest: Mapping[str, np.ndarray], own: Mapping[str, np.ndarray]) -> str:
    """A line a set and table: how far the cells are from the printed ones, as shipped and with the closest numbers
    (linear; fitted anew), and how many no number within its range reaches, were each cell alone."""
    lines = []
    for name, found in cells.items():
        steps, target = closest_steps(found, name), printed_cells(name)
        for table, part in PARTS.items():
            off = target[part] - found.value[part]
            beyond = np.abs(off) > np.abs(found.slope[part]).sum(axis=1)
            linear, anew = off - found.slope[part] @ steps, target[part] - closest[name][part]
            cell = [f"{rms(x):.1f}" for x in (off, linear, anew)]
            lines.append([name, table, *cell, f"{beyond.sum()} of {len(off)}"])
    return markdown(["set", "Tables", "as shipped", "closest, linear", "fitted anew", "out of reach"], lines)


def cells_table(cells: Mapping[str, Cells]) -> str:
    """A line a cell that no numbers within their ranges reach: printed, ours, and the farthest they could take it."""
    lines = []
    for name, found in cells.items():
        target, reach = printed_cells(name), np.abs(found.slope).sum(axis=1)
        for k in np.flatnonzero(np.abs(target - found.value) > reach):
            lines.append([name, label(int(k)), f"{target[k]:.1f}", f"{found.value[k]:.1f}", f"+-{reach[k]:.1f}"])
    return markdown(["set", "cell", "thesis", "as shipped", "reach"], lines)


def label(cell: int) -> str:
    """Name a cell."""
    angles = [f"{bone}_{axis}" for bone in ("clavicle", "scapula") for axis in "yzx"]
    if cell >= PARTS["6.5"].start:
        return f"Table 6.5, {('M_y', 'M_z', 'A_x', 'A_y', 'A_z', 'conoid_length')[cell - 24]}, mm"
    table = ("3.4", "3.5", "6.1-6.2", "6.3-6.4")[cell // 6]
    return f"Table {table}, {angles[cell % 6]}, deg"


@app.command()
def study(
    files: Annotated[list[Path], typer.Argument(metavar="MOTIONS.csv...")],
    mean: Annotated[list[str], typer.Option(help="Subjects that are mean motions: Tables 3.4 and 3.5.")],
    model: Annotated[list[str], typer.Option(help="Sets.")] = list(printed.SETS),
) -> None:
    """Print which unpublished number decides the tables, and what numbers within their ranges can reach."""
    motions = persons(files, ())
    check_known(mean, motions.subjects, "subject")
    data, models = prepare(motions, mean), [load_model(name) for name in model]
    say = cli.console.print if False else (lambda text: typer.echo(text, err=True))
    cells = {one.name: by_derivatives(one, data, say) for one in models}
    ends = np.vstack([np.zeros(len(REACH)), *(s * row for row in np.diag(REACH) for s in (-1.0, 1.0))])
    fitted, closest = dict[str, np.ndarray](), dict[str, np.ndarray]()
    for one in models:
        say(f"{one.name}: fitted anew")
        steps = closest_steps(cells[one.name], one.name)
        every = by_fits(one, data, np.vstack([ends, steps * REACH]))
        fitted[one.name], closest[one.name] = every[:-1], every[-1]
        typer.echo(f"{one.name}: " + ", ".join(f"{n.name} {x:+.1f}" for n, x in zip(NUMBERS_MOVED, steps * REACH)))
        typer.echo(f"largest difference of the two engines: {np.abs(cells[one.name].value - every[0]).max():.1e}")
    for table in (decide_table(cells, fitted), reach_table(cells, closest, fitted), cells_table(cells)):
        typer.echo("\n" + table)


if __name__ == "__main__":
    app()
