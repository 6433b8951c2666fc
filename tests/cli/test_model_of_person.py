"""``girdle model`` and the commands that use its sets: output, exit statuses, broken inputs."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from meshes import write_stl
from scipy.spatial import ConvexHull

from adapt.evaluation.model_subjects import simulate_model_subjects
from models import load_model
from models.girdle import Girdle
from models.parameter_sets import FOLDER
from models.person.attachments import scapular_map
from models.person.family import load_personal_sets
from motions import write_motions
from motions.landmarks.frames import scapula_frame
from scripts.research.person.simulated_persons import landmark_table, point_table, simulate_persons
from tests.helpers.command import girdle, refused
from tests.helpers.laboratory import simulated_trial, trc_lines
from tests.helpers.round_points import cylinder_points, sphere_points
from tests.helpers.thesis_tables import DISSECTION


@pytest.fixture(scope="module")
def persons():
    return simulate_persons(load_model("R2"), 3, 1.0, 2)


@pytest.fixture(scope="module")
def folder(persons, tmp_path_factory):
    """Write motions, landmarks and points of three simulated persons as files."""
    home = tmp_path_factory.mktemp("persons")
    write_motions(persons.motions, home / "motions.csv")
    landmark_table(persons).to_csv(home / "landmarks.csv", index=False)
    point_table(persons).to_csv(home / "points.csv", index=False)
    return home


def test_one_run_makes_a_set_of_each_and_adapts_each_with_its_own(folder, persons):
    made = girdle("model", folder / "landmarks.csv", "--points", folder / "points.csv", "--out", folder / "own")
    assert made.status == 0, made.err
    assert "3 files written" in made.out
    own = load_personal_sets(folder / "own")
    assert tuple(own.by_subject) == tuple(sorted(persons.motions.subjects))
    for subject in persons.motions.subjects:
        assert own.of(subject).source["thorax.centre_mm"].startswith("measured: least D of 25 points")
    ran = girdle("adapt", folder / "motions.csv", "--models-of", folder / "own", "--out", folder / "adapted")
    assert ran.status == 0, ran.err
    together = pd.read_csv(folder / "adapted" / "parameters.csv").set_index("subject")
    assert set(together["model"]) == {"own"}
    for subject in persons.motions.subjects:
        assert together.loc[subject, "A_x_mm_model"] == float(own.of(subject).girdle.semi_axes_mm[0])
        assert (folder / "adapted" / "models" / f"own_{subject}.toml").exists()
    first = persons.motions.subjects[0]
    write_motions(persons.motions.select(persons.motions.subject == first), folder / "one.csv")
    alone = girdle("adapt", folder / "one.csv", "--model", folder / "own" / f"{first}.toml", "--out", folder / "alone")
    assert alone.status == 0, alone.err
    row = pd.read_csv(folder / "alone" / "parameters.csv").iloc[0]
    for name in ("M_y_mm", "A_x_mm", "E"):
        assert row[name] == pytest.approx(together.loc[first, name], rel=1e-9)
    again = girdle("adapt", "--repeat", folder / "adapted" / "run.json", "--out", folder / "again")
    assert again.status == 0, again.err
    assert (folder / "again" / "parameters.csv").read_bytes() == (folder / "adapted" / "parameters.csv").read_bytes()


def test_who_has_no_set_is_left_out_by_name(folder, persons):
    first = persons.motions.subjects[0]
    landmark_table(persons, [first]).to_csv(folder / "first.csv", index=False)
    (folder / "few").mkdir()
    assert girdle("model", folder / "first.csv", "--out", folder / "few" / "first.toml").status == 0
    ran = girdle("adapt", folder / "motions.csv", "--models-of", folder / "few", "--out", folder / "partly")
    assert ran.status == 3
    assert f"there is no parameter set of subject '{persons.motions.subjects[1]}'" in ran.err
    assert f"It has sets of {first}: the line name = ... of a file is the subject" in ran.err
    nobody = girdle("fit", folder / "motions.csv", "--models-of", folder, "--out", folder / "nothing")
    assert nobody.status == 2
    assert "no .toml file" in nobody.err


def table_4_2(tmp_path, **changes):
    """Write the landmarks of the dissected cadaver in several equal postures, with changed columns."""
    names = ("IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI")
    columns: dict[str, object] = {f"{n}_{a}_mm": [DISSECTION[n][k]] for n in names for k, a in enumerate("xyz")}
    table = pd.DataFrame(columns).assign(**changes)
    path = tmp_path / "person.csv"
    table.to_csv(path, index=False)
    return path


def test_points_give_gh_shaft_and_their_volumes(tmp_path):
    head, shaft = sphere_points(0.2), cylinder_points(0.2)
    rows = [("humeral_head", p) for p in head.T] + [("humeral_shaft", p) for p in shaft.T]
    table = pd.DataFrame([{"surface": s} | dict(zip(("x_mm", "y_mm", "z_mm"), p, strict=True)) for s, p in rows])
    table.to_csv(tmp_path / "points.csv", index=False)
    ran = girdle("model", table_4_2(tmp_path), "--points", tmp_path / "points.csv", "--out", tmp_path / "person.toml")
    assert ran.status == 0, ran.err
    assert "GH, centre of the humeral head: (1" in ran.out
    assert "radius 18.5" in ran.out
    assert "humeral shaft: through" in ran.out
    assert load_model(tmp_path / "person.toml").name == "person"


def test_a_left_shoulder_is_mirrored(tmp_path):
    right = girdle("model", table_4_2(tmp_path), "--out", tmp_path / "right.toml")
    mirrored = {f"{n}_x_mm": [-DISSECTION[n][0]] for n in ("IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI")}
    left = girdle("model", table_4_2(tmp_path, **mirrored), "--side", "left", "--out", tmp_path / "left.toml")
    assert right.status == left.status == 0
    for field in ("sc_mm", "ts_mm", "ai_mm", "ts_distance_mm"):
        np.testing.assert_allclose(
            getattr(load_model(tmp_path / "left.toml").girdle, field),
            getattr(load_model(tmp_path / "right.toml").girdle, field),
            atol=1e-9,
        )


def scapula_surface(own: Girdle) -> tuple[np.ndarray, np.ndarray]:
    """Return corners and triangles of a convex bone through AC, TS and AI of a set, in its scapula frame."""
    ends = np.stack([np.zeros(3), own.ts_mm, own.ai_mm], axis=1)
    ball = np.random.default_rng(4).normal(size=(3, 1500))
    bone = np.array([[45.0], [40.0], [25.0]]) * ball / np.linalg.norm(ball, axis=0)
    bone[:, bone[0] > 20.0] *= np.array([[0.9], [1.0], [1.4]])
    points = np.hstack([ends, ends.mean(axis=1, keepdims=True) + bone])
    return points, ConvexHull(points.T).simplices


def placed(corners: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Map corners of the scapula frame by M and place them where the landmarks of the dissection put the bone."""
    AC, TS, AI = (np.array(DISSECTION[name]) for name in ("AC", "TS", "AI"))
    return AC[:, None] + scapula_frame(AC, TS, AI) @ M @ corners


def test_surfaces_of_the_scapula_carry_the_conoid(tmp_path):
    """The conoid moves with the surface: as mapped by the landmarks, and half as thick again. An offset is refused."""
    pytest.importorskip("vtkmodules")
    generic = load_model("R2").girdle
    corners, triangles = scapula_surface(generic)
    write_stl(tmp_path / "generic.stl", corners, triangles)
    landmarks = table_4_2(tmp_path)
    assert girdle("model", landmarks, "--out", tmp_path / "landmarks.toml").status == 0
    own = load_model(tmp_path / "landmarks.toml").girdle
    M = scapular_map(*(np.asarray(v) for v in (generic.ts_mm, generic.ai_mm, own.ts_mm, own.ai_mm)))
    surfaces = "--surface", tmp_path / "own.stl", "--generic-surface", tmp_path / "generic.stl"
    for thicker in (1.0, 1.5):
        write_stl(tmp_path / "own.stl", placed(corners, np.diag([1.0, 1.0, thicker]) @ M), triangles)
        made = girdle("model", landmarks, *surfaces, "--out", tmp_path / "surfaces.toml")
        assert made.status == 0, made.err
        found = load_model(tmp_path / "surfaces.toml")
        expected = np.diag([1.0, 1.0, thicker]) @ np.asarray(own.scapula_conoid_mm)
        assert np.linalg.norm(np.asarray(found.girdle.scapula_conoid_mm) - expected) < 3.0
        assert found.source["scapula.conoid_mm"].startswith("derived: of R2, carried by the surfaces")
    np.testing.assert_array_equal(found.girdle.clavicle_conoid_mm, own.clavicle_conoid_mm)
    write_stl(tmp_path / "own.stl", placed(corners, M) + 80.0, triangles)
    off = girdle("model", landmarks, *surfaces, "--out", tmp_path / "off.toml")
    refused(off, str(tmp_path / "own.stl"), "the landmarks of 1 are off this surface: AC", "frame and unit")
    alone = girdle("model", landmarks, "--surface", tmp_path / "own.stl", "--out", tmp_path / "off.toml")
    refused(alone, "--generic-surface", "the other none", "Give both, or none")


AI_ON_THE_LINE = {f"AI_{a}_mm": [1.6 * DISSECTION["TS"][k] - 0.6 * DISSECTION["AC"][k]] for k, a in enumerate("xyz")}
METRES = {f"{n}_{a}_mm": [DISSECTION[n][k] / 1000.0] for n in DISSECTION if n != "AC-J" for k, a in enumerate("xyz")}
LEFT_HANDED = {f"{n}_z_mm": [-DISSECTION[n][2]] for n in ("IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI")}
NO_AC = {f"AC_{a}_mm": [np.nan] for a in "xyz"}
AA = {f"AA_{a}_mm": [DISSECTION["AC"][k] + (12.0, -15.0, 30.0)[k]] for k, a in enumerate("xyz")}
NO_SC = {f"SC_{a}_mm": [np.nan] for a in "xyz"}


@pytest.mark.parametrize(
    ("changes", "options", "cause", "remedy"),
    [
        (AI_ON_THE_LINE, [], "on a line", "--rest"),
        (METRES, [], "IJ and C7 are 0.135 mm apart", "look like m"),
        (LEFT_HANDED, [], "the side is right", "left-handed"),
        (NO_AC, [], "marker 'AC' (AC) was nowhere measured", "AA does too: AC is placed from it with --aa-to-ac"),
        (NO_AC | AA, [], "AC was not measured", "place it from AA with --aa-to-ac kolz2020"),
        (NO_SC, [], "SC was not measured", "--sc-from-ij kaptein1999"),
        ({}, ["--rest", "7"], "no posture called '7'", "Name one of 1"),
        ({}, ["--sc-from-ij", "nobody"], "no offset 'nobody'", "kaptein1999"),
        ({}, ["--model", "R3"], "no parameter set", "R2"),
        ({}, ["--side", "both"], "the side is 'both'", "left or right"),
        ({}, ["--points", "nowhere.csv"], "cannot be read", "Check"),
    ],
)
def test_one_clear_message(tmp_path, changes, options, cause, remedy):
    ran = girdle("model", table_4_2(tmp_path, **changes), "--out", tmp_path / "person.toml", *options)
    assert ran.status == 2
    assert len(ran.err.strip().splitlines()) == 1
    assert cause in ran.err
    assert remedy in ran.err
    assert not (tmp_path / "person.toml").exists()


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("surface,x_mm,y_mm,z_mm\nchest,1,2,3\n", "line 2: there is no surface 'chest'"),
        ("surface,x_mm,y_mm,z_mm\nthorax,1,,3\n", "line 2: a coordinate of the point is empty"),
        ("surface,x_mm,y_mm\nthorax,1,2\n", "columns surface, x_mm, y_mm and z_mm"),
        ("surface,x_mm,y_mm,z_mm\nthorax,1,-200,3\n", "1 points on the thorax, and the ellipsoid needs 6"),
        ("surface,x_mm,y_mm,z_mm\nhumeral_head,.16,-.03,.08\n", "point of humeral_head is 0.181 mm from IJ"),
        ("surface,x_mm,y_mm,z_mm\nthorax,8,-20,9\n", "point of thorax is 23.3 mm from IJ"),
        ("surface,x_mm,y_mm,z_mm\nscapula,900,-900,90\n", "point of scapula is 1.28e+03 mm from IJ"),
        ("surface,x_mm,y_mm,z_mm,posture\nthorax,1,2,3,9\n", "no posture called '9'"),
    ],
)
def test_wrong_points(tmp_path, rows, said):
    (tmp_path / "points.csv").write_text(rows)
    ran = girdle("model", table_4_2(tmp_path), "--points", tmp_path / "points.csv", "--out", tmp_path / "p.toml")
    assert ran.status == 2
    assert said in ran.err


def test_a_landmark_named_twice(tmp_path):
    path = table_4_2(tmp_path)
    header, row = path.read_text().splitlines()
    path.write_text(f"{header},TS_x_mm\n{row},1.0\n")
    ran = girdle("model", path, "--out", tmp_path / "p.toml")
    assert ran.status == 2
    assert "column 'TS_x_mm' stands there twice" in ran.err


def test_sc_from_ij_says_so_in_the_file(tmp_path):
    ran = girdle(
        "model", table_4_2(tmp_path, **NO_SC), "--sc-from-ij", "kaptein1999", "--out", tmp_path / "person.toml"
    )
    assert ran.status == 0, ran.err
    source = load_model(tmp_path / "person.toml").source
    assert "SC from IJ by a stated offset" in source["clavicle.length_mm"]
    assert source["scapula.ts_mm"].startswith("measured")


def test_a_thorax_that_ts_or_ai_is_inside_of_is_warned_of(persons, tmp_path):
    """The landmarks of a person like R2, with a thorax 30 mm wider and deeper than R2's."""
    text = (FOLDER / "R2.toml").read_text()
    x, y, z = load_model("R2").girdle.semi_axes_mm
    line = next(line for line in text.splitlines() if line.startswith("semi_axes_mm"))
    wider = text.replace(line, f"semi_axes_mm = [{x + 30.0}, {y}, {z + 30.0}]")
    (tmp_path / "wide.toml").write_text(wider.replace('name = "R2"', 'name = "wide"'))
    landmark_table(persons, [persons.motions.subjects[0]]).to_csv(tmp_path / "one.csv", index=False)
    made = [
        girdle("model", tmp_path / "one.csv", "--model", model, "--out", tmp_path / "one.toml")
        for model in ("R2", tmp_path / "wide.toml")
    ]
    assert [one.status for one in made] == [0, 0]
    assert made[0].err == ""
    assert "inside the thorax of wide. Give points on the person's thorax" in made[1].err
    assert made[1].err.startswith(f"warning: {tmp_path / 'one.csv'}: subject '{persons.motions.subjects[0]}': at rest")
    assert float(load_model(tmp_path / "one.toml").girdle.ai_distance_mm) < -6.0


def test_the_elevation_at_rest_and_the_name_of_the_set_are_said(tmp_path):
    trial = simulated_trial(np.linspace(20.0, 120.0, 11))
    (tmp_path / "trial.trc").write_text("\n".join(trc_lines(trial.thorax_mm)) + "\n")
    ran = girdle("model", tmp_path / "trial.trc", "--out", tmp_path / "S07.toml")
    assert ran.status == 0, ran.err
    assert "1, arm at 20" in " ".join(ran.out.split())
    assert f"{tmp_path / 'S07.toml'} written; its name is trial (--subject is for files without names)\n" in ran.out
    assert "# Taken for rest: 1, arm at 20 degrees." in (tmp_path / "S07.toml").read_text()


def test_no_file_that_is_read_is_replaced(persons, tmp_path):
    """The mapping, the generic set, and a set of the same name in the folder of the results."""
    (tmp_path / "lab.toml").write_text('unit = "mm"\n')
    shutil.copy(FOLDER / "R2.toml", tmp_path / "mine.toml")
    landmarks, first = table_4_2(tmp_path), persons.motions.subjects[0]
    landmark_table(persons).to_csv(tmp_path / "three.csv", index=False)
    (tmp_path / "sets").mkdir()
    shutil.copy(FOLDER / "R2.toml", tmp_path / "sets" / f"{first}.toml")
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    for source, options, out, replaced in (
        (landmarks, ("--map", tmp_path / "lab.toml"), tmp_path / "lab.toml", "lab.toml"),
        (landmarks, ("--model", tmp_path / "mine.toml"), tmp_path / "sets" / ".." / "mine.toml", "sets/../mine.toml"),
        (
            tmp_path / "three.csv",
            ("--model", tmp_path / "sets" / f"{first}.toml"),
            tmp_path / "sets",
            f"sets/{first}.toml",
        ),
    ):
        ran = girdle("model", source, *options, "--out", out)
        refused(ran, str(tmp_path / replaced), "this command reads this file and would replace it", "Name another file")
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == files


def test_options_that_change_nothing_are_said(tmp_path):
    trial = simulated_trial(np.linspace(20.0, 120.0, 11)).thorax_mm
    (tmp_path / "trial.trc").write_text("\n".join(trc_lines(trial)) + "\n")
    (tmp_path / "still.trc").write_text("\n".join(trc_lines({name: p[:, :1] for name, p in trial.items()})) + "\n")
    (tmp_path / "lab.toml").write_text('[clusters]\nscapula = ["AMC1", "AMC2", "AMC3"]\n')
    to = "--out", tmp_path / "person.toml"
    unused = girdle("model", tmp_path / "trial.trc", "--sc-from-ij", "kaptein1999", "--aa-to-ac", "kolz2020", *to)
    assert "SC was measured, so --sc-from-ij changes nothing. Leave --sc-from-ij out" in unused.err
    assert "AC was measured, so --aa-to-ac changes nothing. Leave --aa-to-ac out" in unused.err
    clusters = girdle("model", tmp_path / "trial.trc", "--map", tmp_path / "lab.toml", *to)
    assert (
        "without --static the clusters of the mapping carry nothing (scapula). Give the static trials" in clusters.err
    )
    still = girdle("model", tmp_path / "still.trc", "--map", tmp_path / "lab.toml", *to)
    assert (unused.status, clusters.status, still.status) == (0, 0, 0)
    assert "clusters" not in still.err
    unit = girdle("model", tmp_path / "trial.trc", "--surface-unit", "m", *to)
    refused(unit, "--surface-unit", "there is no surface that could have this unit", "leave it out")


def test_two_sets_of_one_name_are_refused(folder):
    home = folder / "twice"
    home.mkdir()
    text = (folder / "few" / "first.toml").read_text()
    (home / "a.toml").write_text(text)
    (home / "b.toml").write_text(text)
    ran = girdle("fit", folder / "motions.csv", "--models-of", home, "--out", folder / "nothing")
    assert ran.status == 2
    assert "is also that of a.toml" in ran.err


def test_convert_names_a_landmark_that_slipped(folder, persons):
    first = persons.motions.subjects[0]
    table = landmark_table(persons, [first])
    along = np.array([table.loc[3, f"TS_{a}_mm"] - table.loc[3, f"AI_{a}_mm"] for a in "xyz"], float)
    for a, part in zip("xyz", 15.0 * along / np.linalg.norm(along), strict=True):
        table.loc[3, f"TS_{a}_mm"] += part
    table.to_csv(folder / "slipped.csv", index=False)
    ran = girdle("convert", folder / "slipped.csv", folder / "converted.csv")
    assert ran.status == 0, ran.err
    assert f"TS slipped: not in its place on the bone in posture 4 of {first}, slipped (column" in ran.out
    assert pd.read_csv(folder / "converted.csv")["slipped"].tolist()[3] == "TS"


def test_three_angles_leave_nothing_to_adapt_and_say_so(tmp_path):
    """Motions of R2 without noise: with three angles R2 follows the scapula exactly."""
    exact = simulate_model_subjects(load_model("R2"), None, 2, 0.0, 1, spread=0.0).motions
    angles = exact.angles_deg.copy()
    angles[exact.subject == exact.subjects[0], :3] = np.nan
    write_motions(replace(exact, angles_deg=angles), tmp_path / "motions.csv")
    ran = girdle("adapt", tmp_path / "motions.csv", "--out", tmp_path / "out")
    assert ran.status == 3
    assert f"not handled: {exact.subjects[0]}: adaptation underdetermined: no posture has more than three" in ran.err
    assert "--sc-from-ij" in ran.err
    assert " nan " not in ran.out, "a dash stands for what was not measured"
    table = pd.read_csv(tmp_path / "out" / "parameters.csv").set_index("subject")["status"]
    assert table.tolist() == ["underdetermined", "ok"]
