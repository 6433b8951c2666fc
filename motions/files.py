"""Writing a file whole or not at all."""

import os
from pathlib import Path
from uuid import uuid4

from motions.errors import InputError


def write_whole(path: str | os.PathLike[str], text: str) -> None:
    """Write the text (UTF-8, line ends as they are) to the path, replacing what was there.

    Whoever reads the path, even while this runs or after it broke off, finds all of the old or all of the
    new content. InputError if the folder cannot be written to.
    """
    path = Path(path)
    # In the same folder, because only within one file system is replacing a file a single step.
    part = path.parent / f".{uuid4().hex}.part"
    try:
        part.write_text(text, encoding="utf-8", newline="")
        part.replace(path)
    except OSError as error:
        cause = f"the file cannot be written ({error.strerror})"
        raise InputError(str(path), None, cause, "Name a file in a folder that exists and may be written") from error
    finally:
        _remove(part)


def _remove(part: Path) -> None:
    """Remove what a write that broke off left behind, if anything."""
    try:
        part.unlink(missing_ok=True)
    except OSError:
        return  # the folder that could not be written to: the write has already said so
