"""Tables of capture software, separators, decimal commas, names: the same girdle is read, or the true reason given."""

import numpy as np
import pytest
from capture_tables import RATE, landmarks, motive, qualisys, text, vicon, visual3d
from laboratory import in_laboratory, simulated_trial, trc_lines, with_gaps
from scipy.spatial.transform import Rotation

from motions import InputError
from motions.errors import InputWarning, listed
from motions.formats.any_file import read_any
from motions.formats.marker_files.any_markers import read_markers
from motions.formats.marker_files.trc import read_trc
from motions.landmarks.mapping import THORAX, Mapping
from motions.landmarks.markers import landmarks_mm
from motions.landmarks.sampled_postures import Labels

EXACT = 1e-9
ELEVATIONS = np.linspace(5.0, 125.0, 9)
LABELS = Labels("P01", "abduction")
KINDS = {"vicon": vicon, "motive": motive, "qualisys": qualisys, "landmarks": landmarks}
SEPARATORS = [(",", "."), ("\t", "."), (";", "."), (";", ","), ("\t", ","), ("|", ".")]


@pytest.fixture(scope="module")
def trial():
    return simulated_trial(ELEVATIONS)


@pytest.fixture(scope="module")
def lab(trial):
    turn = Rotation.from_euler("xyz", [90, 10, -30], degrees=True).as_matrix()
    return in_laboratory(trial.thorax_mm, turn, np.array([300.0, -500.0, 1200.0]))


def written(folder, content, name="trial.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(content.encode(encoding))
    return path


def assert_same(path, trial, mapping=None):
    motions = read_any(path, mapping or Mapping(), LABELS)
    assert len(motions.posture) == len(ELEVATIONS)
    difference = np.delete(motions.angles_deg - trial.angles_deg, 2, axis=1)
    np.testing.assert_allclose(difference, 0.0, atol=EXACT)
    np.testing.assert_allclose(motions.humerus_elevation_deg, trial.elevation_deg, rtol=0.0, atol=EXACT)


def refused(path, cause, remedy, mapping=None, labels=LABELS):
    with pytest.raises(InputError, match=cause) as caught:
        read_any(path, mapping or Mapping(), labels)
    assert remedy in caught.value.remedy, caught.value.remedy
    return caught.value


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("separator", "decimal"), SEPARATORS)
@pytest.mark.parametrize("ending", ["csv", "tsv"])
def test_the_same_girdle_from_every_table(trial, lab, tmp_path, kind, separator, decimal, ending):
    assert_same(written(tmp_path, text(KINDS[kind](lab), separator, decimal), f"trial.{ending}"), trial)


@pytest.mark.parametrize("kind", KINDS)
def test_a_gap_of_a_table_is_a_gap(lab, tmp_path, kind):
    """An empty cell, or zeros in some frames; the other markers keep their positions."""
    gappy = with_gaps(lab, {"AC": slice(2, 4), "EL": slice(8, 9)})
    gappy["TS"][:, 6] = 0.0
    markers = read_markers(written(tmp_path, text(KINDS[kind](gappy))))
    assert markers is not None
    names = [name.removeprefix("P01:").removeprefix("P01_") for name in markers.names]
    assert names == list(lab)
    expected = np.stack(list(gappy.values()))
    expected[names.index("TS"), :, 6] = np.nan
    np.testing.assert_array_equal(markers.positions, expected)


@pytest.mark.parametrize("gap", ["NULL", "nan", "NaN", "0.000"])
def test_what_qtm_writes_for_a_gap(lab, tmp_path, gap):
    gappy = with_gaps(lab, {"AC": slice(2, 4)})
    markers = read_markers(written(tmp_path, text(qualisys(gappy, gap=gap), "\t"), "trial.tsv"))
    assert markers is not None
    np.testing.assert_array_equal(markers.positions, np.stack(list(gappy.values())))


def test_unit_and_rate_are_those_of_the_header(trial, lab, tmp_path):
    metres = {name: xyz / 1000.0 for name, xyz in lab.items()}
    for rows, unit in ((vicon(metres, "m"), "m"), (motive(metres, "Meters"), "m"), (qualisys(lab), "mm")):
        path = written(tmp_path, text(rows))
        markers = read_markers(path)
        assert markers is not None
        assert (markers.unit, markers.rate_hz) == (unit, RATE)
        assert_same(path, trial)
    inches = {name: xyz / 25.4 for name, xyz in lab.items()}
    assert_same(written(tmp_path, text(motive(inches, "Inches"))), trial)
    refused(written(tmp_path, text(motive(inches))), "IJ and C7 are 4.98 mm apart", 'write unit = "inch"')
    refused(written(tmp_path, text(motive(metres, "Feet"))), "the unit of the positions is 'Feet'", "mm, cm, m, inch")
    trc = read_trc(written(tmp_path, "\n".join(trc_lines(lab)) + "\n", "trial.trc"))
    assert trc.rate_hz == RATE


@pytest.mark.parametrize("with_time", [True, False])
@pytest.mark.parametrize("ending", ["", "\t"])
def test_qtm_with_and_without_time_and_a_tab_at_the_end(trial, lab, tmp_path, with_time, ending):
    lines = text(qualisys(lab, with_time), "\t").splitlines()
    path = written(tmp_path, "\n".join(line + ending for line in lines) + "\n", "trial.tsv")
    assert_same(path, trial)


def test_other_sections_and_velocities_of_vicon(trial, lab, tmp_path):
    """Devices before, model outputs after, and X' Y' Z' columns behind each position."""
    rows = vicon(lab)
    wide = [
        [cell for k in range(len(lab)) for cell in (*row[2 + 3 * k : 5 + 3 * k], *more)]
        for row, more in [
            (rows[2], [""] * 3),
            (rows[3], ["X'", "Y'", "Z'"]),
            (rows[4], ["mm/s"] * 3),
            *((row, ["7"] * 3) for row in rows[5:]),
        ]
    ]
    devices = [
        ["Devices"],
        ["1000"],
        ["", "", "Force", "", ""],
        ["Frame", "Sub Frame", "Fx", "Fy", "Fz"],
        ["1", "0", "1", "2", "3"],
        [],
    ]
    outputs = [
        [],
        ["Model Outputs"],
        ["100"],
        ["", "", "P01:Angle"],
        ["Frame", "Sub Frame", "X", "Y", "Z"],
        ["", "", "deg", "deg", "deg"],
        ["1", "0", "1", "2", "3"],
    ]
    body = [[*row[:2], *more] for row, more in zip(rows[2:], wide, strict=True)]
    assert_same(written(tmp_path, text([*devices, *rows[:2], *body, *outputs])), trial)
    error = refused(written(tmp_path, text([*devices, *outputs[1:]])), "has devices, model outputs and no Traj", "Traj")
    assert "Vicon" in error.cause


def test_two_header_rows_without_the_first_lines(trial, lab, tmp_path):
    assert_same(written(tmp_path, text(vicon(lab)[2:])), trial)
    without_unit = [row for k, row in enumerate(vicon(lab)) if k != 4]
    refused(written(tmp_path, text(without_unit)), "does not say in which unit", 'unit = "mm"')
    assert_same(tmp_path / "trial.csv", trial, Mapping(unit="mm"))


def test_what_a_table_lacks_is_said(lab, tmp_path):
    """The message names the program and the export that works."""
    bodies = [[cell.replace("Marker", "Rigid Body Marker") for cell in row] for row in motive(lab)]
    refused(
        written(tmp_path, text(bodies)), "Motive export has Rigid Body, Rigid Body Marker and no", "Markers switched on"
    )
    refused(written(tmp_path, text(motive(lab)[:3])), "no row Frame, Time", "with the header")
    six = [["NO_OF_FRAMES", "9"], ["DATA_INCLUDED", "6D"], ["BODY_NAMES", "AMC"]]
    refused(written(tmp_path, text(six, "\t"), "trial.tsv"), "Qualisys export holds 6D data", "3D data")
    few = [row if row[0] != "NO_OF_MARKERS" else ["NO_OF_MARKERS", "5"] for row in qualisys(lab)]
    refused(written(tmp_path, text(few, "\t"), "trial.tsv"), r"says 5 markers .* but has 12 names", "from QTM")
    more = [row if row[0] != "NO_OF_FRAMES" else ["NO_OF_FRAMES", "12"] for row in qualisys(lab)]
    with pytest.warns(InputWarning, match=r"line 1: the header says 12 frames \(NO_OF_FRAMES\) but the file has 9"):
        read_markers(written(tmp_path, text(more, "\t"), "trial.tsv"))
    cut = text(vicon(lab)).rstrip()[:-40] + "\n"
    assert refused(written(tmp_path, cut), "ends before the 38 of the header", "cut off").row == 14
    unnamed = vicon(lab)
    unnamed[2][2] = ""
    refused(written(tmp_path, text(unnamed)), "the first marker has no name", "Nexus")
    refused(written(tmp_path, "time,a\n1,2\n", "trial.tsv"), "no positions of markers", "Qualisys and Visual3D")


@pytest.mark.parametrize(
    "column",
    [
        "{name}_{axis}_mm",
        "{name}_{AXIS}_mm",
        "{name} {AXIS} [mm]",
        "{name}.{axis} (mm)",
        "{name}:{AXIS}_MM",
        "{name} {axis} [millimeters]",
        "{name} {axis} / mm",
        "{name} ({axis}) [mm]",
        "{name}_mm_{axis}",
        "{name}{AXIS}_mm",
        "{AXIS}_{name} (mm)",
        "{name} {axis} in mm",
        "{name}[{AXIS}] mm",
        "{name}/{axis} [mm]",
        "{axis}({name}) in mm",
    ],
)
def test_how_columns_of_landmarks_may_be_called(trial, lab, tmp_path, column):
    assert_same(written(tmp_path, text(landmarks(lab, column))), trial)


@pytest.mark.parametrize("column", ["{name}_{axis}", "{name} {AXIS}", "{name}.{axis}", "{name}{AXIS}", "{AXIS}_{name}"])
def test_columns_without_a_unit_ask_for_it(trial, lab, tmp_path, column):
    path = written(tmp_path, text(landmarks(lab, column), ";", ","))
    refused(path, "does not say in which unit", 'unit = "mm"')
    assert_same(path, trial, Mapping(unit="mm"))


def test_a_line_of_units_under_the_header(trial, lab, tmp_path):
    header, *rows = landmarks({name: xyz / 1000.0 for name, xyz in lab.items()}, "{name}_{AXIS}")
    assert_same(written(tmp_path, text([header, ["[m]"] * len(header), *rows], "\t")), trial)


def test_a_csv_of_something_else_is_named(tmp_path):
    path = written(tmp_path, "u_IJ,v_IJ,w_IJ\n1,2,3\n")
    refused(path, "neither angles nor positions of markers, but u_IJ, v_IJ, w_IJ", "IJ_x_mm")
    refused(written(tmp_path, "0.5,2,-3e1\n1,2,3\n"), "no header: the first line has numbers and no names", "IJ_x_mm")


@pytest.mark.parametrize("above", ["sep=;\n", "# my export\n", "# exported by X\n", "Subject P01;;\n\n"])
def test_what_may_stand_over_the_header(trial, lab, tmp_path, above):
    assert_same(written(tmp_path, above + text(landmarks(lab), ";", ",")), trial)


@pytest.mark.parametrize("gap", ["n/a", "#N/A", "NULL", "None", "-", "--", "-nan(ind)", "1.#QNAN", "<NA>"])
def test_words_of_programs_for_what_was_not_seen(trial, lab, tmp_path, gap):
    header, *rows = landmarks(lab)
    place = header.index("TS_x_mm")
    rows[4][place : place + 3] = [gap] * 3
    with pytest.warns(InputWarning, match="They have gaps in TS"):
        motions = read_any(written(tmp_path, text([header, *rows])), Mapping(), LABELS)
    assert motions.posture.tolist() == [1, 2, 3, 4, 6, 7, 8, 9]
    left = np.delete(np.arange(9), 4)
    np.testing.assert_allclose(motions.angles_deg[:, 3:], trial.angles_deg[left, 3:], rtol=0.0, atol=EXACT)


def test_signs_of_numbers_that_a_spreadsheet_writes(trial, lab, tmp_path):
    """A typographic minus is read as a minus; a comma between thousands is refused, not read as a decimal comma."""
    header, *rows = landmarks(lab)
    with_minus = [[cell.replace("-", "\u2212") if "e" not in cell else cell for cell in row] for row in rows]
    assert_same(written(tmp_path, text([header, *with_minus])), trial)
    with_thousands = [[f'"{float(cell):,.3f}"' for cell in row] for row in rows]
    refused(written(tmp_path, text([header, *with_thousands])), r"'-?1,\d+.\d+' is not a number", "between thousands")


@pytest.mark.parametrize(
    ("first", "ending"), [("PathFileType\t4", ".trc"), ("states\ninDegrees=yes\nendheader", ".mot")]
)
@pytest.mark.parametrize("name", ["trial.csv", "trial.txt"])
def test_a_file_of_another_kind_under_the_ending_of_a_table(tmp_path, first, ending, name):
    refused(written(tmp_path, f"{first}\n1\t2\n", name), rf"this is a \{ending}", f"end in {ending}")


def test_a_frame_of_qtm_in_which_nothing_was_seen_keeps_its_number(trial, lab, tmp_path):
    rows = qualisys(lab, with_time=False)
    rows[-4] = [""] * len(rows[-4])
    with pytest.warns(InputWarning, match="1 of 9 postures are left out"):
        motions = read_any(written(tmp_path, text(rows, "\t"), "trial.tsv"), Mapping(), LABELS)
    assert motions.posture.tolist() == [1, 2, 3, 4, 5, 7, 8, 9]


def test_cells_between_blanks(trial, lab, tmp_path):
    """Fixed-width text in which only blanks separate the cells."""
    assert_same(written(tmp_path, text(landmarks(lab), "  "), "trial.txt"), trial)


def test_a_table_of_matlab_and_one_of_pandas(trial, lab, tmp_path):
    """IJ_1, IJ_2, IJ_3 of MATLAB's writetable; a pandas MultiIndex of names and axes, with frame numbers."""
    _, *rows = landmarks(lab)
    numbered = [f"{name}_{k}" for name in lab for k in (1, 2, 3)]
    two = [["", *(name for name in lab for _ in "xyz")], ["frame", *["x", "y", "z"] * len(lab)]]
    for path in (
        written(tmp_path, text([numbered, *rows]), "matlab.csv"),
        written(tmp_path, text([*two, *([str(k), *row] for k, row in enumerate(rows))]), "pandas.csv"),
    ):
        refused(path, "does not say in which unit", 'unit = "mm"')
        assert_same(path, trial, Mapping(unit="mm"))


def test_targets_of_visual3d(trial, lab, tmp_path):
    path = written(tmp_path, text(visual3d(lab), "\t"), "trial.txt")
    refused(path, "does not say in which unit", 'unit = "mm"')
    assert_same(path, trial, Mapping(unit="mm"))
    angles = written(tmp_path, text(visual3d(lab, "LINK_MODEL_BASED")))
    assert refused(angles, "Visual3D has LINK_MODEL_BASED and no TARGET", "TARGET or LANDMARK").row == 3
    two = [[*row, *row[1:]] for row in visual3d(lab)]
    two[0][-3:] = ["P02.c3d"] * 3
    refused(written(tmp_path, text(two)), "2 trials side by side: P01.c3d, P02.c3d", "one trial")


def test_only_markers_that_the_program_expects(lab, tmp_path):
    """Markers of a skeleton are columns of another type; the measured markers have no names."""
    rows = motive({f"Unlabeled {1000 + k}": xyz for k, xyz in enumerate(lab.values())}, subject="")
    refused(
        written(tmp_path, text(rows)), "has Rigid Body and no positions of Markers with names", "Markers switched on"
    )


def test_what_is_wrong_with_a_table_of_landmarks(lab, tmp_path):
    rows = landmarks(lab)
    rows[0][1] = "IJ_why_mm"
    refused(written(tmp_path, text(rows)), "column IJ_y_mm is missing", "x, y and z")
    rows[0][1] = "IJ_X_mm"
    refused(written(tmp_path, text(rows)), "columns IJ_x_mm and IJ_X_mm are one coordinate", "once")
    rows[0][1] = "IJ_y_cm"
    refused(written(tmp_path, text(rows)), "positions are in mm and in cm", "one unit")
    mixed = text(landmarks(lab), ";", ",").replace(",", ".", 1)
    refused(written(tmp_path, mixed), "is not a number", "decimal point")
    refused(written(tmp_path, text(landmarks(lab), ",", ",")), "cells where the header has 36", "decimal commas")


def test_angles_whose_unit_is_left_out_are_no_positions(tmp_path):
    """``clavicle_y`` is not the y coordinate of a marker called "clavicle"."""
    content = (
        "subject,motion,posture,humerus_elevation,clavicle_y,clavicle_z,clavicle_x,scapula_y,scapula_z,scapula_x\n"
    )
    path = written(tmp_path, content + "A,a,1,2,3,4,5,6,7,8\n")
    refused(path, "humerus_elevation_deg, clavicle_y_deg", "rename theirs", labels=Labels("", ""))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "utf-16"])
def test_encodings_of_a_spreadsheet(trial, lab, tmp_path, encoding):
    """A marker beside the landmarks has an accent in its name."""
    more = {**lab, "épaule": lab["AC"]}
    path = written(tmp_path, text(landmarks(more), "\t"), "trial.txt", encoding)
    assert_same(path, trial)
    markers = read_markers(path)
    assert markers is not None
    assert markers.names[-1] == "épaule"


@pytest.mark.parametrize("separator", [" ", "  ", ";", ",", ", "])
def test_a_trc_with_other_separators(trial, lab, tmp_path, separator):
    lines = [line.replace("\t\t\t", "\t").rstrip("\t") if separator.isspace() else line for line in trc_lines(lab)]
    content = "\n".join(line.replace("\t", separator) for line in lines) + "\n"
    assert_same(written(tmp_path, content, "trial.trc"), trial)


def test_two_carriage_returns_before_each_line_feed(trial, lab, tmp_path):
    assert_same(written(tmp_path, "\r\r\n".join(trc_lines(lab)) + "\r\r\n", "trial.trc"), trial)
    assert_same(written(tmp_path, text(vicon(lab)).replace("\n", "\r\r\n")), trial)


@pytest.mark.parametrize("separator", ["\t", ";", " "])
def test_a_trc_with_decimal_commas(trial, lab, tmp_path, separator):
    lines = trc_lines(lab)
    lines[3] = lines[3].replace("\t\t\t", "\t").rstrip("\t")
    content = "\n".join([*lines[:5], *(line.replace(".", ",") for line in lines[5:])]) + "\n"
    assert_same(written(tmp_path, content.replace("\t", separator), "trial.trc"), trial)


def test_counts_with_decimals_and_an_accent_in_the_path_of_a_trc(trial, lab, tmp_path):
    lines = trc_lines(lab)
    lines[0] = lines[0].replace("trial.trc", "C:\\Mesures\\épaule\\essai.trc")
    lines[2] = lines[2].replace("\t9\t12\t", "\t9.000000\t12,0\t")
    assert_same(written(tmp_path, "\n".join(lines) + "\n", "trial.trc", "latin-1"), trial)


def test_names_of_a_trc_that_are_not_as_many_as_it_says(lab, tmp_path):
    lines = trc_lines(lab)
    lines[3] = lines[3].replace("\t\t\t", "\t").replace("C7\t", "").rstrip("\t")
    refused(written(tmp_path, "\n".join(lines) + "\n", "trial.trc"), "says 12 markers .*and 11 names", "empty cells")


@pytest.mark.parametrize(
    "rename",
    [
        str.lower,
        lambda name: f"P07:{name}",
        lambda name: f"p07:{name.lower()}",
        lambda name: f"Anna_{name}",
        lambda name: f"sub-1.{name.title()}",
    ],
)
def test_names_match_without_case_and_prefix(trial, lab, tmp_path, rename):
    assert_same(written(tmp_path, text(landmarks({rename(name): xyz for name, xyz in lab.items()}))), trial)


def test_a_name_of_the_mapping_matches_too(trial, lab, tmp_path):
    """One mapping serves the files of all persons, whatever prefix their markers have."""
    renamed = {f"P03:{'STRN' if name == 'IJ' else name}": xyz for name, xyz in lab.items()}
    path = written(tmp_path, text(landmarks(renamed)))
    assert_same(path, trial, Mapping(markers={"IJ": "strn"}))
    assert_same(path, trial, Mapping(markers={"IJ": "2*strn - STRN"}))


def test_markers_of_one_segment_with_two_prefixes_are_named(trial, lab, tmp_path):
    """A prefix may name the person, or the segment; a mapping with the whole names settles it."""
    whose = {name: "P02" if name == "AI" else "P01" for name in lab}
    path = written(tmp_path, text(landmarks({f"{whose[name]}:{name}": xyz for name, xyz in lab.items()})))
    with pytest.warns(InputWarning, match="P01:TS. and .P02:AI. are taken for one person. Name the right ones in a"):
        read_any(path, Mapping(), LABELS)
    assert_same(path, trial, Mapping(markers={"AI": "P02:AI"}))
    segment = {name: "thorax" if name in THORAX else "arm" for name in lab}
    by_segment = {f"{segment[name]}:{name}": xyz for name, xyz in lab.items()}
    assert_same(written(tmp_path, text(landmarks(by_segment))), trial)


def test_an_exact_name_wins_and_two_that_match_are_asked_about(lab, tmp_path):
    """Landmarks of a second person, or of both sides, are never chosen by guessing."""
    other = {f"other:{name}": xyz + 5.0 for name, xyz in lab.items()}
    markers = read_markers(written(tmp_path, text(landmarks(other | lab))))
    assert markers is not None
    np.testing.assert_array_equal(landmarks_mm(markers, Mapping())["TS"], lab["TS"])
    two = {f"P{k}:{name}": xyz for k in (1, 2) for name, xyz in lab.items()}
    path = written(tmp_path, text(landmarks(two)))
    refused(path, "markers 'P1:IJ' and 'P2:IJ' may both be IJ", "which is IJ")
    sides = {name if name in ("IJ", "PX", "C7", "T8") else f"R_{name}": xyz for name, xyz in lab.items()}
    refused(written(tmp_path, text(landmarks(sides))), "no markers for landmarks TS, AI, AC", "--write-map")


def test_a_list_in_a_message_ends_with_the_number_left_out(lab, tmp_path):
    assert listed(["a", "b", "c"], 3) == "a, b, c"
    assert listed(["a", "b", "c", "d"], 2) == "a, b and 2 more"
    others = {f"m{k}": lab["IJ"] for k in range(100)}
    error = refused(written(tmp_path, text(landmarks(others))), "no markers for landmarks IJ", "m39 and 60 more")
    assert "m40" not in error.remedy
