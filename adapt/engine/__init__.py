"""The engine under the solvers: one text of a kernel as machine code, by XLA or by numpy, over batches of problems.

The text is Python on components (``[x + dx for x, dx in zip(q, step)]``), with the functions and loops of
``motions.arrays`` and the axes of ``adapt.engine.axes``. What each file does:

- ``batching``: batches in chunks, in rounds, in threads;
- ``kernel``: a text as a function of arrays, by machine code or by XLA;
- ``simd_values``, ``function_builder``, ``instructions``, ``trigonometry``, ``axes``: the compiler, from text to LLVM;
- ``machine_code``, ``object_cache``: LLVM, by llvmlite; what it made is kept between runs;
- ``compilation_cache``: what XLA made is kept, too.

Why a compiler beside XLA and numba
-----------------------------------
XLA runs the same text operation by operation over arrays of a chunk of problems, with every value of the thousands in
memory, and goes on with all problems of a chunk until the last one has ended. Here a value stays in a register or in
the first cache, and only the problems of one register wait for each other. Measured on the first ten iterations of the
subject sweep, 512 simulated subjects, float64, two busy cores, machine code is 15 times as fast as XLA (10 to 20 in
five repeats; in CPU time 13.6), XLA without fusion, which suits it best:

    python scripts/benchmark.py --subjects 512 --peers 2 --repeats 5 --largest 500    # machine_code_vs_xla

numba, which has not been measured, compiles scalar code: it would need a second text of each kernel beside the one for
numpy and XLA, since it does not take trees of components (lists in named tuples in lists, ``jax.tree``) nor an argument
that stands for any array; and whether problems share a register is left to LLVM's vectoriser, which does not do so
across loops that each problem ends at its own time.

CONTRIBUTING says when the compiler is to be deleted.
"""
