"""Thousands of broken files through every reader: each is read or refused in one line, and never is there more.

``python scripts/fuzz_readers.py --inputs 2000 --seed 1`` makes that many of each kind: random bytes, pieces of the
format in no order, and valid files that were changed in a few places. A reader fails if it raises anything but an
InputError, warns, takes longer than LONGEST_S, ends its process, or explains itself in more than one printable line.
Failures are kept in --keep. Prints a table; exit status 1 if anything failed.
"""

import multiprocessing
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated

import ezc3d
import numpy as np
import typer
from numpy.random import PCG64, Generator
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adapt.output.repeat import read_record, recorded_arguments
from adapt.output.run_files import inputs_record, write_run
from models.parameter_sets import FOLDER, load_model
from models.person.contours.click_table import by_slice, read_clicks
from models.person.contours.image_slices import ImageSlice
from motions.errors import InputError, InputWarning
from motions.formats.angle_table import table_from_motions
from motions.formats.any_file import read_any, read_calibration
from motions.formats.mot import write_mot
from motions.landmarks.mapping import MARKERS, Mapping, read_mapping
from motions.landmarks.sampled_postures import Labels
from motions.motion_csv.reading import read_motions
from motions.rhythm_subjects import DATA_FILE

LONGEST_S = 20.0
"""A reader of files of a few kilobytes that takes longer hangs, on however busy a machine."""

READ, REFUSED = "read", "refused"

_TOKENS = [
    *(b"nan", b"inf", b"-inf", b"1e999", b"-1e308", b"1e-320", b"-0", b"+", b"0x10", b"1_000", b"9" * 400, b"9" * 5000),
    *(b"", b" ", b"\n", b"\r", b"\t", b",", b";", b'"', b"'", b'"""', b"=", b"[", b"]", b"[[", b"{", b"#", b"\\"),
    *(b"\0", b"\xff", b"\xef\xbb\xbf", b"\xff\xfe", b"\x1b[31m", b"\xe2\x80\xa8", b"\xd9\xa1", b"true", b"1979-05-27"),
    *(b"../../x", b"/etc/passwd", b"$(touch x)", b"=1+1", b"[" * 2000, b"a." * 500, b"left", b"side", b"mm"),
]


@dataclass(frozen=True)
class Kind:
    """One kind of file: its ending, how it is read, and a valid one."""

    ending: str
    read: Callable[[Path], object]
    valid: bytes


def kinds(folder: Path) -> dict[str, Kind]:
    """Every reader of files of a user. The valid files are made in the folder."""
    labels = Labels("P1", "abduction")

    def any_motions(path: Path) -> object:
        return read_any(path, Mapping(), labels)

    def in_mm(path: Path) -> object:
        return read_any(path, Mapping(unit="mm"), labels)

    def record(path: Path) -> object:
        return recorded_arguments(read_record(path), path, "adapt", {"weight", "reading"})

    return {
        "motion CSV": Kind(".csv", read_motions, b"\n".join(DATA_FILE.read_bytes().splitlines()[:29])),
        "parameter set": Kind(".toml", load_model, (FOLDER / "R2.toml").read_bytes()),
        "mapping": Kind(".toml", read_mapping, _MAPPING),
        "landmark CSV": Kind(".csv", any_motions, _landmark_csv()),
        "landmarks, semicolons": Kind(".csv", any_motions, _with_commas(_landmark_csv())),
        "trc": Kind(".trc", any_motions, _trc()),
        "trc, blanks": Kind(".trc", any_motions, _trc().replace(b"\t\t\t", b"\t").replace(b"\t", b" ")),
        "vicon": Kind(".csv", any_motions, _vicon()),
        "motive": Kind(".csv", any_motions, _motive()),
        "qualisys": Kind(".tsv", any_motions, _qualisys()),
        "visual3d": Kind(".txt", in_mm, _visual3d()),
        "matlab": Kind(".csv", in_mm, _matlab()),
        "pandas": Kind(".csv", in_mm, _pandas()),
        "clusters": Kind(".trc", _carried(folder), _trc(_CLUSTER_MM)),
        "static trial": Kind(".trc", _calibrated, _trc(_CLUSTER_MM)),
        "mot": Kind(".mot", any_motions, _mot(folder)),
        "mot, commas": Kind(".mot", any_motions, _mot(folder).replace(b"\t", b",")),
        "c3d": Kind(".c3d", any_motions, _c3d(folder)),
        "run.json": Kind(".json", record, _run_json(folder)),
        "clicks": Kind(".csv", _read_clicks, _CLICKS),
    }


_MAPPING = b"""unit = "mm"
axes = ["x", "y", "z"]
scapula_relative_to = "thorax"
[markers]
IJ = "STRN"
[clusters]
scapula = ["A1", "A2", "A3"]
"""

_CLUSTERS = Mapping(clusters={"scapula": ("A1", "A2", "A3")})


def _calibrated(path: Path) -> object:
    """A static trial with a cluster on the acromion."""
    return read_calibration([path], _CLUSTERS, Labels("P1", "abduction"))


def _carried(folder: Path) -> Callable[[Path], object]:
    """A reader of trials whose scapula a cluster carries."""
    static = folder / "static.trc"
    static.write_bytes(_trc(_CLUSTER_MM))
    labels = Labels("P1", "abduction")
    calibration = read_calibration([static], _CLUSTERS, labels)
    return lambda path: read_any(path, _CLUSTERS, labels, calibration)


_CLICKS = b"""slice,x_px,y_px,use,surface,subject
a.png,10,12.5,draw,thorax,P1
a.png,30,12,,thorax,P1
1,30,28,draw,thorax,P1
b,9,8,correct,thorax,P1
b,19,8,correct,thorax,P1
b,14,3,correct,thorax,P1
"""


def _read_clicks(path: Path) -> object:
    """Clicks in two slices, which need not be there."""
    nothing = np.zeros(3)
    slices = [ImageSlice(name, np.zeros((40, 50)), nothing, nothing, nothing) for name in ("a.png", "b.png")]
    return by_slice(read_clicks(path, slices), str(path))


def broken(kind: Kind, generator: Generator) -> bytes:
    """A file that is broken in one of the ways above."""
    way = generator.random()
    if way < 0.05:
        return generator.bytes(int(generator.integers(0, 600)))
    pieces = [*kind.valid.split(), *_TOKENS]
    if way < 0.15:
        chosen = generator.integers(len(pieces), size=int(generator.integers(1, 60)))
        return b"".join(pieces[k] + _one_of(generator, [b"", b" ", b"\n", b",", b"\t"]) for k in chosen)
    content = kind.valid
    for _ in range(int(generator.integers(1, 5))):
        content = _changed(content, pieces, generator)
    return content


def _changed(content: bytes, pieces: list[bytes], generator: Generator) -> bytes:
    """Cut off, cut out, doubled, a byte turned, a piece put in or in place of another, or two lines swapped."""
    here, there = sorted(int(k) for k in generator.integers(0, len(content) + 1, size=2))
    piece = _one_of(generator, pieces)
    match int(generator.integers(7)):
        case 0:
            return content[:here]
        case 1:
            return content[:here] + content[min(there, here + 200) :]
        case 2:
            return content[:there] + content[here:]
        case 3:
            return content[:here] + generator.bytes(1) + content[here + 1 :]
        case 4:
            return content[:here] + piece + content[here:]
        case 5:
            old = _one_of(generator, content.split() or [b""])
            return content.replace(old, piece, 1) if old else piece
    lines = content.splitlines(keepends=True) or [b""]
    first, second = generator.integers(len(lines), size=2)
    lines[first], lines[second] = lines[second], lines[first]
    return b"".join(lines)


def _one_of(generator: Generator, items: list[bytes]) -> bytes:
    return items[int(generator.integers(len(items)))]


def outcome(kind: Kind, content: bytes, folder: Path) -> str:
    """READ, REFUSED, or what went wrong."""
    path = folder / f"fuzz{kind.ending}"
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", InputWarning)  # it is said to a person, and the file is read
            kind.read(path)
    except InputError as error:
        said = str(error)
        return REFUSED if said.isprintable() else f"says more than a printable line: {said!r}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return READ


def file_number(kind: Kind, seed: int, number: int) -> bytes:
    """The same for the same seed and number, whatever came before."""
    return broken(kind, Generator(PCG64([seed, number])))


def _work(name: str, seed: int, numbers: range, pipe: Connection) -> None:
    with tempfile.TemporaryDirectory() as folder:
        kind = kinds(Path(folder))[name]
        outcome(kind, kind.valid, Path(folder))  # what is compiled for the first valid file is no hang
        for number in numbers:
            pipe.send(outcome(kind, file_number(kind, seed, number), Path(folder)))


def outcomes(name: str, seed: int, inputs: int) -> list[str]:
    """Of every input in turn, read in a process of its own, which is replaced where it hangs or dies."""
    found: list[str] = []
    context = multiprocessing.get_context("spawn")
    while len(found) < inputs:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(name, seed, range(len(found), inputs), theirs))
        process.start()
        theirs.close()
        patience_s = 10 * LONGEST_S  # for its start
        while len(found) < inputs:
            try:
                found.append(ours.recv() if ours.poll(patience_s) else "hangs")
            except EOFError:
                process.join()
                found.append(f"ends its process with status {process.exitcode}")
            if found[-1].startswith(("hangs", "ends its process")):
                break
            patience_s = LONGEST_S
        process.kill()
        process.join()
    return found


# --- valid files -----------------------------------------------------------------------------------------------------

_THORAX_MM = {"IJ": (0, 0, 0), "C7": (0, 40, 120), "PX": (0, -170, -10), "T8": (0, -150, 130)}
_SHOULDER_MM = {
    "SC": (20, -8, 12),
    "AC": (160, 20, 80),
    "TS": (60, 10, 130),
    "AI": (90, -100, 140),
    "AA": (155, 5, 110),
    "GH": (165, -25, 65),
    "EM": (200, -300, 80),
    "EL": (260, -290, 60),
}
_FRAMES = 4


def _positions_mm() -> dict[str, np.ndarray]:
    """About a shoulder, moving a little: (frames, 3) by landmark."""
    rest = _THORAX_MM | _SHOULDER_MM
    moves = {name: name in _SHOULDER_MM for name in rest}
    return {name: np.array(rest[name]) + 3.0 * np.arange(_FRAMES)[:, None] * moves[name] for name in MARKERS}


def _landmark_csv() -> bytes:
    positions = _positions_mm()
    header = ",".join(f"{name}_{axis}_mm" for name in positions for axis in "xyz")
    rows = (",".join(f"{x:g}" for place in positions.values() for x in place[k]) for k in range(_FRAMES))
    return "\n".join([header, *rows, ""]).encode()


def _with_commas(content: bytes) -> bytes:
    """As a spreadsheet writes a table in many languages: every number with a decimal comma."""
    return re.sub(rb"(?<=;)(-?\d+)(?=;|\n)", rb"\1,5", content.replace(b",", b";"))


_CLUSTER_MM = {"A1": (150.0, 30.0, 90.0), "A2": (170.0, 30.0, 80.0), "A3": (155.0, 45.0, 100.0)}
"""Markers on the acromion, which move with the shoulder."""


def _table(rows: list[list[str]], separator: str) -> bytes:
    return ("\n".join(separator.join(row) for row in rows) + "\n").encode()


def _frames() -> list[list[str]]:
    """x, y and z of all landmarks in each frame."""
    return [[f"{x:g}" for place in _positions_mm().values() for x in place[k]] for k in range(_FRAMES)]


def _vicon() -> bytes:
    names = list(_positions_mm())
    rows = [["Trajectories"], ["100"], ["", "", *(cell for name in names for cell in (f"P1:{name}", "", ""))]]
    rows += [["Frame", "Sub Frame", *"XYZ" * len(names)], ["", "", *["mm"] * 3 * len(names)]]
    return _table([*rows, *([str(k + 1), "0", *cells] for k, cells in enumerate(_frames()))], ",")


def _motive() -> bytes:
    names = [name for name in _positions_mm() for _ in range(3)]
    rows = [["Format Version", "1.23", "Export Frame Rate", "100.0", "Length Units", "Millimeters"], []]
    rows += [["", "Type", *["Marker"] * len(names)], ["", "Name", *names], ["", "", *["Position"] * len(names)]]
    rows.append(["Frame", "Time (Seconds)", *"XYZ" * (len(names) // 3)])
    return _table([*rows, *([str(k), f"{k / 100}", *cells] for k, cells in enumerate(_frames()))], ",")


def _qualisys() -> bytes:
    names = list(_positions_mm())
    rows = [["NO_OF_FRAMES", str(_FRAMES)], ["NO_OF_MARKERS", str(len(names))], ["FREQUENCY", "100"]]
    return _table([*rows, ["DATA_INCLUDED", "3D"], ["MARKER_NAMES", *names], *_frames()], "\t")


def _visual3d() -> bytes:
    names = [name for name in _positions_mm() for _ in range(3)]
    rows = [["", *[cell] * len(names)] for cell in ("P1.c3d", "", "TARGET", "ORIGINAL")]
    rows[1][1:] = names
    rows.append(["ITEM", *"XYZ" * (len(names) // 3)])
    return _table([*rows, *([str(k), *cells] for k, cells in enumerate(_frames(), 1))], "\t")


def _matlab() -> bytes:
    """A table whose variables are matrices, as writetable writes it."""
    return _table([[f"{name}_{k}" for name in _positions_mm() for k in (1, 2, 3)], *_frames()], ",")


def _pandas() -> bytes:
    """Two rows of names, under a line that a spreadsheet takes for what separates the cells."""
    names = list(_positions_mm())
    rows = [["sep=;"], ["", *(name for name in names for _ in range(3))], ["", *"xyz" * len(names)]]
    return _table([*rows, *([str(k), *cells] for k, cells in enumerate(_frames()))], ";")


def _trc(more_mm: dict[str, tuple[float, float, float]] | None = None) -> bytes:
    moved = {name: np.array(place) + 3.0 * np.arange(_FRAMES)[:, None] for name, place in (more_mm or {}).items()}
    positions = _positions_mm() | moved
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ttrial.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"100\t100\t{_FRAMES}\t{len(positions)}\tmm\t100\t1\t{_FRAMES}",
        "Frame#\tTime\t" + "\t\t\t".join(positions) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{k + 1}" for k in range(len(positions)) for axis in "XYZ"),
        "",
    ]
    for k in range(_FRAMES):
        cells = (f"{x:g}" for place in positions.values() for x in place[k])
        lines.append(f"{k + 1}\t{k / 100}\t" + "\t".join(cells))
    return "\n".join([*lines, ""]).encode()


def _mot(folder: Path) -> bytes:
    motions = read_motions(DATA_FILE)
    path = folder / "valid.mot"
    write_mot(table_from_motions(motions.select(np.arange(len(motions.posture)) < 7), False, str(path)), path)
    return path.read_bytes()


def _c3d(folder: Path) -> bytes:
    positions = _positions_mm()
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(positions)
    points = np.ones((4, len(positions), _FRAMES))
    points[:3] = np.stack([place.T for place in positions.values()], axis=1)
    content["data"]["points"] = points
    path = folder / "valid.c3d"
    content.write(str(path))
    return path.read_bytes()


def _run_json(folder: Path) -> bytes:
    write_run(folder, "adapt", inputs_record([DATA_FILE], ["R2"]), {"weight": 10.0, "reading": "mm2_deg2"})
    return (folder / "run.json").read_bytes()


# --- the command -----------------------------------------------------------------------------------------------------


def main(
    inputs: Annotated[int, typer.Option(min=1, help="How many of each kind of file.")] = 2000,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same files.")] = 1,
    keep: Annotated[Path, typer.Option(help="Folder for the files that a reader failed on.")] = Path("out/fuzz"),
) -> None:
    """Try every reader of files on broken ones."""
    with tempfile.TemporaryDirectory() as folder:
        every = kinds(Path(folder))
        for name, kind in every.items():
            said = outcome(kind, kind.valid, Path(folder))
            assert said == READ, f"the valid file of {name} is not read: {said}"
    table = Table("file", *(f"[right]{word}" for word in ("tried", READ, REFUSED, "failed")))
    failed: list[str] = []
    total: Counter[str] = Counter()
    for name in track(every, "reading", console=Console(stderr=True)):
        found = outcomes(name, seed, inputs)
        count = Counter(word if word in (READ, REFUSED) else "failed" for word in found)
        total += count
        table.add_row(name, *(f"{number}" for number in (len(found), count[READ], count[REFUSED], count["failed"])))
        for number, said in enumerate(found):
            if said not in (READ, REFUSED):
                keep.mkdir(parents=True, exist_ok=True)
                path = keep / f"{name.replace(' ', '_')}_{seed}_{number}{every[name].ending}"
                path.write_bytes(file_number(every[name], seed, number))
                failed.append(f"{path}: {said}")
    table.add_row("all", *(f"{number}" for number in (total.total(), total[READ], total[REFUSED], total["failed"])))
    Console().print(table)
    for line in failed:
        print(line)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)
