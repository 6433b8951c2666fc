"""Positions in a text file of Visual3D (Export Data to ASCII): five rows above the data.

Each column has the trial's file, the name of the signal, its type (TARGET, LANDMARK, ...), its folder, and in the row
ITEM X, Y or Z. The file does not say the unit.
"""

from pathlib import Path

from motions.errors import InputError, listed
from motions.formats.marker_files.export_table import Block, ExportTable, markers_of, read_export_table
from motions.landmarks.markers import Markers

_ITEM = "item"
_ROWS_OVER_IT = 4
_POSITIONS = ("target", "landmark")
"""Types of signals that are positions of markers."""

_MOST_NAMED = 5
"""Maximum number of types or files in a message."""

_EXPORT = "Export signals of type TARGET or LANDMARK of one trial again, with all components"


def is_visual3d(head: ExportTable) -> bool:
    """Check whether a file begins as an export of Visual3D."""
    return _item(head) is not None


def read_visual3d(path: Path) -> Markers:
    """Read the targets and landmarks. Raise InputError if there are none, or if they belong to several trials."""
    table = read_export_table(path)
    row = _item(table)
    assert row is not None
    files, names, types = (table.lines[row - step].cells for step in (4, 3, 2))
    axes = [cell.casefold() for cell in table.lines[row].cells]
    width = min(len(axes), len(names), len(types), len(files))
    blocks = [
        Block(names[k], (k, k + 1, k + 2))
        for k in range(1, width - 2)
        if axes[k : k + 3] == ["x", "y", "z"] and types[k].casefold() in _POSITIONS
    ]
    if not blocks:
        there = listed(list(dict.fromkeys(cell for cell in types if cell)), _MOST_NAMED)
        cause = f"this export of Visual3D has {there or 'no signals'} and no TARGET or LANDMARK"
        raise InputError(table.file, table.lines[row - 2].number, cause, _EXPORT)
    trials = list(dict.fromkeys(files[block.columns[0]] for block in blocks))
    if len(trials) > 1:
        cause = f"this export of Visual3D has {len(trials)} trials side by side: {listed(trials, _MOST_NAMED)}"
        raise InputError(table.file, table.lines[row - 4].number, cause, _EXPORT)
    data = [line for line in table.lines[row + 1 :] if any(line.cells)]
    return markers_of(table, blocks, data, len(axes), None, None)


def _item(table: ExportTable) -> int | None:
    """Return the index of the row of the components; None without such a row with four rows above it."""
    return next((k for k, word in enumerate(table.first_words()) if word == _ITEM and k >= _ROWS_OVER_IT), None)
