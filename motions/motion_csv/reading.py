"""Reading of motion files into one table of postures; subjects and files with errors are left out and named."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from motions.checks.at_rest import SubjectDoubts
from motions.errors import InputError, warn_input
from motions.motion_csv.columns import not_read
from motions.motion_csv.packed import PackedRow, PostureColumns, packed
from motions.motion_csv.posture_rows import Posture, posture_from_row
from motions.motion_csv.rows import Row, iterate_rows
from motions.motion_csv.unit_and_side import CHECKS
from motions.table import Motions


def read_motions(*paths: str | os.PathLike[str]) -> Motions:
    """Read the postures of all subjects in the CSV files, as right shoulders, in the order of the files.

    A file or a subject with an error is left out and named in ``rejected``. A subject whose motions are in several
    files is one subject. Raise InputError if a path does not exist or if no subject is left. Issue an InputWarning
    about subjects whose angles with the arm lowest, or over elevation, no person has: another sign, unit or frame.
    """
    (motions,) = MotionStream(*paths).in_chunks(None)
    return motions


class MotionStream:
    """Motion files, read a few subjects at a time so that files of any size fit in memory: see ``read_motions``.

    ``rejected`` has the errors of the files that were left out, and of the subjects left out in the chunks read so far.
    """

    def __init__(self, *paths: str | os.PathLike[str]) -> None:
        """Read all files once to list their subjects. Raise InputError if a path is missing or no file is usable."""
        if not paths:
            raise InputError("motion files", None, "no file was named", "Name at least one CSV file")
        named = [Path(path) for path in paths]
        for path in named:
            _check_existence(path)
        self.rejected: list[InputError] = []
        self._doubts = SubjectDoubts()
        self._columns: set[str] = set()
        self._usable: list[Path] = []
        self._last: dict[str, int] = {}  # place of the last row of each subject
        self._once: dict[Path, list[PackedRow]] = {}  # rows of pipes, which can be read only once
        rows = 0
        for place, path in enumerate(named):
            try:
                if any(path.samefile(earlier) for earlier in named[:place]):
                    raise InputError(str(path), None, "the file is named twice", "Name each file once")
                if path.is_fifo():
                    self._once[path] = [packed(row) for row in iterate_rows(path)]
                last = {row.cells["subject"]: rows + number for number, row in enumerate(self._rows_of(path))}
            except InputError as error:
                self.rejected.append(error)
                continue
            self._usable.append(path)
            self._last |= last
            rows = max(last.values()) + 1
        self._rows = rows
        if not self._usable:
            raise _first_of(self.rejected)

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of all subjects of the usable files, in the order in which they first appear."""
        return tuple(self._last)

    def _rows_of(self, path: Path) -> Iterable[Row]:
        return (row.unpacked() for row in self._once[path]) if path in self._once else iterate_rows(path)

    def _warn_of_columns(self, table: Motions, files: Mapping[str, str]) -> None:
        """Warn once of each column that is not read although it was likely meant to be."""
        new = [name for name in table.extra.columns if name not in self._columns]
        self._columns.update(new)
        for doubt in not_read(new):
            warn_input(InputError(next(iter(files.values())), None, *doubt))

    def in_chunks(self, subjects: int | None) -> Iterator[Motions]:
        """Yield the motions of ``subjects`` subjects at a time (None: of all), as soon as their last rows are read."""
        waiting: dict[str, list[tuple[int, PackedRow]]] = {}
        chunk, named, found = _Chunk(), tuple(self.rejected), False
        for place, row in enumerate(row for path in self._usable for row in self._rows_of(path)):
            subject = row.cells["subject"]
            waiting.setdefault(subject, []).append((place, packed(row)))
            if place == self._last[subject]:
                chunk.take(waiting.pop(subject))
            if chunk.subjects == (subjects or len(self._last)) or place == self._rows - 1:
                rejected = chunk.rejected
                self.rejected += rejected
                if len(chunk.columns):
                    found = True
                    table = chunk.columns.table([*named, *rejected])
                    self._warn_of_columns(table, chunk.files)
                    self._doubts.look_at(table, chunk.files)
                    yield table
                chunk, named = _Chunk(), ()
        self._doubts.end("the motions")
        if not found:
            raise _first_of(self.rejected)


class _Chunk:
    """Chunk of subjects of which all rows were read: postures of accepted subjects, errors of rejected ones."""

    def __init__(self) -> None:
        self.subjects = 0
        self.columns = PostureColumns()
        self.files: dict[str, str] = {}  # file of each subject's first row
        self._rejected: list[tuple[int, InputError]] = []

    @property
    def rejected(self) -> list[InputError]:
        """Errors, in the order in which their subjects first appear."""
        return [error for _, error in sorted(self._rejected, key=lambda one: one[0])]

    def take(self, rows: Sequence[tuple[int, PackedRow]]) -> None:
        """Convert all rows of a subject, each given with its place, and store its postures or its error."""
        self.subjects += 1
        unpacked = [row.unpacked() for _, row in rows]
        self.files[unpacked[0].cells["subject"]] = unpacked[0].file
        try:
            postures = _subject_from_rows(unpacked)
        except InputError as error:
            self._rejected.append((rows[0][0], error))
        else:
            self.columns.add([place for place, _ in rows], postures)


def _check_existence(path: Path) -> None:
    """Raise InputError if the path does not exist: a mistyped name is never skipped."""
    try:
        path.stat()
    except FileNotFoundError as error:
        raise InputError(str(path), None, "the file does not exist", "Check its name and folder") from error
    except (OSError, ValueError) as error:
        cause = f"there is no way to this file ({error})"
        raise InputError(str(path), None, cause, "Check its name and folder") from error


def _subject_from_rows(rows: Sequence[Row]) -> list[Posture]:
    """Return all postures of one subject. Raise InputError for the first wrong row, or the first failed check."""
    postures = [posture_from_row(row) for row in rows]
    _check_duplicates(postures)
    _check_one_side(postures)
    for check in CHECKS:
        if finding := check(postures):
            raise rows[0].error(finding.cause, finding.remedy)
    return postures


def _check_duplicates(postures: Sequence[Posture]) -> None:
    """Raise InputError, which names both places, if a motion has the same posture twice."""
    first: dict[tuple[str, int], Row] = {}
    for posture in postures:
        earlier = first.setdefault((posture.motion, posture.number), posture.row)
        if earlier is not posture.row:
            cause = (
                f"posture {posture.number} of motion {posture.motion!r} stands here and in "
                f"{earlier.file}, line {earlier.line}"
            )
            raise posture.row.error(cause, "Delete one of the two rows or give it another number or subject")


def _check_one_side(postures: Sequence[Posture]) -> None:
    """Raise InputError if one subject has rows of both shoulders: two shoulders are two girdles."""
    first = postures[0]
    for posture in postures:
        if posture.side != first.side:
            cause = f"the side is {posture.side} here and {first.side} in {first.row.file}, line {first.row.line}"
            raise posture.row.error(cause, "Write the side in every row, and name each shoulder as a subject")


def _first_of(errors: Sequence[InputError]) -> InputError:
    """Return the first error, with the number of further errors in its remedy."""
    first, others = errors[0], len(errors) - 1
    if not others:
        return first
    more = f"{others} more {'file or subject has' if others == 1 else 'files or subjects have'} an error too"
    return InputError(first.file, first.row, first.cause, f"{first.remedy} ({more})")
