"""Calibration by static trials: places of a segment's landmarks relative to the markers of the segment's cluster.

One static posture gives one place per landmark (Cappozzo et al., Clin. Biomech. 10 (1995) 171-178; for the acromion van
Andel et al., Gait Posture 29 (2009) 123-128). The skin of the acromion moves over the bone as the arm rises. With two
postures or more, the pose of the scapula in its cluster is therefore interpolated over the elevation of the arm (double
calibration: Brochard et al., J. Biomech. 44 (2011) 751-754), and extrapolated beyond these postures.
"""

from collections.abc import Mapping as Dictionary
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from motions.checks.distances import blamed, distances_mm
from motions.checks.never_seen import never_seen_of_cluster
from motions.checks.trial import frames_of, sound_landmarks
from motions.errors import InputError, warn_input
from motions.landmarks.clusters.rigid_fit import FEWEST, Pose, fit_rigid, mean_shape, part_of_the_way
from motions.landmarks.estimated_landmarks import GlenohumeralOffset, place_gh
from motions.landmarks.frames import thorax_frame
from motions.landmarks.mapping import THORAX, Mapping
from motions.landmarks.markers import Markers, check_size, landmarks_there_mm, marker_mm, millimetres
from motions.motion_csv.cells import Side
from motions.rotations import DEG

CARRIED = {"thorax": (*THORAX, "SC"), "scapula": ("AC", "AA", "TS", "AI"), "humerus": ("EM", "EL")}
"""Landmarks that each cluster carries. GH, which belongs to two bones, is carried with the humerus, or with the scapula
if there is no cluster on the humerus."""

SAME_POSTURE_DEG = 10.0
"""Range of elevations, from the lowest up, in which static trials are one posture: within it the skin of the acromion
moves by less than the scatter of a palpated landmark."""

SAME_BONE_MM = 20.0
"""Largest plausible change of a distance between palpated landmarks from one posture to another. Assumed: each end is
palpated twice with an SD of 5 mm, so the difference has an SD of 10 mm."""

_MOST_FRAMES = (0.05, 0.95)
"""Quantiles of the elevation between which a static trial must hold still, so that a jumping marker does not count."""

Positions = Dictionary[str, Float[np.ndarray, "3 frames"]]

Node = tuple[float, str, dict[str, Float[np.ndarray, "3 1"]]]
"""Elevation of the arm, file of the static trial, and places of the scapula's landmarks in the cluster's frame."""


@dataclass(frozen=True, eq=False)
class Cluster:
    """The markers of a cluster and their places in its frame, mm."""

    names: tuple[str, ...]
    shape_mm: Float[np.ndarray, "markers 3"]


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body of landmarks: their places in its frame, and its poses in the cluster at elevations of the arm."""

    landmarks_mm: dict[str, Float[np.ndarray, "3 1"]]
    poses: tuple[Pose, ...]
    """One pose for all elevations, or one per elevation."""
    elevations_deg: tuple[float, ...]

    def in_cluster(self, elevation_deg: Float[np.ndarray, " frames"]) -> Pose:
        """Compute the pose of the landmarks in the frame of the cluster; NaN where a needed elevation is NaN."""
        if len(self.poses) == 1:
            return Pose(*(np.repeat(part, len(elevation_deg), axis=-1) for part in self.poses[0]))
        nodes = np.array(self.elevations_deg)
        which = np.clip(np.searchsorted(nodes, elevation_deg) - 1, 0, len(nodes) - 2)
        R, t = np.full((3, 3, len(elevation_deg)), np.nan), np.full((3, len(elevation_deg)), np.nan)
        for k, (lower, upper) in enumerate(zip(self.poses[:-1], self.poses[1:], strict=True)):
            share = (elevation_deg[which == k] - nodes[k]) / (nodes[k + 1] - nodes[k])
            R[..., which == k], t[:, which == k] = lower.after(part_of_the_way(lower.inverse().after(upper), share))
        return Pose(R, t)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Clusters and bodies of landmarks from the static trials, by segment."""

    clusters: dict[str, Cluster]
    bodies: dict[str, Body]
    gh_placed: bool
    """True where GH was estimated, not palpated."""

    @property
    def said(self) -> str:
        """Describe the calibration of the scapula."""
        nodes = self.bodies["scapula"].elevations_deg if "scapula" in self.bodies else ()
        at = f"at {', '.join(f'{at:.0f}' for at in nodes)} degrees" if len(nodes) > 1 else "in one posture"
        return f"cluster, calibrated {at}"


def calibrate(
    statics: Sequence[Markers], mapping: Mapping, side: Side = "right", gh_from: GlenohumeralOffset | None = None
) -> Calibration:
    """Compute the places of the landmarks relative to the clusters of ``mapping.clusters``.

    ``statics``: the static trials. ``gh_from``: offset that places GH, if GH was not palpated. InputError where a
    cluster is complete in no trial or has no landmark, or where the scapula was palpated in several trials and the
    elevation of the arm in one of them is not known.
    """
    if not mapping.clusters:
        cause = "the mapping file does not say which markers are clusters"
        remedy = 'Write under [clusters] lines such as scapula = ["AMC1", "AMC2", "AMC3"] (--map)'
        raise InputError(statics[0].file, None, cause, remedy)
    read = [_Static(markers, mapping, side, gh_from) for markers in statics]
    clusters = {segment: _cluster(segment, names, read) for segment, names in mapping.clusters.items()}
    single = {segment: _single(segment, cluster, read, mapping) for segment, cluster in clusters.items()}
    if "scapula" in clusters:
        elevations = [_elevation_of_static(one, clusters, single) for one in read]
        single["scapula"] = _over_elevation(clusters["scapula"], read, elevations, mapping)
    return Calibration(clusters, single, any(one.gh_placed for one in read))


def carried_by(segment: str, mapping: Mapping) -> tuple[str, ...]:
    """Return the landmarks that a segment's cluster carries."""
    own_gh = segment == "humerus" or (segment == "scapula" and "humerus" not in mapping.clusters)
    return (*CARRIED[segment], "GH") if own_gh else CARRIED[segment]


def elevation_deg(positions: Positions) -> Float[np.ndarray, " frames"] | None:
    """Compute the angle between the humerus (halfway EM-EL to GH) and the thorax's y; None without the landmarks."""
    if not all(name in positions for name in (*THORAX, "GH", "EM", "EL")):
        return None
    up = thorax_frame(*(positions[name] for name in THORAX))[:, 1]
    along = positions["GH"] - (positions["EM"] + positions["EL"]) / 2.0
    sine = np.linalg.norm(np.cross(up, along, axis=0), axis=0)
    return np.arctan2(sine, np.sum(up * along, axis=0)) * DEG


class _Static:
    """Landmarks and cluster markers of a static trial, mm."""

    def __init__(self, markers: Markers, mapping: Mapping, side: Side, gh_from: GlenohumeralOffset | None):
        self.file, factor = markers.file, millimetres(markers, mapping)
        self.landmarks_mm = landmarks_there_mm(markers, mapping, factor)
        self.gh_placed = gh_from is not None and "GH" not in self.landmarks_mm
        if gh_from is not None:
            self.landmarks_mm = place_gh(self.landmarks_mm, gh_from, side)
        if {"IJ", "C7"} <= self.landmarks_mm.keys():
            check_size(markers.file, self.landmarks_mm, factor)
        if self.landmarks_mm:
            self.landmarks_mm = sound_landmarks(self.landmarks_mm, "static trial", markers.file)
        self.markers_mm = {
            name: place
            for segment in mapping.clusters
            for name, place in cluster_markers_mm(markers, mapping, segment, factor).items()
        }

    def seen(self, names: Sequence[str]) -> np.ndarray | None:
        """Return the positions of a cluster's markers; None if the file lacks one of them."""
        if not all(name in self.markers_mm for name in names):
            return None
        return np.stack([self.markers_mm[name] for name in names])

    def beside(self, cluster: Cluster, landmarks: Sequence[str]) -> dict[str, Float[np.ndarray, "3 1"]]:
        """Compute the median places in the cluster's frame of those landmarks that were seen together with it."""
        seen = self.seen(cluster.names)
        if seen is None:
            return {}
        pose = fit_rigid(cluster.shape_mm, seen).pose
        found = {name: pose.fetch(self.landmarks_mm[name]) for name in landmarks if name in self.landmarks_mm}
        known = {name: place[:, np.isfinite(place).all(axis=0)] for name, place in found.items()}
        return {name: np.median(place, axis=1, keepdims=True) for name, place in known.items() if place.shape[1]}


def cluster_markers_mm(
    markers: Markers, mapping: Mapping, segment: str, factor: float
) -> dict[str, Float[np.ndarray, "3 frames"]]:
    """Return the markers of a segment's cluster that a file has, mm; NaN, with InputWarning, where one was not seen."""
    names = dict.fromkeys(name for one in mapping.clusters.values() for name in one)
    every = {name: marker_mm(markers, mapping, name, factor) for name in names}
    others = {name: place for name, place in every.items() if place is not None}
    found = {name: others.pop(name) for name in mapping.clusters[segment] if name in others}
    others |= landmarks_there_mm(markers, mapping, factor)
    for name, unseen in never_seen_of_cluster(found, others, mapping.clusters.get("thorax", THORAX)).items():
        if unseen.any():
            x, y, z = found[name][:, np.flatnonzero(unseen)[0]]
            found[name] = np.where(unseen, np.nan, found[name])
            cause = (
                f"marker {name} of cluster {segment} is at ({x:g}, {y:g}, {z:g}) in {frames_of(np.flatnonzero(unseen))}"
            )
            warn_input(InputError(markers.file, None, cause, "It was not seen there and is left out"))
    return found


def _cluster(segment: str, names: tuple[str, ...], read: Sequence[_Static]) -> Cluster:
    """Build a cluster from the first static trial that has all of its markers."""
    said = [f"there are no markers {', '.join(names)} of cluster {segment} together"]
    for one in read:
        seen = one.seen(names)
        try:
            if seen is not None:
                return Cluster(names, mean_shape(seen))
        except ValueError as error:
            said.append(f"cluster {segment}: {error}")
    remedy = (
        "Name the markers of one cluster under [clusters] in the mapping file (--map), as the static trial has them"
    )
    raise InputError(read[0].file, None, said[-1], remedy)


def _single(segment: str, cluster: Cluster, read: Sequence[_Static], mapping: Mapping) -> Body:
    """Compute the places of a segment's landmarks in its cluster: means over the static trials."""
    landmarks = carried_by(segment, mapping)
    places = _means([one.beside(cluster, landmarks) for one in read])
    if not places:
        cause = f"no static trial has a landmark of the {segment} ({', '.join(landmarks)}) beside its cluster"
        raise InputError(read[0].file, None, cause, "Name the markers of the landmarks in the mapping file (--map)")
    return Body(places, (Pose(np.eye(3)[..., None], np.zeros((3, 1))),), ())


def _means(found: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    names = dict.fromkeys(name for one in found for name in one)
    return {name: np.mean([one[name] for one in found if name in one], axis=0) for name in names}


def _elevation_of_static(one: _Static, clusters: dict[str, Cluster], bodies: dict[str, Body]) -> float:
    """Compute the median elevation of the arm in a static trial; NaN if not known. InputError if the arm moves."""
    positions = dict(one.landmarks_mm)
    for segment, cluster in clusters.items():
        seen = one.seen(cluster.names)
        if seen is not None:
            pose = fit_rigid(cluster.shape_mm, seen).pose
            positions = {name: pose.carry(place) for name, place in bodies[segment].landmarks_mm.items()} | positions
    elevation = elevation_deg(positions)
    known = np.array([]) if elevation is None else elevation[np.isfinite(elevation)]
    if not len(known):
        return np.nan
    moves_deg = float(np.ptp(np.quantile(known, _MOST_FRAMES)))
    if moves_deg > SAME_POSTURE_DEG:
        cause = f"the arm moves by {moves_deg:.0f} degrees in this static trial"
        raise InputError(one.file, None, cause, "Give each posture a file of its own")
    return float(np.median(known))


def _over_elevation(
    cluster: Cluster, read: Sequence[_Static], elevations_deg: Sequence[float], mapping: Mapping
) -> Body:
    """Compute the pose of the scapula in its cluster at one or several postures of the arm."""
    landmarks = carried_by("scapula", mapping)
    found = [(at, one.file, one.beside(cluster, landmarks)) for at, one in zip(elevations_deg, read, strict=True)]
    palpated = [one for one in found if one[2]]
    if len(palpated) > 1 and any(np.isnan(at) for at, _, _ in palpated):
        file = next(file for at, file, _ in palpated if np.isnan(at))
        cause = "the elevation of the arm is not known in this static trial, so it is not clear where it counts"
        remedy = "Give GH, EM and EL and the thorax, or clusters that carry them; or a single static trial"
        raise InputError(file, None, cause, remedy)
    groups: list[list[tuple[float, str, dict[str, np.ndarray]]]] = []
    for one in sorted(palpated, key=lambda one: one[0]):
        if groups and one[0] - groups[-1][0][0] <= SAME_POSTURE_DEG:
            groups[-1].append(one)
        else:
            groups.append([one])
    nodes = [
        (float(np.mean([at for at, _, _ in group])), group[0][1], _means([places for _, _, places in group]))
        for group in groups
    ]
    return _body(nodes)


def _check_same_bone(first: Node, other: Node) -> None:
    """Raise InputError where the palpated distances of two postures differ by more than one scapula allows."""
    pairs = [pair for pair in combinations(sorted(first[2]), 2) if set(pair) <= other[2].keys()]
    if not pairs:
        return
    change = distances_mm(other[2], pairs)[:, 0] - distances_mm(first[2], pairs)[:, 0]
    bad = {frozenset(pair): float(mm) for pair, mm in zip(pairs, change, strict=True) if abs(mm) > SAME_BONE_MM}
    if not bad:
        return
    off = {pair: float(mm) / SAME_BONE_MM for pair, mm in zip(pairs, change, strict=True)}
    named = " or ".join(" and ".join(names) for names in blamed(list(bad), off))
    most = max(bad, key=lambda pair: abs(bad[pair]))
    cause = f"{named} cannot be right: {' and '.join(sorted(most))} are {abs(bad[most]):.0f} mm "
    cause += f"{'farther from' if bad[most] > 0.0 else 'nearer to'} each other than in {first[1]}"
    raise InputError(other[1], None, cause, f"A scapula keeps its shape: palpate {named} again in one of the two")


def _body(nodes: Sequence[Node]) -> Body:
    """Fit one rigid scapula to the landmarks palpated at each elevation. InputError where these are too few."""
    first = nodes[0][2]
    poses = []
    for at, file, places in nodes:
        _check_same_bone(nodes[0], (at, file, places))
        common = [name for name in first if name in places]
        shape = np.stack([first[name][:, 0] for name in common])
        fit = fit_rigid(shape, np.stack([places[name] for name in common])) if len(common) >= FEWEST else None
        if len(nodes) > 1 and (fit is None or np.isnan(fit.residual_mm).any()):
            cause = (
                f"with the arm at {at:.0f} degrees only {', '.join(common) or 'no landmark'} of the scapula is known"
            )
            raise InputError(file, None, cause, "Palpate AC, TS and AI in each static posture")
        poses.append(Pose(np.eye(3)[..., None], np.zeros((3, 1))) if len(nodes) == 1 or fit is None else fit.pose)
    shape = _means(
        [
            {name: pose.fetch(place) for name, place in places.items()}
            for pose, (_, _, places) in zip(poses, nodes, strict=True)
        ]
    )
    return Body(shape, tuple(poses), tuple(at for at, _, _ in nodes))
