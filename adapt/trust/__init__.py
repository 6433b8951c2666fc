"""Trust in an adaptation: uncertainty, held-out gap, and checks whether the ellipsoid can be a thorax."""
