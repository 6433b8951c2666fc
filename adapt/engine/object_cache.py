"""Object code is kept between runs, in the user's cache folder."""

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import jax

from adapt.engine.compilation_cache import cache_folder
from adapt.engine.machine_code import describe_target, emit_object
from motions.errors import InputError
from motions.files import atomic_write_bytes

_DIGEST = hashlib.sha256

_ROOT = Path(__file__).parents[2]

_PACKAGES = ("motions", "models", "adapt/engine", "adapt/solvers", "adapt/own_bones")
"""What compiled texts are made of: the rooms above import these, and not the other way."""


def machine_folder() -> Path:
    """Return the folder of the object code."""
    return cache_folder() / "machine"


def of_this_version(path: Path) -> bool:
    """Say whether a file of the folder is for this text, JAX, compiler and processor: no other is read again."""
    return path.name.endswith(f"-{_key()}")


def object_code(name: str, text: Callable[[], str]) -> bytes:
    """Return what was kept, or compile the text and keep it. A file that is not as it was written is not used."""
    path = machine_folder() / f"{name}-{_key()}"
    with suppress(OSError):
        content = path.read_bytes()
        digest, made = content[: _DIGEST().digest_size], content[_DIGEST().digest_size :]
        if _DIGEST(made).digest() == digest:
            return made
    made = emit_object(text())
    with suppress(OSError, InputError):  # a folder that cannot be written to costs the next run this compilation
        path.parent.mkdir(parents=True, exist_ok=True)
        atomic_write_bytes(path, _DIGEST(made).digest() + made)
    return made


@cache
def _key() -> str:
    """Return one word for all that the code depends on: the text of ``_PACKAGES``, JAX, the compiler, the processor.

    JAX's derivatives may differ between its versions in the order of their operations.
    """
    return _DIGEST(f"{jax.__version__} {describe_target()}".encode() + source_digest(_ROOT)).hexdigest()[:32]


def source_digest(root: Path) -> bytes:
    """Hash the names and the text of every Python file of the packages below a folder, at any depth."""
    digest = _DIGEST()
    for package in _PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            text = file.read_bytes()
            digest.update(f"{file.relative_to(root).as_posix()} {len(text)}\n".encode() + text)
    return digest.digest()
