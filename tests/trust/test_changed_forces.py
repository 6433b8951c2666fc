# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportIndexIssue=false, reportCallIssue=false
# (pandas types nearly every result as "Series | DataFrame | scalar")
"""Checks of forces, with limits from the published sets: these pass, an ellipsoid that shrank or ran away does not."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command import SHIPPED

from adapt.api import adapt_subjects, fit_postures
from adapt.solvers import status
from adapt.tables.before_after import BeforeAfter, before_and_after
from adapt.tables.contact_table import contact_table
from adapt.tables.muscle_tables import muscle_tables, serratus_arms, unbalanced
from adapt.tables.results import fits_table
from adapt.trust.changed_forces import SERRATUS_RATIO, TURNED_DEG, force_checks
from adapt.trust.thorax_plausibility import PASS, WARNING, checks
from adapt.trust.usable_results import plausibility_table
from models import ParameterSet, load_model
from models.adapted_parameters import ADAPTED_PARAMETERS
from models.muscles.muscle_lines import muscle_lines
from motions import read_motions
from scripts.reporting import CADAVER_SETS as SETS
from scripts.research.trust.spread_of_sets import rhythm, spread

UNBOUND_MM = 1e4

LIMIT = 0.005
"""Largest relative excess of a limit over the largest difference: limits are rounded up."""


def test_the_limits_are_the_largest_differences_between_published_sets():
    found = spread()
    for force, limit in TURNED_DEG.items():
        assert 0.0 <= limit - found[f"{force} turned, deg"].max() < LIMIT * limit
    for joint, limit in SERRATUS_RATIO.items():
        ratios = found[f"serratus about {joint.upper()}, ratio"]
        assert 0.0 <= limit - ratios.max() < LIMIT * limit


def changed(model: ParameterSet, **by: float) -> np.ndarray:
    """Return the set's adapted parameters, some of them times a factor."""
    return np.array(
        [
            value * by.get(one.name, 1.0)
            for one, value in zip(ADAPTED_PARAMETERS, np.asarray(model.girdle.adapted_mm), strict=True)
        ]
    )


def tables(model: ParameterSet, theta: np.ndarray) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Make tables of an 'adaptation' to theta: postures of the rhythm fitted before and after."""
    motions = rhythm()
    after = ParameterSet(model.name, model.girdle.with_adapted(theta), model.points_mm, model.bounds_mm, model.source)
    fits = [fit_postures(motions, one).by_model[model.name] for one in (model, after)]
    rows = pd.concat([fits_table(motions, model.name, bool(k), fit) for k, fit in enumerate(fits)], ignore_index=True)
    values = {one.key: [value] for one, value in zip(ADAPTED_PARAMETERS, theta, strict=True)}
    return rows, pd.DataFrame({"model": [model.name], "subject": [motions.subjects[0]], **values})


def pair(model: ParameterSet, theta: np.ndarray) -> list[tuple[ParameterSet, BeforeAfter]]:
    return [(model, before_and_after(model, *tables(model, theta)))]


def verdicts(model: ParameterSet, theta: np.ndarray) -> dict[str, str]:
    pairs = pair(model, theta)
    found = force_checks(contact_table(pairs), serratus_arms(pairs))
    named = dict(zip(found["check"], found["verdict"], strict=True))
    return named | {check.name: check.verdict for check in checks(model, theta)}


@pytest.mark.parametrize("name", SETS)
def test_a_published_set_as_it_is_passes(name):
    model = load_model(name)
    found = verdicts(model, changed(model))
    forces = {key: value for key, value in found.items() if key.startswith(("direction", "serratus"))}
    assert len(forces) == 5
    assert set(forces.values()) == {PASS}


def test_another_published_ellipsoid_passes_but_for_what_is_not_of_the_ellipsoid():
    model, other = load_model("R6"), load_model("breteler_dissection")
    theta = np.asarray(other.girdle.adapted_mm).copy()
    theta[-1] = float(model.girdle.conoid_length_mm)
    found = verdicts(model, theta)
    assert found["direction at TS"] == found["direction at AI"] == PASS


def test_a_shrunken_ellipsoid_is_flagged():
    model = load_model("R6")
    found = verdicts(model, changed(model, A_x=0.75, A_z=0.6))
    assert WARNING in {found[name] for name in found if name.startswith(("direction", "serratus"))}


def test_a_runaway_ellipsoid_is_flagged():
    model = load_model("R6")
    found = verdicts(model, changed(model, M_y=12.0, A_y=8.0))
    assert found["volume"] == WARNING
    assert WARNING in {found[name] for name in found if name.startswith(("direction", "serratus"))}


@pytest.mark.parametrize("name", ["R2", "R4"])
def test_what_an_adaptation_without_bounds_runs_away_to_is_flagged(name):
    """Check adaptations of simulated subjects in which M_y and A_y may run away by 10 m, and do.

    The size of the thorax shows this; the forces keep their directions.
    """
    model = load_model(name)
    own = np.asarray(model.girdle.adapted_mm)
    free = replace(model, bounds_mm=np.stack([np.where(np.arange(6) < 2, own - UNBOUND_MM, 1.0), own + UNBOUND_MM]))
    motions = read_motions(SHIPPED)
    motions = motions.select(np.isin(motions.subject, motions.subjects[:2]))
    result = adapt_subjects(motions, free, held_out=())
    assert set(result.parameters["status"]) == {status.OK}
    assert np.all(result.parameters["A_y_mm"] > 0.5 * UNBOUND_MM)
    found = plausibility_table([free], result.parameters)
    of_size = found[found["check"].isin(["depth", "width", "volume"])]
    assert len(of_size) == 6
    assert set(of_size["verdict"]) == {WARNING}
    pairs = [(free, before_and_after(free, result.fits, result.parameters))]
    assert set(force_checks(contact_table(pairs), serratus_arms(pairs))["verdict"]) == {PASS}


def test_a_set_without_landmarks_has_contact_but_no_serratus():
    model = load_model("das3")
    fits, parameters = tables(model, changed(model))
    assert status.OK in set(fits["status"])
    pairs = [(model, before_and_after(model, fits, parameters))]
    assert serratus_arms(pairs).empty
    found = force_checks(contact_table(pairs), pd.DataFrame())
    assert len(found) == len(TURNED_DEG)


def test_the_tables_have_a_row_a_posture_and_state_and_name_what_has_no_solution():
    model = load_model("R2")
    fits, parameters = tables(model, changed(model, A_y=1.02))
    pair = before_and_after(model, fits, parameters)
    found = muscle_tables([model], fits, parameters, body_mass_kg=70.0)
    postures = len(pair.rows)
    assert len(found.balance) == postures
    lines = muscle_lines(model)
    assert len(found.muscles) == len(lines.muscles) * postures
    assert len(found.lines) == 2 * len(lines.name) * postures
    assert len(found.arms) == len(lines.muscles)
    assert unbalanced(found.balance).empty
    total = found.lines[found.lines["state"] == "before"].groupby("posture")["force_N"].sum()
    by_muscle = found.muscles.groupby("posture")["force_before_N"].sum()
    np.testing.assert_allclose(total, by_muscle)
    np.testing.assert_allclose(found.balance["muscles_before_N"].sum(), total.sum())


def test_a_posture_that_only_one_state_reaches_is_left_out():
    model = load_model("R2")
    fits, parameters = tables(model, changed(model))
    fits.loc[fits.index[3], "status"] = status.UNREACHABLE
    pair = before_and_after(model, fits, parameters)
    assert len(pair.rows) == len(rhythm().posture) - 1
    assert 4 not in pair.rows.loc[pair.rows["motion"] == "abduction", "posture"].tolist()
