"""Compilation of LLVM IR to object code of this processor, and loading of object code into this process, by
llvmlite."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any


class MachineCodeError(Exception):
    """Error of llvmlite: it is missing, does not know this processor, or cannot compile or link a module for it."""


@contextmanager
def _llvmlite() -> Iterator[Any]:
    """Import llvmlite's binding, and turn every error inside the block into MachineCodeError."""
    try:
        import llvmlite.binding as llvm

        yield llvm
    except Exception as error:
        raise MachineCodeError(f"{type(error).__name__}: {error}") from error


def describe_target() -> str:
    """Return one line for all that object code depends on besides its IR: the compiler and the processor."""
    with _llvmlite() as llvm:
        import llvmlite

        return f"{llvmlite.__version__} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


def emit_object(text: str) -> bytes:
    """Compile a module, given as LLVM IR, to object code of this processor."""
    with _llvmlite() as llvm:
        module = llvm.parse_assembly(text)
        module.verify()
        return _target_machine().emit_object(module)


def link(name: str, object_code: bytes) -> Any:
    """Load object code into this process; return the addresses of its symbols ``name`` and ``name_rows``, by name."""
    with _llvmlite() as llvm:
        builder = llvm.JITLibraryBuilder().add_object_img(object_code).add_current_process()
        exported = builder.export_symbol(name).export_symbol(f"{name}_rows")
        _LINKED.append(exported.link(_jit(), f"{name}{len(_LINKED)}"))
        return _LINKED[-1]


_LINKED: list[Any] = []
"""Loaded libraries, kept to the end of the process: threads may be running their functions, and LLVM cannot unload one
function alone."""


@cache
def _target_machine() -> Any:
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=2, jit=True)


@cache
def _jit() -> Any:
    import llvmlite.binding as llvm

    return llvm.create_lljit_compiler(_target_machine())
