"""Where the gap lies: by angle, motion and elevation, and as rotations."""
