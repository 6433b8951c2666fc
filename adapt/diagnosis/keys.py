"""Keys and words of a diagnosis: its answers, its bones, and the steps of its gap budget."""

from typing import Literal

Answer = Literal["none", "effect", "unknown"]
NONE: Answer = "none"
EFFECT: Answer = "effect"
UNKNOWN: Answer = "unknown"

ALL = "all"
"""Key of both bones together, in gaps by bone."""

BASE, ADAPTED_STEP, NOISE = "base", "adapted", "noise"
"""Steps of the gap budget beside the causes."""

OWN_BONES = "own_bones"
"""Step of the gap budget with own bones and frames, the null of every cause."""
