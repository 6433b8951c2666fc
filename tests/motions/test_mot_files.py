"""Angles in OpenSim files: there and back, units, names of columns, and the traps."""

from dataclasses import replace

import numpy as np
import pytest
from lab_files import ELEVATIONS, EXACT, LABELS, refused
from laboratory import simulated_trial
from scipy.spatial.transform import Rotation

from models.export.opensim import SCAPULA_COORDINATES
from motions import ANGLES, InputError, read_motions
from motions.errors import InputWarning
from motions.formats.angle_table import motions_from_table, table_from_motions
from motions.formats.any_file import read_any
from motions.formats.mot import read_mot, write_mot
from motions.landmarks.acromion import KOLZ
from motions.landmarks.estimated_landmarks import KAPTEIN, KAPTEIN_GH
from motions.landmarks.mapping import Mapping, read_mapping
from motions.landmarks.sampled_postures import ESTIMATED, Labels
from motions.rhythm_subjects import DATA_FILE


@pytest.mark.parametrize("isb", [False, True])
def test_angles_through_mot_and_back(tmp_path, isb):
    one = read_motions(DATA_FILE)
    one = one.select((one.subject == "simulated03") & (one.motion == "abduction"))
    one.angles_deg[2, 2] = np.nan
    one.extra[ESTIMATED] = "yes"
    path = tmp_path / "a.mot"
    write_mot(table_from_motions(one, isb, "a.mot"), path)
    again = read_any(path, Mapping(), Labels("", ""))
    np.testing.assert_allclose(again.angles_deg, one.angles_deg, rtol=0.0, atol=EXACT)
    np.testing.assert_array_equal(again.humerus_elevation_deg, one.humerus_elevation_deg)
    assert (again.subject == one.subject).all()
    assert (again.motion == one.motion).all()
    np.testing.assert_array_equal(again.posture, one.posture)
    assert set(again.extra["origin"]) == {"simulated"}
    assert set(again.extra[ESTIMATED]) == {"yes"}


def mot(folder, lines, name="trial.mot"):
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


ROWS = ["time st_y st_z st_x", "0.0 30 10 -10", "0.5 31 11 -9", "1.0 nan nan nan"]


def test_a_laboratorys_own_mot_file(tmp_path):
    names = {"scapula_y": "st_y", "scapula_z": "st_z", "scapula_x": "st_x"}
    path = mot(tmp_path, ["Coordinates", "datarows 3", "datacolumns 4", "inDegrees=yes", "endheader", *ROWS])
    with pytest.warns(InputWarning, match=r"no column of clavicle \(clavicle_y, .*\); humerus \(humerus_elevation\)"):
        motions = read_any(path, Mapping(columns=names), LABELS)
    np.testing.assert_array_equal(motions.angles_deg[:, 3:], [[30, 10, -10], [31, 11, -9]])
    assert np.isnan(motions.angles_deg[:, :3]).all()
    assert motions.posture.tolist() == [1, 2]
    refused(path, "none of the columns clavicle_y", "the file has time, st_y, st_z, st_x")
    path = mot(tmp_path, ["Coordinates", "inDegrees=no", "endheader", ROWS[0], "0 0.5 0.1 0.2"])
    with pytest.warns(InputWarning, match="no column of clavicle"):
        radians = read_any(path, Mapping(columns=names), LABELS)
    np.testing.assert_allclose(radians.angles_deg[0, 3:], np.degrees([0.5, 0.1, 0.2]), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize(
    ("lines", "cause", "remedy"),
    [
        (["name", "nRows=3", *ROWS], "there is no line endheader", "OpenSim"),
        (["name", "endheader", *ROWS], "does not say whether angles are in degrees", "inDegrees=yes"),
        (["name", "inDegrees=yes", "nRows=7", "endheader", *ROWS], "nrows=7 but the file has 3", "nrows=3"),
        (["name", "inDegrees=yes", "nColumns=9", "endheader", *ROWS], "ncolumns=9 but the file has 4", "ncolumns=4"),
        (["name", "inDegrees=yes", "endheader", *ROWS, "2.0 1 2"], "3 cells where there are 4", "nan"),
        (["name", "inDegrees=yes", "endheader", "time a a", "0 1 2"], "'a' stands there twice", "Rename"),
        (["name", "inDegrees=yes", "endheader", "time a b", "0 1 x"], "'x' is not a number", "decimal"),
        (["name", "inDegrees=yes", "endheader", "time a b", "0 1 1_0"], "'1_0' is not a number", "decimal"),
        (["name", "inDegrees=yes", "endheader", "time a b", "0 1 inf"], "'inf' is infinite", "Empty"),
        (["name", "inDegrees=yes", "endheader"], "no rows under endheader", "columns"),
    ],
)
def test_the_traps_of_a_mot_file(tmp_path, lines, cause, remedy):
    with pytest.raises(InputError, match=cause) as caught:
        read_mot(mot(tmp_path, lines))
    assert remedy in caught.value.remedy


def test_isb_angles_are_through_aa_unless_the_file_says_ac(tmp_path):
    head = ["name", "inDegrees=yes", "endheader", "time scapula_alpha scapula_beta scapula_gamma"]
    path = mot(tmp_path, [*head, "0 30 -10 -5"])
    refused(path, "ISB's scapula frame goes through AA", "scapula_through=AC")
    with pytest.warns(InputWarning, match="no column of clavicle"):
        motions = read_any(path, Mapping(), Labels("P", "m", aa_to_ac=KOLZ, aa_to_ac_name="kolz2020"))
    assert motions.angles_deg[0, 3] > 35.0
    path = mot(tmp_path, [head[0], "scapula_through=AC", *head[1:], "0 30 -10 -5"])
    with pytest.warns(InputWarning, match="no column of clavicle"):
        through_ac = read_any(path, Mapping(), LABELS)
    np.testing.assert_array_equal(through_ac.angles_deg[0, 3:], [30, 10, -5])


def test_fewer_than_three_angles_in_every_row(tmp_path):
    """Regression test for a fault found by fuzzing."""
    path = mot(tmp_path, ["name", "inDegrees=yes", "endheader", "time clavicle_y clavicle_z other", "0 -30 10 5"])
    refused(path, "no posture has 3 angles; of columns there are clavicle_y, clavicle_z", "it has time, clavicle_y")


def angles_as(folder, names, unit="yes", factor=1.0, name="trial.sto"):
    """Write nine postures of the trial as an OpenSim file with other column names."""
    trial = simulated_trial(ELEVATIONS)
    columns = np.column_stack([np.arange(9.0), factor * trial.elevation_deg, factor * trial.angles_deg])
    rows = [" ".join(map(repr, map(float, row))) for row in columns]
    return trial, mot(folder, ["states", f"inDegrees={unit}", "endheader", " ".join(["time", *names]), *rows], name)


def test_the_unit_of_angles_is_checked_by_their_values(tmp_path):
    names = ["humerus_elevation", *ANGLES]
    _, path = angles_as(tmp_path, names, "no")
    assert refused(path, r"says radians \(inDegrees=no\), but humerus_elevation goes to 125", "inDegrees=yes").row == 2
    trial, path = angles_as(tmp_path, names, "yes", np.pi / 180.0)
    assert refused(path, r"says degrees \(inDegrees=yes\), but clavicle_y never exceeds 1.04", "inDegrees=no").row == 2
    _, path = angles_as(tmp_path, names, "no", np.pi / 180.0)
    np.testing.assert_allclose(read_any(path, Mapping(), LABELS).angles_deg, trial.angles_deg, rtol=0.0, atol=EXACT)


def test_angles_by_a_turn_are_the_same(tmp_path):
    trial, path = angles_as(tmp_path, ["humerus_elevation", *ANGLES])
    table = read_mot(path)
    for turned in (lambda x: x % 360.0, lambda x: x + 360.0, lambda x: x - 360.0):
        columns = {name: turned(x) if name in ANGLES else x for name, x in table.columns.items()}
        found = motions_from_table(replace(table, columns=columns), Mapping(), LABELS)
        np.testing.assert_allclose(found.angles_deg, trial.angles_deg, rtol=0.0, atol=EXACT)
    tenths = {name: 30.0 * x if name in ANGLES else x for name, x in table.columns.items()}
    with pytest.raises(InputError, match=r"an angle is .* degrees\. Give angles in degrees between -180 and 180"):
        motions_from_table(replace(table, columns=tenths), Mapping(), LABELS)
    high = table.columns | {"humerus_elevation": 3.0 * table.columns["humerus_elevation"]}
    with pytest.raises(InputError, match="humerus_elevation is 375, more than 180 degrees"):
        motions_from_table(replace(table, columns=high), Mapping(), LABELS)


def test_options_of_landmarks_change_nothing_of_angles(tmp_path):
    _, path = angles_as(tmp_path, ["humerus_elevation", *ANGLES])
    asked = Labels("P", "m", aa_to_ac=KOLZ, sc_from_ij=KAPTEIN, gh_from_ac=KAPTEIN_GH, clavicle_z="global")
    with pytest.warns(InputWarning, match="through AC, so --aa-to-ac, --sc-from-ij, --gh-from-ac, --clavicle-z"):
        read_any(path, Mapping(), asked)
    with pytest.warns(InputWarning, match="as they are, so --sc-from-ij changes nothing. Leave it out"):
        read_any(DATA_FILE, Mapping(), Labels("", "", sc_from_ij=KAPTEIN))
    of_landmarks = Mapping(
        unit="m", axes=("x", "z", "-y"), markers={"IJ": "jug"}, clusters={"scapula": ("a", "b", "c")}
    )
    with pytest.warns(InputWarning, match=r"so unit, axes, \[markers\], \[clusters\] changes nothing. Leave it out"):
        read_any(path, of_landmarks, LABELS)
    read_any(path, replace(of_landmarks, columns={"scapula_y": "scapula_y"}), LABELS)  # of both kinds of file


def test_one_row_in_radians_is_enough_where_both_bones_are_there(tmp_path):
    _, path = angles_as(tmp_path, ["humerus_elevation", *ANGLES], "yes", np.pi / 180.0)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:5], ""]))
    assert refused(path, "clavicle_y never exceeds 0.*: radians", "inDegrees=no").row == 2


def test_angles_in_two_units_are_named_both(tmp_path):
    """Neither value of inDegrees would be right."""
    trial = simulated_trial(ELEVATIONS)
    names = ["humerus_elevation", *ANGLES]
    head = ["states", "inDegrees=no", "endheader", " ".join(["time", *names])]
    for unit in ("no", "yes"):
        head[1] = f"inDegrees={unit}"
        rows = [
            f"0 {e} " + " ".join(map(str, np.radians(a)))
            for e, a in zip(trial.elevation_deg, trial.angles_deg, strict=True)
        ]
        cause = "humerus_elevation goes to 125: degrees; clavicle_y never exceeds 1.04: radians"
        assert refused(mot(tmp_path, [*head, *rows]), cause, "one unit").row == 2
    rows = [
        f"0 {np.radians(e)} " + " ".join(map(str, a))
        for e, a in zip(trial.elevation_deg, trial.angles_deg, strict=True)
    ]
    refused(mot(tmp_path, [*head, *rows]), "degrees; humerus_elevation never exceeds 2.18: radians", "one unit")


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), ("\t", ",")])
def test_a_spreadsheets_mot_with_names_of_a_motion_file(tmp_path, separator, decimal):
    trial = simulated_trial(ELEVATIONS)
    names = ["time", "humerus_elevation_deg", *(f"{angle}_deg" for angle in ANGLES)]
    rows = [[0.0, e, *a] for e, a in zip(trial.elevation_deg, trial.angles_deg, strict=True)]
    lines = [
        separator.join(names),
        *(separator.join(repr(float(x)).replace(".", decimal) for x in row) for row in rows),
    ]
    motions = read_any(mot(tmp_path, ["t", "nColumns=8", "inDegrees=yes", "endheader", *lines]), Mapping(), LABELS)
    np.testing.assert_array_equal(motions.angles_deg, trial.angles_deg)


def test_names_of_opensims_states_are_those_of_its_coordinates(tmp_path):
    """``.osim`` files of this project have these coordinates; OpenSim's scapulothoracic joint has others, which are
    named."""
    clavicle = [f"/jointset/sternoclavicular/{name}/value" for name in ANGLES[:3]]
    trial, path = angles_as(tmp_path, ["humerus_elevation", *clavicle, *ANGLES[3:]], "no", np.pi / 180.0)
    np.testing.assert_allclose(read_any(path, Mapping(), LABELS).angles_deg, trial.angles_deg, rtol=0.0, atol=EXACT)
    joint = [f"/jointset/scapulothoracic/{name}/value" for name in SCAPULA_COORDINATES[:3]]
    _, path = angles_as(tmp_path, ["humerus_elevation", *clavicle, *joint], "no", np.pi / 180.0)
    with pytest.warns(InputWarning, match="no column of scapula .*scapulothoracic joint are no angles of a bone"):
        found = read_any(path, Mapping(), LABELS)
    np.testing.assert_allclose(found.angles_deg[:, :3], trial.angles_deg[:, :3], rtol=0.0, atol=EXACT)
    assert np.isnan(found.angles_deg[:, 3:]).all()


def test_angles_of_the_ac_joint_are_asked_about(tmp_path):
    """As in DAS3, the scapula is relative to the clavicle. Expected by scipy: R_thorax_scapula = R_clavicle R_joint."""
    trial, _ = angles_as(tmp_path, ["humerus_elevation", *ANGLES])
    clavicle, scapula = (
        Rotation.from_euler("YZX", part, degrees=True) for part in np.split(trial.angles_deg, 2, axis=1)
    )
    joint = (clavicle.inv() * scapula).as_euler("YZX", degrees=True)
    rows = np.column_stack([np.arange(9.0), trial.elevation_deg, trial.angles_deg[:, :3], joint])
    names = ["time", "humerus_elevation", "SC_y", "SC_z", "SC_x", "AC_y", "AC_z", "AC_x"]
    lines = [" ".join(map(repr, map(float, row))) for row in rows]
    path = mot(tmp_path, ["das3", "inDegrees=yes", "endheader", " ".join(names), *lines])
    refused(path, "none of the columns clavicle_y", 'scapula_relative_to = "clavicle"')
    columns = {str(angle): name for angle, name in zip(ANGLES, names[2:], strict=True)}
    refused(path, "AC_y looks like an angle of the AC joint", "relative_to", Mapping(columns=columns))
    found = read_any(path, Mapping(columns=columns, scapula_relative_to="clavicle"), LABELS)
    np.testing.assert_allclose(found.angles_deg, trial.angles_deg, rtol=0.0, atol=EXACT)
    as_said = read_any(path, Mapping(columns=columns, scapula_relative_to="thorax"), LABELS)
    np.testing.assert_allclose(as_said.angles_deg[:, 3:], joint, rtol=0.0, atol=EXACT)
    (tmp_path / "map.toml").write_text('scapula_relative_to = "floor"')
    with pytest.raises(InputError, match=r"scapula_relative_to is 'floor'.*thorax, clavicle"):
        read_mapping(tmp_path / "map.toml")
