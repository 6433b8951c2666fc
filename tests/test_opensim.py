"""What is written for OpenSim, opened in OpenSim."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from models import load_model, model_names
from models.girdle import bone_rotations, chain_landmarks
from models.opensim import Q, opensim_model
from motions import read_motions
from motions.rotations import DEG
from motions.simulation import DATA_FILE
from motions.table import ANGLES
from tests.command import girdle

osim = pytest.importorskip("opensim", reason="the package opensim is not installed")

ASSEMBLED_MM = 1e-3
"""OpenSim's assembly ends at 1e-10 of its own error measure; below a micrometre a bone is where it should be."""

TURNED_DEG = 8.0
"""Away from rest, and well within what every set's clavicle can take."""


@pytest.fixture(autouse=True)
def _quiet():
    """No opensim.log in the folder of the tests, nothing on the terminal."""
    osim.Logger.removeFileSink()
    osim.Logger.setLevelString("error")


def opened(name: str, folder: Path):
    """The model as OpenSim has it, and its state at the default coordinates."""
    path = folder / f"{name}.osim"
    path.write_text(opensim_model(load_model(name)), encoding="utf-8")
    model = osim.Model(str(path))
    return model, model.initSystem()


def marker_mm(model, state, name: str) -> np.ndarray:
    """Where OpenSim puts a marker, in the axes of the thorax frame."""
    model.realizePosition(state)
    place = model.getMarkerSet().get(name).getLocationInGround(state)
    return 1000.0 * Q.T @ np.array([place.get(axis) for axis in range(3)])


def clavicle_rad(model, state) -> np.ndarray:
    return np.array([model.getCoordinateSet().get(name).getValue(state) for name in ANGLES[:3]])


@pytest.mark.parametrize("turned_deg", [0.0, TURNED_DEG], ids=["rest", "turned"])
@pytest.mark.parametrize("name", model_names())
def test_opensim_opens_the_model_and_closes_its_chain(name, turned_deg, tmp_path):
    """SC and AC are where our clavicle of the same angles has them; the scapula has our size, the conoid its length."""
    ours = load_model(name).girdle
    model, state = opened(name, tmp_path)
    protraction = model.getCoordinateSet().get("clavicle_y")
    protraction.setValue(state, protraction.getValue(state) + turned_deg * float(DEG), False)
    protraction.setLocked(state, True)
    model.assemble(state)
    angles = np.concatenate([clavicle_rad(model, state), np.zeros(3)])
    expected = chain_landmarks(ours, *bone_rotations(jnp.asarray(angles)))
    found = {point: marker_mm(model, state, point) for point in ("SC", "AC", "TS", "AI")}
    np.testing.assert_allclose(found["SC"], np.asarray(ours.sc_mm), atol=ASSEMBLED_MM)
    np.testing.assert_allclose(found["AC"], np.asarray(expected.AC), atol=ASSEMBLED_MM)
    for point, in_scapula_mm in (("TS", ours.ts_mm), ("AI", ours.ai_mm)):
        distance = np.linalg.norm(found[point] - found["AC"])
        assert distance == pytest.approx(float(np.linalg.norm(in_scapula_mm)), abs=ASSEMBLED_MM)
    assert conoid_mm(model, state, ours) == pytest.approx(float(ours.conoid_length_mm), abs=ASSEMBLED_MM)


def conoid_mm(model, state, ours) -> float:
    """Between the attachments, as OpenSim places them."""
    ends = []
    for body, point in (("clavicle", ours.clavicle_conoid_mm), ("scapula", ours.scapula_conoid_mm)):
        place = osim.Vec3(*(Q @ np.asarray(point) / 1000.0))
        end = model.getBodySet().get(body).findStationLocationInGround(state, place)
        ends.append(np.array([end.get(axis) for axis in range(3)]))
    return 1000.0 * float(np.linalg.norm(ends[0] - ends[1]))


def test_opensim_reads_the_motions(tmp_path):
    """The angles of the first subject's first motion, as OpenSim's own table reader has them."""
    assert girdle("convert", DATA_FILE, tmp_path / "motions").status == 0
    motions = read_motions(DATA_FILE)
    path = sorted((tmp_path / "motions").glob("*.mot"))[0]
    table = osim.TimeSeriesTable(str(path))
    assert table.getTableMetaDataAsString("inDegrees") == "yes"
    subject, motion = path.stem.split("_", 1)
    expected = motions.select((motions.subject == subject) & (motions.motion == motion)).angles_deg
    read = np.column_stack([table.getDependentColumn(name).to_numpy() for name in ANGLES])
    np.testing.assert_array_equal(read, expected)
