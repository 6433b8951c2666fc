# pyright: reportAttributeAccessIssue=false, reportGeneralTypeIssues=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Run of ``girdle convert``: files in, one file or a folder of files out; their names determine the conversion."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from adapt.cli.landmarks.many_files import calibration_for, is_folder_of_trials, read_several
from adapt.solvers import status
from models.export.opensim import opensim_model
from models.parameter_sets import load_model
from motions.errors import InputError, pip_install
from motions.files import atomic_write, atomic_write_bytes, file_names, make_folder, refuse_replacing
from motions.formats.angle_table import SCAPULA_THROUGH, split, table_from_motions
from motions.formats.any_file import read_any
from motions.formats.marker_files.export_table import read_head
from motions.formats.mot import write_mot
from motions.formats.text import numbers
from motions.landmarks.mapping import Mapping
from motions.landmarks.sampled_postures import Labels
from motions.motion_csv.cells import LARGEST_POSTURE
from motions.motion_csv.rows import read_table
from motions.motion_csv.writing import write_motions
from motions.table import ANGLES, Motions

_TEXT_COLUMNS = ("model", "subject", "motion", "status")
_NUMBERS_OF_FITS = ("adapted", "posture", "humerus_elevation_deg", *(f"{angle}_simulated_deg" for angle in ANGLES))

_AS_WRITTEN = "Give fits.csv as girdle fit or girdle adapt has written it"


def convert(
    sources: Sequence[Path],
    target: Path,
    mapping: Mapping,
    labels: Labels,
    isb: bool = False,
    statics: Sequence[Path] = (),
) -> Motions | None:
    """Convert the sources to the target; return the motions that were written, or None for a table or a model.

    Motions (markers, angles, a Spartacus checkout, motion CSV, fits.csv; several files or a folder of them) become
    .csv, .mot or a folder of .mot files; a table becomes .parquet, a parameter set .osim. Raise an InputError if a
    source cannot be read or converted to that form; several sources are read without the unreadable ones, which are
    named.
    """
    if isb and target.suffix.lower() not in ("", ".mot"):
        cause = f"only .mot files hold ISB's angles, and {target} is none"
        raise InputError("--isb", None, cause, "Name a .mot file or a folder, or leave --isb out")
    if len(sources) == 1 and not is_folder_of_trials(sources[0]):
        refuse_replacing(target, sources)
        return _convert_one(sources[0], target, mapping, labels, isb, statics)
    motions = read_several(sources, target, mapping, labels, statics)
    _write(motions, target, isb, sources)
    return motions


def _convert_one(
    source: Path, target: Path, mapping: Mapping, labels: Labels, isb: bool, statics: Sequence[Path]
) -> Motions | None:
    kind = target.suffix.lower()
    if kind == ".osim":
        if source.suffix.lower() != ".toml" and source.is_file():
            cause = "a model of OpenSim is made of a parameter set, and this is none"
            raise InputError(str(source), None, cause, "Give its .toml: girdle model makes one of a person's landmarks")
        atomic_write(target, opensim_model(load_model(str(source))))
        return None
    if source.suffix.lower() == ".toml":
        cause = f"a parameter set becomes a model of OpenSim, not a file that ends in {kind!r}"
        raise InputError(str(target), None, cause, "Name a file that ends in .osim")
    if kind == ".parquet":
        write_parquet(source, target)
        return None
    if source.suffix.lower() == ".csv" and _is_fits(source):
        motions = simulated_motions(source)
    else:
        motions = read_any(source, mapping, labels, calibration_for(source, statics, mapping, labels))
    _write(motions, target, isb, [source])
    return motions


def _write(motions: Motions, target: Path, isb: bool, sources: Sequence[Path]) -> None:
    """Write motions in the form that the name of the target asks for; raise an InputError for an unknown ending."""
    kind = target.suffix.lower()
    _check_replaceable(target)
    if kind == ".csv":
        make_folder(target.parent)
        write_motions(motions, target)
    elif kind == ".mot":
        write_one_mot(motions, target, isb)
    elif not kind:
        write_mot_folder(motions, target, isb, sources)
    else:
        cause = f"files that end in {kind!r} are not written"
        raise InputError(str(target), None, cause, "Known are .csv, .mot, a folder for .mot files, .parquet and .osim")


def _check_replaceable(target: Path) -> None:
    """Raise an InputError where the target is a laboratory's file, because the name of the output was left out."""
    if not target.is_file() or target.suffix.lower() not in (".csv", ".mot"):
        return
    head = read_head(target)
    own = "clavicle_y_deg" in head.columns() or any(word.startswith(SCAPULA_THROUGH) for word in head.first_words())
    if not own and head.columns():
        cause = "this file is there and no motion file, so it is not replaced"
        raise InputError(str(target), None, cause, "Name the file to write to last, behind those to read")


def write_one_mot(motions: Motions, target: Path, isb: bool) -> None:
    """Write a single motion; raise an InputError if there are several, as a .mot file has a single time."""
    parts = split(motions)
    if len(parts) > 1:
        cause = f"there are {len(parts)} motions and a .mot file holds one"
        raise InputError(str(target), None, cause, "Name a folder instead, without an ending")
    write_mot(table_from_motions(parts[0], isb, str(target)), target)


def write_mot_folder(motions: Motions, folder: Path, isb: bool, sources: Sequence[Path]) -> None:
    """Write one .mot file for each motion of each subject; raise an InputError if one would replace a source."""
    parts = split(motions)
    names = list(file_names([f"{part.subject[0]}_{part.motion[0]}" for part in parts]))
    read = [path for source in sources for path in (source.rglob("*.mot") if source.is_dir() else [source])]
    for name in names:
        refuse_replacing(folder / f"{name}.mot", read)
    make_folder(folder)
    for part, name in zip(parts, names, strict=True):
        write_mot(table_from_motions(part, isb, str(folder / name)), folder / f"{name}.mot")


def write_parquet(source: Path, target: Path) -> None:
    """Write a CSV table as Parquet, names as text; raise an InputError if it is no table, or pyarrow is missing."""
    if importlib.util.find_spec("pyarrow") is None:
        cause = "Parquet needs pyarrow, which is not installed"
        raise InputError(str(target), None, cause, f"Install it: {pip_install('pyarrow')}")
    atomic_write_bytes(target, _table(source).to_parquet(index=False))


def simulated_motions(fits: Path) -> Motions:
    """Read the simulated angles of the postures in a ``fits.csv`` whose status is ``ok``.

    Angles after adaptation are taken where the file has them. The subjects are called MODEL_SUBJECT. Raise an
    InputError if there is no such posture, or if the file was changed after it was written.
    """
    table, file = read_table(fits), str(fits)
    if missing := [name for name in (*_TEXT_COLUMNS, *_NUMBERS_OF_FITS) if name not in table.columns]:
        raise InputError(file, 1, f"columns {', '.join(missing)} are missing", _AS_WRITTEN)
    rows = [row for row in table.rows if row.cells["status"] == status.OK]
    cells = np.array([[row.cells[name] for name in _NUMBERS_OF_FITS] for row in rows], dtype=object)
    values = numbers(cells.reshape(len(rows), len(_NUMBERS_OF_FITS)), [row.line for row in rows], file)
    if not rows:
        raise InputError(file, None, "no posture was fitted", "Look at the column status")
    adapted, posture = values[:, 0], values[:, 1]
    whole = np.isfinite(np.delete(values, 2, axis=1)).all(axis=1) & (np.abs(posture) < LARGEST_POSTURE)
    if not whole.all():  # the elevation may be unknown
        raise InputError(file, rows[int(np.argmin(whole))].line, "a number of the posture is missing", _AS_WRITTEN)
    kept = np.flatnonzero(adapted == adapted.max())
    said = "simulated by the adapted model" if adapted.max() else "simulated by the model as it is"
    return Motions(
        subject=np.array([f"{rows[k].cells['model']}_{rows[k].cells['subject']}" for k in kept]),
        motion=np.array([rows[k].cells["motion"] for k in kept]),
        posture=posture[kept].astype(np.int64),
        humerus_elevation_deg=values[kept, 2],
        angles_deg=values[kept, 3:],
        landmarks_mm={},
        extra=pd.DataFrame({"origin": [said] * len(kept)}, dtype=str),
    )


def _table(path: Path) -> pd.DataFrame:
    """Read a CSV table without loss: numbers with all digits, names as text even where they look like numbers.

    Raise an InputError if the file is no CSV table.
    """
    names = [name for name in read_table(path).columns if name in _TEXT_COLUMNS]
    return pd.read_csv(path, dtype=dict.fromkeys(names, "str"), keep_default_na=False, na_values=[""])


def _is_fits(path: Path) -> bool:
    columns = read_head(path).columns()
    return "adapted" in columns and all(f"{angle}_simulated_deg" in columns for angle in ANGLES)
