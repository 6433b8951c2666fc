"""Texts of a diagnosis, and its JSON."""
