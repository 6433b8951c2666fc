"""The reference solvers: exact steps, implicit derivatives, effects; what the batched ones are held against."""
