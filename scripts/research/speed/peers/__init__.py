"""The same adaptation by other solvers, for ``scripts/benchmark.py``: one file per solver, whose docstring says whether
the comparison is fair."""
