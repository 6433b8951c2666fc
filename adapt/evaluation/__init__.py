"""What every adaptation comes with: its gap on held-out postures, and the uncertainty of its parameters."""
