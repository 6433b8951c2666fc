"""Measured positions of landmarks: as rows of the linear model, and what they say of sizes."""
