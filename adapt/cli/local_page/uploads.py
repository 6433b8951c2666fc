"""Files that a browser sends: which are taken, and under which names they are kept."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import PurePosixPath, PureWindowsPath

from motions import InputError
from motions.files import printable

ENDINGS = (".c3d", ".trc", ".mot", ".sto", ".csv", ".tsv")
TRIALS = (".c3d", ".trc")

LARGEST_FILE_BYTES = 200_000_000
"""Of one file: a trial of minutes with its analog channels is smaller."""

MOST_FILES = 200
MOST_BYTES = 1_000_000_000
"""Of a session: what a temporary folder can be expected to hold, results included."""

LONGEST_NAME = 100

USUAL_ELEVATIONS = "20,40,60,80,100,120"
"""At which a trial is sampled unless the page says otherwise."""


class State(Enum):
    """How far a file is: it arrives, waits, is being read; was read or refused; its names were altered since."""

    ARRIVING, WAITING, READING, READ, REFUSED, ALTERED = range(6)


@dataclass(frozen=True)
class TrialLabels:
    """What the page says of a file: whose trial it is, and at which elevations it is sampled."""

    subject: str = ""
    motion: str = ""
    side: str = "right"
    at: str = ""


@dataclass
class Upload:
    """A file of a session. ``stored``: its name here; ``own_name``: the browser's, only ever shown."""

    stored: str
    own_name: str
    size: int
    labels: TrialLabels = field(default_factory=TrialLabels)
    markers: tuple[str, ...] = ()
    """Names of the markers, of a file of positions."""
    said: str = ""
    """What `girdle convert` said of it."""
    state: State = State.ARRIVING

    @property
    def read(self) -> bool:
        """Whether there is a motion file of it, made as the page says."""
        return self.state is State.READ

    @property
    def source(self) -> str:
        """Return where it is in the folder of the session."""
        return f"uploads/{self.stored}"

    @property
    def motions(self) -> str:
        """Return where the motion file that is made of it is."""
        return f"motions/{PurePosixPath(self.stored).stem}.csv"

    @property
    def names_itself(self) -> bool:
        """Whether it is a motion file, which says its subjects and motions itself."""
        return self.stored.endswith(".csv") and not self.markers


def accepted(client_name: str, size: int, earlier: Sequence[Upload]) -> Upload:
    """Give a file that a browser sends its name here, a number; the ending is all that is kept of the browser's name.

    size: in bytes. InputError if it is of no known kind, empty, too large, or one too many.
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
    """Return the last part of what a browser calls a file, as it can be shown: no folder, no control character."""
    name = PurePosixPath(PureWindowsPath(client_name).name).name
    return printable(name)[-LONGEST_NAME:] or "without a name"


def first_labels(name: str) -> TrialLabels:
    """Propose labels by the name of a file, to be corrected on the page: ``P01_abduction.trc`` is abduction of P01."""
    path = PurePosixPath(name)
    subject, _, motion = path.stem.partition("_")
    at = USUAL_ELEVATIONS if path.suffix.lower() in TRIALS else ""
    return TrialLabels(subject or path.stem, motion or path.stem, at=at)


def with_own_names(text: str, uploads: Sequence[Upload]) -> str:
    """Put the browser's name of a file wherever a message has the one here."""
    for one in uploads:
        for place in (one.source, one.motions):
            text = text.replace(place, one.own_name)
    return text
