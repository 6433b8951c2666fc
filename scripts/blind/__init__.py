"""What `scripts/blind_check.py` does: its cases, their runs and lines, kept fits, figures and fitted constants."""
