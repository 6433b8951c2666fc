"""What `blind_check.py` does: its cases, their runs and lines, and the figures."""
