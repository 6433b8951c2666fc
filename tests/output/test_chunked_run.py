# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Runs in chunks: any chunk size, an interruption and a cluster give the same results; nothing is lost or doubled."""

import importlib.util
import io
import os
import signal
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import girdle
from dying_work import DyingWork
from waiting_work import WAIT_S

from adapt.api import adapt_subjects
from adapt.output.large_runs import chunked_run
from adapt.output.large_runs.chunked_run import ChunkFiles, Chunks, Work, one_after_another
from adapt.output.large_runs.local_processes import in_processes
from adapt.output.large_runs.table_arrays import as_rows, as_table
from adapt.output.publishing import UNFINISHED
from adapt.output.run_files import inputs_record, run_key
from adapt.own_bones.own_adaptation import learn_people
from adapt.solvers.rows import posture_rows
from adapt.tables.held_out import NOTHING
from adapt.tables.results import STATISTICS
from adapt.trust.usable_results import flat_by_subject
from models import load_model
from motions import InputError, MotionStream, read_motions, write_motions
from motions.rhythm_subjects import simulate_subjects

SAME = 1e-9
"""Tolerance in degrees, mm, mm^2: solutions are exact to rounding, whatever the batch."""

TABLES = ("fits", "heldout", "parameters", "summary")


@pytest.fixture(scope="module")
def motion(tmp_path_factory) -> Path:
    """Write five simulated subjects."""
    path = tmp_path_factory.mktemp("motion") / "motion.csv"
    write_motions(simulate_subjects(5, seed=3), path)
    return path


@pytest.fixture(scope="module")
def whole(motion, tmp_path_factory) -> Path:
    """Adapt them in one chunk."""
    folder = tmp_path_factory.mktemp("whole")
    ended = girdle("adapt", motion, "--model", "R2", "--out", folder)
    assert ended.status == 0, ended.err
    return folder


@pytest.fixture(scope="module", params=[(), ("--own-bones",)], ids=["plain", "own bones"])
def asked(request, motion, tmp_path_factory) -> tuple[tuple[object, ...], Path]:
    """Return the arguments of an adaptation in five chunks, and the folder of the same one in one chunk."""
    options, folder = (motion, "--model", "R2", *request.param), tmp_path_factory.mktemp("asked")
    ended = girdle("adapt", *options, "--out", folder)
    assert ended.status == 0, ended.err
    return (*options, "--chunk", 1), folder


def work(held_out: Iterable[str] = (), shown: Iterable[str] = ()) -> Work:
    return Work((load_model("R2"),), 10.0, "mm2_deg2", frozenset(shown), frozenset(held_out))


def assert_same_tables(folder: Path, expected: Path) -> None:
    for name in TABLES:
        one, other = (pd.read_csv(each / f"{name}.csv") for each in (folder, expected))
        pd.testing.assert_frame_equal(one, other, check_exact=False, rtol=SAME, atol=SAME)


@pytest.mark.parametrize("chunk", [1, 2, 5])
def test_results_do_not_depend_on_the_chunk(motion, whole, tmp_path, chunk):
    ended = girdle("adapt", motion, "--model", "R2", "--chunk", chunk, "--out", tmp_path)
    assert ended.status == 0, ended.err
    assert_same_tables(tmp_path, whole)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in whole.iterdir())
    assert len(list((tmp_path / "models").iterdir())) == 5


def test_the_report_of_several_chunks_says_that_it_is_a_sample(motion, tmp_path, monkeypatch):
    monkeypatch.setattr("adapt.cli.commands.fit_runs.MOST_SHOWN", 3)
    girdle("adapt", motion, "--model", "R2", "--chunk", 2, "--out", tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "this page is about 3 of 5 subjects" in page
    assert len(pd.read_csv(tmp_path / "parameters.csv")) == 5


def test_a_chunk_is_what_its_subjects_are_alone(motion):
    """The numbers equal those from Python, bit by bit, because they are written with all digits."""
    motions = read_motions(motion)
    tables = adapt_subjects(motions, load_model("R2"))
    folder = motion.parent / "alone"
    folder.mkdir()
    made = ChunkFiles(folder, "key")
    made.make(work(motions.subjects, motions.subjects), [motions], one_after_another, lambda _: None)
    found = made.merge(folder, work(shown=motions.subjects))
    assert found.flat == flat_by_subject(["R2"], motions.subjects, tables.uncertainty)
    for name in ("summary", "parameters", "heldout"):
        pd.testing.assert_frame_equal(getattr(found, name), getattr(tables, name), check_exact=True)
    pd.testing.assert_frame_equal(found.shown.fits, tables.fits, check_exact=True)
    assert found.failed == {}


def test_of_subjects_that_the_report_does_not_show_the_statistics_are_kept(motion):
    motions = read_motions(motion)
    folder = motion.parent / "some"
    folder.mkdir()
    made, one = ChunkFiles(folder, "key"), motions.subjects[1]
    chunks = [motions.select(motions.subject == name) for name in motions.subjects]
    made.make(work(), chunks, one_after_another, lambda _: None)
    found = made.merge(folder, work(shown=[one]))
    everybody = pd.read_csv(folder / "summary.csv")
    kept = everybody[everybody["subject"].isin([one, *STATISTICS])].reset_index(drop=True)
    pd.testing.assert_frame_equal(found.summary, kept, check_dtype=False, rtol=SAME, atol=SAME)
    assert set(everybody["subject"]) == {*motions.subjects, *STATISTICS}
    of_shown = (set(table["subject"]) - {*STATISTICS} for table in (found.shown.parameters, found.shown.summary))
    assert list(of_shown) == [{one}, {one}]
    assert set(found.parameters["subject"]) == set(motions.subjects)


def test_arrays_hold_a_table_exactly_and_a_chunk_without_rows_changes_nothing():
    """Floats are exact, integers stay integers, names have any length; without chunks there is an empty table."""
    names = ["s1", "a,b", "x" * 300, "ä"]
    table = pd.DataFrame({"subject": names, "gap_deg": [np.nan, np.inf, 0.1 + 0.2, 5e-324], "postures": range(4)})
    chunks = [as_rows(one) for one in (table.iloc[:0], table.iloc[:1], table.iloc[1:])]
    assert not any(rows.dtype.hasobject for rows in chunks)
    pd.testing.assert_frame_equal(as_table(lambda: chunks), table, check_exact=True)
    empty = as_table(lambda: [as_rows(NOTHING)])
    assert (len(empty), tuple(empty)) == (0, tuple(NOTHING))


class StoppedError(Exception):
    """Interruption, as if the machine had been switched off."""


def test_a_stopped_run_goes_on_where_it_was(asked, tmp_path, monkeypatch):
    options, whole = asked

    def stopped(work: Work, chunks: Chunks) -> Iterator[tuple[int, bytes]]:
        for count, made in enumerate(one_after_another(work, chunks)):
            if count == 2:
                raise StoppedError
            yield made

    arguments = ("adapt", *options, "--out", tmp_path)
    monkeypatch.setattr("adapt.output.large_runs.local_processes.one_after_another", stopped)
    with pytest.raises(StoppedError):
        girdle(*arguments)
    assert [path.name for path in tmp_path.iterdir()] == [UNFINISHED]
    assert len(list((tmp_path / UNFINISHED).rglob("*.npz"))) == 2

    made = []

    def counted(work: Work, chunks: Chunks) -> Iterator[tuple[int, bytes]]:
        for number, content in one_after_another(work, chunks):
            made.append(number)
            yield number, content

    monkeypatch.setattr("adapt.output.large_runs.local_processes.one_after_another", counted)
    assert girdle(*arguments).status == 0
    assert made == [2, 3, 4]
    assert_same_tables(tmp_path, whole)
    assert not (tmp_path / UNFINISHED).exists()


# --- reading in chunks ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("chunk", [1, 2, 3, None])
def test_chunks_hold_every_posture_once(motion, chunk):
    """Also for subjects whose rows alternate, and that are in two files."""
    header, *lines = motion.read_text().splitlines()
    turns = [line for k in range(14) for line in lines[k::14]]
    files = [motion.parent / "first.csv", motion.parent / "second.csv"]
    for path, some in zip(files, (turns[:40], turns[40:]), strict=True):
        path.write_text("\n".join([header, *some]) + "\n")
    whole = read_motions(*files)
    read = list(MotionStream(*files).in_chunks(chunk))
    assert [len(one.subjects) for one in read] == {1: [1] * 5, 2: [2, 2, 1], 3: [3, 2], None: [5]}[chunk]
    for name in whole.subjects:
        (mine,) = (one for one in read if name in one.subjects)
        mine, expected = (one.select(one.subject == name) for one in (mine, whole))
        np.testing.assert_array_equal(mine.angles_deg, expected.angles_deg)
        assert mine.posture.tolist() == expected.posture.tolist()


def test_who_is_left_out_is_named_once(motion):
    header, *lines = motion.read_text().splitlines()
    bad = motion.parent / "bad.csv"
    told = "simulated02,abduction,3,"
    spoiled = [line.replace(told, f"{told}x") for line in lines]
    bad.write_text("\n".join([header, *spoiled]) + "\n")
    stream = MotionStream(bad)
    names = [name for one in stream.in_chunks(2) for name in one.subjects]
    assert names == ["simulated01", "simulated03", "simulated04", "simulated05"]
    assert [error.row for error in stream.rejected] == [18]


# --- a cluster ------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="distributed is not installed")
@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_is_killed_costs_nothing(motion, whole, tmp_path, monkeypatch):
    """Two processes; one is killed after the first chunk is written, while it has work."""
    from distributed import Client, LocalCluster

    written = []
    write = chunked_run.atomic_write_bytes

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            pids = list(client.run(os.getpid).values())

        def write_and_kill(path: Path, content: bytes) -> None:
            written.append(path.name)
            write(path, content)
            if len(written) == 1:
                os.kill(pids[0], signal.SIGKILL)

        monkeypatch.setattr(chunked_run, "atomic_write_bytes", write_and_kill)
        address = cluster.scheduler_address
        ended = girdle("adapt", motion, "--model", "R2", "--chunk", 1, "--dask", address, "--out", tmp_path)
    assert ended.status == 0, ended.err
    assert sorted(written) == [f"{number:07d}.npz" for number in range(5)]
    assert_same_tables(tmp_path, whole)


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="distributed is not installed")
@pytest.mark.filterwarnings("ignore")
def test_an_address_without_a_scheduler_is_bad_input(motion, tmp_path, monkeypatch):
    monkeypatch.setattr("adapt.output.large_runs.dask_cluster._CONNECT_S", 0.5)
    ended = girdle("adapt", motion, "--dask", "tcp://127.0.0.1:1", "--out", tmp_path)
    assert ended.status == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:1" in ended.err


def test_a_run_of_a_pipe_goes_on_with_no_other(motion, tmp_path):
    """Input files are identified by their hash; a pipe has none, and may contain something else the next time."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    of_file, of_pipe = (inputs_record([path], ["R2"]) for path in (motion, pipe))
    assert run_key(of_file, {}) == run_key(of_file, {})
    assert run_key(of_pipe, {}) != run_key(of_pipe, {})


def content(chunk_file: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(chunk_file)) as file:
        return {name: file.read(name) for name in file.namelist()}


@pytest.mark.parametrize("own_bones", [False, True], ids=["set's bones", "own bones"])
def test_processes_make_the_chunk_files_that_one_makes(motion, own_bones):
    chunks, asked = list(enumerate(MotionStream(motion).in_chunks(2))), work()
    if own_bones:
        asked = replace(asked, people=learn_people(posture_rows(read_motions(motion)), asked.models))
    expected, found = (list(maker(asked, iter(chunks))) for maker in (one_after_another, in_processes))
    assert [number for number, _ in found] == [0, 1, 2]
    for (_, one), (_, other) in zip(found, expected, strict=True):
        assert content(one) == content(other)


def test_a_process_that_the_system_ends_is_named_with_what_to_do(motion):
    chunks = enumerate(MotionStream(motion).in_chunks(5))
    dying = DyingWork(*(getattr(work(), field.name) for field in fields(Work)))
    with pytest.raises(InputError, match=r"the system ended a process.* continues where it was\. A smaller --chunk"):
        list(in_processes(dying, chunks))


def test_processes_end_with_the_one_that_asks_for_chunks():
    """The asking process is killed and cannot tell its workers; their output ends when the last one has ended."""
    program = Path(__file__).parents[1] / "helpers" / "waiting_work.py"
    environment = os.environ | {"PYTHONPATH": str(program.parents[2])}
    with subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True, env=environment) as asking:
        assert asking.stdout is not None
        assert asking.stdout.readline() == "working\n"
        asking.kill()
        assert asking.communicate(timeout=WAIT_S / 2.0) == ("", None)


def test_a_run_of_many_chunks_is_shared_between_processes(motion, whole, tmp_path, monkeypatch):
    """The command decides by the number of chunks and cores; on one core it starts no processes."""
    made = []

    def maker(given: Work, chunks: Chunks):
        made.append("processes")
        return one_after_another(given, chunks)

    monkeypatch.setattr("adapt.output.large_runs.local_processes.in_processes", maker)
    monkeypatch.setattr("adapt.output.large_runs.local_processes.MANY_CHUNKS", 5)
    for cores, expected in ((1, []), (2, ["processes"])):
        monkeypatch.setattr("adapt.output.large_runs.local_processes.cores", lambda cores=cores: cores)
        girdle("adapt", motion, "--model", "R2", "--chunk", 1, "--out", tmp_path / str(cores))
        assert made == expected
        assert_same_tables(tmp_path / str(cores), whole)
