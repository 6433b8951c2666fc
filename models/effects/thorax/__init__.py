"""Effects of a thorax that is not the ellipsoid."""
