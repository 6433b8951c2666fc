# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false
# pyright: reportGeneralTypeIssues=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Assessment of an adaptation: uncertainty, held-out gap, and checks whether the ellipsoid can be a thorax and whether
forces act as before."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt.api import Adaptations, adapt_with_every_fold
from adapt.evaluation.covariance import NORMAL_95, Uncertainty, sd
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapted_from
from adapt.solvers.objective import WEIGHT
from adapt.solvers.problems import Problems
from adapt.tables.before_after import before_and_after
from adapt.tables.contact_table import contact_table
from adapt.tables.in_notebook import notebook_html
from adapt.tables.muscle_tables import serratus_arms
from adapt.trust.changed_forces import force_checks
from adapt.trust.flat_directions import FLAT_MM
from adapt.trust.profile import Profile, profile_intervals
from adapt.trust.thorax_plausibility import WARNING
from adapt.trust.usable_results import flat_by_subject, plausibility_table, use_table
from adapt.trust.weight_choice import weight_table
from models.adapted_parameters import ADAPTED
from models.person.family import AnyModel, as_list
from motions.errors import InputError
from motions.motion_csv.typed_motions import check_motions
from motions.table import Motions, counted

PARABOLA, BOUNDS, NONE = "parabola", "bounds", "none"
"""Origins of an interval: +-1.96 SD within the bounds; the bounds, for a parameter at a bound; no interval."""

_ALMOST_NO_POINTS = 1e3
"""Factor on w at which the thorax points determine only what the motion leaves undetermined: D has a thousandth of its
weight."""


_GAPS = [f"gap_{kind}_deg" for kind in ("before", "in_sample", "unseen_motion", "unseen_postures")]

_COLUMNS = [
    *("model", "subject", "status", *_GAPS),
    *("noise_deg", "points_forbid", "jump_free", "at_bound", "flat", "plausibility", "warnings"),
]
"""Columns of ``trust.csv``."""

_SHOWN = ["model", "subject", *_GAPS, "at_bound", "flat", "plausibility", "warnings"]
"""Columns of ``trust.csv`` that a notebook shows."""


@dataclass(frozen=True, repr=False)
class Trust:
    """Tables of an adaptation; their columns are described at the functions that make them."""

    adaptations: Adaptations
    """Adaptations, with motions and with thirds of the postures held out."""
    subjects: pd.DataFrame
    """``trust.csv``: one row per model and subject."""
    uncertainty: pd.DataFrame
    """``uncertainty.csv``: one row per model, subject and parameter."""
    plausibility: pd.DataFrame
    """``plausibility.csv``: one row per model, subject and check."""
    contact: pd.DataFrame
    """``contact.csv``: one row per model and posture."""
    weights: pd.DataFrame | None
    """``weights.csv``: one row per model and w; None unless requested."""

    def __repr__(self) -> str:
        models = ", ".join(dict.fromkeys(self.subjects["model"]))
        warned = int((self.subjects["plausibility"] == WARNING).sum())
        subjects = counted(self.subjects["subject"].nunique(), "subject")
        return f"Trust({subjects}, {models}: {warned} of {len(self.subjects)} outside the limits)"

    def _repr_html_(self) -> str:
        """Return gaps, degrees, and warnings by subject, as a notebook shows them."""
        return notebook_html(repr(self), _SHOWN, self.subjects[_SHOWN].itertuples(index=False))


def assess_trust(
    motions: Motions,
    models: AnyModel | Sequence[AnyModel],
    weight: float = WEIGHT,
    choose_weight: bool = False,
    progress: Callable[[str], None] = lambda _: None,
    own_bones: bool = False,
) -> Trust:
    """Adapt every model to every subject and assess the result.

    E = D + weight mean(J), mm^2 and deg^2, as in ``adapt_subjects``; ``choose_weight`` also tries other w on held-out
    motions. ``own_bones`` assesses the adaptation with own bones, whose E has no thorax points, bounds or w to assess;
    the intervals are then those of its posterior.
    """
    motions = check_motions(motions)
    models = as_list(models)
    names, everyone = [model.name for model in models], motions.subjects
    if own_bones and choose_weight:
        raise InputError("--choose-weight", None, "w changes nothing with own bones", "Leave one of the two out")
    result = adapt_with_every_fold(motions, models, weight, progress, own_bones)
    problems, found = result.problems, result.uncertainty
    data, adapted = problems.data, problems.adapted
    progress("profiles of E")
    profile = profile_intervals(data, adapted, found, (found.sd_mm > FLAT_MM) & (not own_bones))
    progress("adaptation without the thorax points")
    free = adapted if own_bones else adapted_from(data, adapted.theta_mm, _ALMOST_NO_POINTS * weight)
    progress("forces before and after")
    pairs = [(model, before_and_after(model, result.fits, result.parameters)) for model in models]
    contact = contact_table(pairs)
    forces = force_checks(contact, serratus_arms(pairs))
    plausible = pd.concat([plausibility_table(models, result.parameters), forces], ignore_index=True)
    spread = uncertainty_table(everyone, models, data, adapted, found, profile)
    weights = None
    if choose_weight:
        weights = weight_table(data, problems.rows, names, problems.held_out.folds, progress=progress)
    summary = _subjects_table(motions, names, result, found, free, plausible)
    return Trust(result, summary, spread, plausible, contact, weights)


def intervals(
    data: Problems, adapted: Adapted, found: Uncertainty
) -> tuple[Float[np.ndarray, "2 6 problems"], np.ndarray]:
    """Compute the 95 % intervals within the bounds, mm, and the origin of each."""
    bounds = np.where(found.bounded, data.bounds_mm, np.array([-np.inf, np.inf])[:, None, None])
    half = NORMAL_95 * found.sd_mm
    ends = np.clip(np.stack([adapted.theta_mm - half, adapted.theta_mm + half]), bounds[:1], bounds[1:])
    origin = np.where(np.isfinite(half), PARABOLA, NONE)
    return np.where(found.free, ends, bounds), np.where(found.free, origin, BOUNDS)


def uncertainty_table(
    subjects: Sequence[str],
    models: Sequence[AnyModel],
    data: Problems,
    adapted: Adapted,
    found: Uncertainty,
    profile: Profile,
) -> pd.DataFrame:
    """Tabulate ``uncertainty.csv``, mm, one row per model, subject and adapted parameter.

    ``low_mm`` and ``high_mm`` are the 95 % interval, ``interval`` is the interval's origin. ``sd_mm`` is the total SD,
    as far as the bounds leave room; ``sd_noise_mm`` is the SD of repeated measurements of the same person;
    ``sd_person_mm`` is the SD that arises because the thorax points are another person's. ``profile_low_mm`` and
    ``profile_high_mm``, given where SD > ``FLAT_MM``, are the ends of the profile interval of E, a check of the
    parabola (in simulations the interval holds the truth as often as it should, the profile less often).
    ``points_share`` is the share of the thorax points in the information on the parameter.
    """
    ends, origin = intervals(data, adapted, found)
    words, good = adapted.status, adapted.status == status.OK
    noise, person, both = sd(found.noise_mm2), sd(found.person_mm2), found.sd_mm
    rows = []
    for problem, (model, subject) in enumerate(product(models, subjects)):
        own = np.asarray(model.of(subject).girdle.adapted_mm)
        for k, name in enumerate(ADAPTED):
            row: dict[str, object] = {"model": model.name, "subject": subject}
            row |= {"parameter": name, "adapted_mm": adapted.theta_mm[k, problem], "prior_mm": own[k]}
            numbers = {"sd_mm": both[k, problem], "sd_noise_mm": noise[k, problem], "sd_person_mm": person[k, problem]}
            numbers |= {"low_mm": ends[0, k, problem], "high_mm": ends[1, k, problem]}
            numbers |= {f"profile_{end}_mm": profile.ends_mm[i, k, problem] for i, end in enumerate(("low", "high"))}
            numbers |= {"points_share": found.points_share[k, problem]}
            row |= {key: value if good[problem] else np.nan for key, value in numbers.items()}
            row["interval"] = origin[k, problem] if good[problem] else NONE
            row["at_bound"] = int(adapted.at_bound[k, problem])
            rows.append(row | {"status": words[problem]})
    return pd.DataFrame(rows)


def jump_free_share(motions: Motions, fits: pd.DataFrame) -> dict[str, float]:
    """Compute, by subject, the share of steps along the motions that stay on one branch of solutions.

    ``fits`` are the posture fits after adaptation. The share is NaN for a subject without steps.
    """
    step, smooth = motions.previous_rows() >= 0, fits["jump"].to_numpy() != 1
    steps = {name: own[step[own]] for name, own in zip(motions.subjects, motions.rows_by_subject(), strict=True)}
    return {name: float(np.mean(smooth[own])) if len(own) else float("nan") for name, own in steps.items()}


def _subjects_table(motions, names, result, found, free, plausible) -> pd.DataFrame:
    """Tabulate ``trust.csv``; gaps are mean |simulated - measured| over all angles, degrees.

    ``points_forbid`` is the share of the possible decrease of mean J, without the thorax points but within the bounds,
    that these points prevent. ``jump_free`` is the share of steps along the motions without a jump to another branch.
    """
    adapted, subjects, fits = result.problems.adapted, motions.subjects, result.fits
    table = use_table(result, plausible, flat_by_subject(names, subjects, found))
    least = [np.where(one.status == status.OK, one.mean_j_deg2, np.nan) for one in (adapted, free)]
    forbid = map(improvement_blocked_by_points, result.parameters["mean_j_before_deg2"], *least)
    smooth = [jump_free_share(motions, fits[(fits["model"] == name) & (fits["adapted"] == 1)]) for name in names]
    table = table.assign(
        status=adapted.status,
        noise_deg=found.noise_deg,
        points_forbid=list(forbid),
        jump_free=[one[subject] for one in smooth for subject in subjects],
    )
    return table.reindex(columns=_COLUMNS)


def improvement_blocked_by_points(before_deg2: float, adapted_deg2: float, without_deg2: float) -> float:
    """Compute the share of the possible decrease of mean J that the thorax points prevent.

    The possible decrease leads from mean J before adaptation to mean J adapted without the thorax points; an adaptation
    with these points achieves only a part. The share is NaN where the adaptation without the points failed, did not
    decrease mean J, or ended in a local minimum above the adaptation with them.
    """
    if not without_deg2 < before_deg2 or not without_deg2 <= adapted_deg2:
        return float("nan")
    return float((adapted_deg2 - without_deg2) / (before_deg2 - without_deg2))
