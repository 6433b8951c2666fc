"""Marker positions in a .c3d file (c3d.org), read by ezc3d."""

import struct
from pathlib import Path

import numpy as np

from motions.errors import InputError
from motions.files import read_by_child, unreadable
from motions.formats.gaps import zeros_as_gaps
from motions.landmarks.markers import Markers

_BLOCK = 512
"""Size of a block in bytes; parts of the file start at whole blocks."""

_PATIENCE_S, _BYTES_A_SECOND = 15.0, 1e6
"""Time limit for ezc3d: seconds, and bytes per further second. ezc3d takes 0.1 s per MB after a start of 0.3 s."""

_MANY_FRAMES = 65535
"""Maximum number of a frame in the header, which has 16 bits: only the parameters have the length of a longer trial."""


def read_c3d(path: Path) -> Markers:
    """Read all markers of a .c3d file; a marker with a negative residual or at exactly (0, 0, 0) has a gap.

    Raise InputError if the file is no .c3d file, or if it has fewer frames than it says.
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
    """Return the output of ``c3d_child``, which reads the file in a process of its own.

    Fuzzing showed that ezc3d never ends on some files with a few wrong bytes, and crashes on others.
    """
    patience_s = _PATIENCE_S + path.stat().st_size / _BYTES_A_SECOND
    remedy = "Export it again as .c3d from the capture software"
    return read_by_child(Path(__file__).with_name("c3d_child.py"), path, "ezc3d", remedy, patience_s)


def _check_header(path: Path) -> int:
    """Return the number of frames in the header, 0 if the trial is too long for it.

    Raise InputError if the file is of another kind or ends before its data. ezc3d never ends on a file that breaks off
    within its parameters.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as content:
            header = content.read(_BLOCK)
    except OSError as error:
        raise unreadable(path, error) from error
    if len(header) < _BLOCK or header[1] != 0x50:
        raise InputError(str(path), None, "this is not a .c3d file", "Export it again as .c3d")
    # Intel and DEC processors write little-endian words, SGI big-endian. The smaller of the two readings of the first
    # data block's number is right: no file has 256 times as many blocks.
    order = "<" if struct.unpack("<H", header[16:18])[0] <= struct.unpack(">H", header[16:18])[0] else ">"
    first, last = struct.unpack(f"{order}2H", header[6:10])
    (data_block,) = struct.unpack(f"{order}H", header[16:18])
    if size <= (data_block - 1) * _BLOCK:
        raise InputError(str(path), None, "the file ends before its data: it was cut off", "Copy or export it again")
    return 0 if last >= _MANY_FRAMES else last - first + 1
