"""The fast solvers: the same iterations written by components for the engine, many problems at once."""
