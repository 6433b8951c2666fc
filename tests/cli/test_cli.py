"""The command line as a user sees it: files, messages, and the exit status where some subjects are not handled."""

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from command import Ended, girdle, refused, shipped_lines, written
from pages import data_of

from adapt.cli.commands.known_effects import effects_of
from adapt.cli.entry import WORDS
from adapt.output.written_files import LIST
from adapt.report.bone_positions import POINTS
from adapt.solvers import status
from adapt.tables.results import STATISTICS
from models import load_model, model_names
from models.adapted_parameters import ADAPTED, HALF_WIDTHS_MM
from models.effects import EFFECTS
from models.effects.amplitudes import read_amplitudes
from models.ellipsoid import signed_distance_mm
from models.parameter_sets import FOLDER
from motions import ANGLES
from motions.errors import InputWarning

ADAPT_FILES = ["fits.csv", LIST, "heldout.csv", "models", "parameters.csv", "run.json", "summary.csv"]

FITS_COLUMNS = [
    *("model", "subject", "motion", "posture", "humerus_elevation_deg", "adapted"),
    *(f"{angle}_{kind}_deg" for angle in ANGLES for kind in ("measured", "simulated", "difference")),
    *("j_deg2", "a1_mm", "a2_mm", "a3_mm", "lambda1", "lambda2", "lambda3", "status", "jump"),
]
PARAMETERS_COLUMNS = [
    *("model", "subject"),
    *(f"{name}_mm{kind}" for name in ADAPTED for kind in ("", "_model", "_sd", "_at_bound")),
    *("E", "D_mm2", "mean_j_before_deg2", "mean_j_after_deg2", "status"),
]
SUMMARY_COLUMNS = [
    *("model", "adapted", "motion", "subject"),
    *(f"{name}_deg" for name in (*ANGLES, "clavicle", "scapula")),
    *("postures", "postures_ok"),
    *("clavicle_held_out_deg", "scapula_held_out_deg"),
]
HELDOUT_COLUMNS = [
    *("model", "subject", "kind", "held_out", "postures", "adapted_to"),
    *(f"{bone}gap_{word}_deg" for word in ("before", "in_sample", "unseen") for bone in ("", "clavicle_", "scapula_")),
    "status",
]
"""Columns of the files, in order. User scripts rely on them: a change is a new major version."""

OPEN_MM = 1e-6
"""Documented accuracy of the files: A1-A3 hold to a nanometre."""

DRAWN_MM = 0.25
"""Tolerance of a report's points and ellipsoids, which are rounded to tenths: 0.05 in each of a few coordinates."""


@dataclass(frozen=True)
class Run:
    """A run that wrote files, and its input."""

    motion: Path
    folder: Path
    ended: Ended

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_csv(self.folder / f"{name}.csv")

    @property
    def record(self) -> dict:
        return json.loads((self.folder / "run.json").read_text())


@pytest.fixture(scope="module")
def motion(tmp_path_factory) -> Path:
    """Write two shipped subjects; all runs of this file have these shapes, so that little is compiled."""
    return written(tmp_path_factory.mktemp("motion"), shipped_lines())


@pytest.fixture(scope="module")
def fitted(motion, tmp_path_factory) -> Run:
    folder = tmp_path_factory.mktemp("fit")
    return Run(motion, folder, girdle("fit", motion, "--model", "R2", "--out", folder))


@pytest.fixture(scope="module")
def adapted(motion, tmp_path_factory) -> Run:
    folder = tmp_path_factory.mktemp("adapt")
    return Run(motion, folder, girdle("adapt", motion, "--model", "R2", "--weight", "5", "--out", folder))


# --- files ---------------------------------------------------------------------------------------------------------


def test_fit_writes_its_files_and_nothing_else(fitted):
    assert (fitted.ended.status, fitted.ended.messages) == (0, [])
    assert sorted(path.name for path in fitted.folder.iterdir()) == ["fits.csv", LIST, "run.json", "summary.csv"]
    assert "R2, before adaptation" in fitted.ended.out


def test_adapt_writes_its_files_and_nothing_else(adapted):
    assert (adapted.ended.status, adapted.ended.messages) == (0, [])
    names = sorted(path.name for path in adapted.folder.iterdir())
    assert names == sorted([*ADAPT_FILES, "report.html"])
    models = sorted(path.name for path in (adapted.folder / "models").iterdir())
    assert models == ["R2_simulated01.toml", "R2_simulated02.toml"]
    assert adapted.ended.out.startswith("R2: 2 of 2 subjects adapted; gap on held-out motions: clavicle ")


def test_the_report_draws_the_closed_chain(adapted):
    """TS and AI keep their distance to the ellipsoid and the conoid its length, to the rounding of the page."""
    data = data_of((adapted.folder / "report.html").read_text())
    (model,) = data["models"]
    girdle = load_model("R2").girdle
    for state in ("before", "after"):
        fitted = model["states"][state]
        points_mm = np.array(fitted["simulated_points_mm"]).reshape(len(POINTS), 3, 28)
        at: dict[str, np.ndarray] = dict(zip(POINTS, points_mm, strict=True))
        theta_mm = np.array(fitted["theta_mm"])[np.repeat([0, 1], 14)].T
        M_y, M_z, A_x, A_y, A_z, conoid_mm = theta_mm
        centre_mm, semi_axes_mm = jnp.array([0.0 * M_y, M_y, M_z]), jnp.array([A_x, A_y, A_z])
        for name, expected_mm in (("TS", girdle.ts_distance_mm), ("AI", girdle.ai_distance_mm)):
            distance_mm = np.asarray(signed_distance_mm(jnp.asarray(at[name]), centre_mm, semi_axes_mm))
            np.testing.assert_allclose(distance_mm, float(expected_mm), rtol=0.0, atol=DRAWN_MM)
        length_mm = np.linalg.norm(at["scapula_conoid"] - at["clavicle_conoid"], axis=0)
        np.testing.assert_allclose(length_mm, conoid_mm, rtol=0.0, atol=DRAWN_MM)


def test_a_report_that_fails_leaves_the_tables(motion, adapted, tmp_path, monkeypatch):
    def fail(*_, **shown):
        raise RuntimeError("no report")

    assert girdle("adapt", motion, "--model", "R2", "--out", tmp_path).status == 0
    monkeypatch.setattr("adapt.report.report_html", fail)
    with pytest.raises(RuntimeError, match="no report"):
        girdle("adapt", motion, "--model", "R2", "--weight", "5", "--out", tmp_path)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ADAPT_FILES
    assert (tmp_path / "fits.csv").read_bytes() == (adapted.folder / "fits.csv").read_bytes()


def test_columns_are_the_contracts(fitted, adapted):
    for run in (fitted, adapted):
        assert run.table("fits").columns.tolist() == FITS_COLUMNS
        assert run.table("summary").columns.tolist() == SUMMARY_COLUMNS
    assert adapted.table("parameters").columns.tolist() == PARAMETERS_COLUMNS
    assert adapted.table("heldout").columns.tolist() == HELDOUT_COLUMNS


def test_each_motion_was_held_out_of_an_adaptation(adapted):
    """Two motions of each subject; the gap of a held-out motion is larger than the gap in sample."""
    table = adapted.table("heldout")
    assert table["held_out"].tolist() == ["abduction", "forward_flexion"] * 2
    assert (table["gap_unseen_deg"] > table["gap_in_sample_deg"]).all()
    summary = adapted.table("summary").query("motion == 'all' and subject == 'simulated01'").set_index("adapted")
    for state, word in ((0, "before"), (1, "in_sample")):
        for bone in ("clavicle", "scapula"):
            gap = table[f"{bone}_gap_{word}_deg"][:2].mean()  # both motions have seven postures
            assert gap == pytest.approx(summary[f"{bone}_deg"][state])
    assert "gap on held-out motions" in " ".join(adapted.ended.out.split())


def test_the_summary_says_how_large_the_gap_is_where_a_motion_was_held_out(adapted):
    """The gap of each motion equals heldout.csv, and the gap of all motions their mean, as they have equal lengths."""
    held_out = adapted.table("heldout").set_index(["subject", "held_out"])
    summary = adapted.table("summary").set_index(["adapted", "motion", "subject"])
    for bone in ("clavicle", "scapula"):
        of_motions = []
        for subject, motion in held_out.index:
            of_motions.append(summary[f"{bone}_held_out_deg"][1, motion, subject])
            assert of_motions[-1] == pytest.approx(held_out[f"{bone}_gap_unseen_deg"][subject, motion])
        assert summary[f"{bone}_held_out_deg"][1, "all", "mean"] == pytest.approx(np.mean(of_motions))
        assert summary[f"{bone}_held_out_deg"][0].isna().all()


def test_fits_have_one_row_a_posture_and_state(fitted, adapted):
    """28 rows in the order of the file, with the measured angles; "before" equals a fit without adaptation."""
    measured = pd.read_csv(fitted.motion)
    fit, both = fitted.table("fits"), adapted.table("fits")
    assert len(fit) == 28
    assert both["adapted"].tolist() == [0] * 28 + [1] * 28
    for rows in (fit, both[:28], both[28:]):
        for column in ("subject", "motion", "posture"):
            assert rows[column].tolist() == measured[column].tolist()
        for angle in ANGLES:
            np.testing.assert_allclose(rows[f"{angle}_measured_deg"], measured[f"{angle}_deg"], rtol=1e-14)
            difference = rows[f"{angle}_simulated_deg"] - rows[f"{angle}_measured_deg"]
            np.testing.assert_allclose(rows[f"{angle}_difference_deg"], difference, rtol=0.0, atol=1e-12)
        assert set(rows["status"]) == {status.OK}
        assert rows[["a1_mm", "a2_mm", "a3_mm"]].abs().to_numpy().max() <= OPEN_MM
    pd.testing.assert_frame_equal(fit, both[:28])


def test_j_is_what_the_differences_say(adapted):
    fits = adapted.table("fits")
    squares = fits[[f"{angle}_difference_deg" for angle in ANGLES]].to_numpy() ** 2
    np.testing.assert_allclose(fits["j_deg2"], squares.mean(axis=1), rtol=1e-9)


def test_parameters_agree_with_the_fits(adapted):
    """E = D + 5 mean J in mm^2 and deg^2, mean J agrees with fits.csv, and the adaptation decreases E."""
    parameters, fits = adapted.table("parameters"), adapted.table("fits")
    assert parameters["subject"].tolist() == ["simulated01", "simulated02"]
    assert set(parameters["status"]) == {status.OK}
    mean_j = fits.groupby(["adapted", "subject"])["j_deg2"].mean()
    np.testing.assert_allclose(parameters["mean_j_before_deg2"], mean_j[0], rtol=1e-9)
    np.testing.assert_allclose(parameters["mean_j_after_deg2"], mean_j[1], rtol=1e-6)
    np.testing.assert_allclose(parameters["E"], parameters["D_mm2"] + 5.0 * parameters["mean_j_after_deg2"], rtol=1e-12)
    assert np.all(parameters["E"] < 5.0 * parameters["mean_j_before_deg2"])


def test_landmarks_enter_e_of_who_has_them_and_the_others_are_named(motion, tmp_path):
    """Only the first subject has TS and AI, far enough from the ellipsoid to move it."""
    table = pd.read_csv(motion)
    first = table["subject"] == "simulated01"
    for name, xyz in (("TS", (75.0, -60.0, 150.0)), ("AI", (90.0, -160.0, 170.0))):
        for axis, value in zip("xyz", xyz, strict=True):
            table[f"{name}_{axis}_mm"] = np.where(first, value + np.arange(len(table)) % 3, np.nan)
    table.to_csv(tmp_path / "motions.csv", index=False)
    said = girdle("adapt", tmp_path / "motions.csv", "--reading", "mm2_deg2_landmarks", "--out", tmp_path / "out")
    assert (said.status, said.messages) == (0, [])
    assert "No positions of TS and AI, adapted without them: simulated02" in said.out
    found = pd.read_csv(tmp_path / "out" / "parameters.csv").set_index("subject")
    terms = found["D_mm2"] + found["L_mm2"].fillna(0.0) + 10.0 * found["mean_j_after_deg2"]
    np.testing.assert_allclose(found["E"], terms, rtol=1e-12)
    assert found["L_mm2"].notna().tolist() == [True, False]
    girdle("adapt", tmp_path / "motions.csv", "--out", tmp_path / "without")
    without = pd.read_csv(tmp_path / "without" / "parameters.csv").set_index("subject")
    moved = np.abs(found["M_z_mm"].to_numpy() - without["M_z_mm"].to_numpy())
    assert moved[0] > 1.0
    assert moved[1] < 1e-6


def test_priors_are_the_models_own(adapted):
    parameters = adapted.table("parameters")
    own = (-296.0, 78.0, 153.0, 404.0, 130.0, 18.3)
    for name, value in zip(ADAPTED, own, strict=True):
        assert parameters[f"{name}_mm_model"].tolist() == [value, value]
        assert np.all(parameters[f"{name}_mm_sd"] > 0.0)


def test_a_parameter_at_its_bound_may_be_anywhere_between_its_bounds(adapted):
    """The SD of a parameter at a bound is the distance of the bounds / sqrt(3): uniform deviation from one end."""
    parameters = adapted.table("parameters")
    held = parameters["A_y_mm_at_bound"] == 1
    width_mm = 2.0 * HALF_WIDTHS_MM["A_y_mm"]
    np.testing.assert_allclose(parameters["A_y_mm_sd"][held], width_mm / np.sqrt(3.0), rtol=1e-9)
    assert held.any()


def test_the_summary_is_the_thesis_table(adapted):
    summary = adapted.table("summary")
    assert list(dict.fromkeys(summary["motion"])) == ["all", "abduction", "forward_flexion"]
    for _, rows in summary.groupby(["adapted", "motion"]):
        assert rows["subject"].tolist() == ["simulated01", "simulated02", *STATISTICS]
        values = rows.set_index("subject")["scapula_y_deg"]
        subjects = values[["simulated01", "simulated02"]]
        expected = [subjects.mean(), subjects.std(), subjects.max(), subjects.min()]
        np.testing.assert_allclose(values[list(STATISTICS)], expected, rtol=1e-12)


def test_the_record_is_enough_to_repeat_the_run(fitted, adapted):
    for run, command in ((fitted, "fit"), (adapted, "adapt")):
        record = run.record
        assert record["command"] == command
        sha256 = hashlib.sha256(run.motion.read_bytes()).hexdigest()
        assert record["motions"] == [{"path": str(run.motion), "sha256": sha256}]
        model = hashlib.sha256((FOLDER / "R2.toml").read_bytes()).hexdigest()
        assert record["models"] == [{"name": "R2", "sha256": model}]
        assert {"python", "girdle", "jax", "jaxlib", "numpy", "pandas"} <= set(record["versions"])
    assert fitted.record["options"] == {"float32": False, "angles": "six", "effect": []}
    assert adapted.record["options"] == {
        "weight": 5.0,
        "objective": "mm2_deg2",
        "float32": False,
        "angles": "six",
        "effect": [],
        "thorax_downweighting": 1.0,
        "own_bones": False,
    }


def test_a_repeated_run_writes_the_same_bytes(adapted, tmp_path, monkeypatch):
    """Repeated in another folder from run.json alone: tables, models, report and the record itself are the same."""
    monkeypatch.chdir(tmp_path)
    ended = girdle("adapt", "--repeat", adapted.folder / "run.json", "--out", "again")
    assert (ended.status, ended.messages) == (0, [])
    names = sorted(path.relative_to(adapted.folder) for path in adapted.folder.rglob("*") if path.is_file())
    assert sorted(path.relative_to("again") for path in Path("again").rglob("*") if path.is_file()) == names
    assert {str(name) for name in names} >= {"fits.csv", "parameters.csv", "summary.csv", "run.json", "report.html"}
    for name in names:
        assert (Path("again") / name).read_bytes() == (adapted.folder / name).read_bytes(), name


def test_an_option_beside_the_record_goes_before_it(fitted, tmp_path):
    ended = girdle("fit", "--repeat", fitted.folder / "run.json", "--model", "R4", "--out", tmp_path)
    assert (ended.status, ended.messages) == (0, [])
    assert set(pd.read_csv(tmp_path / "fits.csv")["model"]) == {"R4"}


def test_models_lists_the_six_sets_one_line_each():
    ended = girdle("models")
    assert (ended.status, ended.err) == (0, "")
    names = [line.split()[0] for line in ended.out.splitlines()]
    assert names == ["R2", "R4", "R6", "breteler_dissection", "breteler_mri", "das3"]
    assert names == sorted(model_names())


# --- some subjects not handled: exit status 3 ------------------------------------------------------------------------


def test_a_bad_subject_is_named_and_the_others_are_in_the_files(fitted, tmp_path):
    """Two good subjects and one with a word instead of a number: rows of the good ones do not change."""
    bad = ["bad,abduction,1,0.0,-32.29,eleven,8.35,27.1,7.1,-4.43,simulated"]
    path = written(tmp_path, [*shipped_lines()[:15], *bad, *shipped_lines()[15:]])
    ended = girdle("fit", path, "--model", "R2", "--out", tmp_path / "out")
    assert ended.status == 3
    (message,) = ended.messages
    assert message.startswith(f"left out: {path}, line 16: subject 'bad': clavicle_z_deg is 'eleven', not a number.")
    assert "Write a number" in message
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "out" / "fits.csv"), fitted.table("fits"))


def test_a_bad_file_is_named_and_the_others_are_in_the_files(fitted, tmp_path):
    bad = written(tmp_path, ["x"], "bad.csv")
    ended = girdle("fit", bad, fitted.motion, "--model", "R2", "--out", tmp_path / "out")
    assert ended.status == 3
    (message,) = ended.messages
    assert message.startswith(f"left out: {bad}, line 1: columns subject, ")
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "out" / "fits.csv"), fitted.table("fits"))


def test_a_folder_among_the_files_is_named_and_the_others_are_in_the_files(fitted, tmp_path):
    ended = girdle("fit", tmp_path, fitted.motion, "--model", "R2", "--out", tmp_path / "out")
    assert ended.status == 3
    (message,) = ended.messages
    assert message.startswith(f"left out: {tmp_path}: this is a folder")
    assert (tmp_path / "out" / "run.json").exists()


@pytest.mark.parametrize("name", ["[/b]", "[bold]"])
def test_a_name_is_printed_as_it_is(tmp_path, name):
    path = written(tmp_path, [line.replace("simulated01", name) for line in shipped_lines()])
    ended = girdle("fit", path, "--out", tmp_path / "out")
    assert ended.status == 0
    assert name in ended.out


def test_a_model_that_cannot_reach_says_so(motion, tmp_path):
    """R4 with a conoid shorter than the distance of its attachments in any posture."""
    text = (FOLDER / "R4.toml").read_text()
    short = text.replace('name = "R4"', 'name = "R4_3.0"').replace("conoid_length_mm = 13.2", "conoid_length_mm = 3.0")
    model = tmp_path / "short.toml"
    model.write_text(short)
    ended = girdle("fit", motion, "--model", model, "--out", tmp_path / "out")
    assert ended.status == 3
    assert ended.messages == [
        f"not handled: {subject}: 14 posture fits unreachable" for subject in ("simulated01", "simulated02")
    ]
    fits = pd.read_csv(tmp_path / "out" / "fits.csv")
    assert set(fits["model"]) == {"R4_3.0"}
    assert set(fits["status"]) == {status.UNREACHABLE}
    assert np.abs(fits["a3_mm"]).min() > 0.1, "the residuals say how far the chain gapes"
    summary = pd.read_csv(tmp_path / "out" / "summary.csv")
    assert np.isnan(summary["clavicle_y_deg"]).all()
    assert set(summary["postures_ok"]) == {0}


def test_no_word_of_a_help_is_cut_at_80_columns(monkeypatch):
    """Rich truncates with an ellipsis what it cannot wrap, such as the name of an option."""
    monkeypatch.setenv("COLUMNS", "80")
    for command in {line.split("\t")[0]: None for line in WORDS.read_text(encoding="utf-8").splitlines()}:
        said = girdle(command, "--help").out
        assert "--help" in said, command
        assert "\N{HORIZONTAL ELLIPSIS}" not in said, command


def test_effects_are_listed_with_what_a_caller_gives_of_them():
    """Each effect has one line that begins with its name; it takes as many sizes as it has directions."""
    ended = girdle("effects")
    assert (ended.status, ended.err) == (0, "")
    lines = dict(line.split(maxsplit=1) for line in ended.out.splitlines())
    assert list(lines) == list(EFFECTS)
    option = "--effect scapulothoracic_gap=TS,AI in mm, at 150 degrees of elevation"
    assert lines["skin_artefact"].endswith("size 4.5 deg; --effect skin_artefact=SHARE in parts of the measured lag")
    assert lines["scapulothoracic_gap"].endswith(f"; size 2 / 3 mm; {option}")
    for name, effect in EFFECTS.items():
        places = ["0" for _ in lines[name].partition(f"--effect {name}=")[2].partition(" in ")[0].split(",")]
        size_unit, unit = ("", "in no unit") if effect.unit == "1" else (f" {effect.size_unit}", effect.unit)
        assert f"{size_unit}; --effect" in lines[name]
        assert unit in lines[name]
        read_amplitudes([f"{name}={','.join(places)}"])  # as many numbers as there are directions


# --- what the terminal says ----------------------------------------------------------------------------------------


def test_an_adaptation_ends_with_a_verdict_and_has_its_tables_on_demand(motion, adapted, tmp_path):
    """The output has one verdict per set, wrapped at 80 columns; tables of subjects only with --tables."""
    held_out = adapted.table("heldout").query("held_out == held_out")
    gap = held_out["scapula_gap_unseen_deg"].mean()  # both motions of a subject have as many postures
    words = " ".join(adapted.ended.out.split())
    assert f"deg, scapula {held_out['scapula_gap_before_deg'].mean():.1f} -> {gap:.1f} deg;" in words
    assert words.endswith(f"Open {adapted.folder / 'report.html'}")
    assert max(map(len, adapted.ended.out.splitlines()[:-1])) <= 80
    assert "after adaptation:" not in words
    said = girdle("adapt", motion, "--model", "R2", "--weight", "5", "--tables", "--out", tmp_path / "out").out
    assert "R2, after adaptation: mean |simulated - measured|" in said
    assert "…" not in said


def test_the_causes_of_a_diagnosis_are_adapted_with(motion, tmp_path):
    """Causes from a diagnosis give the same numbers and the same record as --effect."""
    option = "scapula_landmark_bias=0,5,0"
    (tmp_path / "diagnosis.json").write_text(json.dumps({"options": [option]}))
    by_folder, by_option = tmp_path / "folder", tmp_path / "option"
    assert girdle("fit", motion, "--effects-of", tmp_path, "--out", by_folder).status == 0
    assert girdle("fit", motion, "--effect", option, "--out", by_option).status == 0
    assert (by_folder / "fits.csv").read_bytes() == (by_option / "fits.csv").read_bytes()
    assert json.loads((by_folder / "run.json").read_text())["options"]["effect"] == [option]


def test_a_diagnosis_is_not_replaced_by_what_it_explains(motion, tmp_path):
    (tmp_path / "diagnosis.json").write_text(json.dumps({"options": ["scapula_landmark_bias=0,5,0"]}))
    for command in ("fit", "adapt"):
        ended = girdle(command, motion, "--effects-of", tmp_path, "--out", tmp_path)
        refused(ended, str(tmp_path), "would replace the diagnosis that --effects-of reads", "Give another folder")


def test_each_model_gets_the_amplitudes_of_its_own_diagnosis(tmp_path):
    """R2's gap is the smallest; R6 was not diagnosed."""
    of_R2, of_R4 = ({"model": name, "options": [f"thorax_tilt=0,{y},0"]} for name, y in (("R2", 5), ("R4", 3)))
    text = json.dumps({**of_R2, "by_model": {"R2": of_R2, "R4": of_R4}})
    (tmp_path / "diagnosis.json").write_text(text)
    assert effects_of(tmp_path, ["R2"]) == of_R2["options"]
    assert effects_of(tmp_path, ["R4"]) == of_R4["options"]
    for models, others in ((["R6"], "R6"), (["R2", "R4"], "R4"), (["R4", "R6"], "R4, R6")):
        with pytest.warns(InputWarning, match=f"were found with R2, and {others} may need others"):
            assert effects_of(tmp_path, models) == of_R2["options"]


def test_the_amplitudes_of_a_diagnosis_are_read_without_a_warning_of_the_model(tmp_path):
    """The command reads the model again, and then warns of it, once."""
    odd = tmp_path / "odd.toml"
    text = (FOLDER / "R2.toml").read_text()
    odd.write_text(re.sub(r"(?m)^conoid_length_mm = .*$", "conoid_length_mm = 80.0", text))
    with pytest.warns(InputWarning, match="constraint.conoid_length_mm is 80"):
        load_model(odd)
    (tmp_path / "diagnosis.json").write_text(json.dumps({"model": "R2", "options": ["thorax_tilt=0,5,0"]}))
    assert effects_of(tmp_path, [str(odd)]) == ["thorax_tilt=0,5,0"]


@pytest.mark.parametrize(
    ("text", "cause", "remedy"),
    [
        (None, "there is no such file", "girdle diagnose --out FOLDER"),
        ("[]", "this is not a diagnosis.json", "girdle diagnose --out FOLDER"),
        ('{"options": "thorax_tilt=0,5,0"}', "this is not a diagnosis.json", "girdle diagnose --out FOLDER"),
        ('{"options": [], "by_model": []}', "this is not a diagnosis.json", "girdle diagnose --out FOLDER"),
        ('{"options": []}', "names no cause whose size a gap shows", "Adapt without --effects-of"),
    ],
)
def test_a_folder_without_causes_is_refused(motion, tmp_path, text, cause, remedy):
    if text is not None:
        (tmp_path / "diagnosis.json").write_text(text)
    ended = girdle("adapt", motion, "--effects-of", tmp_path, "--out", tmp_path / "out")
    refused(ended, str(tmp_path / "diagnosis.json"), cause, remedy)
