"""Shipped parameter sets as TOML files, with the checks that every set passes."""
