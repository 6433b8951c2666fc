"""The one error of a user's input, and the one warning: where it is, what is wrong, what to do about it."""

import difflib
import shlex
import sys
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

Value = TypeVar("Value")


class InputError(ValueError):
    """A file or folder named by the user cannot be used as it is.

    file: the path as the user wrote it. row: the line in the file, from 1 (the header is line 1), or None
    when the whole file is meant. cause: what is wrong. remedy: what the user does to put it right.
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
        return "".join(c if c.isprintable() else "?" for c in said)  # it may quote a file: one line, whatever is in it


class InputWarning(UserWarning):
    """A file is used as it is, but one may want to look at it. Its text is that of an :class:`InputError`."""


def warn_input(doubt: InputError) -> None:
    """Warn of a file that is used as it is: InputWarning, in the words of an error that is not raised."""
    warnings.warn(InputWarning(str(doubt)), stacklevel=3)


def pip_install(*packages: str) -> str:
    """Write the command that installs packages into the environment that runs, whatever made it.

    Packages, and not `girdle[extra]`: girdle is in no index, where that name may be anybody's.
    """
    return shlex.join([sys.executable, "-m", "pip", "install", *packages])


def named(name: str, known: Mapping[str, Value], place: str, kind: str) -> Value:
    """Look up what has this name. InputError that names the place where nothing has."""
    if name not in known:
        raise InputError(place, None, f"there is no {kind} '{name}'", f"Use one of {', '.join(known)}")
    return known[name]


def listed(words: Sequence[str], most: int) -> str:
    """List the words, and the number of those that are left out where there are more than ``most``."""
    shown = ", ".join(words[:most])
    return shown if len(words) <= most else f"{shown} and {len(words) - most} more"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Write 'Did you mean ...? ' of the known word that is nearest, whatever its case; nothing where none is near."""
    lower = {other.lower(): other for other in known}
    near = difflib.get_close_matches(word.lower(), lower, n=1)
    return f"Did you mean {lower[near[0]]}? " if near else ""
