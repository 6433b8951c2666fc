"""Which single unpublished number of R2, R4 and R6 influences the thesis's tables most?

    python scripts/research/thesis/study_unpublished.py ../shared/motions/*.csv \
        --mean mean_ludewig2009 --mean mean_oki2012

Derivatives of the cells of Tables 3.4, 3.5 and 6.1-6.5 in each number that the thesis does not print, through fits and
adaptation, times the range that the set states: by ``adapt.differentiable``, or with --differences by differences of
the compiled fits. Beside them the change when the number is moved by its range, up and down, and everything is fitted
and adapted anew. Then the numbers within their ranges that come closest to the printed means, and the differences that
remain. Prints Markdown.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Bool, Float
from scipy.optimize import lsq_linear

from adapt.differentiable import adapt_subject, fit_posture
from adapt.solvers import status
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import problems_of
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.trust.thesis import printed
from models import ParameterSet, load_model
from models.girdle import COUNT_OF_NUMBERS, NUMBERS, Girdle
from motions import Motions
from motions.landmarks.girdle_angles import CLAVICLE_X
from motions.rotations import DEG
from scripts.completion import POINT_AZIMUTHS_DEG, POINT_HEIGHTS_MM
from scripts.reporting import check_known, markdown
from scripts.research.thesis.outcomes import ABDUCTION, ADAPTED_TO, FLEXION, persons

PLACES = {
    "SC": ("sc_mm", 10.0),
    "conoid on the clavicle": ("clavicle_conoid_mm", 8.0),
    "conoid on the scapula": ("scapula_conoid_mm", 8.0),
    "distance of TS": ("ts_distance_mm", 10.0),
    "distance of AI": ("ai_distance_mm", 10.0),
}
"""Numbers of a girdle that are not printed, and their ranges in mm, as stated in the source of the set."""

POINTS_AROUND, POINTS_UP, AXIAL_ZERO = "thorax points, around", "thorax points, up", "zero of the axial rotation"
OTHERS = {POINTS_AROUND: (10.0, "deg"), POINTS_UP: (20.0, "mm"), AXIAL_ZERO: (10.0, "deg")}
"""Other numbers and their ranges, as stated by the sets. The zero of the clavicle's axial rotation is assumed: data
sets differ by up to 8 degrees."""

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
    """Index in ``Girdle.numbers_mm``."""


def unpublished() -> list[Unpublished]:
    """List the unpublished numbers: eleven of the girdle, two of the thorax points, the zero of one measured angle."""
    found = []
    for name, (field, reach) in PLACES.items():
        places = range(COUNT_OF_NUMBERS)[NUMBERS[field]]
        axes = [f", {axis}" for axis in XYZ] if len(places) == len(XYZ) else [""]
        found += [Unpublished(name + axis, reach, "mm", place) for axis, place in zip(axes, places, strict=True)]
    return found + [Unpublished(name, reach, unit) for name, (reach, unit) in OTHERS.items()]


NUMBERS_MOVED = unpublished()

REACH = np.array([one.reach for one in NUMBERS_MOVED])


def moved(model_girdle: Girdle, step) -> tuple[Girdle, jax.Array]:
    """Move every number by its step (in the order of NUMBERS_MOVED); return the girdle and the thorax points."""
    shifts = jnp.zeros(COUNT_OF_NUMBERS)
    for k, one in enumerate(NUMBERS_MOVED):
        if one.place is not None:
            shifts = shifts.at[one.place].add(step[k])
    girdle = Girdle.of_numbers(jnp.asarray(model_girdle.numbers_mm) + shifts)
    around, up = (step[place] for place in (-3, -2))
    return girdle, points_at(model_girdle, around, up)


def turned(angles, step) -> jax.Array:
    """Shift the zero of the clavicle's measured axial rotation; rad."""
    return jnp.asarray(angles).at[CLAVICLE_X].add(step[-1] / float(DEG))


def points_at(girdle: Girdle, around_deg, up_mm) -> jax.Array:
    """Place the rule's points (``scripts.completion.thorax_points_mm``) elsewhere on the set's own ellipsoid."""
    _, M_y, M_z = girdle.centre_mm
    A_x, A_y, A_z = girdle.semi_axes_mm
    azimuth, y = (grid.ravel() for grid in np.meshgrid(np.radians(POINT_AZIMUTHS_DEG), POINT_HEIGHTS_MM))
    azimuth, y = azimuth + around_deg / float(DEG), y + up_mm
    width = jnp.sqrt(1.0 - ((y - M_y) / A_y) ** 2)
    return jnp.stack([A_x * width * jnp.cos(azimuth), y, M_z + A_z * width * jnp.sin(azimuth)])


@dataclass(frozen=True)
class Data:
    """Persons with both motions, and mean motions; postures with all six angles."""

    rows: PostureRows
    abduction: Bool[np.ndarray, "postures subjects"]
    """Mask of the postures whose gaps count."""
    angles: Float[np.ndarray, "6 fits"]
    """Angles of every posture fitted with unadapted sets, rad: abduction of the persons, both mean motions."""
    shares: Float[np.ndarray, "3 fits"]
    """Weight of each posture in the mean gaps of Table 3.4, of Table 3.5, and of Tables 6.1 and 6.2."""


def prepare(motions: Motions, means: Sequence[str]) -> Data:
    """Pack abduction and flexion of the subjects that have both."""
    motions = motions.select(np.isin(motions.motion, ADAPTED_TO) & np.isfinite(motions.angles_deg).all(axis=1))
    is_mean = np.isin(motions.subject, list(means))
    both = [name for name in motions.subjects if {*ADAPTED_TO} <= {*motions.motion[motions.subject == name]}]
    rest = motions.select(np.isin(motions.subject, both) & ~is_mean)
    rows = posture_rows(rest)
    groups = [is_mean & (motions.motion == ABDUCTION), is_mean & (motions.motion == FLEXION)]
    groups.append(np.isin(motions.subject, both) & ~is_mean & (motions.motion == ABDUCTION))
    kept = np.any(groups, axis=0)
    shares = np.stack([_shares(group, motions.subject)[kept] for group in groups])
    return Data(rows, rows.counted & rows.packed(rest.motion == ABDUCTION), motions.angles_deg[kept].T / DEG, shares)


def _shares(group: np.ndarray, subject: np.ndarray) -> np.ndarray:
    """Compute weights that are equal for each subject of the group, and for each posture of a subject."""
    names = np.unique(subject[group])
    counts = [np.where(group & (subject == name), 1.0 / (group & (subject == name)).sum(), 0.0) for name in names]
    return np.sum(counts, axis=0) / len(names)


@jax.jit
def fitted(model_girdle: Girdle, angles, start, step) -> jax.Array:
    """Compute the closest closed postures, with the numbers moved by ``step``."""
    girdle, _ = moved(model_girdle, step)
    return fit_posture(girdle, turned(angles, step), start=start).angles


def adapted(model_girdle: Girdle, bounds_mm, angles, measured, theta_mm, step) -> tuple[jax.Array, jax.Array]:
    """Adapt to a subject with the numbers moved by ``step``; return postures and parameters (mm).

    theta_mm: result of the compiled adaptation, where the search starts; its minimum is the same.
    """
    girdle, points = moved(model_girdle, step)
    found = adapt_subject(girdle, points, bounds_mm, turned(angles, step), measured, start=theta_mm)
    return found.postures.angles, found.theta_mm


def gaps_and_slopes(found, slopes, angles, shares) -> tuple[np.ndarray, np.ndarray]:
    """Compute mean |simulated - measured| of each angle, deg, and its derivatives; ``shares`` weights the postures."""
    off, change = np.asarray(found) - angles, np.array(slopes)
    change[CLAVICLE_X, :, -1] -= 1.0 / DEG  # derivative of the measured angle itself
    gaps = (np.abs(off) * shares).sum(axis=1) * DEG
    return gaps, np.einsum("ap,apn->an", np.sign(off) * shares, change) * DEG


@dataclass(frozen=True)
class Cells:
    """Cells of one set: 12 of Tables 3.4 and 3.5, 6 before, 6 after, 6 parameters, means over subjects."""

    value: Float[np.ndarray, " 30"]
    slope: Float[np.ndarray, "30 numbers"]
    """Derivatives in degrees and mm per range of the number."""


PARTS = dict(zip(TABLES, (slice(0, 12), slice(12, 18), slice(18, 24), slice(24, 30)), strict=True))

FAST = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
"""Compilation then takes a third of the time, which suits a program that runs once per subject."""


@cache
def with_slopes(function, count: int):
    """Compile a function with its derivative in its last argument, once for all sets and subjects."""
    return jax.jit(lambda *args: (function(*args), jax.jacfwd(function, count - 1)(*args)), compiler_options=FAST)


def by_derivatives(model: ParameterSet, data: Data, progress: Callable[[str], None]) -> Cells:
    """Compute all cells of a set with their derivatives in every unpublished number."""
    problems, rest = problems_of(data.rows, [model]), jnp.zeros(len(REACH))
    girdle = jax.tree.map(jnp.asarray, model.girdle)
    progress(f"{model.name}: as it is")
    start = posture_angles(model.girdle, data.angles)
    found, slopes = with_slopes(fitted, 4)(girdle, data.angles, start, rest)
    parts = [gaps_and_slopes(found, slopes, data.angles, shares) for shares in data.shares]
    after = []
    theta = adapt_batch(problems).theta_mm
    for k, name in enumerate(data.rows.subjects):
        progress(f"{model.name}: {name}, adapted")
        angles, measured = (np.asarray(x)[..., k] for x in (problems.angles, problems.measured & problems.counted))
        both = with_slopes(adapted, 6)(girdle, jnp.asarray(model.bounds_mm), angles, measured, theta[:, k], rest)
        (found, theta_mm), (slopes, of_theta) = both
        share = data.abduction[:, k] / data.abduction[:, k].sum()
        gaps = gaps_and_slopes(found, slopes, angles, share)
        after.append([np.concatenate(pair) for pair in zip(gaps, (theta_mm, of_theta), strict=True)])
    mean = [np.mean([one[k] for one in after], axis=0) for k in range(2)]
    value, slope = (np.concatenate([*(part[k] for part in parts), mean[k]]) for k in range(2))
    return Cells(value, slope * REACH)


@dataclass(frozen=True)
class SignedGaps:
    """Simulated - measured, deg, for the postures in the tables' means, and the adapted parameters."""

    before: Float[np.ndarray, "6 fits"]
    after: Float[np.ndarray, "6 postures subjects"]
    theta_mm: Float[np.ndarray, " 6"]
    """Means over subjects."""

    def cells(self, data: Data, about: "SignedGaps | None" = None) -> Float[np.ndarray, " 30"]:
        """Compute the mean |gap|s and the parameters; with ``about``, each gap takes the sign that it has there."""
        signs = about or self
        shares = data.abduction / data.abduction.sum(axis=0) / data.abduction.shape[1]
        before, after = np.sign(signs.before) * self.before, np.sign(signs.after) * self.after
        gaps = [(before * share).sum(axis=1) for share in data.shares]
        return np.concatenate([*gaps, (after * shares).sum(axis=(1, 2)), self.theta_mm])


def by_fits(model: ParameterSet, data: Data, steps: np.ndarray) -> Float[np.ndarray, "cases 30"]:
    """Compute the cells with the compiled fits, with the numbers moved by each row of ``steps``."""
    return np.array([signed_gaps(model, data, step).cells(data) for step in steps])


def signed_gaps(model: ParameterSet, data: Data, step: np.ndarray) -> SignedGaps:
    """Fit and adapt with the compiled fits, with the numbers moved by ``step``."""
    girdle, points = (jax.tree.map(np.asarray, part) for part in moved(model.girdle, step))
    problems = problems_of(data.rows, [replace(model, girdle=girdle, points_mm=points)])
    problems = replace(problems, angles=np.asarray(turned(problems.angles, step)))
    found = adapt_batch(problems)
    there = np.asarray(turned(data.angles, step))
    after = np.where(data.abduction, found.angles - problems.angles, 0.0) * DEG
    return SignedGaps((posture_angles(girdle, there) - there) * DEG, after, found.theta_mm.mean(axis=1))


def posture_angles(girdle: Girdle, angles: np.ndarray) -> np.ndarray:
    """Fit postures with the compiled fits, rad; NaN where a fit failed."""
    fits = fit_batch(girdle.repeated(angles.shape[1]), angles, np.ones(angles.shape, bool))
    return np.where(fits.status == status.OK, fits.angles, np.nan)


def printed_cells(name: str) -> Float[np.ndarray, " 30"]:
    """Return the printed cells, means over the thesis's ten subjects."""
    k = printed.SETS.index(name)
    means = [printed.tables()[table].values[:, 2 * k] for table in ("Table 3.4", "Table 3.5")]
    gaps = [printed.gaps_deg(adapted)[k].mean(axis=1) for adapted in (False, True)]
    return np.concatenate([*means, *gaps, printed.adapted_mm()[k]])


def rms(values: np.ndarray) -> float:
    """Compute the root mean square of the finite values."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def decide_table(cells: Mapping[str, Cells], anew: Mapping[str, np.ndarray]) -> str:
    """Tabulate, per number, the rms change of each table's cells over its range: linear, and fitted anew."""
    lines = []
    for k, one in enumerate(NUMBERS_MOVED):
        row = []
        for part in PARTS.values():
            linear = rms(np.stack([found.slope[part, k] for found in cells.values()]))
            changed = [anew[name][[2 * k + 1, 2 * k + 2]][:, part] - anew[name][0, part] for name in cells]
            row.append(f"{linear:.1f} ({rms(np.stack(changed)):.1f})")
        lines.append([one.name, f"{one.reach:g} {one.unit}", *row])
    lines.sort(key=lambda row: -sum(float(cell.split()[0]) for cell in row[2:5]))
    return markdown(["number", "range, +-", *(f"Tables {name}" for name in TABLES)], lines)


GAPS = slice(0, 24)
"""Cells whose printed values are the target: the gaps. The parameters then follow."""

_ROUNDS, _REACHES = 40, 0.5 ** np.arange(8)
"""Most Gauss-Newton steps, and limits of a number's change per step, in ranges, of which the best is taken."""

_DIFFERENCE = 0.0005
"""Step of the differences, in ranges. Derivatives on the measured shoulders are then within 1e-4 degrees and mm of the
exact ones. At 0.02 one cell of R2 is 23 mm off, because a parameter reaches its bound within the step."""


def closest_steps(model: ParameterSet, found: Cells, data: Data) -> Float[np.ndarray, " numbers"]:
    """Find numbers within their ranges, in ranges, whose gaps come closest to the printed ones (a local optimum).

    Gauss-Newton from the set as shipped: the first Jacobian is that of ``found``, later ones are differences of the
    compiled fits.
    """
    target, at, cells, slope = printed_cells(model.name)[GAPS], np.zeros(len(REACH)), found.value[GAPS], found.slope
    for _ in range(_ROUNDS):
        boxes = [(np.maximum(-1.0 - at, -far) - 1e-9, np.minimum(1.0 - at, far) + 1e-9) for far in _REACHES]
        places = at + np.stack([lsq_linear(slope[GAPS], target - cells, bounds=box).x for box in boxes])
        tried = by_fits(model, data, places * REACH)[:, GAPS]
        off = [rms(target - one) if np.isfinite(one).all() else np.inf for one in tried]
        best = int(np.argmin(off))
        if off[best] >= rms(target - cells):
            break
        at, cells = places[best], tried[best]
        slope = differences(model, data, at)
    return at


def _shipped(model: ParameterSet, data: Data) -> Cells:
    at = np.zeros(len(REACH))
    return Cells(by_fits(model, data, at[None])[0], differences(model, data, at))


def differences(
    model: ParameterSet, data: Data, at: np.ndarray, step: float = _DIFFERENCE
) -> Float[np.ndarray, "30 numbers"]:
    """Compute the derivatives of all cells, per range of each number, by central differences of the compiled fits.

    Every gap keeps the sign that it has at ``at``, because |gap| has no derivative where the gap is 0.
    """
    about = signed_gaps(model, data, at * REACH)
    ends = [(at + sign * step * one) * REACH for one in np.eye(len(REACH)) for sign in (1.0, -1.0)]
    cells = np.array([signed_gaps(model, data, end).cells(data, about) for end in ends])
    return ((cells[0::2] - cells[1::2]) / (2.0 * step)).T


def reach_table(cells: Mapping[str, Cells], closest: Mapping[str, np.ndarray]) -> str:
    """Tabulate per set and table the rms difference from the printed cells, as shipped and with the closest numbers.

    The last column counts the cells that no numbers within their ranges reach, each cell alone and linearly.
    """
    lines = []
    for name, found in cells.items():
        target = printed_cells(name)
        for table, part in PARTS.items():
            off = target[part] - found.value[part]
            beyond = np.abs(off) > np.abs(found.slope[part]).sum(axis=1)
            cell = [f"{rms(x):.1f}" for x in (off, target[part] - closest[name][part])]
            lines.append([name, table, *cell, f"{beyond.sum()} of {len(off)}"])
    return markdown(["set", "Tables", "as shipped", "closest numbers", "out of reach"], lines)


def cells_table(cells: Mapping[str, Cells], closest: Mapping[str, np.ndarray]) -> str:
    """Tabulate the cells that no numbers within their ranges reach.

    Columns: the printed value, ours, the largest linear change within the ranges, and the value with the closest
    numbers.
    """
    lines = []
    for name, found in cells.items():
        target, reach = printed_cells(name), np.abs(found.slope).sum(axis=1)
        for k in np.flatnonzero(np.abs(target - found.value) > reach):
            cell = [f"{x[k]:.1f}" for x in (target, found.value, closest[name])]
            lines.append([name, label(int(k)), *cell[:2], f"+-{reach[k]:.1f}", cell[2]])
    return markdown(["set", "cell", "thesis", "as shipped", "reach", "closest numbers"], lines)


def label(cell: int) -> str:
    """Return the name of a cell."""
    angles = [f"{bone}_{axis}" for bone in ("clavicle", "scapula") for axis in "yzx"]
    if cell >= PARTS["6.5"].start:
        return f"Table 6.5, {('M_y', 'M_z', 'A_x', 'A_y', 'A_z', 'conoid_length')[cell - 24]}, mm"
    table = ("3.4", "3.5", "6.1-6.2", "6.3-6.4")[cell // 6]
    return f"Table {table}, {angles[cell % 6]}, deg"


@app.command()
def study(
    files: Annotated[list[Path], typer.Argument(metavar="MOTIONS.csv...")],
    mean: Annotated[list[str], typer.Option(help="Subjects that are mean motions: Tables 3.4 and 3.5.")],
    model: Annotated[list[str] | None, typer.Option(help="Sets; default: R2, R4, R6.")] = None,
    by_differences: Annotated[
        bool, typer.Option("--differences", help="Slopes by differences of the compiled fits: fewer minutes.")
    ] = False,
) -> None:
    """Print which unpublished number changes the tables most, and how close numbers within their ranges come."""
    motions = persons(files, ())
    check_known(mean, motions.subjects, "subject")
    data, models = prepare(motions, mean), [load_model(name) for name in model or printed.SETS]
    say = partial(typer.echo, err=True)
    cells = {one.name: _shipped(one, data) if by_differences else by_derivatives(one, data, say) for one in models}
    ends = np.vstack([np.zeros(len(REACH)), *(s * row for row in np.diag(REACH) for s in (-1.0, 1.0))])
    anew, closest = dict[str, np.ndarray](), dict[str, np.ndarray]()
    for one in models:
        steps = closest_steps(one, cells[one.name], data)
        every = by_fits(one, data, np.vstack([ends, steps * REACH]))
        anew[one.name], closest[one.name] = every[:-1], every[-1]
        typer.echo(
            f"{one.name}: " + ", ".join(f"{n.name} {x:+.1f}" for n, x in zip(NUMBERS_MOVED, steps * REACH, strict=True))
        )
        if not by_differences:
            typer.echo(f"largest difference of the two engines: {np.abs(cells[one.name].value - every[0]).max():.1e}")
            slopes = differences(one, data, np.zeros(len(REACH)))
            typer.echo(f"of their slopes: {np.abs(cells[one.name].slope - slopes).max():.1e}")
    for table in (decide_table(cells, anew), reach_table(cells, closest), cells_table(cells, closest)):
        typer.echo("\n" + table)


if __name__ == "__main__":
    app()
