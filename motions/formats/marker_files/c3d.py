"""Marker positions in a .c3d file (c3d.org), read by ezc3d."""

import struct
from pathlib import Path

import numpy as np

from motions.errors import InputError
from motions.files import read_by_child, unreadable
from motions.formats.gaps import zeros_as_gaps
from motions.landmarks.markers import Markers

_BLOCK = 512
"""Bytes; parts of the file start at whole blocks."""

_PATIENCE_S, _BYTES_A_SECOND = 15.0, 1e6
"""How long ezc3d is waited for: it takes 0.1 s a MB after a start of 0.3 s."""

_MANY_FRAMES = 65535
"""The header's counts have 16 bits: a longer trial has its length in the parameters alone."""


def read_c3d(path: Path) -> Markers:
    """Read all markers of a .c3d file; a marker with a negative residual or at exactly (0, 0, 0) has a gap.

    InputError if the file is none, or if it has fewer frames than it says.
    """
    file = str(path)
    frames_said = _check_header(path)
    content = _by_ezc3d(path)
    points = content["points"]
    if points.ndim != 3 or 0 in points.shape or not content["labels"].size:
        raise InputError(file, None, "the file has no markers", "Export the trial with its labelled trajectories")
    positions = np.moveaxis(points[:3], 1, 0)
    frames_said = max(frames_said, int(content["frames"]))
    if positions.shape[2] < frames_said:
        cause = f"the file says that it has {frames_said} frames but holds {positions.shape[2]}: it was cut off"
        raise InputError(file, None, cause, "Copy or export it again")
    names = content["labels"].tolist()
    rate_hz = float(content["rate"]) or None
    count = min(len(names), len(positions))  # LABELS may go on after the last marker
    return Markers(
        file, tuple(names[:count]), zeros_as_gaps(positions[:count]), str(content["unit"]) or None, {}, rate_hz
    )


def _by_ezc3d(path: Path) -> dict[str, np.ndarray]:
    """What ``c3d_child`` says, which reads the file in a process of its own.

    Found by fuzzing: of files with a few wrong bytes, ezc3d reads some for ever and crashes on others.
    """
    patience_s = _PATIENCE_S + path.stat().st_size / _BYTES_A_SECOND
    remedy = "Export it again as .c3d from the capture software"
    return read_by_child(Path(__file__).with_name("c3d_child.py"), path, "ezc3d", remedy, patience_s)


def _check_header(path: Path) -> int:
    """The header's number of frames (0 where it cannot say). InputError if the file is none or ends before its data.

    ezc3d reads on for ever in a file that ends within its parameters.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as content:
            header = content.read(_BLOCK)
    except OSError as error:
        raise unreadable(path, error) from error
    if len(header) < _BLOCK or header[1] != 0x50:
        raise InputError(str(path), None, "this is not a .c3d file", "Export it again as .c3d")
    # Intel and DEC processors write little-endian words, SGI big-endian: the size decides, no file has 256 x too many.
    order = "<" if struct.unpack("<H", header[16:18])[0] <= struct.unpack(">H", header[16:18])[0] else ">"
    first, last = struct.unpack(f"{order}2H", header[6:10])
    (data_block,) = struct.unpack(f"{order}H", header[16:18])
    if size <= (data_block - 1) * _BLOCK:
        raise InputError(str(path), None, "the file ends before its data: it was cut off", "Copy or export it again")
    return 0 if last >= _MANY_FRAMES else last - first + 1
