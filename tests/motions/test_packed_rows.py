"""Motion files of millions of rows: memory per row, and results that do not depend on the order of reading."""

import tracemalloc
from pathlib import Path

import pytest
from command import shipped_lines, written

from motions import read_motions

HEADER, *ROWS = shipped_lines(10)

BYTES_A_ROW = 400.0
"""Limit per row: two million rows are to be read in 1 GB, of which the program itself takes 0.25 GB."""


def many(folder: Path, copies: int, takes_turns: bool) -> Path:
    """Write copies of the shipped subjects, one after another, or alternating posture by posture."""
    rows = [[row.replace("simulated", f"copy{copy}_", 1) for row in ROWS] for copy in range(copies)]
    turns = zip(*rows, strict=True) if takes_turns else rows
    return written(folder, [HEADER, *(row for some in turns for row in some)], f"{copies}.csv")


def peak_bytes(path: Path) -> int:
    tracemalloc.start()
    try:
        read_motions(path)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.filterwarnings("ignore::motions.errors.InputWarning")
@pytest.mark.parametrize("takes_turns", [False, True])
def test_a_row_takes_little_memory_whether_or_not_subjects_take_turns(tmp_path, takes_turns):
    few, more = (peak_bytes(many(tmp_path, copies, takes_turns)) for copies in (5, 25))
    assert (more - few) / (20 * len(ROWS)) < BYTES_A_ROW


def test_columns_and_rows_keep_the_order_of_the_files_whoever_ends_first(tmp_path):
    """The first subject has rows in both files; the second one, of the last file alone, is complete before it."""
    header, row = HEADER.removesuffix(",origin"), ROWS[0].removesuffix(",simulated")
    first, last = tmp_path / "first.csv", tmp_path / "last.csv"
    first.write_text(f"{header},b,a\n{row},1,2\n")
    other, next_row = row.replace("simulated01", "other"), row.replace(",1,", ",2,", 1)
    last.write_text(f"{header},c,a\n{other},3,4\n{next_row},5,6\n")
    motions = read_motions(first, last)
    assert motions.subject.tolist() == ["simulated01", "other", "simulated01"]
    assert motions.extra.to_dict("list") == {"b": ["1", "", ""], "a": ["2", "4", "6"], "c": ["", "3", "5"]}
    assert list(motions.extra) == ["b", "a", "c"]
