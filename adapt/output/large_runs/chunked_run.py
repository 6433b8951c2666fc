# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportReturnType=false, reportCallIssue=false
# (pandas declares "Series | DataFrame | scalar" for nearly every result)
"""Runs of any size in chunks: a chunk file holds the rows of a chunk of subjects in the tables of ``girdle adapt``.

A chunk file has arrays (npz, without pickle) and is written whole or not at all. Chunk files wait in ``unfinished/KEY``
below the folder of the results. A run that was stopped continues with those that exist; when all exist, they become the
tables, each written once. Then they are removed (``adapt.output.publishing``).
"""

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from adapt.api import Adaptations, adapt_checked, checked, simulated_positions
from adapt.output.large_runs.table_arrays import Rows, as_rows, as_table
from adapt.output.publishing import UNFINISHED
from adapt.own_bones.own_adaptation import NOT_CONVERGED, WORDS, People
from adapt.solvers import status
from adapt.solvers.status import EXPLANATION
from adapt.tables.positions_table import NO_POSITIONS, POSITIONS_FILE, with_positions
from adapt.tables.results import OWN_WORD, STATISTICS, Tables, as_csv, rows_of_subjects, summary_pieces
from adapt.trust.usable_results import Flat, flat_by_subject
from models.effects.amplitudes import Amplitudes
from models.person.family import AnyModel
from motions.files import atomic_write_bytes, atomic_write_pieces, make_folder
from motions.table import Motions

LANES = 512
"""Number of subjects times models per chunk: two of the batches that stay in a core's cache, and 0.3 GB of memory. With
chunks of 1024, 100 000 subjects took 3 % less time and a tenth more memory."""

MOST_SHOWN = 400
"""Largest number of subjects in the report of a run of several chunks."""

_STATES = (0, 1)
"""Values of the column ``adapted``."""

_ENDING = ".npz"


@dataclass(frozen=True)
class Work:
    """Computation that is applied to every chunk."""

    models: tuple[AnyModel, ...]
    weight: float
    objective: str
    shown: frozenset[str]
    """Subjects of the report."""
    held_out: frozenset[str]
    """Subjects for whom held-out gaps are computed."""
    float32: bool = False
    effects: Amplitudes = field(default_factory=dict)
    """Amplitudes of known effects, in a dict, which can be sent to a worker."""
    thorax_downweighting: float = 1.0
    people: People | None = None
    """Differences between the persons of the run, where each person has own bones."""

    def chunk_file(self, motions: Motions) -> bytes:
        """Compute the content of the chunk file of these subjects; the result is the same in every process."""
        dtype = np.float32 if self.float32 else np.float64
        result = adapt_checked(
            checked(motions),
            self.models,
            self.weight,
            self.objective,
            self.held_out,
            dtype,
            self.effects,
            self.thorax_downweighting,
            False if self.people is None else self.people,
        )
        content = io.BytesIO()
        arrays = _arrays(result, [model.name for model in self.models])
        arrays["flat"] = self._flat(result, motions)
        arrays |= self._positions(result, motions)
        np.savez(content, allow_pickle=False, **arrays)
        return content.getvalue()

    def _flat(self, result: Adaptations, motions: Motions) -> np.ndarray:
        """Return model, subject and flat directions of each adaptation that the report shows."""
        found = flat_by_subject(list(result.adapted), motions.subjects, result.uncertainty, self.shown)
        return np.array([(*pair, said) for pair, said in found.items()], dtype=str).reshape(-1, 3)

    def _positions(self, result: Adaptations, motions: Motions) -> dict[str, np.ndarray]:
        """Return the positions of landmarks, for the subjects with a measured landmark."""
        there = with_positions(motions)
        table = simulated_positions(result, motions, self.models) if len(there) else NO_POSITIONS
        mine = table[table["subject"].isin(there)]
        return {_name("positions", k): as_rows(mine[mine["model"] == m.name]) for k, m in enumerate(self.models)}


def _arrays(result: Adaptations, models: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the content of a chunk file, by name: the rows of each table, separate for each model and state."""
    found: dict[str, np.ndarray] = {"failed": np.array(list(not_adapted(result).items()), dtype=str).reshape(-1, 2)}
    for k, model in enumerate(models):
        fits = result.fits[result.fits["model"] == model]
        for state in _STATES:
            found[_name("fits", k, state)] = as_rows(fits[fits["adapted"] == state])
            found[_name("subjects", k, state)] = as_rows(result.subjects[model, state])
        found[_name("parameters", k)] = as_rows(result.parameters[result.parameters["model"] == model])
        found[_name("heldout", k)] = as_rows(result.heldout[result.heldout["model"] == model])
    return found


def _name(table: str, model: int, state: int | str = "") -> str:
    """Return the name of the rows of a table for one model, by its number, and for one state where the table has
    two."""
    return f"{table}{state}/{model}"


Chunks = Iterator[tuple[int, Motions]]

Maker = Callable[[Work, Chunks], Iterable[tuple[int, bytes]]]
"""Function that makes the chunk files of numbered chunks, in any order."""


def one_after_another(work: Work, chunks: Chunks) -> Iterator[tuple[int, bytes]]:
    """Make the chunk files one after another in this process, on every device that JAX sees."""
    for number, motions in chunks:
        yield number, work.chunk_file(motions)


class Merged(NamedTuple):
    """Tables that a run needs after they are written."""

    shown: Tables
    """Tables of the subjects that the report shows."""
    parameters: pd.DataFrame
    heldout: pd.DataFrame
    """Held-out gaps of all subjects, as ``parameters`` is of all subjects."""
    summary: pd.DataFrame
    """Statistics over all subjects, with the rows of the subjects that the report shows."""
    failed: dict[str, str]
    """Failures of all subjects, by subject."""
    flat: Flat
    """Flat directions of the adaptations that the report shows."""


class ChunkFiles:
    """Chunk files of one run, finished and missing."""

    def __init__(self, folder: Path, key: str):
        """Create the folder of the chunk files. ``key`` identifies the run: those of other runs stay until a run in
        this folder is complete."""
        self._home = folder / UNFINISHED / key
        make_folder(self._home)

    def make(self, work: Work, chunks: Iterable[Motions], maker: Maker, progress: Callable[[str], None]) -> Motions:
        """Make every missing chunk file, and return the motions that the report shows."""
        shown: list[Motions] = []
        done = 0

        def missing() -> Chunks:
            nonlocal done
            for number, motions in enumerate(chunks):
                shown.append(motions.select(np.isin(motions.subject, list(work.shown))))
                done += len(motions.subjects)
                if not self._path(number).exists():
                    progress(f"adaptation, {done} subjects")
                    yield number, replace(motions, rejected=())

        for number, content in maker(work, missing()):
            atomic_write_bytes(self._path(number), content)
        return Motions.concatenate(shown)

    def merge(self, folder: Path, work: Work) -> Merged:
        """Write fits.csv, parameters.csv, heldout.csv, summary.csv and, where landmarks were measured, positions.csv.

        Fits and positions are in memory one chunk at a time, the summary one motion at a time.
        """
        models = range(len(work.models))
        states = [(state, k) for state in _STATES for k in models]
        shown: list[pd.DataFrame] = []
        summary: list[pd.DataFrame] = []

        def every_fit() -> Iterator[pd.DataFrame]:
            for table in self._tables(_name("fits", k, state) for state, k in states):
                shown.append(table[table["subject"].isin(work.shown)])
                yield table

        atomic_write_pieces(folder / "fits.csv", _pieces(every_fit()))
        fits = pd.concat(shown, ignore_index=True)
        parameters, heldout = (
            as_table(partial(self._rows, [_name(one, k) for k in models])) for one in ("parameters", "heldout")
        )

        def every_summary() -> Iterator[pd.DataFrame]:
            for state, k in states:
                chunks = partial(self._tables, [_name("subjects", k, state)])
                for table in summary_pieces(work.models[k].name, state, chunks, heldout):
                    kept = table[table["subject"].isin([*work.shown, *STATISTICS])]
                    if len(kept):
                        summary.append(kept)
                    yield table

        for name, pieces in (("parameters", [parameters]), ("heldout", [heldout]), ("summary", every_summary())):
            atomic_write_pieces(folder / f"{name}.csv", _pieces(pieces))
        names = [_name("positions", k) for k in models]
        if any(len(rows) for rows in self._rows(names)):
            atomic_write_pieces(folder / POSITIONS_FILE, _pieces(self._tables(names)))
        failed = {subject: why for pairs in self._rows(["failed"]) for subject, why in pairs.tolist()}
        mine = (table[table["subject"].isin(work.shown)] for table in (parameters, heldout))
        return Merged(
            Tables(fits, *mine, rows_of_subjects(fits)),
            parameters,
            heldout,
            pd.concat(summary, ignore_index=True),
            failed,
            {(model, subject): said for rows in self._rows(["flat"]) for model, subject, said in rows.tolist()},
        )

    def _tables(self, names: Iterable[str]) -> Iterator[pd.DataFrame]:
        return map(pd.DataFrame, self._rows(names))

    def _rows(self, names: Iterable[str]) -> Iterator[Rows]:
        """Yield the arrays of these names, name by name over all chunks, with one array in memory at a time."""
        paths = sorted(self._home.glob(f"*{_ENDING}"))
        for name in names:
            for path in paths:
                with np.load(path) as chunk:
                    rows = chunk[name]
                yield rows

    def _path(self, number: int) -> Path:
        return self._home / f"{number:07d}{_ENDING}"


def not_adapted(result: Tables) -> dict[str, str]:
    """Return, by subject, the failures of its adaptation or of the posture fits after it."""
    failed = failed_subjects(result.fits[result.fits["adapted"] == 1])
    for subject, word in zip(result.parameters["subject"], result.parameters["status"], strict=True):
        if word != status.OK:
            failed[subject] = f"adaptation {word}" + (f": {EXPLANATION[word]}" if word in EXPLANATION else "")
    if OWN_WORD in result.parameters:
        for subject in result.parameters["subject"][result.parameters[OWN_WORD] == WORDS[NOT_CONVERGED]]:
            failed.setdefault(subject, f"own bones {WORDS[NOT_CONVERGED]}, the plain adaptation is kept")
    return failed


def failed_subjects(fits: pd.DataFrame) -> dict[str, str]:
    """Return, by subject, the number and kinds of failed posture fits; subjects without a failure are left out."""
    bad = fits[fits["status"] != status.OK]
    return {
        subject: f"{len(rows)} posture fits {', '.join(sorted(set(rows['status'])))}"
        for subject, rows in bad.groupby("subject", sort=False)
    }


_ROWS = 10_000
"""Rows of a table that are text at a time: a row takes ten times as much memory as text as in numbers."""


def _pieces(tables: Iterable[pd.DataFrame]) -> Iterator[bytes]:
    """Yield one CSV of tables with the same columns: a header, then all rows, ``_ROWS`` of them as text at a time."""
    headed = False
    for table in tables:
        for first in range(0, max(1, len(table)), _ROWS):
            text = as_csv(table.iloc[first : first + _ROWS])
            yield (text.partition("\n")[2] if headed else text).encode()
            headed = True
