"""Solvers of the two fits: the closed postures nearest to measured ones, and the girdle nearest to a subject's
postures."""
