"""Files of a laboratory in every format: contents, and traps of real files, read correctly or refused by a message."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from lab_files import ELEVATIONS, EXACT, LABELS, refused
from laboratory import in_laboratory, simulated_trial, trc_lines, write_c3d
from scipy.spatial.transform import Rotation

from motions import ANGLES, InputError, read_motions
from motions.errors import InputWarning
from motions.formats.any_file import read_any
from motions.formats.marker_files.c3d import read_c3d
from motions.formats.marker_files.trc import read_trc
from motions.landmarks.acromion import KOLZ
from motions.landmarks.mapping import Mapping, read_mapping
from motions.landmarks.markers import Markers, landmarks_mm
from motions.landmarks.sampled_postures import (
    CLAVICLE_PLACED,
    ESTIMATED,
    FRAMES,
    SCAPULA_ROTATED,
    Labels,
    spread_column,
)
from motions.motion_csv.writing import write_motions

C3D_MM = 1e-4
"""Tolerance: a .c3d file has single precision, 1e-7 of positions of 1000 mm."""

C3D_DEG = 1e-3
"""The same tolerance as an angle, over 100 mm between landmarks."""

Z_UP = Rotation.from_euler("X", 90, degrees=True).as_matrix()
ORIGIN_MM = np.array([300.0, -500.0, 1200.0])


@pytest.fixture(scope="module")
def trial():
    """Simulate nine postures without noise."""
    return simulated_trial(ELEVATIONS)


@pytest.fixture(scope="module")
def lab(trial):
    """Return their landmarks in a laboratory with z up, mm."""
    return in_laboratory(trial.thorax_mm, Z_UP, ORIGIN_MM)


def trc(folder, lines, name="trial.trc"):
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


def known(motions):
    """Return all angles but the estimated one."""
    return np.delete(motions.angles_deg, 2, axis=1)


def true(trial):
    return np.delete(trial.angles_deg, 2, axis=1)


@pytest.mark.parametrize("kind", ["c3d", "trc", "csv"])
@pytest.mark.parametrize("axes", ["y up", "z up"])
@pytest.mark.parametrize("unit", ["mm", "m"])
def test_the_same_girdle_from_every_kind_of_file(trial, tmp_path, kind, axes, unit):
    """Metres or millimetres, y up or z up: the file gives the unit, and the thorax shows the vertical axis."""
    lab = in_laboratory(trial.thorax_mm, np.eye(3) if axes == "y up" else Z_UP, ORIGIN_MM)
    lab = {name: xyz / (1000.0 if unit == "m" else 1.0) for name, xyz in lab.items()}
    path = tmp_path / f"trial.{kind}"
    if kind == "c3d":
        write_c3d(path, lab, unit)
    elif kind == "trc":
        trc(tmp_path, trc_lines(lab, unit))
    else:
        header = ",".join(f"{name}_{axis}_{unit}" for name in lab for axis in "xyz")
        rows = np.concatenate(list(lab.values())).T
        path.write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in rows)]) + "\n")
    motions = read_any(path, Mapping(), LABELS)
    tolerance = C3D_DEG if kind == "c3d" else EXACT
    np.testing.assert_allclose(known(motions), true(trial), rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(motions.humerus_elevation_deg, trial.elevation_deg, rtol=0.0, atol=tolerance)
    assert motions.subjects == ("P01",)
    assert set(motions.motion) == {"abduction"}
    assert set(motions.extra[ESTIMATED]) == {"yes"}
    assert motions.angles_deg[0, 2] == pytest.approx(0.0, abs=tolerance)
    tolerance_mm = C3D_MM if kind == "c3d" else EXACT
    for name, position in motions.landmarks_mm.items():
        np.testing.assert_allclose(position, trial.thorax_mm[name].T, rtol=0.0, atol=10 * tolerance_mm)


def test_the_names_of_the_files_stand_in_for_subject_and_motion(lab, tmp_path):
    motions = read_any(trc(tmp_path, trc_lines(lab), "P07_flexion.trc"), Mapping(), Labels("", ""))
    assert (motions.subjects, set(motions.motion)) == (("P07_flexion",), {"P07_flexion"})


def test_a_left_shoulder_of_a_trial(trial, tmp_path):
    mirror = np.diag([-1.0, 1.0, 1.0])
    lab = in_laboratory({name: mirror @ xyz for name, xyz in trial.thorax_mm.items()}, Z_UP, ORIGIN_MM)
    path = trc(tmp_path, trc_lines(lab))
    refused(path, "lies on the left", "--side left")
    motions = read_any(path, Mapping(), Labels("P01", "abduction", "left"))
    np.testing.assert_allclose(known(motions), true(trial), rtol=0.0, atol=EXACT)
    written = tmp_path / "out.csv"
    write_motions(motions, written)
    assert read_motions(written).angles_deg == pytest.approx(motions.angles_deg, abs=EXACT)


def test_left_handed_axes_need_a_word(trial, tmp_path):
    lab = {name: xyz * np.array([1.0, 1.0, -1.0])[:, None] for name, xyz in trial.thorax_mm.items()}
    path = trc(tmp_path, trc_lines(lab))
    refused(path, "acromion lies on the left", 'axes = ["x", "y", "-z"]')
    motions = read_any(path, Mapping(axes=("x", "y", "-z")), LABELS)
    np.testing.assert_allclose(known(motions), true(trial), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("kind", ["c3d", "trc"])
def test_metres_called_millimetres_are_found_out(lab, tmp_path, kind):
    metres = {name: xyz / 1000.0 for name, xyz in lab.items()}
    path = tmp_path / f"trial.{kind}"
    write_c3d(path, metres, "mm") if kind == "c3d" else trc(tmp_path, trc_lines(metres, "mm"))
    refused(path, "IJ and C7 are 0.126 mm apart", "look like m: correct the unit")


def test_a_unit_that_is_not_known_or_not_said(lab, tmp_path):
    path = trc(tmp_path, trc_lines(lab, "furlong"))
    refused(path, "the unit of the positions is 'furlong'", "mm, cm, m")
    path = tmp_path / "trial.c3d"
    write_c3d(path, lab, "")
    refused(path, "does not say in which unit", 'unit = "mm"')
    motions = read_any(path, Mapping(unit="mm"), LABELS)
    assert len(motions.posture) == len(ELEVATIONS)
    refused(trc(tmp_path, trc_lines(lab, "")), "does not say in which unit", 'unit = "mm"')
    path = trc(tmp_path, trc_lines(lab, "furlong"))
    with pytest.warns(InputWarning, match="in furlong; they are read as mm, as the mapping file says"):
        motions = read_any(path, Mapping(unit="mm"), LABELS)
    assert len(motions.posture) == len(ELEVATIONS)


@pytest.mark.parametrize("kind", ["c3d", "trc"])
def test_the_unit_of_the_mapping_wins_with_a_note(trial, lab, tmp_path, kind):
    metres = {name: xyz / 1000.0 for name, xyz in lab.items()}
    path = tmp_path / f"trial.{kind}"
    write_c3d(path, metres, "mm") if kind == "c3d" else trc(tmp_path, trc_lines(metres, "mm"))
    with pytest.warns(InputWarning, match=r'in mm; they are read as m, as the mapping .* Remove unit = "m"'):
        motions = read_any(path, Mapping(unit="m"), LABELS)
    np.testing.assert_allclose(known(motions), true(trial), rtol=0.0, atol=C3D_DEG)


def test_a_trc_header_between_blanks_is_read_as_one_between_tabs(lab, tmp_path):
    lines = trc_lines(lab)
    blanks = [*lines[:1], *(line.replace("\t", "  ") for line in lines[1:3]), *lines[3:]]
    tabs, spaced = (read_any(trc(tmp_path, one), Mapping(), LABELS) for one in (lines, blanks))
    np.testing.assert_array_equal(known(spaced), known(tabs))


@pytest.mark.parametrize("kind", ["c3d", "trc"])
@pytest.mark.parametrize("gap", [np.nan, 0.0])
def test_a_gap_costs_its_frames_and_nothing_else(trial, lab, tmp_path, kind, gap):
    """An empty cell, a negative residual or (0, 0, 0): the other markers keep their positions."""
    gappy = {name: xyz.copy() for name, xyz in lab.items()}
    gappy["SC"][:, 3] = gap
    gappy["PX"][:, 5] = gap
    path = tmp_path / f"trial.{kind}"
    write_c3d(path, gappy) if kind == "c3d" else trc(tmp_path, trc_lines(gappy))
    with pytest.warns(InputWarning, match="1 of 9 postures are left out: fewer than 3 angles are known there"):
        motions = read_any(path, Mapping(), LABELS)
    rows = [0, 1, 2, 3, 4, 6, 7, 8]
    assert motions.posture.tolist() == [row + 1 for row in rows]
    expected = true(trial)[rows]
    expected[3, :2] = np.nan
    np.testing.assert_allclose(known(motions), expected, rtol=0.0, atol=C3D_DEG)
    assert motions.extra[ESTIMATED].tolist()[3] == ""
    assert np.isnan(motions.angles_deg[3, 2])


def test_a_marker_that_is_the_origin_is_no_gap(trial, tmp_path):
    """A file in the thorax frame has IJ at (0, 0, 0) in every frame."""
    motions = read_any(trc(tmp_path, trc_lines(trial.thorax_mm)), Mapping(), LABELS)
    np.testing.assert_allclose(known(motions), true(trial), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("kind", ["c3d", "trc"])
def test_renamed_and_repeated_markers(lab, tmp_path, kind):
    names = ["my" + name for name in lab]
    path = tmp_path / f"trial.{kind}"

    def write(names):
        if kind == "c3d":
            write_c3d(path, lab, names=names)
        else:
            lines = trc_lines(lab)
            lines[3] = "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t"
            trc(tmp_path, lines)

    write(names)
    refused(path, "no markers for landmarks IJ, PX, C7, T8, TS, AI, AC", 'a line such as IJ = "myIJ" for each')
    all_but_one = Mapping(markers={name[2:]: name for name in names if name != "myTS"})
    refused(path, "there is no marker 'TS' for landmark TS", "Is it 'myTS'?", all_but_one)
    mapping = Mapping(markers={name[2:]: name for name in names})
    assert len(read_any(path, mapping, LABELS).posture) == len(ELEVATIONS)
    write(["IJ" if name == "SC" else name for name in lab])
    refused(path, "there are 2 markers called 'IJ'", "Rename one of them")


def test_a_marker_that_was_nowhere_measured(lab, tmp_path):
    empty = lab | {"TS": np.full_like(lab["TS"], np.nan)}
    refused(trc(tmp_path, trc_lines(empty)), r"marker 'TS' \(TS\) was nowhere measured", "another trial")


@pytest.mark.parametrize("said", [8, 12])
def test_a_wrong_number_of_frames_in_a_trc_header_is_a_warning(lab, tmp_path, said):
    expected = read_any(trc(tmp_path, trc_lines(lab)), Mapping(), LABELS)
    cropped = trc(tmp_path, trc_lines(lab, frames_said=said))
    with pytest.warns(InputWarning, match=rf"line 3: the header says {said} frames .* write 9 for NumFrames"):
        found = read_any(cropped, Mapping(), LABELS)
    np.testing.assert_array_equal(found.angles_deg, expected.angles_deg)


def test_a_trc_that_ends_within_a_line_was_cut_off(lab, tmp_path):
    file = trc(tmp_path, trc_lines(lab, frames_said=12))
    file.write_text(file.read_text().rstrip("\n"))
    error = refused(file, "says 12 frames", "write 9 for NumFrames")
    assert error.row == 3


def test_a_wrong_number_of_markers_in_a_trc_header(lab, tmp_path):
    lines = trc_lines(lab)
    cells = lines[2].split("\t")
    cells[3] = "5"
    lines[2] = "\t".join(cells)
    refused(trc(tmp_path, lines), "says 5 markers", "NumMarkers")


def test_a_trc_line_with_too_many_or_wrong_cells(lab, tmp_path):
    lines = trc_lines(lab)
    lines[7] += "\t17.0"
    assert refused(trc(tmp_path, lines), "more than the", "surplus tab").row == 8
    lines = trc_lines(lab)
    lines[-1] = lines[-1][: len(lines[-1]) // 2]
    assert refused(trc(tmp_path, lines), "ends before", "cut off").row == len(lines)
    lines = trc_lines(lab)
    lines[8] = lines[8].replace(lines[8].split("\t")[4], "1,5")
    assert refused(trc(tmp_path, lines), "'1,5' is not a number", "decimal point").row == 9


def test_a_wrong_number_of_frames_in_a_c3d_header(trial, lab, tmp_path):
    """Where header and parameters disagree and the data are whole, they are read; truncated data are refused."""
    path = tmp_path / "trial.c3d"
    write_c3d(path, lab)
    content = bytearray(path.read_bytes())
    whole = bytes(content)
    first, last = struct.unpack("<2H", content[6:10])
    content[6:10] = struct.pack("<2H", first, last - 4)
    path.write_bytes(content)
    np.testing.assert_allclose(known(read_any(path, Mapping(), LABELS)), true(trial), rtol=0.0, atol=C3D_DEG)
    longer = 100
    content[6:10] = struct.pack("<2H", first, last + longer)
    path.write_bytes(content)
    refused(path, f"says that it has {len(ELEVATIONS) + longer} frames but holds 9", "export it again")
    path.write_bytes(whole[:-700])
    refused(path, "says that it has 9 frames but holds", "export it again")


@pytest.mark.parametrize("content", [b"", b"hello", b"\x02\x50" + b"\0" * 600, b"\x02\x50" + b"\xff" * 600])
def test_what_is_no_c3d_file_ends_in_a_message(tmp_path, content):
    path = tmp_path / "trial.c3d"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"not a \.c3d file|cut off|cannot read"):
        read_c3d(path)


def test_a_c3d_file_that_ends_within_its_parameters(lab, tmp_path):
    """ezc3d alone would read endlessly."""
    path = tmp_path / "trial.c3d"
    write_c3d(path, lab)
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(InputError, match="ends before its data"):
        read_c3d(path)


def test_more_markers_than_one_parameter_of_a_c3d_file_can_name(lab, tmp_path):
    others = {f"cluster{k}": lab["IJ"] + k for k in range(300)}
    path = tmp_path / "trial.c3d"
    write_c3d(path, others | lab)
    markers = read_c3d(path)
    assert markers.names[-1] == "EL"
    np.testing.assert_allclose(markers.positions[markers.names.index("TS")], lab["TS"], rtol=0.0, atol=C3D_MM)


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_line_ends_and_a_missing_blank_line_of_a_trc_file(lab, tmp_path, line_end):
    lines = trc_lines(lab)
    del lines[5]
    path = tmp_path / "trial.trc"
    path.write_bytes((line_end.join(lines) + line_end).encode())
    np.testing.assert_allclose(read_trc(path).positions[1], lab["C7"], rtol=0.0, atol=EXACT)


def test_blank_lines_and_a_missing_line_of_axes_in_a_trc_header(trial, lab, tmp_path):
    """No frame is mistaken for a line of the header."""
    lines = [line for line in trc_lines(lab) if line]
    lines[3] = lines[3].replace("Frame#", "Frame #")
    for variant in (lines, ["", *lines[:4], "", *lines[4:]], [*lines[:4], *lines[5:]]):
        path = tmp_path / "variant.trc"
        path.write_text("\n".join(variant) + "\n")
        assert len(read_trc(path).positions[0, 0]) == len(trial.elevation_deg)


@pytest.mark.parametrize("lines", [[], ["a", "b"], ["PathFileType\t4"] + ["x"] * 9])
def test_what_is_no_trc_file(tmp_path, lines):
    with pytest.raises(InputError, match=r"trc file|Frame#"):
        read_trc(trc(tmp_path, lines))


def test_aa_without_ac_is_never_taken_for_it(trial, lab, tmp_path):
    aa_only = {name: xyz for name, xyz in lab.items() if name != "AC"}
    path = trc(tmp_path, trc_lines(aa_only))
    refused(path, "has AA but not AC", "--aa-to-ac kolz2020")
    labels = Labels("P01", "abduction", aa_to_ac=KOLZ, aa_to_ac_name="kolz2020")
    motions = read_any(path, Mapping(), labels)
    assert motions.extra[CLAVICLE_PLACED].str.startswith("AC from AA").all()
    assert np.abs(motions.angles_deg[:, :2] - trial.angles_deg[:, :2]).max() < KOLZ.uncertainty_deg
    assert "kolz2020" in motions.extra[SCAPULA_ROTATED][0]
    assert "4 deg" in motions.extra[SCAPULA_ROTATED][0]
    assert np.abs(motions.angles_deg[:, 3:] - trial.angles_deg[:, 3:]).max() < 3 * KOLZ.uncertainty_deg
    with pytest.warns(InputWarning, match="AC was measured, so --aa-to-ac changes nothing"):
        both = read_any(trc(tmp_path, trc_lines(lab)), Mapping(), labels)
    np.testing.assert_allclose(known(both), true(trial), rtol=0.0, atol=EXACT)
    assert SCAPULA_ROTATED not in both.extra


def test_a_mapping_of_angles_alone_changes_nothing_of_landmarks(lab, tmp_path):
    path, of_angles = trc(tmp_path, trc_lines(lab)), Mapping(columns={"scapula_y": "y"}, scapula_relative_to="thorax")
    with pytest.warns(InputWarning, match=r"no angles, so scapula_relative_to and \[columns\] of the mapping changes"):
        read_any(path, of_angles, LABELS)
    read_any(path, replace(of_angles, unit="mm"), LABELS)  # the mapping of both kinds of file


def test_palpated_postures_of_several_subjects(trial, lab, tmp_path):
    """One row per posture; each subject's estimate starts from its own lowest arm posture over all its motions."""
    header = "subject,motion,posture," + ",".join(f"{name}_{axis}_mm" for name in lab for axis in "xyz")
    rows = np.concatenate(list(lab.values())).T
    lines = [header]
    for subject, order in (("A", [3, 0, 5]), ("B", [8, 2])):
        lines += [
            ",".join([subject, "up" if k < 4 else "high", str(10 + k), *map(repr, map(float, rows[k]))]) for k in order
        ]
    path = tmp_path / "palpated.csv"
    path.write_text("\n".join(lines) + "\n")
    motions = read_any(path, Mapping(), Labels("", ""))
    assert motions.subject.tolist() == ["A", "A", "A", "B", "B"]
    assert motions.motion.tolist() == ["up", "up", "high", "high", "up"]
    assert motions.posture.tolist() == [13, 10, 15, 18, 12]
    np.testing.assert_allclose(known(motions), true(trial)[[3, 0, 5, 8, 2]], rtol=0.0, atol=EXACT)
    zero = np.abs(motions.angles_deg[:, 2]) < EXACT
    assert zero.tolist() == [False, True, False, False, True]


def test_a_trial_is_sampled_where_it_was_asked_for(tmp_path):
    trial = simulated_trial(np.linspace(10.0, 70.0, 61))
    lab = in_laboratory(trial.thorax_mm, Z_UP, ORIGIN_MM)
    labels = Labels("P01", "abduction", at_deg=(10.5, 40.5, 69.5, 120.0))
    with pytest.warns(InputWarning, match="no posture at 120 degrees of --at: the arm goes from 10 to 70 degrees"):
        motions = read_any(trc(tmp_path, trc_lines(lab)), Mapping(), labels)
    assert motions.humerus_elevation_deg.tolist() == [10.5, 40.5, 69.5]
    at = motions.humerus_elevation_deg
    expected = np.stack([np.interp(at, trial.elevation_deg, column) for column in true(trial).T], axis=1)
    bend_deg = 0.05  # error of a straight line through the curved rhythm, within 5 degrees of the arm
    np.testing.assert_allclose(known(motions), expected, rtol=0.0, atol=bend_deg)
    assert motions.extra[FRAMES].tolist() == ["6", "10", "6"]
    spread = motions.extra[[spread_column(angle) for angle in ANGLES]].astype(float).to_numpy()
    assert (spread < bend_deg).all()
    refused(
        tmp_path / "trial.trc", "the arm goes from 10 to 70", "passes through", labels=Labels("P", "m", at_deg=(90.0,))
    )


def test_elevations_in_a_gap_are_named(tmp_path):
    """The scapula has a gap while the arm was measured: the message names the missing postures."""
    trial = simulated_trial(np.linspace(10.0, 70.0, 61))
    gappy = {name: xyz.copy() for name, xyz in trial.thorax_mm.items()}
    gappy["TS"][:, 20:42] = np.nan
    labels = Labels("P01", "abduction", at_deg=(20.0, 40.0, 60.0))
    with pytest.warns(InputWarning, match="abduction: 1 of 3 postures are left out, at 40 degrees: .* Look for gaps"):
        motions = read_any(trc(tmp_path, trc_lines(gappy)), Mapping(), labels)
    assert motions.humerus_elevation_deg.tolist() == [20.0, 60.0]


@pytest.mark.parametrize("step_deg", [2.0, 3.0])
def test_both_ends_of_a_trial_of_few_frames_are_sampled(tmp_path, step_deg):
    """If fewer frames than a line needs are within 5 degrees of an end, the next frames inside the trial count too."""
    elevation_deg = np.arange(0.0, 121.0, step_deg)
    trial = simulated_trial(elevation_deg)
    labels = Labels("P01", "abduction", at_deg=(0.0, 120.0))
    motions = read_any(trc(tmp_path, trc_lines(trial.thorax_mm)), Mapping(), labels)
    assert motions.humerus_elevation_deg.tolist() == [0.0, 120.0]
    assert motions.extra[FRAMES].tolist() == ["4", "4"]
    bend_deg = 0.01  # error of a straight line over 9 degrees of the arm; landmarks add rounding
    np.testing.assert_allclose(known(motions), true(trial)[[0, -1]], rtol=0.0, atol=bend_deg)
    sparse = simulated_trial(np.arange(0.0, 121.0, 4.0))
    cause = r"no posture at 0, 120 degrees .* needs 4 frames within 5 degrees, or within 10 of an end"
    refused(trc(tmp_path, trc_lines(sparse.thorax_mm)), cause, "passes through", labels=labels)


def test_raising_and_lowering_that_differ_show_in_the_spread(tmp_path):
    """The scapula has a hysteresis of +-2 degrees about its long axis, which is an SD of 2."""
    trial = simulated_trial(np.tile(np.linspace(30.0, 50.0, 21), 2))
    differs = Rotation.from_euler("Y", 2.0, degrees=True).as_matrix()
    moved = {name: xyz.copy() for name, xyz in trial.thorax_mm.items()}
    for name in ("TS", "AI"):
        for half, turn in ((slice(0, 21), differs), (slice(21, 42), differs.T)):
            around = moved["AC"][:, half]
            moved[name][:, half] = around + turn @ (moved[name][:, half] - around)
    labels = Labels("P01", "abduction", at_deg=(40.0,))
    motions = read_any(trc(tmp_path, trc_lines(moved)), Mapping(), labels)
    assert float(motions.extra[spread_column("scapula_y")].iloc[0]) == pytest.approx(2.0, abs=0.15)
    assert float(motions.extra[spread_column("clavicle_y")].iloc[0]) < 0.05


@pytest.mark.parametrize(
    ("text", "cause", "remedy"),
    [
        ("markers = 3", "markers is not a section", "IJ ="),
        ('[markers]\nXX = "a"', "no landmark 'XX'", "IJ, PX, C7, T8"),
        ('[markers]\nIJ = "a"\nPX = "a"', "'a' stands for two", "of its own"),
        ('unit = "foot"', "unit is 'foot'", "mm, cm, m, inch"),
        ('unit = ["x"]', r"unit is \['x'\]", "mm, cm, m"),
        ('axes = ["x", "y"]', "axes is", '"-z"'),
        ('axes = ["x", "y", "y"]', "axes is", '"-z"'),
        ('units = "mm"', "key 'units' is unknown", "Known: unit"),
        ('IJ = "Jug"', r"IJ stands outside \[markers\]", "Put the line [markers] above it"),
        ('unit = "mm"\nPX_T8 = "mid"', r"PX_T8 stands outside \[markers\]", "Put the line [markers] above it"),
        ("unit = ", "not a TOML file", "unit"),
    ],
)
def test_a_wrong_mapping_file(tmp_path, text, cause, remedy):
    path = tmp_path / "lab.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=cause) as caught:
        read_mapping(path)
    assert remedy in caught.value.remedy


def test_a_mapping_file(tmp_path):
    path = tmp_path / "lab.toml"
    path.write_text('unit = "m"\naxes = ["z", "x", "y"]\n[markers]\nIJ = "STRN"\n[columns]\nclavicle_y = "sc_y"\n')
    mapping = read_mapping(path)
    assert (mapping.unit, mapping.marker("IJ"), mapping.marker("PX")) == ("m", "STRN", "PX")
    assert mapping.column("clavicle_y") == "sc_y"
    np.testing.assert_array_equal(mapping.axes_matrix @ [1.0, 2.0, 3.0], [3.0, 1.0, 2.0])
    with pytest.raises(InputError, match="cannot be read"):
        read_mapping(tmp_path / "nowhere.toml")


@pytest.mark.parametrize("name", ["trial.xlsx", "trial"])
def test_a_kind_of_file_that_is_not_known(tmp_path, name):
    (tmp_path / name).write_text("x")
    with pytest.raises(InputError, match=r"not known|no ending") as caught:
        read_any(tmp_path / name, Mapping(), LABELS)
    assert ".c3d, .trc" in caught.value.remedy


def test_a_position_beyond_all_laboratories_is_named():
    """The message comes before any computation that would overflow."""
    names = ("IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI")
    positions = np.zeros((len(names), 3, 2))
    positions[3, 0, 1] = -1e308
    markers = Markers("trial.trc", names, positions, "mm", {})
    with pytest.raises(InputError, match=r"trial\.trc: marker 'T8' has a coordinate of 1e\+308\. Correct it"):
        landmarks_mm(markers, Mapping())
