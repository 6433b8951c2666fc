"""Positions of markers as programs of laboratories write them."""
