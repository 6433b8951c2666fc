"""The same adaptation by solvers that others wrote, for ``scripts/benchmark.py``: one file a peer, whose docstring says
whether the comparison is fair."""
