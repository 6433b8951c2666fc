"""Report page as one HTML text: the filled template with style, scripts and data inside."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from adapt.api import Adaptations
from adapt.diagnosis.result import POSITIONS, Diagnoses, Diagnosis, GapLevels, Step
from adapt.diagnosis.texts.cause_sentences import cause_sentence, coefficient_unit, described, tested_text
from adapt.diagnosis.texts.json_form import JsonObject, plain
from adapt.diagnosis.texts.measure_next import measure_next
from adapt.diagnosis.texts.notes import rests_on
from adapt.diagnosis.texts.wording import (
    amplitude_text,
    held_out_kind_text,
    held_out_text,
    listed,
    number,
    percent_text,
    probability_text,
    sentence,
    step_text,
    violations_text,
    with_unit,
)
from adapt.report.figure_data import figure_data
from adapt.report.headline import closest, headline
from adapt.report.muscle_figures import force_sentence, muscle_sentence
from adapt.report.overview import adapted_parameters, overview, people, simulated_subjects
from adapt.report.plain_words import GLOSSARY, explained, with_hover
from adapt.report.position_figures import HEIGHT, STATE_NAMES, WIDTH, drawings, shown_states
from adapt.tables.muscle_tables import MuscleTables, force_means, humerus_known_by, muscle_means
from adapt.tables.results import Tables
from adapt.tables.thorax_table import THORAX_WORDS, thorax_table
from adapt.trust.usable_results import Flat, flat_by_subject, quick_sentences
from models.girdle import CONSTRAINT_NAMES
from models.person.family import AnyModel
from motions.table import ANGLE_NAMES, Motions

_TEMPLATES = Path(__file__).parent / "templates"

_SCRIPTS = ("shared.js", "plane.js", "muscles.js", "space.js", "numbers.js", "reach.js", "choices.js")
"""Scripts of the page; each uses the scripts before it, so their order matters."""


def report_html(
    motions: Motions,
    models: Sequence[AnyModel],
    result: Tables,
    not_handled: Mapping[str, str] | None = None,
    diagnoses: Diagnoses | None = None,
    sampled_from: int = 0,
    active_effects: str = "",
    muscles: MuscleTables | None = None,
    thorax_downweighting: float = 1.0,
    flat: Flat | None = None,
) -> str:
    """Build the report page; the same results give the same text.

    The page needs no other file and no network. ``not_handled`` names the subjects that could not be fitted, each with
    its reason. ``diagnoses`` belong to the same motions and models. Where these subjects are a sample, ``sampled_from``
    is the number of subjects from which the sample was drawn. ``active_effects`` describes the effects that the fits
    included, if any. With ``muscles`` the page shows muscle lines and moment arms. ``thorax_downweighting``: see
    :func:`adapt.adapt_subjects`. ``flat``: flat directions (``adapt.trust.usable_results``), if they are known and
    ``result`` has no covariances.
    """
    by_model = diagnoses.by_model if diagnoses else {}
    noise_deg = {name: one.noise.angle_deg for name, one in by_model.items()}
    data = figure_data(motions, models, result, noise_deg, muscles)
    who = people(len(motions.subjects), len(simulated_subjects(motions)))
    first = diagnoses.closest.model if diagnoses else closest(result.summary)
    data |= {
        "first_model": [one.name for one in models].index(first),
        "gap": {name: _gaps(one) for name, one in by_model.items()},
    }
    adapted = headline(result.summary, who, set(result.heldout["kind"]))
    kind, said = "adaptation", adapted
    if diagnoses:
        kind, said = "diagnosis", sentence(diagnoses.closest)
    elif muscles:
        kind, said = "muscles", muscle_sentence(muscles, first, who)
    return (
        _environment()
        .get_template("report.html")
        .render(
            kind=kind,
            sentence=said,
            adaptation=adapted,
            forces_moved=force_sentence(muscles, first) if muscles else "",
            diagnosed=diagnoses is not None,
            by_model=by_model,
            who=who,
            sampled_from=sampled_from,
            active_effects=active_effects,
            thorax_downweighting=thorax_downweighting,
            simulated=simulated_subjects(motions),
            subjects=motions.subjects,
            drawn=len(data["subjects"]),
            postures=len(motions.posture),
            postures_drawn=len(data["posture"]),
            overview=overview(result),
            whether_to_use=quick_sentences(models, result, _flat(result) if flat is None else flat),
            parameters=adapted_parameters(result),
            held_out=result.heldout["subject"].nunique(),
            not_handled=not_handled or {},
            rejected=[str(error) for error in motions.rejected],
            muscles=muscle_means(muscles).reset_index().to_dict("records") if muscles else [],
            forces=force_means(muscles.balance) if muscles else {},
            posed=" ".join(humerus_known_by(muscles.balance)) if muscles else "",
            with_lines=_with_lines(data),
            thorax=thorax_table(motions).to_dict("records"),
            thorax_words=THORAX_WORDS,
            data=_json(data),
            style=_verbatim("report.css"),
            script=Markup("\n").join(map(_verbatim, _SCRIPTS)),
            plotly=Markup(get_plotlyjs()),
        )
    )


def _flat(result: Tables) -> Flat | None:
    """Describe the flat directions of a result that has its covariances; None for others."""
    if not isinstance(result, Adaptations):
        return None
    subjects = list(dict.fromkeys(result.parameters["subject"]))
    return flat_by_subject(list(result.adapted), subjects, result.uncertainty)


def _with_lines(data: JsonObject) -> int:
    """Count the drawn postures of one model that have muscle lines."""
    first = (data["muscles"] or [{"states": {}}])[0]["states"]
    return len(set().union(*(state["paths"] for state in first.values())))


def _gaps(diagnosis: Diagnosis) -> JsonObject:
    """Collect the gaps of one model in sample and with most held out; ``with_effect`` only if there are causes."""

    def shown(levels: GapLevels) -> JsonObject:
        return {kind: one for kind, one in plain(levels).items() if diagnosis.goes_further or kind != "with_effect"}

    gaps = diagnosis.gaps
    return {"held_out": shown(gaps.hardest), "in_sample": shown(gaps.in_sample), "what": held_out_kind_text(gaps)}


def _largest(budget: Sequence[Step]) -> float:
    """Return the gap in degrees that the longest bar stands for."""
    return max((step.gap_deg.value for step in budget if step.gap_deg.value > 0.0), default=1.0)


def _environment() -> Environment:
    """Create the template environment, which escapes all inserted names and raises an error for a misspelt variable."""
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "deg": _deg,
        "drawings": drawings,
        "coefficient_unit": coefficient_unit,
        "held_out": held_out_text,
        "hover": with_hover,
        "largest": _largest,
        "listed": listed,
        "measure_next": measure_next,
        "rests_on": rests_on,
        "percent": percent_text,
        "probability": probability_text,
        "sentence": sentence,
        "shown_states": shown_states,
        "size": amplitude_text,
        "step": step_text,
        "held_out_kind": held_out_kind_text,
        "tested": tested_text,
        "violations": violations_text,
    }
    environment.globals |= {
        "angle_names": ANGLE_NAMES,
        "by_positions": POSITIONS,
        "cause_sentence": cause_sentence,
        "constraints": CONSTRAINT_NAMES,
        "explained": lambda diagnosis, name: explained(name, described(diagnosis, name)),
        "glossary": GLOSSARY,
        "number": number,
        "path_height": HEIGHT,
        "path_width": WIDTH,
        "state_names": STATE_NAMES,
        "what": described,
        "with_unit": with_unit,
    }
    return environment


def _verbatim(name: str) -> Markup:
    return Markup((_TEMPLATES / name).read_text(encoding="utf-8"))


def _json(data: Any) -> Markup:
    """Serialise data to JSON in which no name can end the enclosing script element."""
    return htmlsafe_json_dumps(data, allow_nan=False, separators=(",", ":"))


def _deg(value: float | None) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.1f}"
