"""Zip file with all files of a session."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

from adapt.cli.local_page.uploads import Upload
from motions.motion_csv.writing import csv_text

FILES_TABLE = "files.csv"
"""Table in the zip that relates the numbers of files to the person's file names."""


def zip_folder(folder: Path, parts: Sequence[str], uploads: Sequence[Upload], target: Path) -> None:
    """Write the existing parts of a folder and the table of file names into a zip."""
    with ZipFile(target, "w", ZIP_DEFLATED) as archive:
        archive.writestr(FILES_TABLE, files_table(uploads))
        for path in _files(folder, parts):
            archive.write(path, path.relative_to(folder).as_posix())


def files_table(uploads: Sequence[Upload]) -> str:
    """Write the table of stored names and the person's file names as CSV."""
    rows = ((one.source, one.own_name, one.motions if one.read else "") for one in uploads)
    return csv_text((("file", "your name of it", "motion file"), *rows))


def _files(folder: Path, parts: Sequence[str]) -> Iterator[Path]:
    for part in parts:
        place = folder / part
        yield from sorted(path for path in (place, *place.rglob("*")) if path.is_file())
