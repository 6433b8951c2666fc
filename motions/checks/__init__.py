"""Checks of measured landmarks and angles: missing markers, body size, outliers, swapped labels and signs."""
