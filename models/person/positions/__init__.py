"""Positions of landmarks: where they are in a girdle, what they say of its numbers, and how joints moved."""
