"""Feed thousands of broken files to every reader: each must be read, or refused with one line.

``python scripts/fuzz_readers.py --inputs 2000 --seed 1`` makes that many files of each kind (a tenth of .c3d and of
surfaces, because each of these starts a process): random bytes, pieces of the format in random order, and valid files
with a few changes. A reader fails if it raises anything but an InputError, warns, takes longer than LONGEST_S, ends its
process, or gives a message that is not one printable line. The files that a reader fails on are kept in --keep. Prints
a table; exit status 1 if any reader failed.
"""

import multiprocessing
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.random import PCG64, Generator
from rich.console import Console
from rich.progress import track
from rich.table import Table

from adapt.cli.commands.known_effects import effects_of, read_known
from adapt.cli.landmarks.check_run import differences_of_two, unsound
from adapt.cli.landmarks.contour import write_contours
from adapt.cli.landmarks.convert import simulated_motions
from adapt.output.repeat import read_record, recorded_arguments
from adapt.output.written_files import LIST, last_written
from adapt.tables.landmark_tables import distances_table, motions_table
from models.parameter_sets import FOLDER, load_model
from models.person.contours.band import VECTOR_PX, Settings
from models.person.contours.click_table import by_slice, read_clicks
from models.person.contours.image_slices import ImageSlice, read_slices
from models.person.transfer.mesh import read_mesh
from motions.errors import InputError, InputWarning
from motions.formats.any_file import read_any, read_calibration
from motions.formats.free_coordinates import coordinates_mm, read_free_coordinates
from motions.formats.landmark_sets import read_landmark_sets
from motions.formats.named_points import read_named_points
from motions.formats.person_file import read_persons
from motions.formats.spartacus import read_spartacus
from motions.landmarks.mapping import Mapping, read_mapping
from motions.landmarks.sampled_postures import Labels
from motions.motion_csv.reading import read_motions
from scripts import valid_files as valid

LONGEST_S = 90.0
"""Seconds after which a reader counts as hanging: no file of a few kilobytes takes that long, even on a busy machine.
A reader that starts a process gives up earlier (``motions.files.read_by_child``)."""

READ, REFUSED, FAILED = "read", "refused", "failed"

_TOKENS = [
    *(b"nan", b"inf", b"-inf", b"1e999", b"-1e308", b"1e-320", b"-0", b"+", b"0x10", b"1_000", b"9" * 400, b"9" * 5000),
    *(b"", b" ", b"\n", b"\r", b"\t", b",", b";", b'"', b"'", b'"""', b"=", b"[", b"]", b"[[", b"{", b"#", b"\\"),
    *(b"\0", b"\xff", b"\xef\xbb\xbf", b"\xff\xfe", b"\x1b[31m", b"\xe2\x80\xa8", b"\xd9\xa1", b"true", b"1979-05-27"),
    *(b"../../x", b"/etc/passwd", b"$(touch x)", b"=1+1", b"[" * 2000, b"a." * 500, b"left", b"side", b"mm"),
]


@dataclass(frozen=True)
class Kind:
    """One kind of file: its extension, its reader, and a valid file."""

    ending: str
    read: Callable[[Path], object]
    valid: bytes
    in_child: bool = False
    """True where the reader starts a process for each file: a tenth as many files are tried."""


def kinds(folder: Path) -> dict[str, Kind]:
    """List the readers of all kinds of user files. The valid files are made in the folder."""
    labels = Labels("P1", "abduction")

    def any_motions(path: Path) -> object:
        return read_any(path, Mapping(), labels)

    def in_mm(path: Path) -> object:
        return read_any(path, Mapping(unit="mm"), labels)

    def record(path: Path) -> object:
        return recorded_arguments(read_record(path), path, "adapt", {"weight", "objective"})

    return {
        "motion CSV": Kind(".csv", read_motions, valid.motion_csv()),
        "parameter set": Kind(".toml", load_model, (FOLDER / "R2.toml").read_bytes()),
        "mapping": Kind(".toml", read_mapping, valid.MAPPING),
        "landmark CSV": Kind(".csv", any_motions, valid.landmark_csv()),
        "landmarks, semicolons": Kind(".csv", any_motions, valid.with_commas(valid.landmark_csv())),
        "trc": Kind(".trc", any_motions, valid.trc()),
        "trc, blanks": Kind(".trc", any_motions, valid.trc().replace(b"\t\t\t", b"\t").replace(b"\t", b" ")),
        "vicon": Kind(".csv", any_motions, valid.vicon()),
        "motive": Kind(".csv", any_motions, valid.motive()),
        "qualisys": Kind(".tsv", any_motions, valid.qualisys()),
        "visual3d": Kind(".txt", in_mm, valid.visual3d()),
        "matlab": Kind(".csv", in_mm, valid.matlab()),
        "pandas": Kind(".csv", in_mm, valid.of_pandas()),
        "clusters": Kind(".trc", _carried(folder), valid.trc(valid.CLUSTER_MM)),
        "static trial": Kind(".trc", lambda path: _calibrated(path), valid.trc(valid.CLUSTER_MM)),
        "second static trial": Kind(".trc", _calibrated_beside(folder), valid.trc(valid.CLUSTER_MM)),
        "mot": Kind(".mot", any_motions, valid.mot(folder)),
        "mot, commas": Kind(".mot", any_motions, valid.mot(folder).replace(b"\t", b",")),
        "c3d": Kind(".c3d", any_motions, valid.c3d(folder), in_child=True),
        "run.json": Kind(".json", record, valid.run_json(folder)),
        "list of a run": Kind(".sha256", _renamed(folder, LIST, last_written), valid.LIST),
        "diagnosis.json": Kind(".json", _renamed(folder, "diagnosis.json", _known_effects), valid.DIAGNOSIS),
        "fits.csv": Kind(".csv", simulated_motions, valid.FITS),
        "clicks": Kind(".csv", _read_clicks, valid.CLICKS),
        "contour volumes": Kind(".csv", _contours_in_discs(folder), valid.CIRCLED),
        "image": Kind(".png", lambda path: read_slices([path], 1.0, 2.0), valid.png()),
        "dicom": Kind(".dcm", lambda path: read_slices([path]), valid.dicom()),
        "stl": Kind(".stl", _surface, valid.stl(), in_child=True),
        "stl, text": Kind(".stl", _surface, valid.stl_text(), in_child=True),
        "ply": Kind(".ply", _surface, valid.ply(), in_child=True),
        "ply, binary": Kind(".ply", _surface, valid.ply_binary(), in_child=True),
        "vtp": Kind(".vtp", _surface, valid.vtp(), in_child=True),
        "attachments": Kind(".csv", lambda path: read_named_points(path, "attachment"), valid.ATTACHMENTS),
        "points to check": Kind(".csv", _checked, valid.points_csv()),
        "landmarks to check": Kind(".csv", _checked, valid.landmark_csv()),
        "second measurement": Kind(".csv", _compared(folder), valid.points_csv()),
        "landmarks of a person": Kind(".csv", lambda path: read_persons(path, Mapping(), labels), valid.landmark_csv()),
        "points on bones": Kind(".csv", _points_of_person(folder), valid.SURFACE_POINTS),
        "free coordinates": Kind(".csv", lambda path: coordinates_mm(read_free_coordinates(path)), valid.COORDINATES),
        "studies of Spartacus": Kind(".csv", _in_checkout(folder, "dataset/dataset_of_datasets"), valid.STUDIES),
        "joints of Spartacus": Kind(".csv", _in_checkout(folder, "dataset/dataset_clean_of_joint_data"), valid.JOINTS),
        "curve of Spartacus": Kind(".csv", _in_checkout(folder, _CURVE), valid.CURVES["SC_elevation"]),
    }


_CURVE = "data/#1_Ludewig_et_al/SC_elevation"
_CLUSTERS = Mapping(clusters={"scapula": ("A1", "A2", "A3")})


def _calibrated(*paths: Path) -> object:
    """Read static trials with a cluster on the acromion."""
    return read_calibration(paths, _CLUSTERS, Labels("P1", "abduction"))


def _calibrated_beside(folder: Path) -> Callable[[Path], object]:
    """Make a reader of a static trial together with a valid first one."""
    static = folder / "first_static.trc"
    static.write_bytes(valid.trc(valid.CLUSTER_MM))
    return lambda path: _calibrated(static, path)


def _carried(folder: Path) -> Callable[[Path], object]:
    """Make a reader of trials in which a cluster carries the scapula."""
    static = folder / "static.trc"
    static.write_bytes(valid.trc(valid.CLUSTER_MM))
    labels = Labels("P1", "abduction")
    calibration = read_calibration([static], _CLUSTERS, labels)
    return lambda path: read_any(path, _CLUSTERS, labels, calibration)


def _renamed(folder: Path, name: str, read: Callable[[Path], object]) -> Callable[[Path], object]:
    """Make a reader that copies the file into the folder under this name and reads the folder."""

    def renamed(path: Path) -> object:
        (folder / name).write_bytes(path.read_bytes())
        return read(folder)

    return renamed


def _known_effects(folder: Path) -> object:
    return read_known(effects_of(folder))


def _read_clicks(path: Path) -> object:
    """Read clicks in two slices; no image files are needed."""
    nothing = np.zeros(3)
    slices = [ImageSlice(name, np.zeros((40, 50)), nothing, nothing, nothing) for name in ("a.png", "b.png")]
    return by_slice(read_clicks(path, slices), str(path))


def _contours_in_discs(folder: Path) -> Callable[[Path], object]:
    """Make a reader of clicks in two slices with a disc, which writes their contours and volumes."""
    images = [folder / name for name in ("a.png", "b.png")]
    for image in images:
        image.write_bytes(valid.png())
    points, volumes = folder / "points.csv", folder / "volumes.csv"
    return lambda path: write_contours(images, path, points, Settings(), VECTOR_PX, (1.0, 2.0), volumes=volumes)


def _surface(path: Path) -> object:
    """Read a surface, and compute the distances of points on it to it."""
    mesh = read_mesh(path)
    return mesh.distances_mm(mesh.spread(5))


def _checked(path: Path) -> object:
    """Run the checks of `girdle check` on one file."""
    sets = read_landmark_sets(path, Mapping())
    return distances_table(sets), motions_table(sets), [unsound(own, str(path)) for own in sets]


def _compared(folder: Path) -> Callable[[Path], object]:
    """Make a reader that runs the checks of `girdle check` on two files."""
    first = folder / "first.csv"
    first.write_bytes(valid.points_csv())
    return lambda path: differences_of_two(first, path, Mapping())


def _points_of_person(folder: Path) -> Callable[[Path], object]:
    """Make a reader of points on the bones of a person."""
    landmarks = folder / "person.csv"
    landmarks.write_bytes(valid.landmark_csv())
    return lambda path: read_persons(landmarks, Mapping(), Labels("P1", "abduction"), path)


def _in_checkout(folder: Path, name: str) -> Callable[[Path], object]:
    """Make a reader of a Spartacus checkout in which one file is replaced."""

    def read(path: Path) -> object:
        with tempfile.TemporaryDirectory(dir=folder) as checkout:
            valid.spartacus(Path(checkout))
            (Path(checkout) / "spartacus" / f"{name}.csv").write_bytes(path.read_bytes())
            return read_spartacus(Path(checkout), Labels("", ""))

    return read


def broken(kind: Kind, generator: Generator) -> bytes:
    """Make a broken file: random bytes, shuffled pieces of the format, or a valid file with a few changes."""
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
    """Truncate, cut out or duplicate a part, change a byte, insert or replace a piece, or swap two lines."""
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
    """Read the file and return READ, REFUSED, or a description of the failure."""
    path = folder / f"fuzz{kind.ending}"
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", InputWarning)  # a warning for the user: the file is read all the same
            kind.read(path)
    except InputError as error:
        said = str(error)
        return REFUSED if said.isprintable() else f"says more than a printable line: {said!r}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return READ


def file_number(kind: Kind, seed: int, number: int) -> bytes:
    """Make the file with this number; it depends on the seed and the number alone."""
    return broken(kind, Generator(PCG64([seed, number])))


Task = tuple[str, int]
"""Kind and number of a file."""


def _work(tasks: list[Task], seed: int, pipe: Connection) -> None:
    with tempfile.TemporaryDirectory() as folder:
        every = kinds(Path(folder))
        for name in dict.fromkeys(name for name, _ in tasks):
            outcome(
                every[name], every[name].valid, Path(folder)
            )  # the first valid file compiles the reader's functions, so that compilation does not count as a hang
            for number in (number for other, number in tasks if other == name):
                pipe.send(outcome(every[name], file_number(every[name], seed, number), Path(folder)))


def outcomes(tasks: list[Task], seed: int) -> Iterator[str]:
    """Yield the outcome of every task; a worker process reads the files and is replaced where it hangs or dies."""
    done = 0
    context = multiprocessing.get_context("spawn")
    while done < len(tasks):
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_work, args=(tasks[done:], seed, theirs))
        process.start()
        theirs.close()
        patience_s, lost = 10 * LONGEST_S, False  # the first file includes the start of the process
        while done < len(tasks) and not lost:
            try:
                said = ours.recv() if ours.poll(patience_s) else "hangs"
            except EOFError:
                process.join()
                said = f"ends its process with status {process.exitcode}"
            done, patience_s = done + 1, LONGEST_S
            lost = said.startswith(("hangs", "ends its process"))
            yield said
        process.kill()
        process.join()


# --- the command -----------------------------------------------------------------------------------------------------


def main(
    inputs: Annotated[
        int, typer.Option(min=1, help="How many of each kind of file; a tenth where each starts a process.")
    ] = 2000,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same files.")] = 1,
    keep: Annotated[Path, typer.Option(help="Folder for the files that a reader failed on.")] = Path("out/fuzz"),
) -> None:
    """Try every reader of files on broken ones."""
    with tempfile.TemporaryDirectory() as folder:
        every = kinds(Path(folder))
        for name, kind in every.items():
            said = outcome(kind, kind.valid, Path(folder))
            assert said == READ, f"the valid file of {name} is not read: {said}"
    counts = {name: Counter[str]() for name in every}
    failed: list[str] = []
    few = -(-inputs // 10)
    tasks = [(name, k) for name, kind in every.items() for k in range(few if kind.in_child else inputs)]
    found = track(outcomes(tasks, seed), "reading", len(tasks), console=Console(stderr=True))
    for (name, number), said in zip(tasks, found, strict=True):
        counts[name][said if said in (READ, REFUSED) else FAILED] += 1
        if said not in (READ, REFUSED):
            keep.mkdir(parents=True, exist_ok=True)
            path = keep / f"{name.replace(' ', '_')}_{seed}_{number}{every[name].ending}"
            path.write_bytes(file_number(every[name], seed, number))
            failed.append(f"{path}: {said}")
    counts["all"] = sum(counts.values(), Counter[str]())
    table = Table("file", *(f"[right]{word}" for word in ("tried", READ, REFUSED, FAILED)))
    for name, count in counts.items():
        table.add_row(name, *(f"{number}" for number in (count.total(), count[READ], count[REFUSED], count[FAILED])))
    Console().print(table)
    for line in failed:
        print(line)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    typer.run(main)
