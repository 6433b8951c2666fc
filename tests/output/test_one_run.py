"""A folder holds one run: files of another command, set or version are removed, the user's own files are not."""

import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from command import Ended, girdle, shipped_lines, written
from quick_girdle import quick_adaptations

from adapt.output import publishing
from adapt.output.large_runs import chunked_run
from adapt.output.publishing import UNFINISHED
from adapt.output.run_files import transaction
from adapt.output.written_files import LIST, last_written

TABLES = {"fits.csv", "summary.csv", "run.json", LIST}
ADAPTED = {*TABLES, "parameters.csv", "heldout.csv", "report.html", "models/R2_simulated01.toml"}


@pytest.fixture
def motion(tmp_path, monkeypatch) -> Path:
    """Write one subject, and replace the adaptation by one without a solver."""
    monkeypatch.setattr(chunked_run, "adapt_checked", quick_adaptations)
    return written(tmp_path, shipped_lines(1))


@pytest.fixture
def adapted(motion, tmp_path) -> Path:
    folder = tmp_path / "out"
    assert girdle("adapt", motion, "--out", folder).status == 0
    assert names(folder) == ADAPTED
    return folder


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def fits(motion: Path, folder: Path) -> Ended:
    ended = girdle("fit", motion, "--model", "R4", "--out", folder)
    assert ended.status == 0, ended.err
    return ended


def test_another_command_leaves_nothing_of_the_one_before(adapted, motion):
    assert fits(motion, adapted).err == ""
    assert names(adapted) == TABLES
    assert [path.name for path in adapted.iterdir() if path.is_dir()] == []
    assert "R2" not in (adapted / "fits.csv").read_text()


def test_another_set_leaves_no_model_of_the_one_before(adapted, motion):
    assert girdle("adapt", motion, "--model", "R4", "--out", adapted).status == 0
    assert names(adapted) == {*ADAPTED, "models/R4_simulated01.toml"} - {"models/R2_simulated01.toml"}


def test_the_list_is_what_sha256sum_checks(adapted):
    checked = subprocess.run(["sha256sum", "--check", "--quiet", LIST], cwd=adapted, capture_output=True, check=False)
    assert (checked.returncode, checked.stdout) == (0, b"")
    assert {*last_written(adapted).hashes} == ADAPTED - {LIST}


def test_files_of_the_user_stay(adapted, motion):
    """Also files with names that another command would write."""
    mine = {"notes.txt", "trust.csv", "models/mine.toml", "figures/one.svg", f"{UNFINISHED}/mine/1.npz"}
    for name in mine:
        (adapted / name).parent.mkdir(parents=True, exist_ok=True)
        (adapted / name).write_text("mine")
    assert fits(motion, adapted).err == ""
    assert names(adapted) == TABLES | mine
    assert girdle("adapt", motion, "--out", adapted).status == 0
    assert names(adapted) == ADAPTED | mine
    assert {(adapted / name).read_text() for name in mine} == {"mine"}


@pytest.mark.parametrize("name", ["models/R2_simulated01.toml", "fits.csv"])
def test_a_file_that_was_changed_since_is_kept_under_another_name(adapted, motion, name):
    """One file that would be removed, and one that would be overwritten."""
    (adapted / name).write_text("mine")
    ended = fits(motion, adapted)
    assert ended.messages == [
        f"warning: {adapted / name}: no run wrote this file, or it was changed since. "
        f"It is kept as {Path(name).name}.kept1."
    ]
    assert names(adapted) == TABLES | {f"{name}.kept1"}
    assert (adapted / f"{name}.kept1").read_text() == "mine"


def test_a_file_of_the_user_is_not_overwritten_by_the_first_run(motion, tmp_path):
    (tmp_path / "out").mkdir()
    for name in ("summary.csv", "summary.csv.kept1"):
        (tmp_path / "out" / name).write_text(name)
    assert "summary.csv.kept2" in fits(motion, tmp_path / "out").err
    assert (tmp_path / "out" / "summary.csv.kept2").read_text() == "summary.csv"
    assert (tmp_path / "out" / "summary.csv.kept1").read_text() == "summary.csv.kept1"


def test_results_of_a_version_without_a_list_go(adapted, motion):
    (adapted / LIST).unlink()
    (adapted / "trust.csv").write_text("mine: girdle adapt wrote none")
    assert fits(motion, adapted).err == ""
    assert names(adapted) == TABLES | {"trust.csv"}


def test_what_a_run_reads_stays(motion, tmp_path):
    folder = tmp_path / "out"
    assert girdle("simulate", "--subjects", 1, "--out", folder).status == 0
    assert girdle("adapt", folder / "motions.csv", "--out", folder).status == 0
    assert names(folder) >= {"motions.csv", "truth.csv", "models/R2_simulated01.toml"}, "simulated motions are data"
    own = folder / "models" / "R2_simulated01.toml"
    assert girdle("fit", folder / "motions.csv", "--model", own, "--out", folder).status == 0
    expected = {*TABLES, "motions.csv", "truth.csv", "models/R2_simulated01.toml"}
    assert names(folder) == expected
    simulated = girdle("simulate", "--subjects", 1, "--seed", 1, "--out", folder)
    assert (simulated.status, simulated.err) == (0, ""), "replaced, as it is listed still"
    assert names(folder) == {"motions.csv", "truth.csv", "run.json", LIST}


@pytest.mark.parametrize("command", ["fit", "adapt", "diagnose", "trust", "muscles"])
def test_an_input_that_the_run_would_replace_is_refused_before_any_work(motion, tmp_path, monkeypatch, command):
    for work in ("adapt.cli.commands.fit_runs.fit_postures", "adapt.evaluation.held_out.adapt_batch"):
        monkeypatch.setattr(work, lambda *_: pytest.fail("worked for nothing"))
    given = tmp_path / "summary.csv"
    given.write_bytes(motion.read_bytes())
    ended = girdle(command, given, "--out", tmp_path)
    assert ended.status == 2
    assert f"this run reads {given.name} in this folder and would replace it" in ended.err
    assert given.read_bytes() == motion.read_bytes()


def test_a_run_that_failed_leaves_the_one_before(adapted, motion, monkeypatch):
    before = {name: (adapted / name).read_bytes() for name in names(adapted)}
    monkeypatch.setattr("adapt.cli.commands.fit_runs.write_run", lambda *_: (_ for _ in ()).throw(OSError(28, "full")))
    assert girdle("fit", motion, "--model", "R4", "--out", adapted).status == 2
    assert {name: (adapted / name).read_bytes() for name in names(adapted)} == before


def test_a_run_that_was_killed_while_it_replaced_files_leaves_none_that_the_next_does_not_know(
    adapted, motion, monkeypatch
):
    class KilledError(BaseException):
        """End as by kill -9: no clean-up handles it."""

    def killed(*_: object) -> None:
        raise KilledError

    with monkeypatch.context() as patch:
        patch.setattr(publishing, "_remove", killed)
        with suppress(KilledError), transaction(adapted) as staged:
            for name in ("fits.csv", "weights.csv", "run.json"):
                (staged / name).write_text('{"motions": [], "models": []}')
    assert {"weights.csv", "parameters.csv"} <= names(adapted)
    assert fits(motion, adapted).err == ""
    assert names(adapted) == TABLES


def test_chunks_of_stopped_runs_stay_until_a_run_has_come_to_its_end(adapted, motion):
    stopped = [adapted / UNFINISHED / (key * 16) / "0000000.npz" for key in "ab"]
    for path in stopped:
        path.parent.mkdir(parents=True)
        path.write_bytes(b"a chunk")
    chunked_run.ChunkFiles(adapted, "b" * 16)
    assert all(path.exists() for path in stopped)
    fits(motion, adapted)
    assert not (adapted / UNFINISHED).exists()


def test_a_file_where_chunks_would_wait_is_said(motion, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / UNFINISHED).write_text("mine")
    ended = girdle("adapt", motion, "--out", tmp_path / "out")
    assert ended.status == 2
    assert "the folder cannot be made" in ended.err
