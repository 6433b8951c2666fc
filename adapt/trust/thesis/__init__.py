"""The printed tables of the thesis, and the same tables of any motions and parameter sets."""
