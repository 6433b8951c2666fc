"""The engine under the solvers: one text of a kernel as machine code, by JAX or by numpy, over batches of problems."""
