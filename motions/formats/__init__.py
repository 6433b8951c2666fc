"""The files of a laboratory: markers in .c3d, .trc and CSV, angles in .mot and .sto, a Spartacus checkout."""
