"""Names that may stand in place of one another: what the data cannot tell apart."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.prediction import Linearised
from adapt.diagnosis.inference.budget import refitted
from adapt.diagnosis.inference.search import Node, Search
from adapt.diagnosis.inference.weights import probabilities
from models.adapted_parameters import ADAPTED

_N = len(ADAPTED)

_LEVEL = 0.95
"""A credible set holds the cause with this probability."""

_LEAST_SHARE = 0.05
"""A name that is less probable than this in its place is not worth a measurement."""


class Alternative(NamedTuple):
    """A set with another cause in the place of one, or with its own."""

    node: Node
    share: float
    """Probability in this place."""


class CredibleSet(NamedTuple):
    """One cause at work: the names it may have, most probable first, and the probability of each in this place."""

    names: tuple[str, ...]
    shares: tuple[float, ...]


def in_place_of(search: Search, named: Node, own: str, set_aside: Collection[Hypothesis]) -> dict[str, Alternative]:
    """Weigh the causes that the linear prediction finds in the place of one, and its own, by exact fits; by name.

    Sets that are ``set_aside`` are left out; the one that is named is none of them.
    """
    nodes = search.in_place_of(named, own, set_aside)
    linear = dict(zip(nodes, probabilities(search, list(nodes.values())), strict=True))
    own_cause = search.joint.candidates.causes[own]
    kept = {name: node for name, node in nodes.items() if name == own_cause or linear[name] >= _LEAST_SHARE}
    shares = probabilities(search, [refitted(search, node) for node in kept.values()])
    return {name: Alternative(node, float(share)) for (name, node), share in zip(kept.items(), shares, strict=True)}


def credible_set(found: dict[str, Alternative]) -> CredibleSet:
    """Find the causes that do as well in the place of one, its own among them."""
    names, kept, reached = [], [], 0.0
    for name in sorted(found, key=lambda name: -found[name].share):
        if reached >= _LEVEL or (names and found[name].share < _LEAST_SHARE):
            break
        names.append(name)
        kept.append(found[name].share)
        reached += found[name].share
    return CredibleSet(tuple(names), tuple(kept))


def similarity(at: Linearised, one: str, other: str) -> float:
    """Compute the mean squared canonical correlation of what two candidates do to y, of the smaller one's directions,
    after all that the adapted parameters of every subject take up."""
    a, b = (_beyond_parameters(at, name) for name in (one, other))
    correlations = np.linalg.svd(a.T @ b, compute_uv=False)
    return float((correlations**2).sum() / min(a.shape[1], b.shape[1]))


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
