"""Measured landmark positions: rows of the linear model, and the effect sizes that they measure."""
