"""Compiler and batch runner under the solvers: one kernel function as machine code, by XLA or by numpy.

A kernel function is Python on components (``[x + dx for x, dx in zip(q, step)]``), with the functions and loops of
``motions.arrays`` and the axes of ``adapt.engine.axes``. The files:

- ``batching``: batches of problems in chunks, in rounds, in threads;
- ``kernel``: a kernel function as a function of arrays, by machine code or by XLA;
- ``simd_values``, ``function_builder``, ``instructions``, ``trigonometry``, ``axes``: the compiler, from a kernel
  function to LLVM's intermediate representation (IR);
- ``jax_program``: any function of JAX as a kernel function, from its jaxpr; XLA runs a function with operations that
  the compiler does not know;
- ``machine_code``, ``object_cache``: LLVM, by llvmlite, and the cache of its object code between runs;
- ``compilation_cache``: the cache of programs that XLA compiled.

Why a compiler beside XLA
-------------------------
XLA runs the same kernel function operation by operation over arrays of a chunk of problems, keeps each of the thousands
of values in memory, and continues with all problems of a chunk until the last one has ended. Machine code keeps a value
in a register or in the first-level cache, and only the problems of one register wait for each other. Measured on the
first ten Newton iterations of 512 simulated subjects, float64, two busy cores, machine code is 15 times as fast as XLA
(10 to 20 in five repeats; in CPU time 13.6). XLA ran without fusion, its best setting here:

    python scripts/benchmark.py --subjects 512 --peers 2 --repeats 5 --largest 500    # machine_code_vs_xla

CONTRIBUTING.md says when to delete the compiler.
"""
