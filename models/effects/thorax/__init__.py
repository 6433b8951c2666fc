"""Effects of a thorax that differs from the ellipsoid."""
