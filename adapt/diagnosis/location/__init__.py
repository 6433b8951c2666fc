"""Location of the gap: by angle, motion and elevation, and in the constraints."""
