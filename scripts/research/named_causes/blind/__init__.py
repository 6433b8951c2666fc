"""Parts of `blind_check.py`: its cases, their runs and result lines, and the figures."""
