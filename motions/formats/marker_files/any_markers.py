"""Reading of any file of marker positions; its extension, and a table's header, tell its kind."""

from pathlib import Path

from motions.errors import InputError
from motions.formats.marker_files.c3d import read_c3d
from motions.formats.marker_files.export_table import ENDINGS, ExportTable, read_head
from motions.formats.marker_files.landmark_table import has_header, holds_positions, read_landmark_table
from motions.formats.marker_files.motive import is_motive, read_motive
from motions.formats.marker_files.qualisys import is_qualisys, read_qualisys
from motions.formats.marker_files.trc import read_trc
from motions.formats.marker_files.vicon import is_vicon, read_vicon
from motions.formats.marker_files.visual3d import is_visual3d, read_visual3d
from motions.landmarks.markers import Markers

_OF_ONE_KIND = {".c3d": read_c3d, ".trc": read_trc}
_TABLES = (
    (is_motive, read_motive),
    (is_qualisys, read_qualisys),
    (is_visual3d, read_visual3d),
    (is_vicon, read_vicon),
    (has_header, read_landmark_table),
)


def read_markers(path: Path) -> Markers | None:
    """Read a file of positions of any kind; None for a file of another kind, such as a motion file.

    Raise InputError if the file is broken, or is a table of text (.tsv, .txt) without positions.
    """
    kind = path.suffix.lower()
    if kind in _OF_ONE_KIND:
        return _OF_ONE_KIND[kind](path)
    if kind not in ENDINGS:
        return None
    head = read_head(path)
    _check_ending(head)
    if holds_positions(head.columns()):
        return read_landmark_table(path)
    for is_kind, read in _TABLES:
        if is_kind(head):
            return read(path)
    if kind != ".csv":
        cause = "the header has no positions of markers: no columns such as IJ_x_mm, and it is none of a known program"
        raise InputError(
            str(path), None, cause, "Known are tables of Vicon, Motive, Qualisys and Visual3D, .c3d and .trc"
        )
    return None


def _check_ending(head: ExportTable) -> None:
    """Raise InputError if a file of another kind has the extension of a table."""
    words = head.first_words()
    found = ".trc" if "pathfiletype" in words[:1] else ".mot or .sto" if "endheader" in words else None
    if found is not None:
        raise InputError(head.file, None, f"this is a {found} file by its first lines", f"Let its name end in {found}")
