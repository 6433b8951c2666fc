"""Files that are read by a library which may crash or hang on broken ones: in a process of its own."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np

from motions.errors import InputError
from motions.files import printable


def read_by_child(child: Path, path: Path, library: str, remedy: str, patience_s: float) -> dict[str, np.ndarray]:
    """Read a file by the program ``child`` of this project, which writes a numpy archive to stdout.

    Its arguments are the path, and seconds after which it ends by itself, as whoever waits for it may be killed.
    InputError with the last line that it says where it fails, crashes, or does not end within ``patience_s``.
    """
    command = [sys.executable, str(child), str(path.absolute()), str(2.0 * patience_s)]
    try:
        ended = subprocess.run(command, capture_output=True, timeout=patience_s, check=False)
        reason = ended.stderr.decode(errors="replace").strip().splitlines()[-1:] if ended.returncode == 1 else []
        reason = reason or ["it crashes"]
    except subprocess.TimeoutExpired:
        ended, reason = None, ["it does not come to an end"]
    if ended is None or ended.returncode:
        raise InputError(str(path), None, f"{library} cannot read the file ({printable(reason[0])})", remedy)
    return dict(np.load(io.BytesIO(ended.stdout)))
