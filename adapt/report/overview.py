# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""First tables of a report: fitted subjects and quality of the fits, over all subjects."""

from dataclasses import dataclass
from typing import Any

from adapt.report.fit_states import STATES, state_rows
from adapt.report.headline import statistic
from adapt.solvers import status
from adapt.tables.results import HELD_OUT, Tables, parameter_statistics
from models.adapted_parameters import ADAPTED
from motions.table import ANGLES, BONES, Motions

_ORIGIN, _SIMULATED = "origin", "simulated"
"""Column that marks simulated motions, and its value (``motions.rhythm_subjects``)."""


@dataclass(frozen=True)
class Row:
    """Row of one parameter set. Gaps are (before, after) adaptation, degrees; NaN where nothing was fitted."""

    model: str
    gap_deg: dict[str, tuple[float, float]]
    """Mean absolute difference of each bone over the subjects; 'largest': the largest of one angle of one subject."""
    held_out_deg: dict[str, float]
    """Held-out gap of each bone, degrees; NaN where nothing was held out."""
    postures: int
    postures_ok: tuple[int, int]
    subjects: int
    adapted: int
    """Number of subjects whose adaptation ended ok."""
    at_bound: dict[str, int]
    """Number of adapted subjects with the parameter at its bound; parameters without such subjects are omitted."""


def overview(result: Tables) -> list[Row]:
    """Summarise the results in one row per parameter set."""
    return [_row(result, model) for model in dict.fromkeys(result.parameters["model"])]


def _row(result: Tables, model: str) -> Row:
    before, after = (statistic(result.summary, model, state) for state in STATES)
    gap_deg = {bone: (before[f"{bone}_deg"], after[f"{bone}_deg"]) for bone in BONES}
    largest = [statistic(result.summary, model, state, "max") for state in STATES]
    fits = [state_rows(result.fits, model, state)["status"] == status.OK for state in STATES]
    parameters = result.parameters[result.parameters["model"] == model]
    good = parameters[parameters["status"] == status.OK]
    at_bound = {name: int(good[f"{name}_mm_at_bound"].sum()) for name in ADAPTED}
    return Row(
        model=model,
        gap_deg=gap_deg | {"largest": tuple(_largest(row) for row in largest)},
        held_out_deg={bone: after[name] for bone, name in HELD_OUT.items()},
        postures=len(fits[0]),
        postures_ok=tuple(int(ok.sum()) for ok in fits),
        subjects=len(parameters),
        adapted=len(good),
        at_bound={name: count for name, count in at_bound.items() if count},
    )


def _largest(row: dict[str, float]) -> float:
    """Return the largest value of the measured angles."""
    values = [row[f"{angle}_deg"] for angle in ANGLES]
    return max((value for value in values if value == value), default=float("nan"))


def adapted_parameters(result: Tables) -> dict[str, list[dict[str, Any]]]:
    """Tabulate mean and SD of the adapted parameters by model (Table 6.5) beside the model's own values (Table 6.6)."""
    rows = parameter_statistics(result.parameters)
    return {str(model): part.to_dict("records") for model, part in rows.groupby("model", sort=False)}


def simulated_subjects(motions: Motions) -> tuple[str, ...]:
    """List the subjects whose rows are marked as simulated."""
    if _ORIGIN not in motions.extra:
        return ()
    rows = (motions.extra[_ORIGIN] == _SIMULATED).to_numpy()
    return tuple(dict.fromkeys(motions.subject[rows].tolist()))


def people(subjects: int, simulated: int) -> str:
    """Describe the subjects: '10 simulated subjects'; '10 subjects (3 simulated)'."""
    word = f"subject{'s' if subjects != 1 else ''}"
    if simulated == subjects:
        return f"{subjects} simulated {word}"
    return f"{subjects} {word} ({simulated} simulated)" if simulated else f"{subjects} {word}"
