# pyright: reportAttributeAccessIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""``girdle convert`` as a user runs it, and the adapted models that ``girdle adapt`` writes."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import girdle, refused
from laboratory import in_laboratory, simulated_trial, trc_lines, up_and_down, with_gaps, with_noise, write_c3d
from numpy.random import PCG64, Generator
from scipy.spatial.transform import Rotation

from adapt import adapt_subjects
from adapt.cli.commands.known_effects import effects_of
from adapt.cli.terminal.print_converted import outliers_in_words
from adapt.output.adapted_models import write_adapted_models
from adapt.tables.results import DIFFERENCES
from models import load_model, model_names
from models.adapted_parameters import ADAPTED
from models.export.opensim import opensim_model
from models.girdle import bone_rotations, chain_landmarks
from models.parameter_sets import FOLDER
from motions import InputError, read_motions, write_motions
from motions.files import file_names
from motions.landmarks.sampled_postures import ESTIMATED, FRAMES, spread_column
from motions.rhythm import REST_DEG
from motions.rhythm_subjects import DATA_FILE
from motions.rotations import DEG
from motions.table import ANGLES, Motions
from scripts.valid_files import FITS

EXACT = 1e-9
NOISE_MM = 1.0
AT = (15, 35, 55, 75, 95, 115, 135)
SIX_STANDARD_ERRORS = 6.0
"""Tolerance in standard errors: noise alone exceeds it once in 5e8."""


@pytest.fixture(scope="module")
def trials():
    """Simulate two motions of a girdle that is R2, 100 frames per second."""
    return {plane: simulated_trial(up_and_down(), plane, closed=True) for plane in (0.0, 90.0)}


@pytest.fixture(scope="module")
def converted(trials, tmp_path_factory) -> dict[str, Motions]:
    """Convert both trials by the command line, from .c3d files: two subjects S0 and S1 with different noise of 1 mm.

    The trials have gaps and z up; S0 is converted from .trc too. Two subjects of 14 postures, as in other tests, so
    that little is compiled.
    """
    generator = Generator(PCG64(7))
    folder = tmp_path_factory.mktemp("laboratory")
    turn = Rotation.from_euler("xyz", [90, 10, -30], degrees=True).as_matrix()
    gaps = {"AC": slice(100, 130), "T8": slice(300, 320), "EL": slice(500, 505)}
    parts = {"c3d": [], "trc": []}
    for number in range(2):
        for plane, trial in trials.items():
            exact = in_laboratory(trial.thorax_mm, turn, np.array([500.0, -200.0, 900.0]))
            lab = with_gaps(with_noise(exact, NOISE_MM, generator), gaps)
            write_c3d(folder / "trial.c3d", lab)
            (folder / "trial.trc").write_text("\n".join(trc_lines(lab)) + "\n")
            for kind in ("c3d", "trc") if number == 0 else ("c3d",):
                names = ("--subject", f"S{number}", "--motion", f"{plane:g}", "--at", ",".join(map(str, AT)))
                ended = girdle("convert", folder / f"trial.{kind}", folder / "out.csv", *names)
                assert (ended.status, ended.err) == (0, ""), ended.err
                parts[kind].append(read_motions(folder / "out.csv"))
    return {kind: Motions.concatenate(some) for kind, some in parts.items()}


def true_at(trial, elevation_deg):
    """Interpolate the true angles on the way up; the way down has the same angles."""
    half = len(trial.elevation_deg) // 2
    columns = trial.angles_deg[:half].T
    return np.stack([np.interp(elevation_deg, trial.elevation_deg[:half], column) for column in columns], axis=1)


def test_noisy_trials_with_gaps_are_converted_to_within_their_noise(trials, converted):
    """The error of each angle is within the limit from its own spread and number of frames."""
    known = [k for k, angle in enumerate(ANGLES) if angle != "clavicle_x"]
    motions = converted["c3d"]
    for plane, trial in trials.items():
        mine = motions.select(motions.motion == f"{plane:g}")
        assert mine.humerus_elevation_deg.tolist() == list(AT) * 2
        error = mine.angles_deg - true_at(trial, mine.humerus_elevation_deg)
        spread = mine.extra[[spread_column(angle) for angle in ANGLES]].astype(float).to_numpy()
        standard_error = spread / np.sqrt(mine.extra[FRAMES].astype(float).to_numpy())[:, None]
        bend_deg = 0.05  # error of a straight line through the curved angles of the window
        assert (np.abs(error) < SIX_STANDARD_ERRORS * standard_error + bend_deg)[:, known].all()
        single_frame = spread[:, known]
        assert single_frame.min() > 0.2  # noise of 1 mm over 100-150 mm
        assert single_frame.max() < 2.5  # noise, and the rotation of the bones within the window
        assert set(mine.extra[ESTIMATED]) == {"yes"}


def test_both_kinds_of_file_say_the_same(converted):
    single_precision_deg = 1e-3
    first = converted["c3d"].select(converted["c3d"].subject == "S0")
    np.testing.assert_allclose(first.angles_deg, converted["trc"].angles_deg, rtol=0.0, atol=single_precision_deg)


def test_the_girdle_is_adapted_to_within_the_noise(converted):
    """R2 adapted to a girdle that is R2: the remaining gap is the noise of the sampled angles, 0.1-0.3 degrees.

    The axial rotation of the clavicle is left out, because its estimate differs from the girdle's own rotation.
    """
    motions = converted["c3d"]
    angles = motions.angles_deg.copy()
    angles[:, ANGLES.index("clavicle_x")] = np.nan
    result = adapt_subjects(replace(motions, angles_deg=angles), load_model("R2"))
    assert result.parameters["status"].tolist() == ["ok"] * 2
    after = result.fits[result.fits["adapted"] == 1]
    noise_deg = 0.3
    assert after[DIFFERENCES].abs().mean().max() < noise_deg
    own = np.asarray(load_model("R2").girdle.adapted_mm)
    moved_mm = np.abs(result.adapted["R2"].theta_mm - own[:, None])
    assert (
        moved_mm[[1, 2, 4]].max() < 3.0
    )  # M_z, A_x, A_z; M_y and A_y trade off, and the conoid length depends on the axial rotation


def test_an_adapted_model_loads_again_to_the_same_girdle(tmp_path):
    names = ["P 1/\u00fc", "p 1/\u00fc"]
    motions = read_motions(DATA_FILE)
    motions = motions.select(np.isin(motions.subject, motions.subjects[:2]))
    named = dict(zip(motions.subjects, names, strict=True))
    motions = replace(motions, subject=np.array([named[name] for name in motions.subject]))
    write_motions(motions, tmp_path / "m.csv")
    ended = girdle("adapt", tmp_path / "m.csv", "--model", "R2", "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    files = sorted((tmp_path / "out" / "models").iterdir())
    assert len(files) == 2
    table = pd.read_csv(tmp_path / "out" / "parameters.csv").set_index("subject")
    by_name = {load_model(path).name: load_model(path) for path in files}
    base = load_model("R2")
    for name in names:
        model = by_name[f"R2_{name}"]
        for parameter, value in zip(ADAPTED, model.girdle.adapted_mm, strict=True):
            assert float(value) == table.loc[name, f"{parameter}_mm"]
        np.testing.assert_array_equal(model.girdle.scapula_conoid_mm, base.girdle.scapula_conoid_mm)
        np.testing.assert_array_equal(model.points_mm, base.points_mm)
        assert model.source["thorax.centre_mm"].startswith(f"adapted to {name}, from R2 (w = 10")
        assert model.source["clavicle.length_mm"] == "of R2: Table 3.2"
        bound = "at its bound" in model.source["constraint.conoid_length_mm"]
        assert bound == bool(table.loc[name, "conoid_length_mm_at_bound"])
    again = girdle("fit", tmp_path / "m.csv", "--model", files[0], "--out", tmp_path / "again")
    assert again.status == 0, again.err
    simulated_go_on_as_mot(tmp_path)


def test_an_adapted_model_keeps_bounds_of_its_own_and_a_failed_one_leaves_nothing(tmp_path):
    """A semi-axis of at least 1 mm has its lower bound closer than the upper one; the file keeps the half widths."""
    text = (FOLDER / "R2.toml").read_text().replace("[source]", "[bounds]\nM_y_mm = 20.0\nA_z_mm = 200.0\n\n[source]")
    (tmp_path / "own.toml").write_text(text)
    own = load_model(tmp_path / "own.toml")
    theta = np.asarray(own.girdle.adapted_mm)[:, None] + np.array([[1.0, 2.0]])
    columns = {"model": "R2", "subject": ["good", "bad"], "status": ["ok", "not_converged"]}
    columns |= {f"{name}_mm": theta[k] for k, name in enumerate(ADAPTED)}
    columns |= {f"{name}_mm_at_bound": 0 for name in ADAPTED}
    write_adapted_models(tmp_path, [own], pd.DataFrame(columns), "a test")
    (file,) = (tmp_path / "models").iterdir()
    assert file.name == "R2_good.toml"
    again = load_model(file)
    np.testing.assert_array_equal(again.girdle.adapted_mm, theta[:, 0])
    half_widths = [20.0, 30.0, 30.0, 100.0, 200.0, 8.0]
    np.testing.assert_allclose(again.bounds_mm[1] - theta[:, 0], half_widths, rtol=1e-12)


def simulated_go_on_as_mot(folder: Path) -> None:
    """Write fits.csv as .mot files, one per motion, and its numbers as Parquet; check them."""
    ended = girdle("convert", folder / "out" / "fits.csv", folder / "mots")
    assert ended.status == 0, ended.err
    files = sorted((folder / "mots").iterdir())
    assert len(files) == 4
    assert "origin=simulated by the adapted model" in files[0].read_text()
    back = girdle("convert", files[0], folder / "back.csv")
    assert back.status == 0, back.err
    fits = pd.read_csv(folder / "out" / "fits.csv")
    motions = read_motions(folder / "back.csv")
    name = motions.subjects[0].removeprefix("R2_")
    rows = fits[(fits["subject"] == name) & (fits["motion"] == motions.motion[0]) & (fits["adapted"] == 1)]
    expected = rows[[f"{angle}_simulated_deg" for angle in ANGLES]].to_numpy()
    np.testing.assert_allclose(motions.angles_deg, expected, rtol=0.0, atol=EXACT)
    ended = girdle("convert", folder / "out" / "fits.csv", folder / "fits.parquet")
    assert ended.status == 0, ended.err
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "fits.parquet"), fits, check_dtype=False)


def test_motions_through_a_folder_of_mot_files(tmp_path):
    shipped = read_motions(DATA_FILE)
    ended = girdle("convert", DATA_FILE, tmp_path / "mots", "--isb")
    assert ended.out == f"{len(shipped.posture)} postures of 10 subjects in {tmp_path / 'mots'}\n"
    for path in (tmp_path / "mots").iterdir():
        assert "clavicle_alpha" in path.read_text()
        assert girdle("convert", path, tmp_path / "back.csv").status == 0
        again = read_motions(tmp_path / "back.csv")
        mine = (shipped.subject == again.subjects[0]) & (shipped.motion == again.motion[0])
        np.testing.assert_allclose(again.angles_deg, shipped.angles_deg[mine], rtol=0.0, atol=EXACT)
        np.testing.assert_array_equal(again.posture, shipped.posture[mine])


@pytest.mark.parametrize(
    ("arguments", "where", "cause", "remedy"),
    [
        (["out.mot"], "out.mot", "there are 20 motions and a .mot file holds one", "Name a folder"),
        (["out.csv", "--isb"], "--isb", "only .mot files hold ISB's angles", "leave --isb out"),
        (["out.xlsx"], "out.xlsx", "files that end in '.xlsx' are not written", ".parquet"),
        (["out.csv", "--side", "up"], "--side", "the side is 'up'", "left or right"),
        (["out.csv", "--at", "30;60"], "--at", "'30;60' is not a list", "30,60,90"),
        (["out.csv", "--at", ","], "--at", "',' is not a list", "30,60,90"),
        (["out.csv", "--aa-to-ac", "x"], "--aa-to-ac", "there is no rotation 'x'", "kolz2020"),
        (["out.csv", "--at", "30,60"], str(DATA_FILE), "--subject, --motion, --side and --at would change", "Leave"),
        (["out.csv", "--map", "nowhere.toml"], "nowhere.toml", "cannot be read", "mapping file"),
    ],
)
def test_what_cannot_be_converted(tmp_path, monkeypatch, arguments, where, cause, remedy):
    monkeypatch.chdir(tmp_path)
    refused(girdle("convert", DATA_FILE, *arguments), where, cause, remedy)
    assert list(tmp_path.iterdir()) == []


def test_no_source_is_replaced(tmp_path):
    motion = tmp_path / "motion.csv"
    motion.write_text(DATA_FILE.read_text().replace("simulated01", " simulated01"))
    before = motion.read_bytes()
    said = "this command reads this file and would replace it", "Name another file"
    refused(girdle("convert", motion, tmp_path / "." / "motion.csv"), str(motion), *said)
    assert motion.read_bytes() == before
    assert girdle("convert", motion, tmp_path / "mots").status == 0
    onto = girdle("convert", tmp_path / "mots", tmp_path / "mots")
    refused(onto, str(tmp_path / "mots" / "simulated01_abduction.mot"), *said)


def test_a_parameter_set_becomes_a_model_of_opensim_alone(tmp_path):
    refused(girdle("convert", FOLDER / "R2.toml", tmp_path / "o.stl"), str(tmp_path / "o.stl"), "becomes", ".osim")
    refused(girdle("convert", DATA_FILE, tmp_path / "o.osim"), str(DATA_FILE), "made of a parameter set", ".toml")


def test_many_outliers_are_one_line():
    motions = read_motions(DATA_FILE)
    slipped = ["TS" if k in (1, 3, 4, 5) else "" for k in range(len(motions.posture))]
    said = outliers_in_words(replace(motions, extra=motions.extra.assign(slipped=slipped)))
    assert said == ["TS slipped: not in its place on the bone in postures 2, 4-6 of simulated01, abduction"]


def test_a_trial_without_elevations_to_sample_says_that_there_could_be(trials, tmp_path):
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(trials[0.0].thorax_mm)) + "\n")
    ended = girdle("convert", tmp_path / "t.trc", tmp_path / "t.csv")
    assert ended.out.startswith(f"600 postures of 1 subject in {tmp_path / 't.csv'}\n")
    assert "--at 30,60,90" in ended.out
    without = {name: xyz for name, xyz in trials[0.0].thorax_mm.items() if name not in ("GH", "EM", "EL")}
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(without)) + "\n")
    ended = girdle("convert", tmp_path / "t.trc", tmp_path / "t.csv")
    assert "--at" not in ended.out
    assert "GH, EM and EL would give the elevation of the arm" in ended.out


def test_a_folder_that_is_not_there_is_made(trials, tmp_path):
    """The first command of the README writes into a folder that does not exist."""
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(trials[0.0].thorax_mm)) + "\n")
    ended = girdle("convert", tmp_path / "t.trc", tmp_path / "mysubjects" / "P01.csv", "--at", "0,60")
    assert ended.status == 0, ended.err
    assert len(read_motions(tmp_path / "mysubjects" / "P01.csv").posture) == 2
    below = tmp_path / "t.trc" / "P01.csv"
    refused(girdle("convert", tmp_path / "t.trc", below), str(below.parent), "cannot be made", "a folder of your own")


def test_an_estimate_and_what_is_left_out_are_said(trials, tmp_path):
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(trials[0.0].thorax_mm)) + "\n")
    ended = girdle("convert", tmp_path / "t.trc", tmp_path / "t.csv", "--at", "0,60,140,160")
    assert ended.status == 0
    said = "clavicle_x_deg (axial rotation) is an estimate; it is 0 with the arm lowest, at 0 degrees"
    assert ended.out.splitlines().count(said) == 1
    assert ended.out.startswith("3 postures")
    (warned,) = ended.err.splitlines()
    assert warned.startswith(
        f"warning: {tmp_path / 't.trc'}: t, t: no posture at 160 degrees of --at: the arm goes from 0"
    )
    motions = read_motions(tmp_path / "t.csv")
    assert motions.humerus_elevation_deg.tolist() == [0.0, 60.0, 140.0]
    write_mot_again = girdle("convert", tmp_path / "t.csv", tmp_path / "t.mot")
    assert "clavicle_x_deg (axial rotation) is an estimate; it is 0" in write_mot_again.out
    without_zero = girdle("convert", tmp_path / "t.mot", tmp_path / "again.csv")
    assert "clavicle_x_deg (axial rotation) is an estimate\n" in without_zero.out


def test_a_map_with_ts_and_ai_swapped_is_refused(trials, tmp_path):
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(trials[0.0].thorax_mm)) + "\n")
    (tmp_path / "lab.toml").write_text('[markers]\nTS = "AI"\nAI = "TS"\n')
    ended = girdle("convert", tmp_path / "t.trc", tmp_path / "t.csv", "--map", tmp_path / "lab.toml", "--at", "20,60")
    said = "t, t: TS is 184 mm from AC, in people 80 to 170"
    refused(ended, str(tmp_path / "t.trc"), said, "Are TS and AI swapped? With them exchanged nothing of this is left")


def test_a_cropped_trial_is_converted_with_a_warning(trials, tmp_path):
    """The header still has the number of frames before cropping."""
    lab = {name: xyz[:, :40] for name, xyz in trials[0.0].thorax_mm.items()}
    (tmp_path / "t.trc").write_text("\n".join(trc_lines(lab, frames_said=600)) + "\n")
    ended = girdle("convert", tmp_path / "t.trc", tmp_path / "t.csv")
    assert ended.out.startswith("40 postures of 1 subject")
    assert ended.err.startswith(f"warning: {tmp_path / 't.trc'}, line 3: the header says 600 frames (NumFrames)")


def test_a_folder_that_is_no_checkout(tmp_path):
    refused(
        girdle("convert", tmp_path, tmp_path / "o.csv"), str(tmp_path), "no files that end in", "Spartacus checkout"
    )


def test_parquet_without_pyarrow_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    ended = girdle("convert", DATA_FILE, tmp_path / "m.parquet")
    refused(ended, str(tmp_path / "m.parquet"), "Parquet needs pyarrow", "pip install pyarrow")


@pytest.mark.parametrize("name", model_names())
def test_the_opensim_model_places_the_bones_as_this_one_does(name):
    """Each bone's pose at rest, computed from the numbers in the file and OpenSim's own order of transforms."""
    girdle_ = load_model(name).girdle
    at = chain_landmarks(girdle_, *bone_rotations(REST_DEG / float(DEG)))
    Q = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
    expected = {point: Q @ np.asarray(getattr(at, point)) / 1000.0 for point in ("AC", "TS", "AI")}
    document = ET.fromstring(opensim_model(load_model(name)))
    assert document.attrib == {"Version": "40000"}
    poses = opensim_poses(document)
    for marker in document.iter("Marker"):
        if marker.get("name") == "SC":
            continue
        body = (marker.findtext("socket_parent_frame") or "").removeprefix("/bodyset/")
        rotation, origin = poses[body]
        found = origin + rotation @ vector(marker, "location")
        np.testing.assert_allclose(found, expected[marker.attrib["name"]], rtol=0.0, atol=1e-12)
    residuals = constraint_errors_m(document, poses)
    assert residuals["acromioclavicular"] < 1e-12
    assert residuals["conoid"] == pytest.approx(
        float(girdle_.residuals_mm(REST_DEG / float(DEG))[2]) / 1000.0, abs=1e-12
    )


def vector(element: ET.Element, tag: str) -> np.ndarray:
    return np.array([float(word) for word in (element.findtext(tag) or "").split()])


def opensim_poses(document: ET.Element) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Compute rotation and origin of clavicle and scapula in the thorax at the default coordinates.

    CustomJoint: rotations about its axes in turn. ScapulothoracicJoint: the parent frame rotated by 90 degrees about z;
    Simbody's ellipsoid mobilizer Rx(q1) Ry(q2) Rz(q3) at (a sin q2, -b sin q1 cos q2, c cos q1 cos q2) with the radii's
    x and y swapped; rotated back; the child frame. (ScapulothoracicJoint.cpp, extendAddToSystem; winging is 0.)
    """
    poses = {}
    joint = next(document.iter("CustomJoint"))
    parent, _ = joint.iter("PhysicalOffsetFrame")
    q = {c.attrib["name"]: float(c.findtext("default_value") or "") for c in joint.iter("Coordinate")}
    rotation = Rotation.identity()
    for axis in list(joint.iter("TransformAxis"))[:3]:
        rotation = rotation * Rotation.from_rotvec(q[axis.findtext("coordinates") or ""] * vector(axis, "axis"))
    poses["clavicle"] = (rotation.as_matrix(), vector(parent, "translation"))
    joint = next(document.iter("ScapulothoracicJoint"))
    parent, child = joint.iter("PhysicalOffsetFrame")
    q1, q2, q3, q4 = (float(c.findtext("default_value") or "") for c in joint.iter("Coordinate"))
    assert q4 == 0.0
    x, y, z = vector(joint, "thoracic_ellipsoid_radii_x_y_z")
    a, b, c = y, x, z
    quarter = Rotation.from_euler("Z", 90, degrees=True)
    frame = Rotation.from_euler("XYZ", vector(parent, "orientation")) * quarter
    mobile = Rotation.from_euler("XYZ", [q1, q2, q3])
    place = np.array([a * np.sin(q2), -b * np.sin(q1) * np.cos(q2), c * np.cos(q1) * np.cos(q2)])
    in_thorax = frame * mobile * quarter.inv()
    scapula = in_thorax * Rotation.from_euler("XYZ", vector(child, "orientation")).inv()
    origin = vector(parent, "translation") + frame.apply(place) - scapula.apply(vector(child, "translation"))
    poses["scapula"] = (scapula.as_matrix(), origin)
    return poses


def constraint_errors_m(document: ET.Element, poses) -> dict[str, float]:
    errors = {}
    for kind in ("PointConstraint", "ConstantDistanceConstraint"):
        constraint = next(document.iter(kind))
        ends = []
        for number in (1, 2):
            body = (constraint.findtext(f"socket_body_{number}") or "").removeprefix("/bodyset/")
            rotation, origin = poses[body]
            ends.append(origin + rotation @ vector(constraint, f"location_body_{number}"))
        length = float(np.linalg.norm(ends[1] - ends[0]))
        errors[constraint.attrib["name"]] = length - float(constraint.findtext("constant_distance") or 0.0)
    return errors


def test_the_joints_point_lies_on_the_ellipsoid_and_the_file_is_whole(tmp_path):
    """The file has each tag that OpenSim's sources require once, and every socket refers to an existing object."""
    ended = girdle("convert", "R4", tmp_path / "R4.osim")
    assert ended.status == 0, ended.err
    document = ET.parse(tmp_path / "R4.osim").getroot()
    joint = next(document.iter("ScapulothoracicJoint"))
    radii = vector(joint, "thoracic_ellipsoid_radii_x_y_z")
    np.testing.assert_allclose(radii, [0.130, 0.314, 0.137], rtol=0.0, atol=1e-15)
    ellipsoid = next(document.iter("WrapEllipsoid"))
    np.testing.assert_array_equal(vector(ellipsoid, "dimensions"), radii)
    np.testing.assert_array_equal(vector(ellipsoid, "translation"), [-0.054, -0.230, 0.0])
    for tag in ("scapula_winging_axis_origin", "scapula_winging_axis_direction"):
        assert len(list(joint.iter(tag))) == 1
    bodies = {f"/bodyset/{body.get('name')}" for body in document.iter("Body")} | {"/ground"}
    frames = {frame.get("name") for frame in document.iter("PhysicalOffsetFrame")}
    for element in document.iter():
        if element.tag in ("socket_parent", "socket_body_1", "socket_body_2"):
            assert element.text in bodies
        if element.tag == "socket_child_frame":
            assert element.text in frames


def test_file_names_are_safe_and_all_different():
    names = ["R2_P1", "R2_p1", "a/b", "a\\b", "..", "", "x" * 300, "x" * 301, "\u00e4 1", "con:"]
    found = list(file_names(names))
    assert found[0] == "R2_P1"
    assert len({name.casefold() for name in found}) == len(names)
    assert all(0 < len(name) < 130 and not set(name) & set('/\\:*?"<>|\0') for name in found)
    assert not any(name.startswith(".") or name.endswith((" ", ".")) for name in found)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (("status", "word"), "line 1: columns status are missing"),
        (("posture", "nr"), "line 1: columns posture are missing"),
        (("abduction,1,", "abduction,one,"), "line 2: 'one' is not a number"),
        (("abduction,1,", "abduction,,"), "line 2: a number of the posture is missing"),
        ((",ok", ",unreachable"), "no posture was fitted"),
    ],
)
def test_a_table_of_fits_that_was_changed_ends_in_a_message(tmp_path, change, cause):
    """Regression test for a fault found by fuzzing."""
    source = tmp_path / "fits.csv"
    source.write_bytes(FITS)
    assert girdle("convert", source, tmp_path / "whole.csv").status == 0
    source.write_text(FITS.decode().replace(*change))
    ended = girdle("convert", source, tmp_path / "out.csv")
    assert (ended.status, len(ended.messages)) == (2, 1)
    assert cause in ended.err


def test_a_diagnosis_nested_too_deep_ends_in_a_message(tmp_path):
    """Regression test for a fault found by fuzzing."""
    (tmp_path / "diagnosis.json").write_text("[" * 5000)
    with pytest.raises(InputError, match=r"not a diagnosis\.json"):
        effects_of(tmp_path, tmp_path / "out")
