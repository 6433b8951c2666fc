"""The examples run and print correct results: each in this process, as a reader would run it from the shell."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import girdle

from adapt import adapt_subjects
from adapt.output.large_runs import dask_cluster
from models import load_model
from motions import read_motions, read_trial
from scripts.rooms import ROOT

EXAMPLES = sorted((ROOT / "scripts" / "examples").glob("[0-9]*.py"))

ROUNDED_MM = 1e-4
"""Tolerance: lengths in a .toml have four decimals."""

ROUNDING_DEG = 1e-9
"""Tolerance of rotations there and back, through positions of 100 mm with all digits."""

STEP_DEG = 0.01
"""Step of a central difference: theta moves by up to 0.1 mm, and its curvature causes an error of 1e-5 of that."""


@pytest.fixture
def example(monkeypatch):
    """Return a function that runs an example, found by its number, and returns the names that it defines."""
    monkeypatch.syspath_prepend(str(ROOT / "scripts" / "examples"))

    def load(number: int) -> dict:
        (path,) = (one for one in EXAMPLES if one.name.startswith(f"{number:02d}_"))
        return runpy.run_path(str(path))

    return load


def test_every_example_is_tried_here():
    assert [path.name[:2] for path in EXAMPLES] == ["01", "02", "03", "04", "05", "06"]


def test_from_a_trial_to_a_report(example, tmp_path):
    report = example(1)["main"](tmp_path)
    page = report.read_text()
    assert "simulated" in page
    assert "P01" in page


def test_the_command_line_does_the_same(example, tmp_path):
    trial, table = example(1)["write_trc"](tmp_path / "P01.trc"), tmp_path / "P01.csv"
    ended = girdle("convert", trial, table, "--subject", "P01", "--motion", "abduction", "--at", "10,50,90,130")
    assert ended.status == 0, ended.err
    here = read_trial(trial, subject="P01", motion="abduction", at_deg=(130, 10, 50, 90))
    np.testing.assert_array_equal(read_motions(table).angles_deg, here.angles_deg)


def test_the_simulated_trial_has_the_angles_that_it_was_made_of(example, tmp_path):
    """Reader and landmark frames against scipy's rotations, with which the example places the landmarks."""
    names = example(1)
    read = read_trial(names["write_trc"](tmp_path / "trial.trc"))
    shipped = example(2)["shipped_subjects"]()
    rows = (shipped.subject == "simulated01") & (shipped.motion == "abduction") & (shipped.humerus_elevation_deg == 50)
    frame = np.isclose(read.humerus_elevation_deg, 50.0)
    measured = [0, 1, 3, 4, 5]  # all but the axial rotation of the clavicle, which landmarks do not determine
    made = shipped.angles_deg[rows][:, measured]
    assert made.shape == (1, 5)
    np.testing.assert_allclose(read.angles_deg[frame][:, measured], made, rtol=0.0, atol=ROUNDING_DEG)


def test_ten_subjects_and_three_sets(example):
    gaps_deg, parameters = example(2)["main"]()
    assert gaps_deg.index.tolist() == ["R2", "R4", "R6"]
    assert (gaps_deg[("scapula_deg", 1)] < gaps_deg[("scapula_deg", 0)]).all()
    assert len(parameters) == 30


def test_an_effect_of_ones_own_is_found(example):
    names = example(3)
    found = names["main"]()
    effect = names["EXAGGERATED"]
    assert found.verdict.answer == "effect"
    assert found.verdict.causes[0].names == (effect.name,)
    size = found.amplitude[effect.name].size
    assert size.low < effect.prior.scale[0] < size.high


def test_errors_of_the_angles_reach_the_parameters(example):
    """The bias agrees with differences of adaptations; the SDs with `girdle trust`, roughly for M_y and A_y."""
    names = example(4)
    bias_mm, sd_mm, trust_sd_mm = names["main"]()
    motions, model = names["shipped_subjects"](), load_model(names["MODEL"])
    motions = motions.select(motions.subject == names["SUBJECT"])
    tipping = np.eye(6)[names["TIPPING"]]
    moved = [replace(motions, angles_deg=motions.angles_deg + sign * STEP_DEG * tipping) for sign in (1, -1)]
    above, below = (adapt_subjects(one, model, held_out=()).adapted[model.name].theta_mm[:, 0] for one in moved)
    np.testing.assert_allclose(bias_mm, (above - below) / (2.0 * STEP_DEG), rtol=0.0, atol=1e-4 * abs(bias_mm).max())
    flat = np.isin(names["PARAMETERS"], ["M_y", "A_y"])
    np.testing.assert_allclose(sd_mm[~flat], trust_sd_mm[~flat], rtol=0.2)
    assert (sd_mm[flat] / trust_sd_mm[flat] < 2.0).all()


def test_a_persons_own_model(example, tmp_path):
    own = example(5)["main"](tmp_path)
    bones = load_model("R4").girdle
    assert own.name == "P01"
    np.testing.assert_allclose(own.girdle.ac_mm, bones.ac_mm, rtol=0.0, atol=ROUNDED_MM)
    np.testing.assert_allclose(own.girdle.ai_mm, bones.ai_mm, rtol=0.0, atol=ROUNDED_MM)


@pytest.mark.filterwarnings("ignore")  # warnings of Dask's processes
def test_a_cluster(example, monkeypatch, tmp_path):
    pytest.importorskip("distributed")
    # Dask's workers are threads of this process: all later tests would compile into the user's cache.
    monkeypatch.setattr(dask_cluster, "keep_compiled", lambda: None)
    parameters = example(6)["main"](tmp_path)
    assert parameters["status"].tolist() == ["ok"] * 10


def test_examples_use_what_is_public():
    public = {"adapt", "adapt.report", "adapt.differentiable", "models", "models.effects", "motions"}
    public |= {"motions.rotations"}
    for path in (*EXAMPLES, Path(EXAMPLES[0].parent / "simulated_trial.py")):
        lines = path.read_text().splitlines()
        imported = [line.split()[1] for line in lines if line.startswith(("from adapt", "from models", "from motions"))]
        assert set(imported) <= public, path.name


def test_the_sample_trials_are_written_as_they_ship(tmp_path, example, monkeypatch):
    written = runpy.run_path(str(ROOT / "scripts" / "examples" / "write_samples.py"))
    written["main"](tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert len(names) == 5
    for name in names:
        if not name.endswith(".c3d"):  # a .c3d file contains the version of its writer
            assert (tmp_path / name).read_bytes() == (ROOT / "motions" / "data" / name).read_bytes(), name


def test_the_sample_trials_say_the_same(tmp_path):
    """Landmarks as .trc, as .c3d and carried by clusters are one motion, except for rounding to 0.01 mm."""
    data, at = ROOT / "motions" / "data", range(0, 121, 20)
    trc, c3d = (read_trial(data / f"simulated_trial.{kind}", at_deg=at) for kind in ("trc", "c3d"))
    clusters = read_trial(
        data / "simulated_cluster_trial.trc",
        mapping=data / "simulated_cluster.toml",
        static=[data / "simulated_cluster_static.trc"],
        at_deg=at,
    )
    np.testing.assert_allclose(c3d.angles_deg, trc.angles_deg, rtol=0.0, atol=0.01)
    np.testing.assert_allclose(clusters.angles_deg, trc.angles_deg, rtol=0.0, atol=0.3)  # zero of the axial rotation
