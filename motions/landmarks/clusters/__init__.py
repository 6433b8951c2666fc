"""Landmarks that clusters of markers carry from static trials, in which they were palpated, into a moving trial."""
