"""Adaptations of several sets as in the thesis: adapted to abduction and flexion, assessed in abduction."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from adapt.solvers import status
from adapt.solvers.adaptation import adapt_batch
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems, problems_of
from adapt.solvers.rows import posture_rows
from adapt.solvers.solution import PostureSolution
from models import load_model
from motions import InputError, Motions, read_motions
from motions.landmarks.girdle_angles import CLAVICLE_X, estimated_axial_deg
from motions.rotations import DEG
from scripts.reporting import check_known
from scripts.research.thesis.variants import AXIAL, Variant, variant_problems, with_axial, without_axial

ABDUCTION, FLEXION = ADAPTED_TO = "frontal_elevation", "sagittal_elevation"


@dataclass(frozen=True)
class Outcome:
    """Adaptation of one set to S subjects."""

    own_mm: Float[np.ndarray, "6 subjects"]
    """Parameters of the set itself, in the order of ADAPTED."""
    theta_mm: Float[np.ndarray, "6 subjects"]
    before_deg: Float[np.ndarray, "6 subjects"]
    """Mean |simulated - measured| of each angle over the postures of abduction, before adaptation."""
    after_deg: Float[np.ndarray, "6 subjects"]
    E: Float[np.ndarray, " subjects"]
    """Objective in the units of the reading; with w = 0 mean J."""
    at_bound: Bool[np.ndarray, "6 subjects"]
    ok: Bool[np.ndarray, " subjects"]

    def take(self, subjects) -> "Outcome":
        """Select subjects by index or mask."""
        return Outcome(**{f.name: getattr(self, f.name)[..., subjects] for f in fields(self)})

    @property
    def shift_mm(self) -> Float[np.ndarray, "6 subjects"]:
        """Change of the parameters: adapted less own."""
        return self.theta_mm - self.own_mm

    @property
    def sd_mm(self) -> Float[np.ndarray, " 6"]:
        """Standard deviation of the adapted parameters over subjects (n - 1)."""
        return np.std(self.theta_mm, axis=1, ddof=1)


@dataclass(frozen=True)
class Study:
    """Subjects with every set: the data that all variants share."""

    sets: tuple[str, ...]
    subjects: tuple[str, ...]
    data: Problems
    """Problems of subjects and sets, as shipped."""
    abduction: Bool[np.ndarray, "postures problems"]
    """Mask of the postures whose gap is reported."""
    axial: dict[str, Float[np.ndarray, "postures problems"]]
    """Clavicle's axial rotation, rad, for each choice of AXIAL; its gap is reported."""


def persons(files: Sequence[Path], leave_out: Sequence[str]) -> Motions:
    """Read motions without some subjects; report unreadable parts on stderr. BadParameter for an unknown subject."""
    motions = read_motions(*files)
    for error in motions.rejected:
        print(f"left out: {error}", file=sys.stderr)
    check_known(leave_out, motions.subjects, "subject")
    return motions.select(~np.isin(motions.subject, list(leave_out)))


def prepare(motions: Motions, sets: Sequence[str]) -> Study:
    """Pack six-angle postures of the subjects with abduction and flexion, with every set. InputError if none has."""
    motions = motions.select(np.isin(motions.motion, ADAPTED_TO) & np.isfinite(motions.angles_deg).all(axis=1))
    both = [name for name in motions.subjects if {*ADAPTED_TO} <= {*motions.motion[motions.subject == name]}]
    if not both:
        raise InputError("motions", None, f"no subject has both {ABDUCTION} and {FLEXION}", "Give other motions")
    motions = motions.select(np.isin(motions.subject, both))
    rows = posture_rows(motions)
    abduction = rows.counted & rows.packed(motions.motion == ABDUCTION)
    count = len(sets)
    estimated = np.tile(rows.packed(axial_estimate_deg(motions) / float(DEG)), count)
    data = problems_of(rows, [load_model(name) for name in sets])
    lowest = np.where(rows.counted, rows.packed(motions.humerus_elevation_deg), np.inf).argmin(axis=0)
    at_lowest = np.tile(lowest, count), np.arange(len(lowest) * count)
    closes = _fitted(without_axial(with_axial(data, estimated))).angles[CLAVICLE_X]
    from_set = estimated + (closes - estimated)[at_lowest]
    measured = np.asarray(data.angles)[CLAVICLE_X]
    axial = dict(zip(map(str, AXIAL), (measured, estimated, from_set, measured, from_set), strict=True))
    return Study(tuple(sets), rows.subjects, data, np.tile(abduction, count), axial)


def axial_estimate_deg(motions: Motions) -> Float[np.ndarray, " postures"]:
    """Estimate the axial rotation that minimises SC and AC rotation (6.3), from each subject's lowest arm posture."""
    found = np.empty(len(motions.posture))
    for name in motions.subjects:
        mine = motions.subject == name
        angles_deg = motions.angles_deg[mine]
        found[mine] = estimated_axial_deg(angles_deg, angles_deg[np.argmin(motions.humerus_elevation_deg[mine])])
    return found


def outcomes(study: Study, variant: Variant) -> dict[str, Outcome]:
    """Adapt every set to every subject in one way; of several choices of sides keep the one with the lowest E."""
    sides = variant_problems(study.data, study.axial[variant.axial], variant)
    reported = sides[0].angles
    before = [_fitted(data) for data in sides]
    adapted = [_adapted(data, variant, fitted) for data, fitted in zip(sides, before, strict=True)]
    chosen = _lowest(before), _lowest(adapted)
    found = Outcome(
        own_mm=np.asarray(study.data.girdle.adapted_mm),
        theta_mm=chosen[1].theta_mm,
        before_deg=_gap_deg(study, chosen[0].angles, reported),
        after_deg=_gap_deg(study, chosen[1].angles, reported),
        E=chosen[1].E,
        at_bound=chosen[1].at_bound,
        ok=chosen[0].ok & chosen[1].ok,
    )
    count = len(study.subjects)
    return {name: found.take(slice(k * count, (k + 1) * count)) for k, name in enumerate(study.sets)}


@dataclass(frozen=True)
class _Fit:
    """Postures of all problems (last axis) at some parameters."""

    theta_mm: np.ndarray
    angles: np.ndarray
    E: np.ndarray
    """Mean J before, E after adaptation."""
    at_bound: np.ndarray
    ok: np.ndarray


def _fitted(data: Problems) -> _Fit:
    """Fit the postures with the unadapted sets; ok is False where a counted posture has no fit."""
    theta, counted = np.asarray(data.girdle.adapted_mm), np.asarray(data.counted)
    fitted = _postures(data, theta)
    J = np.where(counted, fitted.j_deg2.reshape(counted.shape), 0.0).sum(axis=0) / counted.sum(axis=0)
    ok = ((fitted.status == status.OK).reshape(counted.shape) | ~counted).all(axis=0)
    nothing = np.zeros(theta.shape, bool)
    return _Fit(theta, fitted.angles.reshape(6, *counted.shape), J, nothing, ok)


def _postures(data: Problems, theta: np.ndarray) -> PostureSolution:
    """Fit every posture with the girdle at theta, from several starting points.

    If an angle is left out of J, the only start is its measured value: two values of the clavicle's axial rotation, up
    to 180 degrees apart, close the conoid equally well, and J does not prefer either.
    """
    posture, problem = (places.ravel() for places in np.indices(data.counted.shape))
    angles, measured = (np.asarray(x).reshape(6, -1) for x in (data.angles, data.measured))
    all_in = bool(data.measured[:, data.counted].all())
    girdles = data.girdles_at(theta, posture, problem)
    return fit_batch(girdles, angles, measured, start=None if all_in else angles)


def _adapted(data: Problems, variant: Variant, before: _Fit) -> _Fit:
    """Adapt; with w = 0 the unadapted fit remains, since only J moves ellipsoid and conoid away from their start."""
    if variant.weight == 0.0:
        return before
    found = adapt_batch(data, variant.weight, variant.objective)
    angles = found.angles
    if not data.measured[:, data.counted].all():
        angles = _postures(data, found.theta_mm).angles.reshape(angles.shape)
    return _Fit(found.theta_mm, angles, found.E, found.at_bound, found.status == status.OK)


def _lowest(fits: Sequence[_Fit]) -> _Fit:
    """Select for each problem the ok fit with the lowest objective."""
    best = fits[0]
    for other in fits[1:]:
        gains = other.ok & (~best.ok | (other.E < best.E))
        best = replace(best, **{k: np.where(gains, v, getattr(best, k)) for k, v in vars(other).items()})
    return best


def _gap_deg(study: Study, angles: np.ndarray, reported: np.ndarray) -> Float[np.ndarray, "6 problems"]:
    """Compute mean |simulated - measured| of each angle over the postures of abduction."""
    known = np.asarray(study.data.measured) & study.abduction
    off = np.where(known, np.abs(angles - reported), 0.0) * float(DEG)
    return off.sum(axis=1) / known.sum(axis=1)
