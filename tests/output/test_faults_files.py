"""State of the files after a run is killed, interrupted or out of disk space, or when two runs share a folder."""

import errno
import itertools
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from command import Ended, girdle, refused, shipped_lines, written
from quick_girdle import quick_adaptations
from started_runs import StartedRun, StartedRuns

from adapt.output import run_files as output
from adapt.output.large_runs import chunked_run
from adapt.output.publishing import UNFINISHED
from models import load_model
from models.parameter_sets import model_file
from motions.files import part_name

TABLES = {"fits.csv", "heldout.csv", "parameters.csv", "summary.csv", "run.json"}

FULL_KB = 164
"""Size of a small disk: two subjects need 30 kB, their chunk file twice that, all ten with models five times that."""

COPIES = 120
"""Copies of the ten subjects: 16 800 postures, more than numpy fits at once, so that programs are compiled."""

ENDS_WITHIN_S = 120
"""Time limit for a started process, on a machine that is busy with other tests."""


@pytest.fixture
def quick(monkeypatch) -> None:
    """Replace the adaptation by one without a solver: the tests check the files, not the results."""
    monkeypatch.setattr(chunked_run, "adapt_checked", quick_adaptations)


@pytest.fixture
def motion(tmp_path) -> Path:
    return written(tmp_path, shipped_lines(2))


@pytest.fixture
def other(tmp_path) -> Path:
    """Write other motions, whose results differ in every file."""
    return written(tmp_path, [line.replace("simulated0", "other") for line in shipped_lines(4)], "other.csv")


@pytest.fixture(scope="module")
def went_well(tmp_path_factory) -> Path:
    """Return the folder of a successful run, to be copied."""
    folder = tmp_path_factory.mktemp("went_well")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunked_run, "adapt_checked", quick_adaptations)
        assert girdle("adapt", written(folder, shipped_lines(2)), "--out", folder / "out").status == 0
    return folder / "out"


@pytest.fixture
def earlier(quick, went_well, tmp_path) -> Path:
    """Return a folder with the files of an earlier run."""
    return shutil.copytree(went_well, tmp_path / "out")


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """Mount a small file system, where this machine permits it."""
    folder = tmp_path / "small"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={FULL_KB}k", "girdle-test", str(folder)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("this user may not mount a small file system")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below the folder, also hidden ones, except the chunk files that the same run would reuse."""
    files = [path for path in folder.rglob("*") if path.is_file() and UNFINISHED not in path.parts]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def listening(command: list[str], environment: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """Start a process that receives interrupts, even where the tests run in the background and ignore them."""
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
    finally:
        signal.signal(signal.SIGINT, heard)


@pytest.fixture(scope="module")
def runs() -> Iterator[StartedRuns]:
    server = StartedRuns()
    yield server
    server.close()


@pytest.fixture
def started(runs, tmp_path) -> Callable[..., StartedRun]:
    """Start the command in a separate process, and return when it reaches the stage."""
    count = itertools.count()
    return lambda at, *arguments: StartedRun(runs, at, arguments, tmp_path / f"started{next(count)}")


def ended(process: subprocess.Popen[str]) -> Ended:
    out, err = process.communicate(timeout=ENDS_WITHIN_S)
    return Ended(process.returncode, out, err)


# --- a run that ends before its end ----------------------------------------------------------------------------------


@pytest.mark.parametrize("stage", ["fitting", "writing"])
def test_a_killed_run_leaves_the_earlier_results_and_the_next_one_clears_up(earlier, other, started, stage):
    before = contents(earlier)
    run = started(stage, "adapt", other, "--out", earlier)
    run.signal(signal.SIGKILL)
    assert run.ended().status == -signal.SIGKILL
    after = contents(earlier)
    assert {name: after[name] for name in before} == before
    assert all(name.startswith(".") for name in set(after) - set(before))
    assert girdle("adapt", other, "--out", earlier).status == 0
    assert b"other1" in (earlier / "fits.csv").read_bytes()
    assert not [name for name in contents(earlier) if name.startswith(".")]


def test_a_run_killed_between_two_files_leaves_each_of_them_whole(earlier, other, started, tmp_path):
    """Only for milliseconds can tables of two runs be present together; run.json shows it."""
    before = contents(earlier)
    assert girdle("adapt", other, "--out", tmp_path / "new").status == 0
    new = contents(tmp_path / "new")
    run = started("publishing", "adapt", other, "--out", earlier)
    run.signal(signal.SIGKILL)
    run.ended()
    after = contents(earlier)
    assert after["parameters.csv"] == before["parameters.csv"]
    for name in TABLES:
        assert after[name] in (before[name], new[name]), name


@pytest.mark.parametrize("stage", ["fitting", "writing", "publishing"])
def test_an_interrupt_is_status_130_and_a_word(earlier, other, started, stage):
    before = contents(earlier)
    run = started(stage, "adapt", other, "--out", earlier)
    run.signal(signal.SIGINT)
    result = run.ended()
    assert (result.status, result.messages) == (130, ["interrupted"])
    after = contents(earlier)
    assert set(after) >= set(before)
    assert not [name for name in after if name.startswith(".")]
    if stage != "publishing":
        assert after == before


def test_an_interrupt_in_mid_batch_ends_the_real_fits(tmp_path):
    header, *rows = shipped_lines(10)
    many = [row.replace("simulated", f"copy{copy}_") for copy in range(COPIES) for row in rows]
    motion = written(tmp_path, [header, *many])
    command = [str(Path(sys.executable).with_name("girdle")), "fit", str(motion), "--out", str(tmp_path / "out")]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}  # an empty cache: compilation takes long
    process = listening(command, environment)
    assert process.stderr is not None
    while not (tmp_path / "out").exists() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    result = ended(process)
    of_copies = [message for message in result.messages if message.startswith("warning: ")]
    assert (result.status, result.messages) == (130, [*of_copies, "interrupted"])
    assert list((tmp_path / "out").iterdir()) == []


# --- no room, no right -----------------------------------------------------------------------------------------------


def test_a_full_disk_is_status_2_and_leaves_the_earlier_results(quick, motion, tmp_path, small_disk):
    folder = small_disk / "out"
    assert girdle("adapt", motion, "--out", folder).status in (0, 2)  # 2: the report, 5 MB, does not fit
    before = contents(folder)
    assert set(before) > TABLES
    everyone = written(tmp_path, shipped_lines(10), "everyone.csv")
    result = girdle("adapt", everyone, "--out", folder)
    refused(result, str(folder), "No space left on device", "Make room")
    assert contents(folder) == before


@pytest.mark.parametrize("nth", range(1, 9))
def test_a_disk_that_is_full_at_any_file_leaves_the_earlier_results(earlier, other, monkeypatch, nth):
    """The ``nth`` file does not fit: the chunk file, fits, parameters, heldout, summary, the two models, run.json."""
    before, opened, count = contents(earlier), Path.open, iter(range(1, 100))

    def full(path: Path, mode: str = "r", **options: Any) -> Any:
        if mode == "wb" and next(count) == nth:
            with opened(path, mode) as file:
                file.write(b"half of it")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return opened(path, mode, **options)

    monkeypatch.setattr(Path, "open", full)
    result = girdle("adapt", other, "--out", earlier)
    (home,) = (earlier / UNFINISHED).iterdir()
    refused(result, str(home / "0000000.npz" if nth == 1 else earlier), "No space left on device", "Make room")
    assert contents(earlier) == before


def test_a_disk_with_room_for_the_tables_alone_gets_them_and_keeps_no_older_report(earlier, other, monkeypatch):
    opened, before = Path.open, contents(earlier)

    def full(path: Path, mode: str = "r", **options: Any) -> Any:
        file = opened(path, mode, **options)
        if mode == "wb" and path.parent != earlier and (path.parent / "run.json").exists():  # files after run.json
            file.close()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return file

    monkeypatch.setattr(Path, "open", full)
    result = girdle("adapt", other, "--out", earlier)
    (said,) = result.messages
    assert result.status == 2
    assert said.startswith(f"error: {earlier / 'report.html'}: the file cannot be written (No space left on device)")
    assert "the tables are there" in said
    assert "subjects adapted" in result.out
    after = contents(earlier)
    assert "report.html" in before
    assert "report.html" not in after
    assert set(after) >= TABLES
    assert all(after[name] != before[name] for name in TABLES)


def test_a_read_only_folder_is_status_2_before_any_work(quick, motion, tmp_path, monkeypatch, small_disk):
    monkeypatch.setattr(chunked_run, "adapt_checked", lambda *_, **__: pytest.fail("worked for nothing"))
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    for folder in (small_disk, small_disk / "below"):
        refused(girdle("adapt", motion, "--out", folder), str(folder), "Read-only file system", "--out")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_of_someone_else_is_status_2(quick, motion, tmp_path):
    folder = tmp_path / "theirs"
    folder.mkdir(mode=0o500)
    refused(girdle("adapt", motion, "--out", folder), str(folder), "Permission denied", "--out")


@pytest.mark.parametrize("name", ["fits.csv", "run.json"])
def test_a_folder_where_a_table_should_be_changes_nothing(quick, motion, tmp_path, name):
    (tmp_path / "out" / name).mkdir(parents=True)
    refused(girdle("adapt", motion, "--out", tmp_path / "out"), str(tmp_path / "out"), "cannot be written", "--out")
    assert contents(tmp_path / "out") == {}


def test_a_file_where_a_folder_should_be_changes_nothing(quick, motion, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "models").write_text("mine")
    refused(girdle("adapt", motion, "--out", tmp_path / "out"), str(tmp_path / "out"), "cannot be written", "--out")
    assert contents(tmp_path / "out") == {"models": b"mine"}


def test_a_cache_that_cannot_be_used_is_no_matter(motion, tmp_path):
    """The cache folder for compiled programs would be below a file, so it cannot be made."""
    (tmp_path / "cache").write_text("")
    command = [str(Path(sys.executable).with_name("girdle")), "simulate", "--subjects", "1", "--out", "out"]
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    result = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=ENDS_WITHIN_S, check=False
    )
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    assert (tmp_path / "out" / "motions.csv").exists()


@pytest.mark.parametrize(
    "error",
    [
        MemoryError("Unable to allocate 29.0 MiB for an array with shape (1680, 29, 78)"),  # numpy's message
        ImportError("_x.so: failed to map segment from shared object"),
        RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 8 bytes."),
        RuntimeError("can't start new thread"),
        OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)),
    ],
    ids=str,
)
def test_too_little_memory_is_one_sentence_and_leaves_the_earlier_results(earlier, other, monkeypatch, error):
    before = contents(earlier)

    def out_of_memory(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(chunked_run, "adapt_checked", out_of_memory)
    refused(girdle("adapt", other, "--out", earlier), "this run", "too little memory", "a smaller --chunk")
    assert contents(earlier) == before


# --- two runs, one folder --------------------------------------------------------------------------------------------


def test_a_second_run_in_a_folder_is_told_of_the_first(earlier, motion, other, started):
    before = contents(earlier)
    first = started("fitting", "adapt", other, "--out", earlier)
    refused(girdle("adapt", motion, "--out", earlier), str(earlier), "another run is writing to this folder", "Wait")
    assert contents(earlier) == before
    first.signal(signal.SIGKILL)
    first.ended()
    assert girdle("adapt", motion, "--out", earlier).status == 0, "the lock ends with its process"


def test_many_runs_at_once_leave_the_files_of_one(quick, motion, other, started, tmp_path):
    folder, inputs = tmp_path / "out", [motion, other] * 2
    at_once = [started("never", "adapt", path, "--out", folder) for path in inputs]
    statuses = [run.ended().status for run in at_once]
    assert set(statuses) <= {0, 2}
    assert 0 in statuses
    alone = {}
    for path in (motion, other):
        assert girdle("adapt", path, "--out", tmp_path / path.stem).status == 0
        alone[path] = contents(tmp_path / path.stem)
    tables = {name: content for name, content in contents(folder).items() if name in TABLES}
    assert tables in [{name: one[name] for name in TABLES} for one in alone.values()]


# --- names from files ------------------------------------------------------------------------------------------------

NAMES = ["../../x", "/etc/girdle", "..", ".", "a\nb", "\x1b]0;title\x07", "C:\\x", "nul", "~", "$(touch x)", "x" * 300]


def test_names_are_no_paths_no_commands_and_no_control_of_the_terminal(quick, tmp_path):
    """Each shipped subject gets a name that would do harm if it were used as a path, a command or terminal output."""
    header, *rows = shipped_lines(1)
    lines = [header] + [row.replace("simulated01", f'"{name}"', 1) for name in NAMES for row in rows]
    home = tmp_path / "some" / "where"
    home.mkdir(parents=True)
    model = model_file("R2").read_text()
    (home / "own.toml").write_text(model.replace('name = "R2"', 'name = "../../\\u001b[31mR2"'))
    result = girdle("adapt", written(home, lines), "--model", home / "own.toml", "--out", home / "out")
    assert result.status == 0, result.err
    assert {path.name for path in tmp_path.iterdir()} == {"some"}
    assert {path.name for path in (tmp_path / "some").iterdir()} == {"where"}
    assert {path.name for path in home.iterdir()} == {"motion.csv", "own.toml", "out"}
    files = list((home / "out" / "models").iterdir())
    assert len(files) == len(NAMES)
    assert {load_model(path).name for path in files} == {f"../../\x1b[31mR2_{name}" for name in NAMES}
    assert not [c for c in result.out + result.err if c != "\n" and not c.isprintable()]


def test_a_file_that_only_looks_like_a_part_is_kept(earlier, motion):
    """Only files with this program's exact names for parts are removed."""
    mine = [earlier / ".notes.part", earlier / f"{part_name()}s", earlier / f"x{part_name()}"]
    for path in mine:
        path.write_text("mine")
    theirs = earlier / part_name()
    theirs.mkdir()
    (theirs / "fits.csv").write_text("half")
    assert girdle("adapt", motion, "--out", earlier).status == 0
    assert all(path.exists() for path in mine)
    assert not theirs.exists()


def test_a_file_system_without_locks_is_written_to(quick, motion, tmp_path, monkeypatch):
    def unsupported(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(output.fcntl, "flock", unsupported)
    assert girdle("adapt", motion, "--out", tmp_path / "out").status == 0
