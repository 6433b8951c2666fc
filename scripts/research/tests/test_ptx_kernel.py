"""The kernel's text for a GPU, run thread by thread on the CPU, because the tests run without a GPU."""

import ctypes
import re

import jax
import numpy as np

from adapt.engine.machine_code import emit_object, link
from adapt.solvers.newton.subjects import subjects_kernel
from adapt.solvers.problems import problems_of, subject_problem
from adapt.solvers.rows import posture_rows
from models import load_model
from motions.rhythm_subjects import simulate_subjects
from scripts.research.speed.ptx_kernel import ThreadBuilder, emit_ptx

SUBJECTS, THREADS = 10, 3

SAME = 1e-9
"""Relative difference of parameters: a multiply-add may be rounded once or twice."""


def on_this_processor(text: str, name: str):
    """Compile the text for the CPU, with the thread's number as an argument, for ``THREADS`` blocks of one thread."""
    registers = {"tid": "0", "ctaid": "%number", "ntid": "1", "nctaid": str(THREADS)}
    text = re.sub(
        r"call i32 @llvm\.nvvm\.read\.ptx\.sreg\.(\w+)\.x\(\)", lambda m: f"add i32 0, {registers[m[1]]}", text
    )
    text = re.sub(r"^(target|declare i32).*\n", "", text, flags=re.M)
    text = text.replace("define ptx_kernel", "define").replace("%scratch) {", "%scratch, i32 %number) {")
    library = link(name, emit_object(f"define i64 @{name}_rows() {{ ret i64 0 }}\n{text}"))
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3, ctypes.c_int32)(library[name])


def test_threads_find_what_machine_code_finds():
    data = problems_of(posture_rows(simulate_subjects(SUBJECTS, seed=3)), [load_model("R2")])
    problem = subject_problem(data, np.full(SUBJECTS, 10.0))
    start = (data.girdle.adapted_mm, data.angles, np.zeros((3, *data.angles.shape[1:])), np.zeros(SUBJECTS, bool))
    trees = (problem, start, np.full(SUBJECTS, 40.0))
    builder = subjects_kernel.build(np.float64, ThreadBuilder)
    function = on_this_processor(builder.text(), builder.name)
    arrays, results, sizes = subjects_kernel.laid_out(trees, np.float64)
    pointers = (ctypes.c_void_p * 100)(*(x.ctypes.data for x in [*arrays, *results]))
    scratch = np.full(builder.scratch_rows * max(sizes[1:]) * THREADS, np.nan)
    for number in range(THREADS):
        function(pointers, (ctypes.c_int64 * 3)(*sizes), scratch.ctypes.data, number)
    found, expected = subjects_kernel.result_of(results, SUBJECTS), subjects_kernel(*trees)
    assert expected.converged.all()
    np.testing.assert_array_equal(found.converged, expected.converged)
    np.testing.assert_allclose(found.theta, expected.theta, rtol=SAME)
    assert jax.tree.structure(found) == jax.tree.structure(expected)


def test_llvm_writes_it_for_a_gpu():
    builder = subjects_kernel.build(np.float64, ThreadBuilder)
    text = emit_ptx(builder.text())
    assert f".visible .entry {builder.name}(" in text
    assert ".local" not in text, "a variable stands in memory"
    assert "call" not in text.replace(".call", ""), "a function that the driver does not have"
