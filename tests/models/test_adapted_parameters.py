"""The list of adapted parameters: its values, and a seventh parameter that changes only this file."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from adapt import adapt_subjects
from adapt.solvers import status
from models import load_model
from models.adapted_parameters import (
    ADAPTED_PARAMETERS,
    PERSON_SD_MM,
    STARTS_MM,
    adapted_components,
    conoid_length,
    ellipsoid_components,
)
from motions.rhythm_subjects import simulate_subjects

ROOT = Path(__file__).parents[2]

AFTER = '    AdaptedParameter("M_z", _CENTRE, 2, 30.0, 0.0, 6.0, 5.0),\n'

SEVENTH = '    AdaptedParameter("M_x", _CENTRE, 0, 20.0, 0.0, 5.0),\n'
"""A thorax beside the midline, which A4 of the thesis excludes."""

PROGRAM = """
import json
import numpy as np
from adapt import adapt_subjects
from adapt.solvers.adaptation import fitted_angles
from adapt.solvers.objective import mean_square_deg2
from adapt.solvers.rows import posture_rows
from adapt.solvers.problems import problems_of
from adapt.solvers.unmeasured import angle_weights
from models import load_model
from models.adapted_parameters import ADAPTED
from models.person.thorax_ellipsoid import thorax_distance_mm2
from motions.rhythm_subjects import simulate_subjects

motions, model = simulate_subjects(2, seed=4), load_model("R2")
result = adapt_subjects(motions, model, held_out=())
adapted, data = result.adapted["R2"], problems_of(posture_rows(motions), [model])

def objective(theta):
    angles = fitted_angles(data, theta)
    j = mean_square_deg2(angles, data.angles, angle_weights(data.measured))
    mean_j = np.where(data.counted, j, 0.0).sum(axis=0) / data.counted.sum(axis=0)
    return thorax_distance_mm2(data.girdle.with_adapted(theta), data.points_mm, data.point_weights) + 10.0 * mean_j

rises = []
for k in range(len(ADAPTED)):
    for sign in (-1.0, 1.0):
        theta = np.clip(adapted.theta_mm + 0.1 * sign * np.eye(len(ADAPTED))[:, [k]], *data.bounds_mm)
        rises.append((objective(theta) - adapted.E).tolist())
print(json.dumps({
    "adapted": list(ADAPTED),
    "columns": [name for name in result.parameters.columns if name.startswith("M_x")],
    "theta_mm": adapted.theta_mm.tolist(),
    "sd_mm": result.uncertainty.sd_mm.tolist(),
    "E": adapted.E.tolist(),
    "status": adapted.status.tolist(),
    "rises": rises,
}))
"""

NO_RISE = -1e-9
"""Smallest rise of E a tenth of a millimetre off the optimum: rounding may make it negative."""


def test_a_seventh_parameter_is_a_change_of_one_file(tmp_path):
    """Check an adaptation of M_x too: E rises in all seven directions, is lower than with six parameters, and every
    table has the columns of M_x."""
    for package in ("adapt", "models", "motions"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    file = tmp_path / "models" / "adapted_parameters.py"
    text = file.read_text()
    assert text.count(AFTER) == 1
    file.write_text(text.replace(AFTER, AFTER + SEVENTH))
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", PROGRAM]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=tmp_path, check=False)
    assert ended.returncode == 0, ended.stderr
    seven = json.loads(ended.stdout)
    six = adapt_subjects(simulate_subjects(2, seed=4), load_model("R2"), held_out=()).adapted["R2"]
    assert seven["adapted"] == ["M_y", "M_z", "M_x", "A_x", "A_y", "A_z", "conoid_length"]
    assert seven["columns"] == ["M_x_mm", "M_x_mm_model", "M_x_mm_sd", "M_x_mm_at_bound"]
    assert set(seven["status"]) == set(six.status) == {status.OK}
    assert np.all(np.abs(seven["theta_mm"][2]) > 0.1)
    assert np.isfinite(seven["sd_mm"]).all()
    assert np.all(np.array(seven["E"]) < six.E)
    assert np.min(seven["rises"]) >= NO_RISE


def test_theta_goes_into_a_girdle_and_out_again():
    girdle = load_model("R2").girdle
    theta = np.arange(1.0, 1.0 + len(ADAPTED_PARAMETERS))
    moved = girdle.with_adapted(jnp.asarray(theta))
    np.testing.assert_array_equal(np.stack(adapted_components(moved)), theta)
    np.testing.assert_array_equal(np.stack(adapted_components(girdle)), girdle.adapted_mm)
    centre, semi_axes = ellipsoid_components(girdle, theta)
    assert centre == (float(girdle.centre_mm[0]), 1.0, 2.0)
    assert semi_axes == (3.0, 4.0, 5.0)
    assert conoid_length(theta) == 6.0


@pytest.mark.parametrize("parameter", ADAPTED_PARAMETERS, ids=lambda one: one.name)
def test_the_widths_of_a_parameter_are_in_order(parameter):
    """Check the order of the widths: an adaptation may go further than people differ."""
    assert 0.0 < parameter.person_sd_mm < parameter.half_width_mm
    assert 0.0 <= parameter.start_offset_mm < parameter.half_width_mm


def test_vectors_are_in_the_order_of_the_list():
    assert PERSON_SD_MM.tolist() == [one.person_sd_mm for one in ADAPTED_PARAMETERS]
    assert STARTS_MM.tolist() == [
        [0.0] * 6,
        [60.0, 0.0, 0.0, 60.0, 0.0, 0.0],
        [-60.0, 0.0, 0.0, -60.0, 0.0, 0.0],
    ]
