"""Error and warning about a user's input: place, cause and remedy."""

import difflib
import shlex
import sys
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

Value = TypeVar("Value")


class InputError(ValueError):
    """Error of a file or folder, named by the user, that cannot be used as it is.

    - ``file``: the path as the user wrote it.
    - ``row``: the line in the file, counted from 1 (the header is line 1); None if the whole file is meant.
    - ``cause``: what is wrong.
    - ``remedy``: what the user can do about it.
    """

    def __init__(self, file: str, row: int | None, cause: str, remedy: str) -> None:
        super().__init__(file, row, cause, remedy)
        self.file = file
        self.row = row
        self.cause = cause
        self.remedy = remedy

    def __str__(self) -> str:
        where = self.file if self.row is None else f"{self.file}, line {self.row}"
        end = "" if self.remedy.endswith("?") else "."
        said = f"{where}: {self.cause.rstrip('.')}. {self.remedy.removesuffix('.')}{end}"
        return "".join(c if c.isprintable() else "?" for c in said)  # one printable line, even if it quotes a file


class InputWarning(UserWarning):
    """Warning about a file that is used as it is, with the text of an :class:`InputError`."""


def warn_input(doubt: InputError) -> None:
    """Warn, with the text of an ``InputError`` that is not raised, about a file that is used as it is."""
    warnings.warn(InputWarning(str(doubt)), stacklevel=3)


def pip_install(*packages: str) -> str:
    """Write the command that installs packages into the running environment, whichever tool created that environment.

    The command names packages and not ``girdle[extra]``: girdle is on no package index, and anybody may take that name
    there.
    """
    return shlex.join([sys.executable, "-m", "pip", "install", *packages])


def named(name: str, known: Mapping[str, Value], place: str, kind: str) -> Value:
    """Return the value of this name. Raise InputError, with ``place`` as its file, if the name is unknown."""
    if name not in known:
        raise InputError(place, None, f"there is no {kind} '{name}'", f"Use one of {', '.join(known)}")
    return known[name]


def listed(words: Sequence[str], most: int) -> str:
    """Join at most ``most`` of the words with commas, and add the number of the words left out."""
    shown = ", ".join(words[:most])
    return shown if len(words) <= most else f"{shown} and {len(words) - most} more"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Write 'Did you mean ...? ' with the most similar known word, ignoring case; empty if none is similar."""
    lower = {other.lower(): other for other in known}
    near = difflib.get_close_matches(word.lower(), lower, n=1)
    return f"Did you mean {lower[near[0]]}? " if near else ""
