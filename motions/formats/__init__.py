"""Files of a laboratory: markers in .c3d, .trc and CSV, angles in .mot and .sto, and a Spartacus checkout."""
