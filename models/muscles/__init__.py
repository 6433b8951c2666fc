"""Muscle lines from thorax to shoulder girdle: paths round the ellipsoid, moment arms, contact and moment balance."""
