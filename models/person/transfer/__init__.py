"""Attachments carried from bone to bone, by landmarks or surfaces, and their distances to measured attachments."""
