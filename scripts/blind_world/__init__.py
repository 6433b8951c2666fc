"""Simulated subjects with a hidden effect: a world of its own, to test the diagnosis on.

Nothing here is shared with the effect library or the fits: rotations, distances, closed chain, courses over elevation
and the effects themselves are written anew, in NumPy alone, and a parameter set is read as plain data. A world is a
motion table, which the diagnosis may see, and the truth, which is opened after. Every number of both is simulated.

    python -m scripts.blind_world sc_translation --model models/sets/R2.toml --out blind.csv --truth blind.json
"""

from scripts.blind_world.catalogue import LABELS
from scripts.blind_world.world import World, make_world

__all__ = ["LABELS", "World", "make_world"]
