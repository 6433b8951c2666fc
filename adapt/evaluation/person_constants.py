"""Constants of each person that positions of landmarks determine: places of SC, AC, TS, AI and AA in their bones.

The person's own constants x (``OwnPlaces`` of ``models.person.positions.landmark_positions``, 15 numbers) are the
places of SC in the thorax, of AC in the clavicle, and of TS, AI and AA in the scapula. The position p of a landmark in
a simulated posture is linear in x:

    p = p_0 + H x,    x ~ N(0, P),    measured - p ~ N(0, s^2)

P is the covariance of persons about the parameter set (``models.person.own_bones``; AA, which no set has, differs by
some 30 mm about AC). Cells that were not measured have no row in H.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import take_problems
from adapt.own_bones.own_adaptation import spread_of
from models.girdle import NUMBERS
from models.person.family import AnyModel
from models.person.positions.landmark_positions import ON_SCAPULA, POSITIONS, BonePoses, positions_mm
from models.person.positions.measured_movement import AA_SD_MM, POSITION_SD_MM

_OF_SET = ("sc_mm", "ac_mm", "ts_mm", "ai_mm")
"""Numbers of a girdle to which the constants are added, in the order of POSITIONS."""

_COUNT = 3 * len(POSITIONS)

_NOT_TOLD = 0.5
"""Ratio of posterior to prior SD above which a constant is undetermined: positions must take away three quarters of the
variance."""

Places = Mapping[str, Float[np.ndarray, "3 rows"]]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Chains:
    """Simulated postures of some problems, with one subject per problem."""

    poses: BonePoses
    """Poses of the bones, (component, n); NaN where a fit failed."""
    row: Int[np.ndarray, " n"]
    """Row of each posture in the motions."""
    problem: Int[np.ndarray, " n"]
    fitted: Bool[np.ndarray, " n"]
    """True where the constants are fitted to the posture."""
    tested: Bool[np.ndarray, " n"]
    """True where the posture is then predicted."""


class Constants(NamedTuple):
    """Constants of each problem, three numbers per landmark in the order of POSITIONS."""

    mean_mm: Float[np.ndarray, "numbers problems"]
    covariance: Float[np.ndarray, "numbers numbers problems"]


def columns_of(model: AnyModel, subjects: tuple[str, ...]) -> Float[np.ndarray, "numbers sizes subjects"]:
    """Compute the change of the constants by one SD of each size of a person: ``SIZES``, and then AA along three
    axes."""
    columns = spread_of([model], subjects).columns_mm
    of_set = np.concatenate([columns[NUMBERS[name]] for name in _OF_SET])
    found = np.zeros((_COUNT, of_set.shape[1] + 3, len(subjects)))
    found[: len(of_set), : of_set.shape[1]] = of_set
    found[len(of_set) :, of_set.shape[1] :] = AA_SD_MM * np.eye(3)[..., None]
    return found


def prior_of(model: AnyModel, subjects: tuple[str, ...]) -> Float[np.ndarray, "numbers numbers subjects"]:
    """Compute the prior covariance P of every subject, mm^2."""
    columns = columns_of(model, subjects)
    return np.einsum("iks,jks->ijs", columns, columns)


def constants_of(
    chains: Chains, measured_mm: Places, prior: Float[np.ndarray, "numbers numbers problems"]
) -> Constants:
    """Fit the constants of every problem: x = (1 + P N)^-1 P b, N = H'H / s^2, b = H'(measured - p_0) / s^2."""
    P, rows = np.moveaxis(prior, -1, 0), take_problems(chains, np.flatnonzero(chains.fitted))
    N, b = np.zeros(P.shape), np.zeros(P.shape[:2])
    at_set = positions_mm(rows.poses, {"AA": np.zeros((3, 1))})
    for name in filter(measured_mm.__contains__, POSITIONS):
        left = measured_mm[name][:, rows.row] - at_set[name]
        known = np.all(np.isfinite(left), axis=0)
        H = place_slopes(take_problems(rows.poses, known), name)
        np.add.at(N, rows.problem[known], np.einsum("kin,kjn->nij", H, H) / POSITION_SD_MM**2)
        np.add.at(b, rows.problem[known], np.einsum("kin,kn->ni", H, left[:, known]) / POSITION_SD_MM**2)
    covariance = np.linalg.solve(np.eye(_COUNT) + P @ N, P)
    return Constants(np.einsum("pij,pj->ip", covariance, b), np.moveaxis(covariance, 0, -1))


def place_slopes(poses: BonePoses, name: str) -> Float[np.ndarray, "3 numbers n"]:
    """Compute dp/dx of a landmark: constants of SC move every landmark, constants of AC every one but SC, all others
    their own."""
    H = np.zeros((3, _COUNT, poses.SC_mm.shape[1]))
    H[:, :3] = np.eye(3)[..., None]
    if name != "SC":
        H[:, 3:6] = poses.R_thorax_clavicle
    if name in ON_SCAPULA:
        own = 3 * POSITIONS.index(name)
        H[:, own : own + 3] = poses.R_thorax_scapula
    return H


def with_constants_mm(chains: Chains, constants: Constants, measured_mm: Places) -> dict[str, np.ndarray]:
    """Compute the positions of the landmarks of every posture with the constants of its problem; AA is NaN unless a
    fitted posture of the problem has it measured."""
    mine = constants.mean_mm[:, chains.problem]
    found = positions_mm(chains.poses, dict(zip(POSITIONS, np.split(mine, len(POSITIONS)), strict=True)))
    seen = np.zeros(constants.mean_mm.shape[1], bool)
    if "AA" in measured_mm:
        known = np.isfinite(measured_mm["AA"][:, chains.row]).all(axis=0) & chains.fitted
        seen[chains.problem[known]] = True
    found["AA"][:, ~seen[chains.problem]] = np.nan
    return found


def distances_mm(
    chains: Chains, measured_mm: Places, prior: Float[np.ndarray, "numbers numbers problems"]
) -> dict[str, Float[np.ndarray, " n"]]:
    """Compute, by landmark, the distances between measured and predicted positions in the tested postures."""
    found = with_constants_mm(chains, constants_of(chains, measured_mm, prior), measured_mm)
    return {
        name: np.where(chains.tested, np.linalg.norm(measured_mm[name][:, chains.row] - place, axis=0), np.nan)
        for name, place in found.items()
        if name in measured_mm
    }


def root_mean_square_mm(distances: Mapping[str, Float[np.ndarray, " n"]]) -> float:
    """Compute the root mean square over landmarks and postures with a distance; NaN where there is none."""
    every = np.concatenate([np.zeros(0), *distances.values()])
    known = every[np.isfinite(every)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def not_told(
    constants: Constants, prior: Float[np.ndarray, "numbers numbers problems"], measured_mm: Places
) -> tuple[str, ...]:
    """Name the constants that the positions determine in no problem, except places of landmarks that were not measured.

    Examples: SC and AA where only AA was measured, or a place in the scapula where the scapula hardly turned against
    the clavicle.
    """
    involved = [name for name in POSITIONS if name in measured_mm or name in ("SC", "AC")]
    found = []
    for name in involved if measured_mm else []:
        own = slice(3 * POSITIONS.index(name), 3 * POSITIONS.index(name) + 3)
        now, before = (np.einsum("iip->ip", one[own, own]) for one in (constants.covariance, prior))
        with np.errstate(invalid="ignore"):
            if np.nanmin(np.sqrt(now / before).max(axis=0)) > _NOT_TOLD:
                found.append(name)
    return tuple(found)
