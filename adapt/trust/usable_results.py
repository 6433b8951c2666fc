# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false, reportReturnType=false
# pyright: reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Answer to which results of an adaptation may be used: gaps, open parameters and checks by subject, and sentences."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pandas as pd

from adapt.evaluation.covariance import Uncertainty
from adapt.solvers import status
from adapt.tables.before_after import before_and_after
from adapt.tables.contact_table import contact_table
from adapt.tables.folds import MOTION, POSTURES
from adapt.tables.held_out import by_subject
from adapt.tables.results import DIFFERENCES, Tables
from adapt.trust.changed_forces import force_checks
from adapt.trust.flat_directions import flat_directions
from adapt.trust.thorax_plausibility import PASS, WARNING, checks
from models.adapted_parameters import ADAPTED
from models.muscles.muscle_lines import all_have_landmarks
from models.person.family import AnyModel

Flat = Mapping[tuple[str, str], str]
"""Flat directions of each adaptation, in words, by model and subject."""

_HELD_OUT = {"gap_unseen_motion_deg": "motions", "gap_unseen_postures_deg": "postures"}
"""Columns of ``trust.csv`` with held-out gaps, the strictest first, and their words."""

_SERRATUS = "; the serratus was not checked: see girdle trust"
"""Clause where the muscle was not checked: its lines round the thorax take minutes."""

_NO_FLAT = "M_y and A_y trade off: see girdle trust"
"""Clause where no covariance is known: the thorax points cover a patch, along which both can change together."""


def flat_by_subject(
    models: Sequence[str], subjects: Sequence[str], found: Uncertainty, shown: Collection[str] | None = None
) -> dict[tuple[str, str], str]:
    """Describe the flat directions of each adaptation, problem = model * subjects + subject; with ``shown``, only of
    these subjects."""
    pairs = [(model, subject) for model in models for subject in subjects]
    return {
        pair: "; ".join(flat_directions(found.covariance_mm2[..., k]))
        for k, pair in enumerate(pairs)
        if shown is None or pair[1] in shown
    }


def plausibility_table(models: Sequence[AnyModel], parameters: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the checks of the ellipsoid in ``plausibility.csv``: value, limits, reason of the limits, and ``pass``
    or ``warning``.

    There is one row per model, subject and check; ``own_value`` is the value of the parameter set itself.
    """
    sets, rows = {model.name: model for model in models}, []
    adapted = parameters[[f"{name}_mm" for name in ADAPTED]].to_numpy(float)
    for model, subject, theta_mm in zip(parameters["model"], parameters["subject"], adapted, strict=True):
        mine = sets[model].of(subject)
        own = checks(mine, np.asarray(mine.girdle.adapted_mm))
        rows += [
            check.row(model, subject, before.value) for check, before in zip(checks(mine, theta_mm), own, strict=True)
        ]
    return pd.DataFrame(rows)


def use_table(result: Tables, plausible: pd.DataFrame, flat: Flat | None) -> pd.DataFrame:
    """Tabulate the columns of ``trust.csv`` on which the sentences rest, one row per model and subject.

    Gaps are mean |simulated - measured| over all angles, degrees. Without ``flat`` the column ``flat`` is left out.
    """
    held_out = {}
    if len(result.heldout):
        held_out = by_subject(result.heldout).set_index(["model", "subject", "kind"])["gap_unseen_deg"].to_dict()
    fits = result.fits.assign(
        gap_deg=result.fits[DIFFERENCES].abs().mean(axis=1).where(result.fits["status"] == status.OK)
    )
    gap = fits.groupby(["model", "subject", "adapted"])["gap_deg"].mean().to_dict()
    warned = (
        plausible[plausible["verdict"] == WARNING].groupby(["model", "subject"])["check"].apply(", ".join).to_dict()
    )
    rows = []
    for one in result.parameters.to_dict("records"):
        pair = one["model"], one["subject"]
        row: dict[str, object] = {"model": pair[0], "subject": pair[1]}
        row |= {"gap_before_deg": gap.get((*pair, 0)), "gap_in_sample_deg": gap.get((*pair, 1))}
        row["gap_unseen_motion_deg"] = held_out.get((*pair, MOTION), np.nan)
        row["gap_unseen_postures_deg"] = held_out.get((*pair, POSTURES), np.nan)
        row["at_bound"] = ", ".join(name for name in ADAPTED if one[f"{name}_mm_at_bound"])
        row |= {} if flat is None else {"flat": flat[pair]}
        row["plausibility"] = WARNING if pair in warned else PASS
        rows.append(row | {"warnings": warned.get(pair, "")})
    return pd.DataFrame(rows)


def quick_sentences(models: Sequence[AnyModel], result: Tables, flat: Flat | None) -> dict[str, list[str]]:
    """Write the sentences of each model from results that are at hand: with every check but that of the serratus."""
    pairs = [(model, before_and_after(model, result.fits, result.parameters)) for model in models]
    forces = force_checks(contact_table(pairs), pd.DataFrame())
    plausible = pd.concat([plausibility_table(models, result.parameters), forces], ignore_index=True)
    rows, subjects = use_table(result, plausible, flat), list(dict.fromkeys(result.parameters["subject"]))
    return {
        one.name: trust_sentences(
            rows[rows["model"] == one.name], _SERRATUS if all_have_landmarks(one, subjects) else ""
        )
        for one in models
    }


def trust_sentences(rows: pd.DataFrame, unchecked: str = "") -> list[str]:
    """Write from the rows of ``trust.csv`` which results of one set may be used: angles, parameters, ellipsoid.

    ``unchecked``: clause about checks that were not made.
    """
    return [_say_angles(rows), _say_parameters(rows), _say_ellipsoid(rows, unchecked)]


def _say_angles(rows: pd.DataFrame) -> str:
    held_out = next((column for column in _HELD_OUT if int(rows[column].count())), None)
    if held_out is None:
        return "Angles: nothing was held out, so nothing says whether the adaptation predicts."
    known = rows[rows[held_out].notna()]
    before, after = known["gap_before_deg"], known[held_out]
    better = int((~(after >= before)).sum())  # NaN: no posture could be fitted before
    use = "use the adapted model" if 2 * better > len(known) else "use the model as it is"
    change = _change(before.mean(), after.mean())
    gap = f"the gap on held-out {_HELD_OUT[held_out]} {change}, smaller in {better} of {len(known)} subjects"
    return f"Angles: {use}; {gap}."


def _change(before_deg: float, after_deg: float) -> str:
    if not np.isfinite(before_deg):
        return f"is {after_deg:.1f} deg, and no posture could be fitted before adaptation"
    return f"goes from {before_deg:.1f} before adaptation to {after_deg:.1f} deg"


def _say_parameters(rows: pd.DataFrame) -> str:
    known = "flat" in rows
    said = rows["at_bound"] + " " + rows["flat"] if known else rows["at_bound"]
    counts = {name: int(said.str.contains(rf"\b{name}\b").sum()) for name in ADAPTED}
    open_ones = ", ".join(f"{name} ({count} of {len(rows)})" for name, count in counts.items() if count)
    if not known:
        return (
            f"Parameters: {f'do not read {open_ones}: at a bound' if open_ones else 'none is at a bound'}; {_NO_FLAT}."
        )
    if not open_ones:
        return "Parameters: all are determined."
    return f"Parameters: do not read {open_ones}: at a bound, or only together with another."


def _say_ellipsoid(rows: pd.DataFrame, unchecked: str) -> str:
    warned = rows[rows["plausibility"] == WARNING]
    if warned.empty:
        return f"Ellipsoid: within all limits{unchecked}."
    outside = f"outside the limits in {len(warned)} of {len(rows)} subjects"
    return f"Ellipsoid: look before you use it; {outside}{unchecked}."
