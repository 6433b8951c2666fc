"""Reading motion files: accepted contents, refusals, and the messages of the refusals."""

import os
import shutil
import threading
import warnings
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapt.diagnosis.marks import declared_effects
from motions import InputError, Motions, read_motions
from motions.errors import InputWarning
from motions.landmarks.sampled_postures import is_yes, marked_outliers
from motions.motion_csv.columns import ANGLES_FROM_LANDMARKS, ESTIMATED, SLIPPED
from motions.rhythm_subjects import simulate_subjects
from motions.table import warn_of_alike_motions

HEADER = (
    "subject,motion,posture,humerus_elevation_deg,clavicle_y_deg,clavicle_z_deg,clavicle_x_deg,"
    "scapula_y_deg,scapula_z_deg,scapula_x_deg"
)
ROW = "P1,abduction,1,10,-30,12,7,32,11,-10"
SHARED_MOTIONS = Path(__file__).parents[3] / "shared" / "motions"


def table(*rows: str, header: str = HEADER) -> str:
    return "\n".join((header, *rows)) + "\n"


def rows_of(subject: str, count: int = 3, tail: str = "") -> list[str]:
    return [f"{subject},abduction,{k},{30 * k},-30,12,7,32,{10 * k},-10{tail}" for k in range(1, count + 1)]


def written(folder: Path, text: str | bytes, name: str = "m.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def refusal(folder: Path, text: str | bytes) -> InputError:
    with pytest.raises(InputError) as caught:
        read_motions(written(folder, text))
    assert caught.value.file == str(folder / "m.csv")
    return caught.value


@pytest.mark.parametrize("gap", ["", " ", "NaN", "n/a", "#N/A", "-", "null"])
def test_a_word_for_what_was_not_measured_is_an_empty_cell(tmp_path, gap):
    motions = read_motions(written(tmp_path, table(f"P1,abduction,1,10,-30,12,{gap},32,11,-10")))
    np.testing.assert_array_equal(motions.angles_deg, [[-30.0, 12.0, np.nan, 32.0, 11.0, -10.0]])


@pytest.mark.parametrize(("separator", "word"), [("\t", "tabs"), ("|", "bars"), (" ", "blanks")])
def test_another_separator_is_named(tmp_path, separator, word):
    error = refusal(tmp_path, table(ROW).replace(",", separator))
    assert f"the cells are separated by {word}, not by commas or semicolons" in error.cause


@pytest.mark.parametrize("first", ["", "sep=;\n", "\n"])
def test_semicolons_and_decimal_commas_are_read_as_commas_and_points(tmp_path, first):
    """Spreadsheets write such files where the comma is the decimal sign; a comma in a name stays."""
    row = "P1,abduction,1,10.5,-30.25,12,,32,-1.5,-10.125,20.5,15.25,170,4.5"
    header = HEADER + ",AC_x_mm,AC_y_mm,AC_z_mm,humerus_plane_deg"
    expected = read_motions(written(tmp_path, table(row, header=header)))
    text = first + table(row, header=header).replace(",", ";").replace(".", ",").replace("abduction", "abduction, slow")
    found = read_motions(written(tmp_path, text))
    np.testing.assert_array_equal(found.angles_deg, expected.angles_deg)
    np.testing.assert_array_equal(found.humerus_elevation_deg, [10.5])
    np.testing.assert_array_equal(found.landmarks_mm["AC"], [[20.5, 15.25, 170.0]])
    assert found.extra["humerus_plane_deg"].tolist() == ["4.5"]
    assert found.motion.tolist() == ["abduction, slow"]


def test_points_of_thousands_are_refused(tmp_path):
    error = refusal(tmp_path, table(ROW).replace(",", ";").replace(";10;", ";1.010,5;"))
    assert "humerus_elevation_deg is '1.010,5', not a number" in error.cause


def test_a_line_of_semicolons_that_is_too_long_is_told_about_semicolons(tmp_path):
    error = refusal(tmp_path, table(ROW + ",7").replace(",", ";"))
    assert error.remedy == "Remove the surplus semicolon"


def test_names_of_columns_with_blanks_are_found_again(tmp_path):
    error = refusal(tmp_path, table(ROW, header=HEADER.replace("_", " ")))
    assert error.remedy.startswith(
        "Rename humerus elevation deg, clavicle y deg, clavicle z deg, clavicle x deg, scapula"
    )


def test_one_posture_in_radians_is_enough(tmp_path):
    error = refusal(tmp_path, table("P1,abduction,1,10,-0.5236,0.2094,0.1222,0.5585,0.192,-0.1745"))
    assert "no angle exceeds 3.14" in error.cause


def test_one_row_becomes_typed_arrays(tmp_path):
    motions = read_motions(written(tmp_path, table(ROW)))
    assert motions.subjects == ("P1",)
    assert motions.motion.tolist() == ["abduction"]
    assert motions.posture.tolist() == [1]
    assert motions.humerus_elevation_deg.tolist() == [10.0]
    assert motions.angles_deg.tolist() == [[-30.0, 12.0, 7.0, 32.0, 11.0, -10.0]]
    assert motions.landmarks_mm == {}
    assert motions.extra.shape == (1, 0)
    assert motions.rejected == ()


@pytest.mark.parametrize(
    "text",
    [
        "\ufeff" + table(ROW),
        table(ROW).replace("\n", "\r\n"),
        table(ROW).replace("\n", "\r"),
        "\n\n" + table("", ROW, " , ,,,,,,,,"),
        table(" P1 , abduction, 1 ,10, -30 ,12,7,32,11,-10", header=HEADER.replace(",", " , ")),
        table(ROW + ",,", header=HEADER + ",,"),
        table(ROW).rstrip("\n"),
        table('"P1","abduction",1.0,1e1,-30,12,7,32,11,-10'),
    ],
    ids=["mark", "crlf", "cr", "blank lines", "spaces", "trailing commas", "no last line end", "quotes"],
)
def test_the_same_table_in_other_clothes(tmp_path, text):
    motions = read_motions(written(tmp_path, text))
    assert motions.subject.tolist() == ["P1"]
    assert motions.posture.tolist() == [1]
    assert motions.angles_deg.tolist() == [[-30.0, 12.0, 7.0, 32.0, 11.0, -10.0]]


def test_an_angle_that_was_not_measured_is_nan(tmp_path):
    motions = read_motions(written(tmp_path, table("P1,abduction,1,,-30,12,,32,NaN,-10")))
    assert np.isnan(motions.humerus_elevation_deg).tolist() == [True]
    assert np.isnan(motions.angles_deg).tolist() == [[False, False, True, False, True, False]]


def test_unknown_columns_are_kept_as_they_are(tmp_path):
    header = "note," + HEADER + ",motion_angle_deg"
    motions = read_motions(written(tmp_path, table(f" first ,{ROW},007", header=header)))
    assert list(motions.extra.columns) == ["note", "motion_angle_deg"]
    assert motions.extra.iloc[0].tolist() == [" first ", "007"]


def test_landmarks_and_the_mirror_of_a_left_shoulder(tmp_path):
    header = HEADER + ",side,AC_x_mm,AC_y_mm,AC_z_mm"
    motions = read_motions(
        written(
            tmp_path,
            table(
                "R,abduction,1,10,-30,12,7,32,11,-10,Right,170,20,50",
                "L,abduction,1,10,30,-12,7,-32,-11,-10,L,-170,20,50",
                "U,abduction,1,10,-30,12,7,32,11,-10,,,,",
                header=header,
            ),
        )
    )
    np.testing.assert_array_equal(motions.angles_deg[0], motions.angles_deg[1])
    assert list(motions.landmarks_mm) == ["AC"]
    np.testing.assert_array_equal(motions.landmarks_mm["AC"], [[170, 20, 50], [170, 20, 50], [np.nan] * 3])
    assert motions.extra["side_measured"].tolist() == ["right", "left", "right"]
    assert list(motions.extra.columns) == ["side_measured"]


def test_subjects_may_be_spread_over_files_with_other_columns(tmp_path):
    first = written(tmp_path, table(ROW, "P2,abduction,1,10,-30,12,7,32,11,-10"), "a.csv")
    header = HEADER + ",AC_x_mm,AC_y_mm,AC_z_mm,day"
    row = "P1,flexion,1,10,-30,12,7,32,11,-10,170,20,50,Monday"
    motions = read_motions(str(first), written(tmp_path, table(row, header=header), "b.csv"))
    assert motions.subjects == ("P1", "P2")
    assert motions.subject.tolist() == ["P1", "P2", "P1"]
    assert np.isnan(motions.landmarks_mm["AC"]).all(axis=1).tolist() == [True, True, False]
    assert motions.extra["day"].tolist() == ["", "", "Monday"]


def test_select_and_concatenate_are_inverse(tmp_path):
    header = HEADER + ",AC_x_mm,AC_y_mm,AC_z_mm,day"
    rows = rows_of("P1", tail=",170,20,50,Monday") + rows_of("P2", tail=",171,20,50,Tuesday")
    motions = read_motions(written(tmp_path, table(*rows, "P3,x,1,,,,,,,,,,,", header=header)))
    first = motions.subject == "P1"
    parts = [motions.select(first), motions.select(~first)]
    assert [part.subjects for part in parts] == [("P1",), ("P2",)]
    again = Motions.concatenate(parts)
    np.testing.assert_array_equal(again.angles_deg, motions.angles_deg)
    np.testing.assert_array_equal(again.landmarks_mm["AC"], motions.landmarks_mm["AC"])
    assert again.extra.equals(motions.extra)
    assert again.rejected == motions.rejected
    assert len(again.rejected) == 1


def test_concatenate_fills_what_a_part_does_not_have(tmp_path):
    header = HEADER + ",AC_x_mm,AC_y_mm,AC_z_mm,day"
    full = read_motions(written(tmp_path, table(ROW + ",170,20,50,Monday", header=header)))
    bare = read_motions(written(tmp_path, table(ROW.replace("P1", "P2"))))
    both = Motions.concatenate([bare, full])
    assert np.isnan(both.landmarks_mm["AC"]).all(axis=1).tolist() == [True, False]
    assert both.extra["day"].tolist() == ["", "Monday"]


FILE_ERRORS = {
    "empty": ("", None, "empty", "header"),
    "blank": ("\n \n\n", None, "empty", "header"),
    "header only": (HEADER + "\n", None, "no rows", "Add one row"),
    "column missing": (
        table(ROW, header=HEADER.replace("posture", "number")),
        1,
        "posture is",
        "Add it to the header, or rename its own among number",
    ),
    "landmarks": (table("1,2,3", header="IJ_x_mm,IJ_y_mm,IJ_z_mm"), 1, "are missing", "girdle convert makes"),
    "columns missing": (table("a,b", header="x,y"), 1, "subject, motion, posture", "Add them"),
    "late header": ("\n\n" + table("a,b", header="x,y"), 3, "are missing", "Add them"),
    "column twice": (table(ROW + ",1,2", header=HEADER + ",a,a"), 1, "'a' stands there twice", "Rename"),
    "tabs": (table(ROW, header=HEADER).replace(",", "\t"), 1, "tabs", "comma-separated"),
    "half a landmark": (table(ROW + ",1", header=HEADER + ",AC_x_mm"), 1, "no column AC_y_mm", "Give x, y"),
    "mirrored twice": (table(ROW + ",l,l", header=HEADER + ",side,side_measured"), 1, "mirrored", "Remove"),
    "latin-1": (table("", "Müller" + ROW).encode("latin-1"), 3, "not UTF-8", "Save"),
    "utf-16": (table(ROW).encode("utf-16"), 1, "not UTF-8", "Save"),
    "binary": (table(ROW).replace("abd", "\0\0\0"), 2, "binary", "Save"),
    "spreadsheet": (b"PK\x03\x04\x14\x00\x06\x00\xff\xfe", 1, "not UTF-8", "CSV"),
    "cut off": (table(ROW, "P1,abduction,2,40,-3"), 3, "5 cells where the header has 10", "Complete"),
    "surplus comma": (table(ROW.replace("12", "12,5")), 2, "11 cells", "Remove the surplus comma"),
    "open quote": (table(ROW, "", '"' + ROW, ROW), 4, "cannot be split", "quotation mark"),
    "nameless column": (table(ROW + ",7", header=HEADER + ","), 2, "without a name", "Name the column"),
}


@pytest.mark.parametrize(("text", "row", "cause", "remedy"), FILE_ERRORS.values(), ids=FILE_ERRORS)
def test_a_file_that_cannot_be_used(tmp_path, text, row, cause, remedy):
    error = refusal(tmp_path, text)
    assert error.row == row
    assert cause in error.cause
    assert remedy in error.remedy


def with_cell(column: str, text: str) -> str:
    """Return a file whose third line has the text in the column."""
    cells = dict(zip(HEADER.split(","), ROW.split(","), strict=True)) | {"posture": "2", column: text}
    return table(ROW, ",".join(cells.values()))


LANDMARK_HEADER = HEADER + ",AC_x_mm,AC_y_mm,AC_z_mm"
LEFT = [f"P1,abduction,{k},{30 * k},30,-12,7,-32,-11,-10" for k in range(1, 4)]

SUBJECT_ERRORS = {
    "no number": (
        with_cell("scapula_z_deg", "x1"),
        3,
        "scapula_z_deg is 'x1', not a number",
        "Write a number",
    ),
    "underscore": (with_cell("scapula_z_deg", "1_0"), 3, "'1_0', not a number", "Write a number"),
    "comma": (with_cell("clavicle_x_deg", '"7,5"'), 3, "'7,5', not a number", "decimal point"),
    "infinite": (with_cell("clavicle_x_deg", "-inf"), 3, "clavicle_x_deg is infinite", "Empty the cell"),
    "overflow": (with_cell("clavicle_x_deg", "1e999"), 3, "infinite", "Empty the cell"),
    "half a turn": (
        with_cell("clavicle_x_deg", "180.5"),
        3,
        "'180.5', more than 180",
        "between -180 and 180",
    ),
    "elevation": (with_cell("humerus_elevation_deg", "-200"), 3, "more than 180", "between -180 and 180"),
    "no posture": (with_cell("posture", ""), 3, "posture is empty", "Number the postures"),
    "posture 1.5": (with_cell("posture", "1.5"), 3, "'1.5', not a whole number", "Number the postures"),
    "posture 1e300": (with_cell("posture", "1e300"), 3, "not a whole number", "Number the postures"),
    "no subject": (table(ROW.removeprefix("P1")), 2, "subject is empty", "Write the subject's name"),
    "no motion": (with_cell("motion", ""), 3, "motion is empty", "Write the motion's name"),
    "nothing measured": (table("P1,x,1,10,,,,,,"), 2, "no angle was measured", "Delete the row"),
    "two measured": (table("P1,x,1,10,,,,32,11,"), 2, "three degrees of freedom", "at least three"),
    "twice": (table(ROW, "", ROW), 4, "m.csv, line 2", "Delete one"),
    "side": (table(ROW + ",both", header=HEADER + ",side"), 2, "side is 'both'", "left or right"),
    "two sides": (
        table(ROW + ",left", ROW.replace("n,1", "n,2") + ",", header=HEADER + ",side"),
        3,
        "the side is right here and left in",
        "in every row",
    ),
    "radians": (
        table(*[f"P1,x,{k},{30 * k},-0.5,0.2,0.1,0.6,0.{k},-0.2" for k in range(1, 4)]),
        2,
        "angles look like radians",
        "in degrees",
    ),
    **{
        f"{angle} in radians": (
            table(*[f"P1,x,{k},{40 * k},{','.join(cells)}" for k in range(1, 4)]),
            2,
            f"{angle}_deg never exceeds 3.14",
            "in degrees",
        )
        for angle, cells in (
            ("clavicle_y", ["-0.5", "12", "7", "32", "20", "-10"]),
            ("scapula_y", ["-30", "12", "7", "0.6", "20", "-10"]),
            ("scapula_z", ["-30", "12", "7", "32", "0.6", "-10"]),
        )
    },
    "elevation in radians": (
        table(*[f"P1,x,{k},0.{k},-30,12,7,32,11,-10" for k in range(1, 4)]),
        2,
        "motion 'x' never exceeds 3.14",
        "in degrees",
    ),
    "metres": (table(ROW + ",.17,.02,.05", header=LANDMARK_HEADER), 2, "look like metres", "in mm"),
    "centimetres": (table(ROW + ",17,2,5", header=LANDMARK_HEADER), 2, "AC look like centimetres", "in mm"),
    "half a position": (table(ROW + ",170,,50", header=LANDMARK_HEADER), 2, "AC has only some", "x, y and z"),
    "left unmarked": (table(*LEFT), 2, "looks like a left shoulder", "Add a column side with the word left"),
    "left marked right": (
        table(*[row + ",r" for row in LEFT], header=HEADER + ",side"),
        2,
        "looks like a left shoulder",
        "Fill the column side with the word left",
    ),
    "right marked left": (
        table(*rows_of("P1", tail=",left"), header=HEADER + ",side"),
        2,
        "mirrored before",
        "Remove the column side",
    ),
}


@pytest.mark.parametrize(("text", "row", "cause", "remedy"), SUBJECT_ERRORS.values(), ids=SUBJECT_ERRORS)
def test_a_subject_that_cannot_be_used(tmp_path, text, row, cause, remedy):
    error = refusal(tmp_path, text)
    assert error.row == row
    assert cause in error.cause
    assert remedy in error.remedy


@pytest.mark.parametrize(
    ("text", "row", "cause", "remedy"),
    [case for name, case in SUBJECT_ERRORS.items() if "side" not in case[0] and "_mm" not in case[0]],
)
def test_a_bad_subject_does_not_take_a_good_one_with_it(tmp_path, text, row, cause, remedy):
    motions = read_motions(written(tmp_path, text + table(*rows_of("good"), header="")))
    assert motions.subjects == ("good",)
    assert [error.row for error in motions.rejected] == [row]
    assert cause in motions.rejected[0].cause


def test_a_scapula_that_hardly_turns_while_the_arm_hardly_moves_is_read(tmp_path):
    rows = [f"P1,x,{k},{10 * k},-30,12,7,32,{k},-10" for k in range(1, 4)]
    assert len(read_motions(written(tmp_path, table(*rows))).posture) == 3


def test_a_trial_is_no_motion_file(tmp_path):
    path = written(tmp_path, "PathFileType", "t.trc")
    with pytest.raises(InputError, match=f"a .trc file is no motion file. Make one of it: girdle convert {path} t.csv"):
        read_motions(path)


def test_an_error_is_one_clear_line(tmp_path):
    error = refusal(tmp_path, with_cell("scapula_z_deg", '"x\n1"'))
    assert str(error) == (
        f"{tmp_path / 'm.csv'}, line 3: subject 'P1': scapula_z_deg is 'x\\n1', not a number. "
        "Write a number with a decimal point, or empty the cell if it was not measured."
    )


def test_the_first_error_says_how_many_more_there_are(tmp_path):
    two, three = ("P1,x,1,10,,,,,,", "P2,x,1,10,,,,,,"), ("P3,x,1,10,,,,,,",)
    assert "1 more file or subject has an error too" in str(refusal(tmp_path, table(*two)))
    assert "2 more files or subjects have an error too" in str(refusal(tmp_path, table(*two, *three)))


def test_a_bad_file_does_not_take_a_good_one_with_it(tmp_path):
    good = written(tmp_path, table(*rows_of("good")), "good.csv")
    bad = written(tmp_path, "x", "bad.csv")
    motions = read_motions(bad, tmp_path, good, good)
    assert motions.subjects == ("good",)
    assert [error.file for error in motions.rejected] == [str(bad), str(tmp_path), str(good)]
    assert ["missing" in motions.rejected[0].cause, "folder" in motions.rejected[1].cause] == [True, True]
    assert "named twice" in motions.rejected[2].cause


def test_a_subject_with_a_row_twice_in_two_files_names_both(tmp_path):
    first = written(tmp_path, table(ROW), "first.csv")
    with pytest.raises(InputError, match="Delete one") as caught:
        read_motions(first, written(tmp_path, table("", ROW), "second.csv"))
    assert (caught.value.file, caught.value.row) == (str(tmp_path / "second.csv"), 3)
    assert f"{first}, line 2" in caught.value.cause


@pytest.mark.parametrize("name", ["nowhere.csv", "no\0where.csv", "n" * 300, "good.csv/inside.csv"])
def test_a_path_that_does_not_exist_is_never_passed_over(tmp_path, name):
    good = written(tmp_path, table(*rows_of("good")), "good.csv")
    with pytest.raises(InputError, match="Check its name and folder") as caught:
        read_motions(good, tmp_path / name)
    assert caught.value.file == str(tmp_path / name)


def test_no_path_at_all():
    with pytest.raises(InputError, match=r"no file was named\. Name at least one"):
        read_motions()


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="this system does not list the files that are open")
@pytest.mark.parametrize("content", ["a,b\n1,2\n", f"{HEADER}\n{ROW}\n1,2\n", f'{HEADER}\n{ROW}\n"1,2\n'])
def test_a_file_that_is_refused_is_not_kept_open_by_its_error(tmp_path, content):
    path = written(tmp_path, content, "refused.csv")
    with pytest.raises(InputError) as caught:
        read_motions(path)
    opened = {os.path.realpath(one) for one in Path("/proc/self/fd").iterdir()}
    assert str(path.resolve()) not in opened
    assert caught.value.__traceback__, "it is kept, with all that its frames hold"


PIECES = st.sampled_from([HEADER, ROW, "\n", "\r", ",", '"', ";", "nan", "left", "1e9", "AC_x_mm", "side", "\x00"])


@settings(max_examples=200, deadline=None)
@given(content=st.binary() | st.lists(PIECES).map("".join).map(str.encode))
def test_any_bytes_are_read_or_refused(tmp_path_factory, content):
    path = written(tmp_path_factory.getbasetemp(), content, "garbage.csv")
    with suppress(InputError):
        assert isinstance(read_motions(path), Motions)


@settings(max_examples=200, deadline=None)
@given(
    column=st.sampled_from(HEADER.split(",")),
    cell=st.text(st.characters(exclude_categories=["Cs"]), max_size=8),
)
def test_any_cell_is_read_or_refused(tmp_path_factory, column, cell):
    path = written(tmp_path_factory.getbasetemp(), with_cell(column, cell), "cell.csv")
    with suppress(InputError), warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # implausible rest angles are read, with a warning
        assert isinstance(read_motions(path), Motions)


@pytest.mark.skipif(not SHARED_MOTIONS.is_dir(), reason="the published motions are not part of the project")
def test_the_published_motions_are_read(tmp_path):
    paths = sorted(SHARED_MOTIONS.glob("*.csv"))
    copies = [Path(shutil.copy(path, tmp_path)) for path in paths]
    motions = read_motions(*copies)
    assert len(paths) == 8
    assert motions.subjects == tuple(path.stem.removeprefix("bonepin_") for path in paths)
    assert motions.rejected == ()
    assert len(motions.posture) == sum(len(path.read_text().splitlines()) - 1 for path in paths)
    assert np.isfinite(motions.angles_deg).all()
    assert list(motions.extra.columns) == ["motion_angle_deg"]


def test_a_pipe_is_read_as_the_file_would_be(tmp_path):
    """A pipe can be read only once."""
    text = table(*rows_of("P1"), *rows_of("P2"))
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(text,))
    writer.start()
    motions = read_motions(pipe)
    writer.join()
    expected = read_motions(written(tmp_path, text))
    assert motions.subjects == expected.subjects
    np.testing.assert_array_equal(motions.angles_deg, expected.angles_deg)


def with_column(folder: Path, column: str, *cells: str) -> Motions:
    """Read a person at rest with an extra column of these cells."""
    rows = [f'P1,rest,{k},10,-30.{k},12,7,32,11.{k},-10,"{cell}"' for k, cell in enumerate(cells)]
    return read_motions(written(folder, table(*rows, header=f"{HEADER},{column}")))


@pytest.mark.parametrize(
    ("column", "cell", "cause", "remedy"),
    [
        (ESTIMATED, "oui", "clavicle_x_estimated is 'oui'", "Write yes or no"),
        (ANGLES_FROM_LANDMARKS, "x", "angles_from_landmarks is 'x'", "Write yes or no"),
        (SLIPPED, "yes", "slipped is 'yes', no landmark", "such as AC TS, or empty the cell"),
    ],
)
def test_a_mark_of_another_word_is_refused_in_its_row(tmp_path, column, cell, cause, remedy):
    with pytest.raises(InputError) as caught:
        with_column(tmp_path, column, "", cell)
    assert caught.value.row == 3
    assert cause in caught.value.cause
    assert remedy in caught.value.remedy


def test_yes_and_no_are_read_alike_in_every_column(tmp_path):
    """A spreadsheet writes TRUE, pandas False and 1.0, a person Yes."""
    for column in (ESTIMATED, ANGLES_FROM_LANDMARKS):
        said = with_column(tmp_path, column, "yes", "Yes", "TRUE", "1", "1.0", "no", "False", "0", "", "nan")
        assert is_yes(said, column).tolist() == [True] * 5 + [False] * 5
    assert declared_effects(with_column(tmp_path, ESTIMATED, "True", "Yes", "1")) == ("clavicle_axial_estimate",)


def test_landmarks_that_slipped_are_read_with_any_separator_and_no_is_none(tmp_path):
    named = with_column(tmp_path, SLIPPED, "AC TS", "ac,ts", "AC; TS", "no", "0", "False", "")
    assert marked_outliers(named) == dict.fromkeys(range(3), "AC TS")


def test_columns_that_were_likely_meant_as_others_are_named(tmp_path):
    header = f"{HEADER},SC_x_m,ts x (cm),scapula_y_spread_deg,Slipped,Side,SIDE_NOTE"
    with pytest.warns(InputWarning) as said:
        read_motions(written(tmp_path, table(ROW + ",0.02,1,1,AC,left,x", header=header)))
    assert [str(one.message).split(": ", 1)[1] for one in said] == [
        "column SC_x_m, ts x (cm) is not read. Positions are SC_x_mm, SC_y_mm, SC_z_mm and so on, in mm.",
        "column Slipped, Side is not read. Write slipped, side in small letters.",
    ]


def test_motions_whose_names_differ_in_case_alone_raise_a_warning():
    motions = simulate_subjects(1, seed=1)
    kinds = sorted(set(motions.motion.tolist()))
    warn_of_alike_motions(motions, "the motions")
    twice = np.where(np.arange(len(motions.motion)) % 2, motions.motion, np.char.upper(motions.motion.astype(str)))
    with pytest.warns(InputWarning) as found:
        warn_of_alike_motions(replace(motions, motion=twice), "the motions")
    said = [str(one.message) for one in found]
    asked = "count as 2 kinds of motion. Give them one name if they are one."
    assert said == [f"the motions: {kind.upper()!r} and {kind!r} {asked}" for kind in kinds]


@pytest.mark.parametrize(
    ("one", "other", "shown"),
    [
        ("caf\u00e9", "cafe\u0301", r"'cafe\u0301' and 'caf\xe9'"),
        ("P 1", "P\u00a01", r"'P 1' and 'P\xa01'"),
        ("P1", "P1\u200b", r"'P1' and 'P1\u200b'"),
        ("P-1", "P\u20131", r"'P-1' and 'P\u20131'"),
        ("P-1", "P\u22121", r"'P-1' and 'P\u22121'"),
    ],
)
def test_subjects_whose_names_look_alike_are_named(one, other, shown):
    motions = simulate_subjects(2, seed=1)
    first = motions.subject == motions.subjects[0]
    with pytest.warns(InputWarning) as said:
        warn_of_alike_motions(replace(motions, subject=np.where(first, one, other)), "it")
    assert shown in str(said[0].message)
    assert "count as 2 subjects" in str(said[0].message)


def test_subjects_whose_names_differ_in_case_are_named():
    """Their adapted models would have the same file name on a file system that ignores case."""
    motions = simulate_subjects(2, seed=1)
    warn_of_alike_motions(
        replace(motions, subject=np.where(motions.subject == motions.subjects[0], "P1_1", "P11")), "it"
    )
    with pytest.warns(InputWarning, match="'P1' and 'p1' count as 2 subjects"):
        warn_of_alike_motions(
            replace(motions, subject=np.where(motions.subject == motions.subjects[0], "P1", "p1")), "it"
        )
