"""Files that a browser uploads: accepted kinds and sizes, and the names under which they are stored."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import PurePosixPath, PureWindowsPath

from motions import InputError
from motions.files import printable

ENDINGS = (".c3d", ".trc", ".mot", ".sto", ".csv", ".tsv")
TRIALS = (".c3d", ".trc")

LARGEST_FILE_BYTES = 200_000_000
"""Largest size of one file; a trial of minutes with its analog channels is smaller."""

MOST_FILES = 200
MOST_BYTES = 1_000_000_000
"""Largest size of all files of a session, so that a temporary folder can hold them with the results."""

LONGEST_NAME = 100

USUAL_ELEVATIONS = "20,40,60,80,100,120"
"""Elevations in degrees at which a trial is sampled by default."""


class State(Enum):
    """State of a file: arriving, waiting, being read, read, refused, or with labels or options altered since."""

    ARRIVING, WAITING, READING, READ, REFUSED, ALTERED = range(6)


@dataclass(frozen=True)
class TrialLabels:
    """Labels of a file on the page: subject, motion, side, and the elevations at which the trial is sampled."""

    subject: str = ""
    motion: str = ""
    side: str = "right"
    at: str = ""


@dataclass
class Upload:
    """File of a session. ``stored``: name in the session; ``own_name``: name in the browser, for display only."""

    stored: str
    own_name: str
    size: int
    labels: TrialLabels = field(default_factory=TrialLabels)
    markers: tuple[str, ...] = ()
    """Names of the markers in a file of marker positions."""
    said: str = ""
    """Message of ``girdle convert`` about the file."""
    state: State = State.ARRIVING

    @property
    def read(self) -> bool:
        """True where the file has been converted to a motion file with the present labels and options."""
        return self.state is State.READ

    @property
    def source(self) -> str:
        """Path of the file in the folder of the session."""
        return f"uploads/{self.stored}"

    @property
    def motions(self) -> str:
        """Path of the motion file that is made of this file."""
        return f"motions/{PurePosixPath(self.stored).stem}.csv"

    @property
    def names_itself(self) -> bool:
        """True for a motion file, which names its subjects and motions itself."""
        return self.stored.endswith(".csv") and not self.markers


def accepted(client_name: str, size: int, earlier: Sequence[Upload]) -> Upload:
    """Accept a file from a browser and number it; its stored name keeps only the ending of the browser's name.

    ``size``: in bytes. Raise an InputError if the kind is unknown, the file empty or too large, or one file too many.
    """
    name = shown_name(client_name)
    ending = PurePosixPath(name).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(name, None, "this kind of file is not known", f"Known are {', '.join(ENDINGS)}")
    if not size:
        raise InputError(name, None, "the file is empty", "Export it again")
    if size > LARGEST_FILE_BYTES:
        remedy = "Leave out what is no marker, or use `girdle convert` on the command line"
        raise InputError(name, None, f"the file is larger than {LARGEST_FILE_BYTES / 1e6:.0f} MB", remedy)
    if len(earlier) >= MOST_FILES or sum(one.size for one in earlier) + size > MOST_BYTES:
        cause = f"more than {MOST_FILES} files, or {MOST_BYTES / 1e9:.0f} GB of them"
        raise InputError(name, None, cause, "Use `girdle adapt` on the command line: it takes any number")
    number = 1 + max((int(PurePosixPath(one.stored).stem) for one in earlier), default=0)
    return Upload(f"{number:03}{ending}", name, size, first_labels(name))


def shown_name(client_name: str) -> str:
    """Return the last part of a browser's file name in displayable form: no folder, no control characters."""
    name = PurePosixPath(PureWindowsPath(client_name).name).name
    return printable(name)[-LONGEST_NAME:] or "without a name"


def first_labels(name: str) -> TrialLabels:
    """Propose labels from a file's name, to be corrected on the page: ``P01_abduction.trc`` is abduction of P01."""
    path = PurePosixPath(name)
    subject, _, motion = path.stem.partition("_")
    at = USUAL_ELEVATIONS if path.suffix.lower() in TRIALS else ""
    return TrialLabels(subject or path.stem, motion or path.stem, at=at)


def with_own_names(text: str, uploads: Sequence[Upload]) -> str:
    """Replace the stored names of files in a message by the names in the browser."""
    for one in uploads:
        for place in (one.source, one.motions):
            text = text.replace(place, one.own_name)
    return text
