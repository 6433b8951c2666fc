# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false, reportIndexIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""``girdle adapt --own-bones``: its files for any chunk size, models that are read back, refusals."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import SHIPPED, Ended, girdle, refused, shipped_lines, written
from oracles import cardan, ellipsoid_distance
from pages import data_of

from adapt.own_bones import most_probable
from adapt.report.bone_positions import POINTS
from adapt.solvers.posture_fits import fit_batch
from models import load_model
from models.adapted_parameters import ADAPTED
from models.person.own_bones import SIZES
from motions import ANGLES, Motions, read_motions
from motions.rotations import DEG

PLAIN_COLUMNS = [
    *("model", "subject"),
    *(f"{name}_mm{kind}" for name in ADAPTED for kind in ("", "_model", "_sd", "_at_bound")),
    *("E", "D_mm2", "mean_j_before_deg2", "mean_j_after_deg2", "status"),
]
OWN_COLUMNS = [
    *(f"{size.key}{kind}" for size in SIZES[len(ADAPTED) :] for kind in ("", "_sd")),
    *("adapted_scale", "bones_scale", "frames_scale", "noise_deg", "far_from_people", "not_told", "own_bones"),
]
"""Columns of the file; user scripts rely on them."""

TABLES = ("fits.csv", "parameters.csv", "summary.csv", "heldout.csv")

DRAWN_MM = 0.25
"""Tolerance of a report's points and ellipsoids, which are rounded to tenths."""


def run(folder: Path, *arguments: object) -> Ended:
    ended = girdle("adapt", *arguments, "--out", folder)
    assert (ended.status, ended.messages) == (0, []), ended.err
    return ended


@pytest.fixture(scope="module")
def adapted(tmp_path_factory) -> Path:
    """Adapt the ten shipped subjects: enough to learn how they differ."""
    folder = tmp_path_factory.mktemp("own")
    ended = run(folder, SHIPPED, "--model", "breteler_dissection", "--own-bones")
    (folder / "printed").write_text(ended.out)
    return folder


@pytest.fixture(scope="module")
def parameters(adapted) -> pd.DataFrame:
    return pd.read_csv(adapted / "parameters.csv", keep_default_na=False)


@pytest.fixture(scope="module")
def motions() -> Motions:
    return read_motions(SHIPPED)


def test_new_columns_are_behind_the_old_ones(parameters):
    assert list(parameters) == PLAIN_COLUMNS + OWN_COLUMNS
    assert set(parameters["status"]) == {"ok"}
    assert set(parameters["own_bones"]) == {"adapted"}
    assert not parameters[[f"{name}_mm_at_bound" for name in ADAPTED]].to_numpy(bool).any()
    assert parameters["bones_scale"].nunique() == parameters["noise_deg"].nunique() == 1
    assert parameters["bones_scale"][0] != 1.0


def test_the_model_s_own_values_stay_beside_them(parameters):
    own = np.asarray(load_model("breteler_dissection").girdle.adapted_mm)
    np.testing.assert_array_equal(parameters[[f"{name}_mm_model" for name in ADAPTED]], np.tile(own, (10, 1)))


def test_the_terminal_says_how_much_persons_differ(adapted, parameters):
    printed = (adapted / "printed").read_text()
    row = parameters.iloc[0]
    assert (
        f"SDs of people times {row['adapted_scale']:.2f} (the six), {row['bones_scale']:.2f} (bones), "
        f"{row['frames_scale']:.2f} (frames); noise {row['noise_deg']:.2f} degrees"
    ) in printed
    for name in set(" ".join(parameters["far_from_people"].fillna("")).split()):
        count = parameters["far_from_people"].fillna("").str.split().map(lambda names, name=name: name in names).sum()
        assert f" {name} ({count} of 10)" in printed.partition("Farther from the set than people are")[2]


def test_adapted_models_have_the_adapted_postures(adapted, motions):
    """Refitting with the models as read from files starts from the postures of fits.csv: J may have another minimum
    that a fit from scratch finds."""
    fits = pd.read_csv(adapted / "fits.csv")
    fits = fits[fits["adapted"].astype(bool)]
    for name in motions.subjects:
        model = load_model(adapted / "models" / f"breteler_dissection_{name}.toml")
        assert np.abs(model.girdle.ac_mm[1:]).min() > 0.0
        assert model.source["clavicle.ac_mm"].startswith(f"adapted to {name}, from breteler_dissection (w = 10,")
        one = fits[fits["subject"] == name]
        before = one[[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy().T
        measured = one[[f"{angle}_measured_deg" for angle in ANGLES]].to_numpy().T
        girdle = model.girdle.repeated(len(one))
        assert np.abs(girdle.residuals_mm(before / DEG)).max() < 1e-9
        again = fit_batch(girdle, measured / DEG, np.ones(measured.shape, bool), before / DEG)
        np.testing.assert_allclose(again.j_deg2, one["j_deg2"], rtol=1e-9)
        np.testing.assert_allclose(again.angles * DEG, before, atol=1e-7)


def test_the_report_draws_the_girdle_of_the_person(adapted, motions):
    """TS and AI have the person's own distance to the person's own ellipsoid; AC is at the end of the clavicle."""
    data = data_of((adapted / "report.html").read_text())
    (model,) = data["models"]
    after, count = model["states"]["after"], len(motions.posture)
    points_mm = np.array(after["simulated_points_mm"]).reshape(len(POINTS), 3, count)
    fits = pd.read_csv(adapted / "fits.csv")
    fits = fits[fits["adapted"].astype(bool)]
    angles_deg = fits[[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy()
    for row in range(0, count, 9):
        name = fits["subject"].iloc[row]
        girdle = load_model(adapted / "models" / f"breteler_dissection_{name}.toml").girdle
        at = dict(zip(POINTS, points_mm[..., row], strict=True))
        for point, distance in (("TS", girdle.ts_distance_mm), ("AI", girdle.ai_distance_mm)):
            found, _ = ellipsoid_distance(at[point] - np.asarray(girdle.centre_mm), np.asarray(girdle.semi_axes_mm))
            assert found == pytest.approx(float(distance), abs=DRAWN_MM)
        AC = girdle.sc_mm + cardan(angles_deg[row, :3])[0] @ girdle.ac_mm
        np.testing.assert_allclose(at["AC"], AC, atol=DRAWN_MM)


@pytest.mark.parametrize("how", ["chunks", "repeated"])
def test_results_do_not_depend_on_the_chunk_and_a_record_repeats_them(adapted, tmp_path, how):
    asked = {
        "chunks": (SHIPPED, "--model", "breteler_dissection", "--own-bones", "--chunk", 3),
        "repeated": ("--repeat", adapted / "run.json"),
    }
    run(tmp_path, *asked[how])
    for name in TABLES:
        assert (tmp_path / name).read_bytes() == (adapted / name).read_bytes(), name
    for path in (adapted / "models").iterdir():
        assert (tmp_path / "models" / path.name).read_bytes() == path.read_bytes()
    assert (tmp_path / "run.json").read_bytes() == (adapted / "run.json").read_bytes()


def test_bones_that_were_not_found_are_said_and_end_with_3(tmp_path, monkeypatch):
    monkeypatch.setattr(most_probable, "_FLAT", -1.0)
    motion = written(tmp_path, shipped_lines())
    ended = girdle("adapt", motion, "--model", "R2", "--own-bones", "--out", tmp_path / "out")
    assert ended.status == 3
    why = "own bones not_converged, the plain adaptation is kept"
    assert ended.messages == [f"not handled: simulated{k:02d}: {why}" for k in (1, 2)]
    assert "Own bones were not found, the plain adaptation is kept: simulated01, simulated02" in ended.out
    table = pd.read_csv(tmp_path / "out" / "parameters.csv", keep_default_na=False)
    assert table["own_bones"].tolist() == ["not_converged"] * 2
    assert table["status"].tolist() == ["ok"] * 2
    assert set(table["TS_x_mm_sd"]) == {""}
    for name in table["subject"]:
        model, R2 = load_model(tmp_path / "out" / "models" / f"R2_{name}.toml"), load_model("R2")
        np.testing.assert_array_equal(model.girdle.ts_mm, R2.girdle.ts_mm)
        assert model.source["scapula.ts_mm"] == "of R2: " + R2.source["scapula.ts_mm"]
        assert model.source["thorax.semi_axes_mm"].startswith(
            f"adapted to {name}, from R2 (w = 10, objective mm2_deg2, plain)"
        )


@pytest.mark.parametrize(
    ("option", "value", "cause"),
    [
        ("--reading", "mm2_deg2_landmarks", "no variant of E and no down-weighting changes it"),
        ("--thorax-downweighting", 30, "no variant of E and no down-weighting changes it"),
        (
            "--effect",
            "scapula_landmark_bias=0,0,0~5,5,5",
            "sizes of effects of each person's own are not fitted beside them",
        ),
    ],
)
def test_what_has_no_part_in_it_is_refused(tmp_path, option, value, cause):
    motion = written(tmp_path, shipped_lines())
    ended = girdle("adapt", motion, "--model", "R2", "--own-bones", option, value, "--out", tmp_path / "out")
    refused(ended, "--own-bones", cause, "Leave one of the two out")
    assert not (tmp_path / "out").exists()
