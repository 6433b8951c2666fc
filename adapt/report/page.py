"""The report as one HTML text: the page's template filled in, with its style, scripts and data inside."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from adapt.diagnosis.json_form import JsonObject, gaps_as_json
from adapt.diagnosis.notes import notes
from adapt.diagnosis.result import HELD_OUT, Diagnoses, Diagnosis
from adapt.diagnosis.wording import amplitude_text, listed, number, probability_text, sentence
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
    diagnoses: Diagnoses | None = None,
    sampled_from: int = 0,
    active_effects: str = "",
) -> str:
    """Build the report page; the same results give the same text.

    No other file and no network is needed to read it. ``not_handled`` names the subjects that could not be fitted, each
    with its reason; ``diagnoses`` are of the same motions and models. ``sampled_from`` is the number of subjects of
    which these are a sample, if they are. ``active_effects`` says with which effects they were fitted, if any.
    """
    by_model = diagnoses.by_model if diagnoses else {}
    noise_deg = {name: one.noise.noise.angle_deg for name, one in by_model.items()}
    data = figure_data(motions, models, result, noise_deg)
    who = people(len(motions.subjects), len(simulated_subjects(motions)))
    first = diagnoses.closest.model if diagnoses else closest(result.summary)
    data |= {
        "first_model": [one.name for one in models].index(first),
        "gap": {name: _gaps(one) for name, one in by_model.items()},
    }
    adapted = headline(result.summary, who, set(result.heldout["kind"]))
    return (
        _environment()
        .get_template("report.html")
        .render(
            sentence=sentence(diagnoses.closest) if diagnoses else adapted,
            adaptation=adapted,
            diagnosed=diagnoses is not None,
            by_model=by_model,
            who=who,
            sampled_from=sampled_from,
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


def _gaps(diagnosis: Diagnosis) -> JsonObject:
    """The gaps of one model; without an effect there is no gap with it."""
    gaps = gaps_as_json(diagnosis.gaps)
    return {kind: level for kind, level in gaps.items() if diagnosis.best or kind != "with_effect"}


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
        "probability": probability_text,
        "size": amplitude_text,
        "listed": listed,
        "notes": notes,
        "sentence": sentence,
    }
    environment.globals |= {
        "angle_names": ANGLE_NAMES,
        "constraints": CONSTRAINT_NAMES,
        "effects": EFFECTS,
        "number": number,
        "held_out_part": HELD_OUT,
    }
    return environment


def _verbatim(name: str) -> Markup:
    return Markup((_TEMPLATES / name).read_text(encoding="utf-8"))


def _json(data: Any) -> Markup:
    """JSON that cannot end the script element which holds it, whatever the names in it are."""
    return htmlsafe_json_dumps(data, allow_nan=False, separators=(",", ":"))


def _deg(value: float | None) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.1f}"
