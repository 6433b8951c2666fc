"""Alternative names of a cause, which the data cannot distinguish."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.joint_fit import Linearised
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

LEVEL = 0.95
"""Probability that a credible set contains the truth, for the names of a cause and for sets of causes."""

_LEAST_SHARE = 0.05
"""Probability of a name in its place, below which the name is not worth a measurement."""


class CredibleSet(NamedTuple):
    """Names of an active cause: its name in the chosen set, then the alternatives, the most probable first; with the
    probability of each name in this place."""

    names: tuple[str, ...]
    shares: tuple[float, ...]


def credible_set(own: str, share: Mapping[str, float]) -> CredibleSet:
    """Find the credible set in place of the cause ``own``; ``share``: probability of each cause there."""
    names, kept, reached = [], [], 0.0
    for name in sorted(share, key=lambda name: (name != own, -share[name])):
        if reached >= LEVEL or (names and share[name] < _LEAST_SHARE):
            break
        names.append(name)
        kept.append(share[name])
        reached += share[name]
    return CredibleSet(tuple(names), tuple(kept))


JOINTS = ("ac_translation", "sc_translation")

MOVES = (*JOINTS, "conoid_strain", "scapulothoracic_gap")
"""Causes that let a constraint of the chain give way along a motion: joints, and causes of a single constraint."""


FRAMES = MappingProxyType({"clavicle_frame_bias": "clavicle_frame", "scapula_landmark_bias": "scapula_frame"})
"""Causes that turn the frame of a bone in every posture, with the sizes (own bones) by which persons differ in it.
Laboratories may differ by any angle: published zeros of the clavicle's axial rotation differ by 35 degrees."""


_OF_A3 = ("conoid_strain", "clavicle_axial_estimate")
"""Causes that change A3 along a motion and show in no landmark on the bones. Only an independently measured axial
rotation distinguishes them."""


def with_what_does_as_well(
    sets: Mapping[str, CredibleSet], causes: Mapping[str, str], only_angles: bool
) -> dict[str, CredibleSet]:
    """Add to every cause the names that the measurement cannot distinguish from it, if they are candidates and not
    named themselves.

    Angles alone show which constraint gives way, and not what moves: joints named from angles contradicted bone pins
    that measured the joints (docs/diagnose.md). So a joint gets all of ``MOVES``. ``causes``: causes of the candidates.
    """
    named = {one.names[0] for one in sets.values()}
    found = dict(sets)
    for name, one in sets.items():
        alike = MOVES if only_angles and one.names[0] in JOINTS else _OF_A3 if one.names[0] in _OF_A3 else ()
        more = [other for other in alike if other in causes.values() and other not in {*one.names, *named}]
        found[name] = CredibleSet((*one.names, *more), (*one.shares, *(0.0 for _ in more)))
    return found


def similarity(at: Linearised, one: str, other: str) -> float:
    """Compute the mean squared canonical correlation of the effects of two candidates on y, beyond the adapted
    parameters of every subject. The mean is over the directions of the candidate with fewer; 0 if a candidate has no
    effect beyond the parameters."""
    a, b = (_beyond_parameters(at, name) for name in (one, other))
    correlations = np.linalg.svd(a.T @ b, compute_uv=False)
    return float((correlations**2).sum() / max(1, min(a.shape[1], b.shape[1])))


def _beyond_parameters(at: Linearised, name: str) -> Float[np.ndarray, "numbers directions"]:
    """Compute an orthonormal basis of a candidate's effect on y beyond the adapted parameters of each subject."""
    shoulders = at.joint.shoulders
    columns = at.Z[..., _N + at.joint.candidates.where((name,))].copy()
    for subject in range(len(shoulders.subjects)):
        rows = shoulders.rows_of(subject)
        own = at.Z[rows][..., :_N].reshape(-1, _N)
        flat = columns[rows].reshape(-1, columns.shape[2])
        columns[rows] = (flat - own @ np.linalg.lstsq(own, flat, rcond=None)[0]).reshape(columns[rows].shape)
    basis, size, _ = np.linalg.svd(columns.reshape(-1, columns.shape[2]), full_matrices=False)
    return basis[:, size > size.max(initial=0.0) * 1e-6]
