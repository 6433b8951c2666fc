"""Files written for OpenSim, opened in OpenSim."""

import json
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from command import girdle

from models import ParameterSet, load_model, model_names
from models.export.opensim import Q, opensim_model
from models.girdle import bone_rotations, chain_landmarks
from models.person.own_bones import with_own_sizes
from motions import ANGLES, read_motions
from motions.rhythm_subjects import DATA_FILE

pytestmark = pytest.mark.skipif(find_spec("opensim") is None, reason="the package opensim is not installed")

ASSEMBLED_MM = 1e-3
"""Tolerance: OpenSim's assembly ends at 1e-10 of its own error measure; a bone within a micrometre is in place."""

IN_OPENSIM = Path(__file__).parents[1] / "helpers" / "in_opensim.py"

TURNED_DEG = 8.0
"""Protraction away from rest, well within the range of every set's clavicle."""


OWN_BONES = "R2 with bones of its own"
OWN_SIZES = {
    "clavicle_AC_y_mm": 4.0,
    "clavicle_AC_z_mm": -3.0,
    "clavicle_length_percent": 5.0,
    "scapula_size_percent": -6.0,
}
"""Sizes with AC off the axis of the clavicle."""


def parameter_set(name: str) -> ParameterSet:
    if name != OWN_BONES:
        return load_model(name)
    R2 = load_model("R2")
    sizes = {key: np.array(value) for key, value in OWN_SIZES.items()}
    return replace(R2, girdle=with_own_sizes(R2.girdle, sizes))


def in_opensim(*arguments: object) -> dict[str, Any]:
    command = [sys.executable, str(IN_OPENSIM), *map(str, arguments)]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def here_mm(place_m) -> np.ndarray:
    """Transform a position from OpenSim to mm in the axes of the thorax frame."""
    return 1000.0 * Q.T @ np.array(place_m)


@pytest.mark.parametrize("turned_deg", [0.0, TURNED_DEG], ids=["rest", "turned"])
@pytest.mark.parametrize("name", [*model_names(), OWN_BONES])
def test_opensim_opens_the_model_and_closes_its_chain(name, turned_deg, tmp_path):
    """Check SC and AC against our clavicle at the same angles, the scapula's size, and the conoid's length."""
    ours = parameter_set(name).girdle
    path = tmp_path / f"{name}.osim"
    path.write_text(opensim_model(parameter_set(name)), encoding="utf-8")
    found = in_opensim("model", path, turned_deg)
    at = {point: here_mm(place) for point, place in found["markers_m"].items()}
    angles = np.concatenate([found["clavicle_rad"], np.zeros(3)])
    expected = chain_landmarks(ours, *bone_rotations(jnp.asarray(angles)))
    np.testing.assert_allclose(at["SC"], np.asarray(ours.sc_mm), rtol=0.0, atol=ASSEMBLED_MM)
    np.testing.assert_allclose(at["AC"], np.asarray(expected.AC), rtol=0.0, atol=ASSEMBLED_MM)
    for point, in_scapula_mm in (("TS", ours.ts_mm), ("AI", ours.ai_mm)):
        distance = np.linalg.norm(at[point] - at["AC"])
        assert distance == pytest.approx(float(np.linalg.norm(in_scapula_mm)), abs=ASSEMBLED_MM)
    one, other = map(here_mm, found["conoid_m"])
    assert np.linalg.norm(one - other) == pytest.approx(float(ours.conoid_length_mm), abs=ASSEMBLED_MM)


def test_opensim_reads_the_motions(tmp_path):
    """Check the angles of the first subject's first motion, as OpenSim's table reader returns them."""
    assert girdle("convert", DATA_FILE, tmp_path / "motions").status == 0
    motions = read_motions(DATA_FILE)
    path = sorted((tmp_path / "motions").glob("*.mot"))[0]
    table = in_opensim("table", path)
    assert table["in_degrees"] == "yes"
    subject, motion = path.stem.split("_", 1)
    expected = motions.select((motions.subject == subject) & (motions.motion == motion)).angles_deg
    read = np.column_stack([table["columns"][name] for name in ANGLES])
    np.testing.assert_array_equal(read, expected)
