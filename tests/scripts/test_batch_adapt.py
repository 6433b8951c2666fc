"""`scripts/batch_adapt.py` gives the results of `girdle adapt` on the files of a folder."""

from pathlib import Path

import pandas as pd
import pytest
import typer
from command import girdle

from motions import InputError
from scripts.batch_adapt import batch

FEW = ["--model", "R2", "--subjects", 1, "--noise-deg", 1]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write two simulated subjects, one file each."""
    made = tmp_path / "subjects"
    made.mkdir()
    for seed in (1, 2):
        assert girdle("simulate", *FEW, "--seed", seed, "--out", tmp_path / str(seed)).status == 0
        table = pd.read_csv(tmp_path / str(seed) / "motions.csv")
        table.assign(subject=f"s{seed}").to_csv(made / f"s{seed}.csv", index=False)
    return made


def test_a_folder_is_adapted_as_its_files_are_with_the_same_options(folder, tmp_path):
    # The programs for this effect, model and number of postures are already compiled by other tests.
    effect, files = "thorax_extension=0,5,0", sorted(folder.glob("*.csv"))
    batch(folder, tmp_path / "batch", effect=[effect])
    assert girdle("adapt", *files, "--effect", effect, "--out", tmp_path / "files").status == 0
    found, expected = (pd.read_csv(tmp_path / name / "parameters.csv") for name in ("batch", "files"))
    assert list(found["subject"]) == ["s1", "s2"]
    pd.testing.assert_frame_equal(found, expected, check_exact=True)


def test_what_is_no_file_is_named_and_left_out(folder, tmp_path, capsys):
    (folder / "gone.csv").symlink_to(folder / "nowhere.csv")
    with pytest.raises(typer.Exit) as ended:
        batch(folder, tmp_path / "out")
    assert ended.value.exit_code == 3
    assert "gone.csv: there is no file behind this name" in capsys.readouterr().err
    assert len(pd.read_csv(tmp_path / "out" / "parameters.csv")) == 2


def test_a_folder_without_motions_and_one_that_holds_them_are_refused(folder, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no motion file"):
        batch(tmp_path / "empty", tmp_path / "out")
    with pytest.raises(InputError, match="taken for motion files"):
        batch(folder, folder)
