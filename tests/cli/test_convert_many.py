"""``girdle convert`` on many files at once: a folder, a mapping that it writes, static trials beside moving ones."""

import numpy as np
import pytest
from capture_tables import text, vicon
from command import girdle, refused
from laboratory import in_laboratory, simulated_trial, trc_lines

from motions import read_motions
from motions.formats.angle_table import table_from_motions
from motions.formats.mot import write_mot
from motions.landmarks.clusters.carried_columns import HUMERUS_PLACED, SCAPULA_FROM

pytestmark = pytest.mark.filterwarnings("ignore:.*(all angles of|same angles|are the same):motions.errors.InputWarning")
"""The trials here are copies of one, for which reading warns."""

ELEVATIONS = np.linspace(5.0, 125.0, 9)
PLACE_MM = np.array([300.0, -500.0, 1200.0])
AMC_MM = {"AMC1": (-10.0, 8.0, 5.0), "AMC2": (20.0, 12.0, -9.0), "AMC3": (5.0, 30.0, 12.0)}
"""Markers of the acromion, from AC in the axes of the thorax: trials with them have a single posture."""


@pytest.fixture(scope="module")
def trial():
    return simulated_trial(ELEVATIONS)


@pytest.fixture(scope="module")
def lab(trial):
    return in_laboratory(trial.thorax_mm, np.eye(3), PLACE_MM)


def trc(path, lab):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(trc_lines(lab)) + "\n")
    return path


def pairs(path):
    motions = read_motions(path)
    return list(dict.fromkeys(zip(motions.subject.tolist(), motions.motion.tolist(), strict=True)))


def test_a_folder_with_one_for_each_person(trial, lab, tmp_path):
    """Files of several kinds become one table; a second run does not read the table that the first one wrote."""
    trc(tmp_path / "P01" / "abduction.trc", lab)
    trc(tmp_path / "P01" / "flexion.trc", lab)
    (tmp_path / "P02").mkdir()
    (tmp_path / "P02" / "abduction.csv").write_text(text(vicon(lab, subject="P02:"), ";", ","))
    (tmp_path / "P02" / "notes.txt").write_text("a good day")
    (tmp_path / "P02" / ".hidden.trc").write_text("")
    out = tmp_path / "all.csv"
    for _ in range(2):
        ended = girdle("convert", tmp_path, out)
        assert (ended.status, ended.err) == (0, "")
        assert "27 postures of 2 subjects" in ended.out
        assert pairs(out) == [("P01", "abduction"), ("P01", "flexion"), ("P02", "abduction")]
    angles = read_motions(out).angles_deg
    np.testing.assert_allclose(np.delete(angles - np.tile(trial.angles_deg, (3, 1)), 2, axis=1), 0.0, atol=1e-9)


def test_files_by_name(lab, tmp_path):
    one, two = (trc(tmp_path / f"{name}.trc", lab) for name in ("abduction", "flexion"))
    out = tmp_path / "out.csv"
    ended = girdle("convert", one, two, out)
    assert "Each file is a subject of its own; --subject" in ended.out
    assert pairs(out) == [("abduction", "abduction"), ("flexion", "flexion")]
    ended = girdle("convert", one, two, out, "--subject", "P01")
    assert "subject of its own" not in ended.out
    assert pairs(out) == [("P01", "abduction"), ("P01", "flexion")]
    other = trc(tmp_path / "P09" / "abduction.trc", lab)
    girdle("convert", one, other, out)
    assert pairs(out) == [(tmp_path.name, "abduction"), ("P09", "abduction")]


def test_a_file_that_cannot_be_read_is_left_out_and_named(lab, tmp_path):
    trc(tmp_path / "a.trc", lab)
    (tmp_path / "b.trc").write_text("nothing")
    ended = girdle("convert", tmp_path, tmp_path / "out.csv", "--subject", "P01")
    assert ended.status == 3
    assert [line for line in ended.messages if "b.trc: this is not a .trc file" in line]
    assert pairs(tmp_path / "out.csv") == [("P01", "a")]


def test_the_same_motion_in_two_files_counts_once(lab, tmp_path):
    trc(tmp_path / "a.trc", lab)
    (tmp_path / "a.csv").write_text(text(vicon(lab)))
    ended = girdle("convert", tmp_path, tmp_path / "out.csv")
    assert ended.status == 3
    assert "motion 'a' of 'a' is that of" in ended.err
    assert "Give the files different names" in ended.err
    assert len(read_motions(tmp_path / "out.csv").posture) == len(ELEVATIONS)


@pytest.mark.parametrize("ending", ["csv", "mot"])
def test_a_file_of_the_laboratory_is_never_replaced(lab, tmp_path, ending):
    """Without a name to write to, a file of the user is not replaced; a file that this command wrote is."""
    (tmp_path / "a.csv").write_text(text(vicon(lab)))
    last = tmp_path / f"b.{ending}"
    content = text(vicon(lab)) if ending == "csv" else "ik\ninDegrees=yes\nendheader\ntime x\n0 1\n"
    last.write_text(content)
    refused(girdle("convert", tmp_path / "a.csv", last), str(last), "is there and no motion file", "to write to last")
    assert last.read_text() == content
    last.unlink()
    for _ in range(2):
        assert girdle("convert", tmp_path / "a.csv", last, "--subject", "P01").status == 0


def test_what_many_files_lack_is_said(tmp_path):
    refused(
        girdle("convert", tmp_path, tmp_path / "o.csv"),
        str(tmp_path),
        "there are no files that end in",
        "folder of trials",
    )
    refused(girdle("convert", tmp_path / "o.csv"), str(tmp_path / "o.csv"), "no name to write to", "IN and OUT")


def test_the_mapping_that_is_written_is_read(lab, tmp_path):
    """The mapping has the names found, and the others as comments with the nearest; it fits another person's file."""
    names = {"SC": "SCJ", "GH": "glenoid centre"}
    renamed = {f"P01:{names.get(name, name)}": xyz for name, xyz in lab.items() if name != "AA"}
    source = trc(tmp_path / "P01.trc", renamed)
    ended = girdle("convert", source, "--write-map", tmp_path / "lab.toml")
    assert ended.status == 0
    assert "9 names found. Edit it" in ended.out
    content = (tmp_path / "lab.toml").read_text()
    for line in ('IJ = "IJ"', '# SC = "SCJ"', '# unit = "mm"  # the file says mm', '# "glenoid centre"'):
        assert line in content.splitlines(), content
    edited = content.replace('# SC = "SCJ"', 'SC = "SCJ"').replace('# GH = ""', 'GH = "glenoid centre"')
    (tmp_path / "lab.toml").write_text(edited)
    other = {name.replace("P01", "P02"): xyz for name, xyz in renamed.items()}
    out = tmp_path / "P02.csv"
    ended = girdle("convert", trc(tmp_path / "P02.trc", other), out, "--map", tmp_path / "lab.toml")
    assert (ended.status, ended.err) == (0, "")
    np.testing.assert_allclose(read_motions(out).humerus_elevation_deg, ELEVATIONS, atol=1e-9)
    with_it = girdle("convert", source, "--write-map", tmp_path / "lab.toml")
    refused(with_it, str(tmp_path / "lab.toml"), "there already", "Name another")


def test_the_mapping_of_a_file_of_angles(tmp_path):
    motions = read_motions(girdle_csv(tmp_path))
    table = table_from_motions(motions, False, "x")
    table.columns["st_y"] = table.columns.pop("scapula_y")
    write_mot(table, tmp_path / "a.mot")
    assert "6 names found" in girdle("convert", tmp_path / "a.mot", "--write-map", tmp_path / "lab.toml").out
    lines = (tmp_path / "lab.toml").read_text().splitlines()
    assert 'clavicle_y = "clavicle_y"' in lines
    assert any(line.startswith("# scapula_y = ") for line in lines)
    assert '# "st_y"' in lines
    no_names = girdle("convert", girdle_csv(tmp_path), "--write-map", tmp_path / "other.toml")
    refused(no_names, str(tmp_path / "motions.csv"), "names from here", ".mot or .sto")


def girdle_csv(folder):
    """Return the text of a motion file of nine postures."""
    path = folder / "motions.csv"
    if not path.exists():
        lab = in_laboratory(simulated_trial(ELEVATIONS).thorax_mm, np.eye(3), PLACE_MM)
        girdle("convert", trc(folder / "m.trc", lab), path)
    return path


def with_amc(lab):
    """Repeat one posture in a trial of nine frames, with the markers of the acromion."""
    still = {name: np.repeat(xyz[:, :1], 9, axis=1) for name, xyz in lab.items()}
    return still | {name: still["AC"] + np.array(place)[:, None] for name, place in AMC_MM.items()}


def test_static_trials_beside_the_moving_ones(lab, tmp_path):
    """``--static static.trc`` is found beside each person's trials and not converted; GH is placed, with a message."""
    (tmp_path / "lab.toml").write_text('[clusters]\nscapula = ["AMC1", "AMC2", "AMC3"]\n')
    whole = with_amc(lab)
    carried = ("AC", "AA", "TS", "AI", "GH")
    for person in ("P01", "P02"):
        trc(tmp_path / person / "static.trc", {name: xyz for name, xyz in whole.items() if name != "GH"})
        trc(tmp_path / person / "moving.trc", {name: xyz for name, xyz in whole.items() if name not in carried})
    common = (tmp_path, tmp_path / "out.csv", "--map", tmp_path / "lab.toml", "--gh-from-ac", "kaptein1999")
    ended = girdle("convert", *common, "--static", "static.trc")
    assert (ended.status, ended.err) == (0, "")
    assert "The scapula is of a cluster, calibrated in one posture" in ended.out
    assert "The elevation rests on GH from AC by a stated offset +- 10 mm" in ended.out
    assert "Cluster scapula: residual of the rigid fit" in ended.out
    motions = read_motions(tmp_path / "out.csv")
    assert pairs(tmp_path / "out.csv") == [("P01", "moving"), ("P02", "moving")]
    assert set(motions.extra[SCAPULA_FROM]) == {"cluster, calibrated in one posture"}
    assert set(motions.extra[HUMERUS_PLACED]) == {"GH from AC by a stated offset +- 10 mm"}
    own = tmp_path / "P01" / "static.trc"
    refused(girdle("convert", *common, "--static", own), str(own), "of one person", "into the folder of each person")
    nowhere = girdle("convert", *common, "--static", "nowhere.trc")
    refused(nowhere, str(tmp_path / "P01" / "nowhere.trc"), "cannot be read", "Check its name")
