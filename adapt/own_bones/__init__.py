"""Adaptation with bones and frames of each person's own, as far as people differ."""
