"""Reading of text files, reading through a child process, file names, and atomic writing."""

import io
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote
from uuid import uuid4

from motions.errors import InputError

if TYPE_CHECKING:
    import numpy as np

_LONGEST_NAME = 120
"""Maximum number of characters of a file name before its extension; file systems allow 255 bytes."""


def read_text(path: Path, remedy: str) -> str:
    """Read the content of a text file, without a byte order mark.

    Raise InputError if the file cannot be read or is not text; ``remedy`` says how to save or export it.
    """
    content = read_bytes(path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(str(path), line, "this is not UTF-8 text", remedy) from error
    refuse_binary(text, path, remedy)
    return text


def read_bytes(path: Path, most: int = -1) -> bytes:
    """Read the content of a file, or its first ``most`` bytes. Raise InputError if it cannot be read."""
    if path.is_dir():
        raise InputError(str(path), None, "this is a folder, not a file", "Name the files in it")
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise unreadable(path, error) from error


def refuse_binary(text: str, path: Path, remedy: str) -> None:
    """Raise InputError if a text contains a null character, which only binary data have."""
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(str(path), line, "this is not text but binary data", remedy)


def unreadable(path: Path, error: OSError) -> InputError:
    """Make the InputError for an operating-system error on reading a file."""
    cause = f"the file cannot be read ({error.strerror})"
    return InputError(str(path), None, cause, "Check its name, and that you may read it")


def read_by_child(child: Path, path: Path, library: str, remedy: str, patience_s: float) -> "dict[str, np.ndarray]":
    """Read a file with the program ``child`` of this project, which writes a numpy archive to stdout.

    The arguments of ``child`` are the path and a number of seconds after which it ends by itself, because the waiting
    parent process may be killed. Raise InputError with the last line of its error output if ``child`` fails, crashes,
    or does not end within ``patience_s`` seconds.
    """
    import numpy as np  # imported here: the help of the command line uses `printable` and must not wait for numpy

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


def refuse_replacing(target: Path, inputs: Iterable[Path | None]) -> None:
    """Raise InputError if a file that is to be written is one of the files that the same command reads."""
    if any(one is not None and _is_same(one, target) for one in inputs):
        cause = "this command reads this file and would replace it"
        raise InputError(str(target), None, cause, "Name another file to write to")


def _is_same(one: Path, other: Path) -> bool:
    return one.resolve() == other.resolve() or (one.exists() and other.exists() and one.samefile(other))


def make_folder(folder: Path) -> None:
    """Make the folder and its missing parents. Raise InputError if this fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        cause = f"the folder cannot be made ({error.strerror})"
        raise InputError(str(folder), None, cause, "Name a folder of your own") from error


def atomic_write(path: str | os.PathLike[str], text: str) -> None:
    """Write the text to the path as UTF-8 with unchanged line ends, as ``atomic_write_bytes`` does."""
    atomic_write_bytes(path, text.encode("utf-8"))


def atomic_write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write the content to the path, as ``atomic_write_pieces`` does."""
    atomic_write_pieces(path, [content])


def atomic_write_pieces(path: str | os.PathLike[str], pieces: Iterable[bytes]) -> None:
    """Write the pieces to the path one after the other, replacing an existing file atomically.

    A reader finds either all of the old content or all of the new content, also during the write and after a write that
    broke off. Raise InputError if the folder cannot be written to.
    """
    path = Path(path)
    # In the same folder: only within one file system is replacing a file a single step.
    part = path.parent / part_name()
    try:
        with part.open("wb") as file:
            for piece in pieces:
                file.write(piece)
        part.replace(path)
    except OSError as error:
        cause = f"the file cannot be written ({error.strerror})"
        remedy = "Make room, or name a file in a folder that exists and may be written"
        raise InputError(str(path), None, cause, remedy) from error
    finally:
        _remove(part)


def printable(text: str) -> str:
    """Replace control characters by ?, because a terminal would execute them; keep line ends."""
    return "".join(c if c == "\n" or c.isprintable() else "?" for c in text)


def part_name() -> str:
    """Make an unused, hidden name for a file that is not complete yet."""
    return f".{uuid4().hex}.part"


def is_part(path: Path) -> bool:
    """Check whether ``part_name`` made the name of this file, which a killed process left behind."""
    return re.fullmatch(r"\.[0-9a-f]{32}\.part", path.name) is not None


def file_names(names: Iterable[str]) -> Iterator[str]:
    """Yield a file name for each name, all different on every file system; a plain name stays as it is.

    Characters other than letters, digits and ``_-.~+`` or blank are written as %XX. Names are cut to ``_LONGEST_NAME``
    characters; names that are then equal, apart from case, are numbered.
    """
    taken: set[str] = set()
    for name in names:
        plain = quote(name, safe=" +")[:_LONGEST_NAME].rstrip(" .") or "_"
        plain = f"%2E{plain[1:]}" if plain.startswith(".") else plain  # neither hidden nor the parent folder
        unique, number = plain, 2
        while unique.casefold() in taken:
            unique, number = f"{plain}~{number}", number + 1
        taken.add(unique.casefold())
        yield unique


def _remove(part: Path) -> None:
    """Remove the temporary file that an interrupted write left behind, if there is one."""
    try:
        part.unlink(missing_ok=True)
    except OSError:
        return  # the folder is not writable, and the write has already raised an error about this
