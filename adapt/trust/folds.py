"""Which postures are held out in turn: those of each motion, every third one."""

import numpy as np
from jaxtyping import Bool, Shaped

POSTURE_PARTS = 3
"""Every so many postures one is held out."""

Postures = Bool[np.ndarray, " postures *subjects"]


def hold_out_motions(counted: Postures, motion: Shaped[np.ndarray, " postures *subjects"]) -> dict[str | int, Postures]:
    """Give the postures of each motion that count, by its name or number in order of appearance."""
    return {name: counted & (motion == name) for name in dict.fromkeys(motion[counted].tolist())}


def hold_out_thirds(counted: Postures) -> list[Postures]:
    """Give every third posture that counts, of each subject on its own, beginning with the third, first and second."""
    turn = np.cumsum(counted, axis=0) % POSTURE_PARTS
    return [counted & (turn == k) for k in range(POSTURE_PARTS)]
