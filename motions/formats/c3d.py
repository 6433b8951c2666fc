"""Marker positions in a .c3d file (c3d.org), read by ezc3d."""

import struct
from pathlib import Path

import ezc3d
import numpy as np

from motions.errors import InputError
from motions.formats.gaps import zeros_as_gaps
from motions.landmarks.markers import Markers

_BLOCK = 512
"""Bytes; parts of the file start at whole blocks."""

_MANY_FRAMES = 65535
"""The header's counts have 16 bits: a longer trial has its length in the parameters alone."""


def read_c3d(path: Path) -> Markers:
    """All markers of a .c3d file; a marker with a negative residual or at exactly (0, 0, 0) has a gap.

    InputError if the file is none, or if it has fewer frames than it says.
    """
    file = str(path)
    frames_said = _check_header(path)
    try:
        content = ezc3d.c3d(file)
    except (OSError, RuntimeError, ValueError, IndexError) as error:
        cause = (
            f"ezc3d cannot read the file ({str(error).strip().splitlines()[0] if str(error) else 'no reason given'})"
        )
        raise InputError(file, None, cause, "Export it again as .c3d from the capture software") from error
    point = content["parameters"]["POINT"]
    positions = np.moveaxis(np.asarray(content["data"]["points"], dtype=float)[:3], 1, 0)
    names = _names(point)
    if positions.shape[0] == 0 or positions.shape[2] == 0 or not names:
        raise InputError(file, None, "the file has no markers", "Export the trial with its labelled trajectories")
    frames_said = max(frames_said, int(point["FRAMES"]["value"][0]) if "FRAMES" in point else 0)
    if positions.shape[2] < frames_said:
        cause = f"the file says that it has {frames_said} frames but holds {positions.shape[2]}: it was cut off"
        raise InputError(file, None, cause, "Copy or export it again")
    unit = point["UNITS"]["value"][0] if "UNITS" in point and point["UNITS"]["value"] else None
    count = min(len(names), len(positions))  # LABELS may go on after the last marker
    return Markers(file, tuple(names[:count]), zeros_as_gaps(positions[:count]), unit or None, {})


def _names(point) -> list[str]:
    """LABELS, LABELS2, ...: 255 names fit into one parameter."""
    parts = [key for key in point if key.startswith("LABELS")]
    return [name.strip() for key in sorted(parts, key=len) for name in point[key]["value"]]


def _check_header(path: Path) -> int:
    """The header's number of frames (0 where it cannot say). InputError if the file is none or ends before its data.

    ezc3d reads on for ever in a file that ends within its parameters.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as content:
            header = content.read(_BLOCK)
    except OSError as error:
        cause = f"the file cannot be read ({error.strerror})"
        raise InputError(str(path), None, cause, "Check its name and folder") from error
    if len(header) < _BLOCK or header[1] != 0x50:
        raise InputError(str(path), None, "this is not a .c3d file", "Export it again as .c3d")
    # Intel and DEC processors write little-endian words, SGI big-endian: the size decides, no file has 256 x too many.
    order = "<" if struct.unpack("<H", header[16:18])[0] <= struct.unpack(">H", header[16:18])[0] else ">"
    first, last = struct.unpack(f"{order}2H", header[6:10])
    (data_block,) = struct.unpack(f"{order}H", header[16:18])
    if size <= (data_block - 1) * _BLOCK:
        raise InputError(str(path), None, "the file ends before its data: it was cut off", "Copy or export it again")
    return 0 if last >= _MANY_FRAMES else last - first + 1
