"""The command line, run in the process of the test."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from adapt.cli import app as cli

SHIPPED = Path(cli.__file__).parents[2] / "motions" / "data" / "simulated_subjects.csv"


@dataclass(frozen=True)
class Ended:
    """Exit status and output of a command that has ended."""

    status: int
    out: str
    err: str

    @property
    def messages(self) -> list[str]:
        """Lines on stderr."""
        return self.err.splitlines()


def girdle(*arguments: object) -> Ended:
    """Run ``girdle ARGUMENTS`` in this process, without the user's compilation cache."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["girdle", *map(str, arguments)])
        patch.setattr(cli, "keep_compiled", lambda: None)
        with pytest.raises(SystemExit) as ended:
            cli.main()
    code = ended.value.code
    assert code is None or isinstance(code, int)
    return Ended(code or 0, out.getvalue(), err.getvalue())


def written(folder: Path, lines: list[str], name: str = "motion.csv") -> Path:
    path = folder / name
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def refused(ended: Ended, where: str, cause: str, remedy: str) -> None:
    """Check for exit status 2 and one line on stderr with place, cause and remedy."""
    assert ended.status == 2
    assert ended.out == ""
    assert ended.err.count("\n") == 1, ended.err
    assert ended.err.startswith(f"error: {where}: "), ended.err
    assert cause in ended.err
    assert remedy in ended.err


def shipped_lines(subjects: int = 2) -> list[str]:
    """Return the header and the rows of the first shipped subjects, with 14 postures each."""
    return SHIPPED.read_text().splitlines()[: 1 + 14 * subjects]
