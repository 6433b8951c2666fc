"""``--repeat run.json``: the inputs and options of an earlier run, if the inputs are unchanged."""

import json
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from adapt.output.run_files import model_sha256, sha256, versions
from models.parameter_sets import model_file
from motions.errors import InputError
from motions.files import read_text

_WRITE_AGAIN = "Give the run.json of a run of this version"


Record = dict[str, Any]
"""Content of a ``run.json``, as ``write_run`` writes it."""


def recorded_arguments(record: Record, path: Path, command: str, options: Collection[str]) -> dict[str, Any]:
    """Restore the arguments of the command, by parameter name, from the record in the file ``path``.

    ``options``: those that the command records; --out is not among them, so that no record says where to write.
    InputError if the record is of another command, or if an input has changed by a single byte.
    """
    if record["command"] != command:
        cause = f"this is the record of 'girdle {record['command']}', not of 'girdle {command}'"
        raise InputError(str(path), None, cause, f"Repeat it with girdle {record['command']} --repeat")
    for name in record["options"]:
        if name not in options:
            raise InputError(str(path), None, f"girdle {command} has no option {name!r} to repeat", _WRITE_AGAIN)
    for motion in record["motions"]:
        _check_unchanged(Path(motion["path"]), sha256, motion["sha256"], path)
    for model in record["models"]:
        _check_unchanged(model_file(model["name"]), model_sha256, model["sha256"], path)
    motions = [motion["path"] for motion in record["motions"]]
    return {"motions": motions, "model": [model["name"] for model in record["models"]], **record["options"]}


def other_versions(record: Record) -> list[str]:
    """List the components whose version differs from the record ('numpy 2.1.0, now 2.2.0'): last digits may differ."""
    now, then = versions(), record["versions"]
    return [f"{name} {then.get(name, 'unknown')}, now {now[name]}" for name in now if then.get(name) != now[name]]


def _check_unchanged(
    file: Path, hashed: Callable[[Path], str | None], recorded_sha256: str | None, record: Path
) -> None:
    now = hashed(file)
    if now == recorded_sha256:
        return
    changed = "has changed since" if now else "is no longer where it was in"
    cause = f"the file {changed} the run of {record}"
    raise InputError(str(file), None, cause, "Put it back as it was, or run the command without --repeat")


def read_record(path: Path) -> Record:
    """Read the record of a run; InputError if the file is no such record."""
    try:
        record = json.loads(read_text(path, _WRITE_AGAIN))
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(str(path), None, f"this is not a JSON file ({error})", _WRITE_AGAIN) from error
    if not _is_record(record):
        raise InputError(str(path), None, "this is not the record of a run", _WRITE_AGAIN)
    return record


def _is_record(record: Any) -> bool:
    return (
        isinstance(record, dict)
        and isinstance(record.get("command"), str)
        and isinstance(record.get("options"), dict)
        and isinstance(record.get("versions"), dict)
        and _are_files(record.get("motions"), "path")
        and _are_files(record.get("models"), "name")
        and record["models"] != []
    )


def _are_files(entries: Any, key: str) -> bool:
    return isinstance(entries, list) and all(
        isinstance(entry, dict) and isinstance(entry.get(key), str) and "sha256" in entry for entry in entries
    )
