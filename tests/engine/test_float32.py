"""Fits in float32: errors against float64, problems that float64 solves again, statuses, and the command option."""

import json
from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest
from command import girdle

from adapt.engine.batching import as_type
from adapt.solvers import newton, status
from adapt.solvers.adaptation import solved_from
from adapt.solvers.newton.postures import postures_kernel
from adapt.solvers.objective import WEIGHT
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import problems_of, subject_problem
from adapt.solvers.rows import posture_rows
from adapt.solvers.unmeasured import angle_weights
from models import load_model
from models.effects import NO_ACTIVE_EFFECTS
from models.parameter_sets import FOLDER
from motions import ANGLES, Motions, write_motions
from motions.rhythm_subjects import simulate_subjects
from scripts.research.speed.measure_float32 import errors, of_postures

MOST_DEG, MOST_MM, MOST_E = 5e-4, 0.05, 5e-6
"""Largest change of an angle, of a parameter and (relative) of E by float32: twice the largest one of 1000 simulated
subjects. Parameters in flat directions change most, but by less than a thousandth of their SD."""

LEAST_DEG, MEDIAN_DEG = 1e-6, 5e-5
"""Limits for the median change of an angle. Rounding of an angle of half a radian is 2e-6 degrees in float32, and two
runs in float64 agree to 1e-7; measured are 1e-5 for posture fits and 2e-5 for the worst posture of an adaptation."""

SAME_RAD, SAME_CONVERGED = 2e-6, 0.98
"""Tolerance for angles of three engines in float32 (a few roundings), and the least share of problems that converge on
both engines of a pair."""

SUBJECTS = 40


def hard(subjects: int) -> Motions:
    """Simulate subjects with 6 degrees of noise and a tenth of the angles missing: many fail in float32."""
    motions = simulate_subjects(subjects, seed=21, noise_deg=6.0)
    motions.angles_deg[np.random.default_rng(0).random(motions.angles_deg.shape) < 0.1] = np.nan
    return motions


def test_errors_of_simulated_subjects_are_those_stated():
    found = errors(simulate_subjects(20, seed=3), [load_model("R2"), load_model("R6")])
    adaptations, fits = found["adaptations"], found["posture_fits"]
    for part in (adaptations, fits):
        assert LEAST_DEG < part["angle_deg"]["median"] < MEDIAN_DEG
        assert part["angle_deg"]["most"] < MOST_DEG
        assert part["other_status"] == 0
        # Rounding may decide for one problem which optimum it reaches.
        assert part["lower_optimum"] + part["higher_optimum"] + part["other_as_low"] <= 1
    assert 0.0 < adaptations["parameter_mm"]["median"] < adaptations["parameter_mm"]["most"] < MOST_MM
    assert adaptations["parameter_in_sd"]["most"] < 1e-3
    assert 0.0 < adaptations["E_relative"]["median"] < adaptations["E_relative"]["most"] < MOST_E


def assert_float64_where_not_done(found, double, names: Sequence[str], done: np.ndarray):
    """Check that problems outside ``done`` have float64's results bit by bit, and others float32's."""
    for name in names:
        np.testing.assert_array_equal(getattr(found, name)[..., ~done], getattr(double, name)[..., ~done])
    off = np.abs(getattr(found, names[0]) - getattr(double, names[0])).max(axis=0)[done]
    assert np.all(off > 0.0)


def test_posture_fits_that_float32_cannot_do_are_those_of_float64():
    """Measured angles far from any closed chain, with many local minima."""
    data = as_type(
        problems_of(posture_rows(simulate_subjects(20, seed=21, noise_deg=30.0)), [load_model("R2")]), np.float32
    )
    problem = of_postures(data)
    done = newton.fit_postures(*problem).converged
    assert 0.5 < done.mean() < 0.98
    found, double = fit_batch(*problem), fit_batch(*as_type(problem, float))
    assert found.angles.dtype == float
    np.testing.assert_array_equal(found.status, double.status)
    assert_float64_where_not_done(found, double, ("angles", "multipliers", "residual_mm", "j_deg2"), done)


def test_adaptations_that_float32_cannot_do_are_those_of_float64():
    data = as_type(problems_of(posture_rows(hard(24)), [load_model("R2")]), np.float32)
    theta, factor = np.clip(data.girdle.adapted_mm, *data.bounds_mm), np.full(24, WEIGHT)
    given = (
        subject_problem(data, factor),
        theta,
        data.angles,
    )
    done = newton.fit_subjects(*given).converged
    assert 0.1 < done.mean() < 0.9
    found, double = (solved_from(fixed, NO_ACTIVE_EFFECTS, *start) for fixed, *start in (given, as_type(given, float)))
    assert found.theta.dtype == float
    np.testing.assert_array_equal(found.converged, double.converged)
    assert_float64_where_not_done(found, double, ("theta", "angles", "residual_mm", "slope"), done)


def test_a_parameter_at_its_bound_is_at_it():
    """Check that a parameter at its bound equals the bound in float64, not the bound rounded to float32."""
    data = as_type(problems_of(posture_rows(simulate_subjects(SUBJECTS, seed=3)), [load_model("R2")]), np.float32)
    given = subject_problem(data, np.full(SUBJECTS, WEIGHT))
    theta = solved_from(given, NO_ACTIVE_EFFECTS, np.clip(data.girdle.adapted_mm, *data.bounds_mm), data.angles).theta
    lower, upper = data.bounds_mm.astype(float)
    assert np.all((theta >= lower) & (theta <= upper))
    assert (theta == upper)[3].mean() > 0.1  # A_y is at its bound
    assert not np.any((theta > upper - 1e-4) & (theta < upper))


def test_three_engines_in_float32():
    data = as_type(problems_of(posture_rows(simulate_subjects(4, seed=7)), [load_model("R4")]), np.float32)
    girdle_, target, measured = of_postures(data)
    count = target.shape[1]
    start = target, np.zeros((3, count)), np.zeros(count, bool)
    given = as_type((girdle_, target, angle_weights(measured), start, np.full(count, 30.0)), np.float32)
    found = postures_kernel.native(*given)
    with np.errstate(all="ignore"):
        eager = postures_kernel.function(*given)
    for other in (eager, postures_kernel.by_jax(*given)):
        assert other.angles.dtype == found.angles.dtype == np.float32
        both = found.converged & other.converged
        assert both.mean() > SAME_CONVERGED
        np.testing.assert_allclose(found.angles[:, both], other.angles[:, both], rtol=0.0, atol=SAME_RAD)


def test_statuses_are_those_of_float64(tmp_path):
    """A chain that cannot close, a posture with too few measured angles, and good postures."""
    short = tmp_path / "short.toml"
    short.write_text((FOLDER / "R4.toml").read_text().replace("conoid_length_mm = 13.2", "conoid_length_mm = 3.0"))
    for model, expected in ((load_model(str(short)), status.UNREACHABLE), (load_model("R4"), status.OK)):
        problem = of_postures(problems_of(posture_rows(simulate_subjects(1, seed=3)), [model]))
        problem[2][2:, 0] = False
        found = fit_batch(*as_type(problem, np.float32))
        assert found.status.tolist() == [status.INVALID] + [expected] * 13


# --- the commands ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["fit", "adapt"])
def test_the_option_is_recorded_and_repeated(tmp_path, command):
    motion = tmp_path / "motion.csv"
    write_motions(simulate_subjects(2, seed=3), motion)
    folders = {name: tmp_path / name for name in ("double", "single", "again")}
    for name, options in (("double", [motion]), ("single", [motion, "--float32"])):
        assert girdle(command, *options, "--out", folders[name]).status == 0
    assert girdle(command, "--repeat", folders["single"] / "run.json", "--out", folders["again"]).status == 0
    records = {name: json.loads((folder / "run.json").read_text()) for name, folder in folders.items()}
    assert {name: one["options"]["float32"] for name, one in records.items()} == {
        "double": False,
        "single": True,
        "again": True,
    }
    assert (folders["again"] / "fits.csv").read_bytes() == (folders["single"] / "fits.csv").read_bytes()
    double, single = (pd.read_csv(folders[name] / "fits.csv") for name in ("double", "single"))
    measured, simulated = ([f"{angle}_{word}_deg" for angle in ANGLES] for word in ("measured", "simulated"))
    np.testing.assert_array_equal(single[measured].to_numpy(), double[measured].to_numpy())
    off = np.abs(single[simulated].to_numpy() - double[simulated].to_numpy())
    assert np.median(off.max(axis=1)) > LEAST_DEG
    assert off.max() < MOST_DEG


def test_no_diagnosis_in_float32(tmp_path):
    """Check that commands which compare small differences refuse the option."""
    for command in ("diagnose", "trust", "simulate"):
        ended = girdle(command, "motion.csv", "--float32", "--out", tmp_path / "out")
        assert ended.status == 2
        assert "float32" in ended.err
