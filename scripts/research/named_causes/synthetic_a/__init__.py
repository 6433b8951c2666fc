"""Simulated subjects with a hidden effect: an independent world to test the diagnosis on.

The world shares nothing with the effect library or the fits: rotations, distances, closed chain, courses over elevation
and the effects are written anew, in NumPy alone, and a parameter set is read as plain data. A world consists of a
motion table, which the diagnosis may see, and the truth, which is opened afterwards. All numbers are simulated.

    python -m scripts.research.named_causes.synthetic_a sc_translation --model models/sets/R2.toml \
        --out blind.csv --truth blind.json
"""

from scripts.research.named_causes.synthetic_a.catalogue import LABELS
from scripts.research.named_causes.synthetic_a.world import World, make_world

__all__ = ["LABELS", "World", "make_world"]
