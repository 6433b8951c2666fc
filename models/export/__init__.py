"""A girdle as a file: TOML that loads again, and OpenSim."""
