"""The engine under the solvers: one text of a kernel as machine code, by XLA or by numpy, over batches of problems.

The text is Python on components (``[x + dx for x, dx in zip(q, step)]``), with the functions and loops of
``motions.arrays`` and the axes of ``adapt.engine.axes``. What each file does:

- ``batching``: batches in chunks, in rounds, in threads;
- ``kernel``: a text as a function of arrays, by machine code or by XLA;
- ``simd_values``, ``function_builder``, ``instructions``, ``trigonometry``, ``axes``: the compiler, from text to LLVM;
- ``jax_program``: any function of JAX as a text, from its jaxpr; XLA runs one with operations that are not known;
- ``machine_code``, ``object_cache``: LLVM, by llvmlite; what it made is kept between runs;
- ``compilation_cache``: what XLA made is kept, too.

Why a compiler beside XLA
-------------------------
XLA runs the same text operation by operation over arrays of a chunk of problems, with every value of the thousands in
memory, and goes on with all problems of a chunk until the last one has ended. Here a value stays in a register or in
the first cache, and only the problems of one register wait for each other. Measured on the first ten
Newton iterations of 512 simulated subjects, float64, two busy cores, machine code is 15 times as fast as XLA (10 to 20
in five repeats; in CPU time 13.6), XLA without fusion, which suits it best:

    python scripts/benchmark.py --subjects 512 --peers 2 --repeats 5 --largest 500    # machine_code_vs_xla

CONTRIBUTING says when the compiler is to be deleted.
"""
