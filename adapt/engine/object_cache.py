"""Cache of object code between runs, in the user's cache folder."""

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from adapt.engine.compilation_cache import cache_folder
from adapt.engine.machine_code import describe_target, emit_object
from motions.errors import InputError
from motions.files import atomic_write_bytes

_DIGEST = hashlib.sha256

_ROOT = Path(__file__).parents[2]

_PACKAGES = ("motions", "models", "adapt/engine", "adapt/solvers", "adapt/own_bones")
"""Packages whose source determines the compiled kernels. Packages above them import them, never the reverse."""


def machine_folder() -> Path:
    """Return the folder of the cached object code."""
    return cache_folder() / "machine"


def of_this_version(path: Path) -> bool:
    """Check whether a cached file is for this source, JAX, compiler and processor; no other file is read again."""
    return path.name.endswith(f"-{_key()}")


def object_code(name: str, text: Callable[[], str]) -> bytes:
    """Return the cached object code, or compile ``text()`` and cache the result. A file that does not match its digest
    is ignored."""
    path = machine_folder() / f"{name}-{_key()}"
    with suppress(OSError):
        content = path.read_bytes()
        digest, made = content[: _DIGEST().digest_size], content[_DIGEST().digest_size :]
        if _DIGEST(made).digest() == digest:
            return made
    made = emit_object(text())
    with suppress(OSError, InputError):  # without write access to the folder, the next run compiles again
        path.parent.mkdir(parents=True, exist_ok=True)
        atomic_write_bytes(path, _DIGEST(made).digest() + made)
    return made


@cache
def _key() -> str:
    """Return a hash of all that object code depends on: the source of ``_PACKAGES``, JAX, the compiler, the processor.

    Versions of JAX may differ in the order of operations of their derivatives.
    """
    return _DIGEST(f"{version('jax')} {describe_target()}".encode() + source_digest(_ROOT)).hexdigest()[:32]


def source_digest(root: Path) -> bytes:
    """Hash the names and contents of all Python files of ``_PACKAGES`` below ``root``, at any depth."""
    digest = _DIGEST()
    for package in _PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            text = file.read_bytes()
            digest.update(f"{file.relative_to(root).as_posix()} {len(text)}\n".encode() + text)
    return digest.digest()
