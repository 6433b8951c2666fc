"""The report as one HTML text: the page's template filled in, with its style, scripts and data inside."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from adapt.cli.print_diagnosis import notes
from adapt.diagnosis.inference.verdict import NONE, UNKNOWN
from adapt.diagnosis.wording import Object, amplitude_text, listed, number
from adapt.report.figure_data import CONSTRAINT_NAMES, figure_data
from adapt.report.headline import closest, headline
from adapt.report.overview import adapted_parameters, overview, people, simulated_subjects
from adapt.tables.results import Tables
from models.effects import EFFECTS
from models.parameter_sets import ParameterSet
from motions.table import ANGLE_NAMES, Motions

_TEMPLATES = Path(__file__).parent / "templates"

_SCRIPTS = ("shared.js", "plane.js", "space.js", "choices.js")
"""In this order: each uses what stands before it."""


def report_html(
    motions: Motions,
    models: Sequence[ParameterSet],
    result: Tables,
    not_handled: Mapping[str, str] | None = None,
    diagnosis: Object | None = None,
    of: int = 0,
    active_effects: str = "",
) -> str:
    """The page: no other file and no network is needed to read it. The same results give the same text.

    ``not_handled`` names the subjects that could not be fitted, each with its reason; ``diagnosis`` is the object of
    diagnosis.json (``adapt.diagnosis.json_form.as_json``), of the same motions and models. ``of`` is the number of
    subjects of which these are a sample, if they are. ``active_effects`` says with which effects they were fitted, if
    any.
    """
    by_model: dict[str, Object] = diagnosis["by_model"] if diagnosis else {}
    noise_deg = {name: of["noise"]["angle_deg"] for name, of in by_model.items()}
    data = figure_data(motions, models, result, noise_deg)
    who = people(len(motions.subjects), len(simulated_subjects(motions)))
    data |= {
        "first_model": [one.name for one in models].index(diagnosis["model"] if diagnosis else closest(result.summary)),
        "gap": {name: _levels(of) for name, of in by_model.items()},
    }
    adapted = headline(result.summary, who, set(result.heldout["kind"]))
    return (
        _environment()
        .get_template("report.html")
        .render(
            sentence=diagnosis["verdict"]["sentence"] if diagnosis else adapted,
            adaptation=adapted,
            diagnosis=diagnosis,
            by_model=by_model,
            who=who,
            of=of,
            active_effects=active_effects,
            simulated=simulated_subjects(motions),
            subjects=motions.subjects,
            drawn=len(data["subjects"]),
            postures=len(motions.posture),
            postures_drawn=len(data["posture"]),
            overview=overview(result),
            parameters=adapted_parameters(result),
            held_out=result.heldout["subject"].nunique(),
            not_handled=not_handled or {},
            rejected=[str(error) for error in motions.rejected],
            data=_json(data),
            style=_verbatim("report.css"),
            script=Markup("\n").join(map(_verbatim, _SCRIPTS)),
            plotly=Markup(get_plotlyjs()),
        )
    )


def _levels(of: Object) -> Object:
    """The gaps of one model; without an effect there is no gap with it."""
    return {kind: level for kind, level in of["gap_deg"].items() if of["best"] or kind != "with_effect"}


def _environment() -> Environment:
    """Names from files are escaped wherever they are put; a name that the template misspells is an error."""
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "deg": _deg,
        "probability": _probability,
        "size": amplitude_text,
        "listed": listed,
        "notes": notes,
        "ranked": _ranked,
    }
    environment.globals |= {
        "angle_names": ANGLE_NAMES,
        "constraints": CONSTRAINT_NAMES,
        "effects": EFFECTS,
        "number": number,
    }
    return environment


def _verbatim(name: str) -> Markup:
    return Markup((_TEMPLATES / name).read_text(encoding="utf-8"))


def _json(data: Any) -> Markup:
    """JSON that cannot end the script element which holds it, whatever the names in it are."""
    return htmlsafe_json_dumps(data, allow_nan=False, separators=(",", ":"))


def _deg(value: float | None) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.1f}"


def _probability(value: float) -> str:
    return "<0.01" if 0.0 < value < 0.005 else f"{value:.2f}"


def _ranked(probability: Mapping[str, float]) -> list[tuple[str, float]]:
    """The effects, the most probable one first, then the answers that are none."""
    effects = sorted((name for name in probability if name not in (NONE, UNKNOWN)), key=lambda n: -probability[n])
    return [(name, probability[name]) for name in (*effects, NONE, UNKNOWN)]
