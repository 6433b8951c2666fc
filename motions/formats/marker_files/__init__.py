"""Positions of markers as the programs of laboratories write them."""
