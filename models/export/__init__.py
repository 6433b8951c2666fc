"""Export of a girdle to a file: TOML, which ``load_model`` reads, and OpenSim."""
