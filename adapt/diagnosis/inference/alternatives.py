"""Names that may stand in place of one another: what the data cannot tell apart."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.joint_fit import Linearised
from adapt.diagnosis.inference.search import Node
from adapt.diagnosis.inference.weights import probabilities
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

LEVEL = 0.95
"""A credible set holds the truth with this probability: of the names of a cause, and of sets of causes."""

_LEAST_SHARE = 0.05
"""A name that is less probable than this in its place is not worth a measurement."""


class CredibleSet(NamedTuple):
    """One active cause: its name in the set that is chosen, then the others that it may have, the most probable first;
    and the probability of each in this place."""

    names: tuple[str, ...]
    shares: tuple[float, ...]


def credible_set(own: str, place: dict[str, Node]) -> CredibleSet:
    """Find the causes that do as well in the place of one, by the sets that have each there."""
    share = dict(zip(place, probabilities([node.resampled for node in place.values()]).tolist(), strict=True))
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
"""What lets a constraint of the chain give way along a motion: joints, and what is of one constraint alone."""


FRAMES = MappingProxyType({"clavicle_frame_bias": "clavicle_frame", "scapula_landmark_bias": "scapula_frame"})
"""What turns the frame of a bone in every posture, and the sizes by which persons differ in it. Laboratories may differ
by any angle: published zeros of the clavicle's axial rotation do by 35 degrees."""


_OF_A3 = ("conoid_strain", "clavicle_axial_estimate")
"""What changes A3 along a motion and shows in no landmark on the bones: only an axial rotation that was measured by
itself tells them apart."""


def with_what_does_as_well(
    sets: Mapping[str, CredibleSet], causes: Mapping[str, str], only_angles: bool
) -> dict[str, CredibleSet]:
    """Give every cause the other names that the measurement cannot tell from it, if they are candidates and no cause
    beside it.

    Angles alone show which constraint gives way, and not what moves: what they named contradicted pins that saw the
    joints (docs/diagnose.md). So a joint gets all of ``MOVES``. ``causes``: of the candidates.
    """
    named = {one.names[0] for one in sets.values()}
    found = dict(sets)
    for name, one in sets.items():
        alike = MOVES if only_angles and one.names[0] in JOINTS else _OF_A3 if one.names[0] in _OF_A3 else ()
        more = [other for other in alike if other in causes.values() and other not in {*one.names, *named}]
        found[name] = CredibleSet((*one.names, *more), (*one.shares, *(0.0 for _ in more)))
    return found


def similarity(at: Linearised, one: str, other: str) -> float:
    """Compute the mean squared canonical correlation of what two candidates do to y, of the smaller one's directions,
    after all that the adapted parameters of every subject take up; 0 of one that does nothing beyond them."""
    a, b = (_beyond_parameters(at, name) for name in (one, other))
    correlations = np.linalg.svd(a.T @ b, compute_uv=False)
    return float((correlations**2).sum() / max(1, min(a.shape[1], b.shape[1])))


def _beyond_parameters(at: Linearised, name: str) -> Float[np.ndarray, "numbers directions"]:
    """Orthonormal basis of what a candidate does to y beyond the adapted parameters of each subject."""
    shoulders = at.joint.shoulders
    columns = at.Z[..., _N + at.joint.candidates.where((name,))].copy()
    for subject in range(len(shoulders.subjects)):
        rows = shoulders.rows_of(subject)
        own = at.Z[rows][..., :_N].reshape(-1, _N)
        flat = columns[rows].reshape(-1, columns.shape[2])
        columns[rows] = (flat - own @ np.linalg.lstsq(own, flat, rcond=None)[0]).reshape(columns[rows].shape)
    basis, size, _ = np.linalg.svd(columns.reshape(-1, columns.shape[2]), full_matrices=False)
    return basis[:, size > size.max(initial=0.0) * 1e-6]
