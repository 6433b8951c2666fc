"""Printed tables of the thesis, and the same tables for any motions and parameter sets."""
