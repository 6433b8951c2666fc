"""Parameter sets from files of the user: their content, and the reasons for which they are refused."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles import shortest_conoid_mm

from models import load_model, model_names
from models.export.toml import parameters_toml
from models.sets.set_geometry import SHORTEST_MM
from motions.errors import InputError, InputWarning

OWN = """\
name = "own"
[thorax]
centre_mm = [0, -296.0, 78.0]
semi_axes_mm = [153.0, 404.0, 130.0]
points_mm = [[86, -20, 17], [110, -20, 94], [79, -20, 145], [114, -200, -3], [146, -200, 100], [105, -200, 167]]
[clavicle]
sc_mm = [20.3, -8.2, 12.4]
length_mm = 158
conoid_mm = [103.0, 15.0, -4.0]
[scapula]
ts_mm = [-119.0, 0.0, 0.0]
ai_mm = [-148.0, -109.0, 0.0]
conoid_mm = [-21.0, 3.0, -39.0]
[constraint]
ts_distance_mm = -2.0
ai_distance_mm = -10.5
conoid_length_mm = 18.3
"""

POINTS = OWN[OWN.index("[[") : OWN.index("]]") + 2]


def own(folder: Path, old: str = "", new: str = "", tail: str = "") -> Path:
    """Write a user's file with one change."""
    assert old in OWN
    path = folder / "own.toml"
    path.write_text(OWN.replace(old, new, 1) + tail, encoding="utf-8")
    return path


def refusal(name_or_path: str | Path) -> InputError:
    with pytest.raises(InputError) as caught:
        load_model(name_or_path)
    assert caught.value.file == str(name_or_path)
    assert caught.value.row is None
    return caught.value


def test_an_own_file_loads_by_its_path(tmp_path, monkeypatch):
    path = own(tmp_path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    bare = tmp_path / "folder" / "own"
    bare.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    for name_or_path in (path, str(path), "own.toml", "./own.toml", "folder/own", bare):
        model = load_model(name_or_path)
        assert model.name == "own"
        assert model.source == {}
        assert model.points_mm[:, 0].tolist() == [86.0, -20.0, 17.0]
        assert model.girdle.ac_mm.tolist() == [158.0, 0.0, 0.0]
        assert model.girdle.ai_mm.tolist() == [-148.0, -109.0, 0.0]
        assert float(model.girdle.ai_distance_mm) == -10.5


def test_default_bounds(tmp_path):
    lower, upper = load_model(own(tmp_path)).bounds_mm
    np.testing.assert_allclose(lower, [-396.0, 48.0, 123.0, 304.0, 100.0, 10.3])
    np.testing.assert_allclose(upper, [-196.0, 108.0, 183.0, 504.0, 160.0, 26.3])


def test_bounds_of_the_file(tmp_path):
    tail = "[bounds]\nM_z_mm = 5\nA_x_mm = 200.0\nconoid_length_mm = 20\n"
    lower, upper = load_model(own(tmp_path, tail=tail)).bounds_mm
    np.testing.assert_allclose(lower, [-396.0, 73.0, SHORTEST_MM, 304.0, 100.0, SHORTEST_MM])
    np.testing.assert_allclose(upper, [-196.0, 83.0, 353.0, 504.0, 160.0, 38.3])


def test_sources_of_an_own_file(tmp_path):
    tail = '[source]\n"clavicle.length_mm" = "MRI of the subject"\n'
    assert load_model(own(tmp_path, tail=tail)).source == {"clavicle.length_mm": "MRI of the subject"}


def test_a_conoid_that_closes_nowhere_is_legal(tmp_path):
    model = load_model(own(tmp_path, "conoid_length_mm = 18.3", "conoid_length_mm = 3.0"))
    assert shortest_conoid_mm(model.girdle) > 3.0


# ------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("name", "near"), [("r2", "R2"), ("R22", "R2"), ("breteler_MR", "breteler_mri"), ("DAS3", "das3")]
)
def test_an_unknown_name(name, near):
    error = refusal(name)
    assert error.cause == "there is no parameter set of this name"
    assert all(known in error.remedy for known in model_names())
    assert error.remedy.startswith("Did you mean ")
    assert near in error.remedy.partition("?")[0]


def test_a_name_that_resembles_none():
    assert "Did you mean" not in refusal("zzzzzz").remedy
    assert "ends in .toml" in refusal("").remedy


def test_a_file_that_is_not_there(tmp_path):
    error = refusal(tmp_path / "none.toml")
    assert "cannot be read (No such file" in error.cause
    assert "Check the path" in error.remedy
    assert "cannot be read" in refusal(tmp_path).cause
    assert "cannot be read" in refusal("a\0b.toml").cause


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"\xff\xfe\x00garbage\x9d", "not UTF-8 text"),
        (b"\x00\x01\x02", "this is not a TOML file"),
        (b"name = 'own'\nthorax = [", "this is not a TOML file"),
        (b"subject,motion\nP1,abduction\n", "at line 1"),
        (b"a = " + b"[" * 100_000, "this is not a TOML file"),
        (b"name = 1" + b"0" * 5000, "this is not a TOML file"),
    ],
)
def test_a_file_that_is_not_toml(tmp_path, content, reason):
    path = tmp_path / "own.toml"
    path.write_bytes(content)
    error = refusal(path)
    assert reason in error.cause
    assert "copy of a shipped set" in error.remedy


REFUSED = {
    "an empty file": (OWN, "", "the key name is missing", "Add name = text in quotes as the first line"),
    "a missing number": (
        "length_mm = 158\n",
        "",
        "the key clavicle.length_mm is missing",
        "Add length_mm = one number under [clavicle]",
    ),
    "a missing section": (
        OWN[OWN.index("[constraint]") :],
        "",
        "the key constraint.ts_distance_mm is missing",
        "under [constraint]",
    ),
    "a misspelt key": (
        "centre_mm",
        "center_mm",
        "the key 'center_mm' in [thorax] is unknown",
        "Did you mean centre_mm?",
    ),
    "a misspelt section": (
        "[scapula]",
        "[scapulae]",
        "the key 'scapulae' is unknown",
        "Did you mean scapula?",
    ),
    "no section": (
        "[thorax]",
        "bounds = 3\n[thorax]",
        "bounds is 3 and must be a section",
        "Write [bounds]",
    ),
    "two coordinates": (
        "[20.3, -8.2, 12.4]",
        "[20.3, -8.2]",
        "clavicle.sc_mm is [20.3, -8.2]",
        "three numbers",
    ),
    "a number for a vector": (
        "[20.3, -8.2, 12.4]",
        "20.3",
        "clavicle.sc_mm is 20.3 and must be three",
        "[x, y, z]",
    ),
    "text for a number": (
        "= 158",
        '= "158"',
        "clavicle.length_mm is '158' and must be one number",
        "without quotes",
    ),
    "true for a number": ("= 158", "= true", "clavicle.length_mm is True", "one number"),
    "a vector for a number": ("= 158", "= [158, 0, 0]", "clavicle.length_mm is [158, 0, 0]", "one number"),
    "a point of two": ("[105, -200, 167]]", "[105, -200]]", "thorax.points_mm is [[86, -20, 17]", "a list of points"),
    "nan": (
        "= 158",
        "= nan",
        "clavicle.length_mm holds a number that is not finite (nan)",
        "Give every number",
    ),
    "infinite": ("12.4]", "-inf]", "clavicle.sc_mm holds a number that is not finite", "Give every number"),
    "beyond a float": (
        "= 158",
        "= 1" + "0" * 400,
        "clavicle.length_mm holds a number that is not",
        "Give every",
    ),
    "a semi-axis of 0": (
        "404.0",
        "0.0",
        "thorax.semi_axes_mm is 0 and must be at least 1 mm",
        "positive numbers",
    ),
    "a negative length": ("= 158", "= -158", "clavicle.length_mm is -158 and must be", "positive numbers"),
    "no conoid": ("= 18.3", "= 0", "constraint.conoid_length_mm is 0 and must be", "positive numbers"),
    "metres": (
        "[153.0, 404.0, 130.0]",
        "[0.153, 0.404, 0.13]",
        "semi_axes_mm is 0.404 mm",
        "metres times 1000",
    ),
    "centimetres": (
        "[153.0, 404.0, 130.0]",
        "[15.3, 40.4, 13.0]",
        "is 40.4 mm, less than of any",
        "centimetres times 10",
    ),
    "the centre in cm": (
        "[0, -296.0, 78.0]",
        "[0, -29.6, 7.8]",
        "thorax.centre_mm is 30.61 mm from IJ, which then lies deep inside",
        "centimetres times 10",
    ),
    "a clavicle in cm": (
        "= 158",
        "= 15.8",
        "clavicle.length_mm is 15.8 mm, less than in any person",
        "It looks like centimetres. Give it in mm: between 30 and 250",
    ),
    "a scapula in metres": (
        "[-148.0, -109.0, 0.0]",
        "[-0.148, -0.109, 0.0]",
        "scapula.ai_mm is 0.1838 mm, less than in any person",
        "It looks like metres. Give it in mm: between 30 and 370",
    ),
    "a clavicle of a giant": ("= 158", "= 1580.0", "clavicle.length_mm is 1580 mm, more than", "tenths of a"),
    "a thorax of a giant": ("404.0", "4040.0", "thorax.semi_axes_mm is 4040 mm, more than", "tenths of a"),
    "an attachment far off": (
        "[-21.0, 3.0, -39.0]",
        "[-1.0, 0.0, 0.0]",
        "scapula.conoid_mm is 1 mm, less than",
        "Give it in mm: between 8 and 120",
    ),
    "a scapula off the thorax": ("= -2.0", "= 414.5", "constraint.ts_distance_mm is 414.5 mm, more than", "75 and 150"),
    "M_x": (
        "[0, -296.0",
        "[0.5, -296.0",
        "thorax.centre_mm starts with 0.5",
        "centre_mm must start with 0.0",
    ),
    "five points": (", [105, -200, 167]]", "]", "thorax.points_mm has 5 points", "Give 6 or more"),
    "no points": (
        POINTS,
        "[]",
        "thorax.points_mm has 0 points",
        "Give 6",
    ),
    "a scapula on a line": (
        "[-148.0, -109.0, 0.0]",
        "[-238.0, 0.0, 0.0]",
        "lie on a line",
        "scapula frame, from AC",
    ),
    "a scapula at a point": (
        "[-119.0, 0.0, 0.0]",
        "[0.0, 0.0, 0.0]",
        "lie on a line",
        "scapula frame, from AC",
    ),
    "whole axes": ("[153.0, 404.0, 130.0]", "[306.0, 808.0, 260.0]", "starts with 306 mm: no thorax", "half of the"),
    "TS lateral of AC": ("[-119.0, 0.0, 0.0]", "[119.0, 0.0, 0.0]", "ts_mm has x = 119, but TS is medial", "frames.md"),
    "AI above AC": ("[-148.0, -109.0, 0.0]", "[-148.0, 109.0, 0.0]", "ai_mm has y = 109, but AI is below", "frames.md"),
    "z forward": ("[0, -296.0, 78.0]", "[0, -296.0, -78.0]", "centre_mm has z = -78, but the thorax is", "frames.md"),
    "TS behind its axis": (
        "[-119.0, 0.0, 0.0]",
        "[-119.0, 0.0, 40.0]",
        "scapula.ts_mm has z = 40, but TS is on the x axis of the scapula frame",
        "frames.md",
    ),
    "TS above its axis": ("[-119.0, 0.0, 0.0]", "[-119.0, 40.0, 0.0]", "ts_mm has y = 40, but TS is on", "frames.md"),
    "AI out of its plane": (
        "[-148.0, -109.0, 0.0]",
        "[-148.0, -109.0, 60.0]",
        "scapula.ai_mm has z = 60, but AI has z = 0 in the scapula frame",
        "frames.md",
    ),
    "a conoid lateral of AC": (
        "[-21.0, 3.0, -39.0]",
        "[21.0, 3.0, -39.0]",
        "scapula.conoid_mm has x = 21, but the conoid is medial of AC",
        "frames.md",
    ),
    "a conoid behind the scapula": (
        "[-21.0, 3.0, -39.0]",
        "[-21.0, 3.0, 39.0]",
        "scapula.conoid_mm has z = 39, but the conoid is in front of the plane of AC, TS and AI",
        "frames.md",
    ),
    "a conoid medial of SC": (
        "[103.0, 15.0, -4.0]",
        "[-103.0, 15.0, -4.0]",
        "clavicle.conoid_mm has x = -103, not between SC at 0 and AC at 158",
        "clavicle frame, from SC",
    ),
    "a conoid beyond AC": ("[103.0, 15.0, -4.0]", "[203.0, 15.0, -4.0]", "has x = 203, not between SC", "from SC"),
    "a thorax above IJ": (
        "[0, -296.0, 78.0]",
        "[0, 296.0, 78.0]",
        "thorax.centre_mm has y = 296, but the middle of the thorax is below IJ",
        "frames.md",
    ),
    "a conoid in cm": (
        "= 18.3",
        "= 1.83",
        "constraint.conoid_length_mm is 1.83 mm, less than in any person",
        "It looks like centimetres. Give it in mm: between 3 and 90",
    ),
    "a scapula deep in the thorax": (
        "= -2.0",
        "= -100.0",
        "constraint.ts_distance_mm is -100 mm, less than in any person",
        "Give it in mm: between -75 and 150",
    ),
    "points in cm": (
        POINTS,
        f"{[[x / 10 for x in point] for point in json.loads(POINTS)]}",
        "of thorax.points_mm the farthest, number 6, is 28.09 mm from IJ",
        "It looks like centimetres. Give points in mm: the farthest is 60 to 1000 away",
    ),
    "points in m": (
        POINTS,
        f"{[[x / 1000 for x in point] for point in json.loads(POINTS)]}",
        "is 0.2809 mm from IJ",
        "It looks like metres",
    ),
    "points in tenths": (
        POINTS,
        f"{[[x * 10 for x in point] for point in json.loads(POINTS)]}",
        "is 2809 mm from IJ",
        "It looks like tenths",
    ),
    "a point far away": (
        "[[86, -20",
        "[[9999, -20",
        "the farthest, number 1, is 9999 mm from IJ",
        "Give points in mm: the farthest is 60",
    ),
    "one point six times": (
        POINTS,
        f"{6 * [[86, -20, 17]]}",
        "points_mm lie on a line, and no ellipsoid is closest",
        "all over the right side",
    ),
    "points on a line": (
        POINTS,
        f"{[[80 + k, -20 * k, 0] for k in range(6)]}",
        "thorax.points_mm lie on a line",
        "all over the right side",
    ),
    "points on a plane": (
        POINTS,
        f"{[[80 + k * k, -100, 20 * k] for k in range(6)]}",
        "thorax.points_mm lie on a plane",
        "all over the right side",
    ),
    "no name": ('"own"', '" "', "name is ' ' and must be text", 'Write name = "..."'),
    "a number as the name": ('"own"', "2", "name is 2 and must be text", 'Write name = "..."'),
}


@pytest.mark.parametrize(("old", "new", "cause", "remedy"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused(tmp_path, old, new, cause, remedy):
    error = refusal(own(tmp_path, old, new))
    assert cause in error.cause
    assert remedy in error.remedy


WARNED = {
    "SC of the other side": (
        "[20.3, -8.2, 12.4]",
        "[-20.3, -8.2, 12.4]",
        "clavicle.sc_mm has x = -20.3, but SC is to the right of IJ. Give a right shoulder in the frames",
    ),
    "SC high above IJ": ("[20.3, -8.2, 12.4]", "[20.3, 55.0, 12.4]", "sc_mm has y = 55, but SC is beside IJ or below"),
    "AI lateral of AC": ("[-148.0, -109.0, 0.0]", "[148.0, -109.0, 0.0]", "ai_mm has x = 148, but AI is medial of AC"),
    "a conoid above AC": ("[-21.0, 3.0, -39.0]", "[-21.0, 13.0, -39.0]", "has y = 13, but the conoid is below AC"),
    "y and z of the axes exchanged": (
        "[153.0, 404.0, 130.0]",
        "[153.0, 130.0, 404.0]",
        "thorax.semi_axes_mm says 404 mm deep and 153 wide: no thorax is so deep. Give the semi-axes to the side",
    ),
    "a whole axis backward": ("404.0, 130.0]", "404.0, 260.0]", "says 260 mm deep and 153 wide: no thorax is so deep"),
    "z of the points turned round": (
        POINTS,
        f"{[[x, y, -z] for x, y, z in json.loads(POINTS)]}",
        "thorax.points_mm are 97 mm (root mean square) off the ellipsoid of centre_mm and semi_axes_mm",
    ),
    "y and z of the points exchanged": (
        POINTS,
        f"{[[x, z, y] for x, y, z in json.loads(POINTS)]}",
        "mm (root mean square) off the ellipsoid",
    ),
    "a long conoid": (
        "= 18.3",
        "= 80.0",
        "constraint.conoid_length_mm is 80, and at rest the two points conoid_mm are",
    ),
    "attachments far apart": ("[-21.0, 3.0, -39.0]", "[-91.0, 3.0, -39.0]", "mm apart. Check the length, and both"),
    "a range in cm": (
        "= 18.3\n",
        "= 18.3\n[source]\n'clavicle.length_mm' = 'measured: MRI; +- 1.2 cm'\n",
        "the range at the end of the source of clavicle.length_mm cannot be read (+- 1.2 cm), so the number has none",
    ),
}


@pytest.mark.parametrize(("old", "new", "said"), WARNED.values(), ids=WARNED.keys())
def test_what_is_improbable_is_warned_of(tmp_path, old, new, said):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        load_model(own(tmp_path, old, new))
    assert any(said in str(one.message) for one in caught)


def test_what_an_adaptation_has_moved_may_lie_farther_off(tmp_path):
    deep = "404.0, 130.0]", "404.0, 190.0]"
    said = "assumed: of R2_S01, not of the person (adapted to S01, from R2 (w = 10))"
    load_model(own(tmp_path, *deep, tail=f'[source]\n"thorax.semi_axes_mm" = "{said}"\n'))
    far = "sc_mm = [20.3, -8.2, 12.4]", "sc_mm = [-25.0, -8.2, 12.4]"
    load_model(own(tmp_path, *far, tail='[source]\n"clavicle.sc_mm" = "adapted to S01, from R2 (w = 10, own bones)"\n'))


@pytest.mark.parametrize(
    ("tail", "cause", "remedy"),
    [
        ("[bounds]\nM_y = 3\n", "the key 'M_y' in [bounds] is unknown", "Did you mean M_y_mm?"),
        ("[bounds]\nM_y_mm = 0\n", "bounds.M_y_mm is 0 and must be above 0", "how far the parameter may go"),
        ("[bounds]\nA_z_mm = '3'\n", "bounds.A_z_mm is '3' and must be one number", "without quotes"),
        ("[bounds]\nA_z_mm = nan\n", "bounds.A_z_mm holds a number that is not finite", "Give every number"),
        ("[source]\n'clavicle.length' = 'x'\n", "is unknown", "Did you mean clavicle.length_mm?"),
        (
            "[source]\nclavicle.length_mm = 'x'\n",
            "the key 'clavicle' in [source] is unknown",
            '"clavicle.length_mm"',
        ),
        (
            "[source]\n'clavicle.length_mm' = 3\n",
            "the source of clavicle.length_mm is 3",
            "where the number comes",
        ),
    ],
)
def test_what_is_refused_of_the_optional_sections(tmp_path, tail, cause, remedy):
    error = refusal(own(tmp_path, tail=tail))
    assert cause in error.cause
    assert remedy in error.remedy


def test_a_joint_off_the_axis_of_the_clavicle(tmp_path):
    """Check AC in the measured frame, as of a person with own bones."""
    lengthy = "length_mm = 158.0253\nac_mm = [157.9, 4.0, -5.0]"
    girdle = load_model(own(tmp_path, "length_mm = 158", lengthy)).girdle
    np.testing.assert_array_equal(girdle.ac_mm, [157.9, 4.0, -5.0])
    np.testing.assert_array_equal(load_model(own(tmp_path)).girdle.ac_mm, [158.0, 0.0, 0.0])


def test_an_adapted_girdle_is_read_back_as_it_was_written(tmp_path):
    given = load_model(own(tmp_path))
    girdle = replace(given.girdle, ac_mm=np.array([157.9, 4.0, -5.0]), sc_mm=np.array([0.1, 1 / 3, -7.0]))
    path = tmp_path / "adapted.toml"
    path.write_text(parameters_toml("adapted", "", girdle, given.points_mm, {"clavicle.ac_mm": "adapted"}))
    again = load_model(path)
    np.testing.assert_array_equal(again.girdle.numbers_mm, girdle.numbers_mm)
    assert again.source == {"clavicle.ac_mm": "adapted"}


def test_a_bone_that_was_adapted_may_be_as_small_as_nobodys(tmp_path):
    of_nobody = "length_mm = 158\nconoid_mm = [103.0, 15.0, -4.0]", "length_mm = 15.8\nconoid_mm = [10.3, 1.5, -0.4]"
    keys = "clavicle.length_mm", "clavicle.conoid_mm"
    tail = "[source]\n" + "".join(f'"{key}" = "adapted to S01, from R2 (w = 10)"\n' for key in keys)
    assert load_model(own(tmp_path, *of_nobody, tail=tail)).girdle.ac_mm[0] == 15.8
    assert "less than in any person" in refusal(own(tmp_path, *of_nobody)).cause


def test_a_joint_that_is_not_where_the_clavicle_ends_is_refused(tmp_path):
    error = refusal(own(tmp_path, "length_mm = 158", "length_mm = 158\nac_mm = [150.0, 4.0, -5.0]"))
    assert "clavicle.length_mm is 158, and clavicle.ac_mm another length from SC" in error.cause
    assert "leave it out" in error.remedy
