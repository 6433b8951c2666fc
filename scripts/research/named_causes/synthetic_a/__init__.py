"""Simulated subjects with a hidden effect: a world of its own, to test the diagnosis on.

Nothing here is shared with the effect library or the fits: rotations, distances, closed chain, courses over elevation
and the effects themselves are written anew, in NumPy alone, and a parameter set is read as plain data. A world is a
motion table, which the diagnosis may see, and the truth, which is opened after. Every number of both is simulated.

    python -m scripts.research.named_causes.synthetic_a sc_translation --model models/sets/R2.toml \
        --out blind.csv --truth blind.json
"""

from scripts.research.named_causes.synthetic_a.catalogue import LABELS
from scripts.research.named_causes.synthetic_a.world import World, make_world

__all__ = ["LABELS", "World", "make_world"]
