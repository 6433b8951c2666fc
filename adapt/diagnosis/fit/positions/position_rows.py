"""Measured positions of landmarks as rows of the linear model: what joints and frames do along a motion, seen directly.

A landmark m is seen from the next measured one that carries it, p (the thorax where none was): c = p_m - p_p, in the
thorax frame, at the angles as they were measured. The closed chain is not in it:

    c = c_0 + A a_s + H x_s + curves + noise,    x_s = S u_s + C h,  h and u_s ~ N(0, 1)

c_0 is that of the parameter set. A is the slope of c in all amplitudes. x_s are the constants of the person
(``adapt.evaluation.person_constants``): the places of SC, AC, TS, AI and AA in their bones, S S' their covariance by a
scale that is learnt (``Discrepancy.people``). What all persons have in common of them is a cause, a candidate
(``_COMMON_OF``); h is of what no candidate changes, as AA, which no set has. The noise of a coordinate is that of a
place, of two where a landmark is seen from another, and that of the measured angles by its lever.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.diagnosis.fit.candidates import Candidates
from adapt.diagnosis.fit.shoulders import Shoulders
from adapt.engine.batching import take_problems
from adapt.evaluation.person_constants import Places, columns_of, place_slopes, prior_of
from models.effects import ActiveEffects, Effect
from models.effects.course import CONSTANT
from models.effects.extended_girdle import NO_ACTIVE_EFFECTS
from models.girdle import Girdle, bone_rotations
from models.person.family import AnyModel
from models.person.own_bones import NAMES
from models.person.positions.landmark_positions import POSITIONS, BonePoses, bone_poses, positions_mm
from motions.landmarks.sampled_postures import measured_places_mm
from motions.rotations import DEG

_OF_SCAPULA = ("TS", "AI", "AA")

_CARRIERS: Mapping[str, tuple[str, ...]] = {"SC": (), "AC": ("SC",), **dict.fromkeys(_OF_SCAPULA, ("AC", "SC"))}
"""The landmarks that carry each, the next one first."""

TURN_THE_SCAPULA_FRAME = ("skin_artefact", "scapula_landmark_bias")
"""Causes that turn the measured frame of the scapula in the bone."""

_STEP = 1e-3
"""Of a strength (mm, deg) or an angle (deg), for central differences: their error is some 1e-7 of the slope."""

_UNMEASURED_DEG = 20.0
"""SD of an angle that was not measured about its mean at rest, over a motion (axial rotation of the clavicle, 17-35
deg over elevation: Ludewig 2009, Matsuki 2014)."""

_OPEN = 10.0
"""Times the SD of a constant, that leaves it open."""

PALPATED_MM = 3.0
"""SD of a coordinate of a palpated landmark (de Groot 1997: 1-4 mm, one palpator)."""

_AA = {"AA": np.array([[-5.0], [-25.0], [22.0]])}
"""AA in the scapula, seen from AC, mm: the mean of bone pins (six shoulders of Moissenet 2023, to some 10 mm). What an
effect does to it goes by it; where it is in a person is a constant."""


_COMMON_OF: Mapping[str, str] = {
    "SC_": "sc_offset",
    "clavicle_length": "clavicle_length",
    "scapula_size": "scapula_size",
    "TS_x": "ts_offset",
    "AI_": "ai_offset",
    "clavicle_AC": "ac_offset",
    "scapula_AC": "ac_offset",
    "clavicle_frame": "clavicle_frame_bias",
    "scapula_frame": "scapula_landmark_bias",
}
"""By how the name of a person's size begins (``models.person.own_bones``), the cause that all have in common of it."""


@dataclass(frozen=True)
class PositionRows:
    """Measured coordinates; n of each posture."""

    values_mm: Float[np.ndarray, "rows n"]
    """c_0 less what was measured; 0 where it was not."""
    measured: Bool[np.ndarray, "rows n"]
    by_amplitude: Float[np.ndarray, "rows n amplitudes"]
    by_constant: Float[np.ndarray, "rows n constants"]
    """H S."""
    by_common: Float[np.ndarray, "rows n common"]
    """H C."""
    landmarks: tuple[str, ...]
    """Those that were measured, three coordinates each; none where only what is ``beside_angles_of_them`` is left."""
    of_noise: Float[np.ndarray, "rows n n"]
    """Covariance of the coordinates where each coordinate of a place has noise of SD 1: a place is in that of its
    landmark, and in those of all that it carries."""
    by_angle: Float[np.ndarray, "rows n 6"]
    """What a degree of noise in each measured angle does, mm; an angle that was not measured has more."""
    noise_mm: float
    """SD of a coordinate of one place."""
    noise_in_y: Float[np.ndarray, "rows 3 6"] | None = None
    """What a degree of noise in each measured angle does to y, where the positions share that noise."""

    def amplitudes(self, where: Int[np.ndarray, " own"]) -> "PositionRows":
        """Take some of the amplitudes."""
        return replace(self, by_amplitude=self.by_amplitude[..., where])

    def carried(self, candidates: Candidates) -> "PositionRows":
        """Take the landmarks of the scapula to go with the frame that was measured, as a cluster on the skin carries
        them: what turns that frame in the bone does not show in them."""
        turning = [one.name for one in candidates.effects if one.cause in TURN_THE_SCAPULA_FRAME]
        of_scapula = np.repeat([name in _OF_SCAPULA for name in self.landmarks], 3)
        by_amplitude = self.by_amplitude.copy()
        by_amplitude[:, np.flatnonzero(of_scapula)[:, None], candidates.where(turning)] = 0.0
        return replace(self, by_amplitude=by_amplitude)

    def beside_angles_of_them(
        self, angles: Float[np.ndarray, "6 rows"], ac_is_on_the_bone: bool = True
    ) -> "PositionRows | None":
        """Keep what is not in angles that were computed from these landmarks: how SC moves, and AC along the clavicle,
        unless skin carried it.

        Where they are in their bones is left open: that is in what landmarks say of sizes (``measured_sizes``). None
        where SC was not measured.
        """
        if "SC" not in self.landmarks:
            return None
        n, count = self.values_mm.shape[1], self.values_mm.shape[0]
        first = 3 * self.landmarks.index("SC")
        kept, directions = (
            [first, first + 1, first + 2],
            [np.tile(one, (count, 1)) for one in np.eye(n)[first : first + 3]],
        )
        if ac_is_on_the_bone and "AC" in self.landmarks:
            own = 3 * self.landmarks.index("AC")
            along = np.zeros((count, n))
            along[:, own : own + 3] = bone_rotations(angles)[0][:, 0].T
            kept, directions = [*kept, own], [*directions, along]
        turned = np.stack(directions, axis=1)
        return PositionRows(
            values_mm=np.einsum("rmn,rn->rm", turned, self.values_mm),
            measured=self.measured[:, kept],
            by_amplitude=turned @ self.by_amplitude,
            by_constant=_OPEN * turned @ self.by_constant,
            by_common=_OPEN * turned @ self.by_constant,
            landmarks=(),
            of_noise=turned @ self.of_noise @ np.swapaxes(turned, 1, 2),
            by_angle=np.zeros((count, len(kept), len(angles))),
            noise_mm=self.noise_mm,
        )


def position_rows(
    model: AnyModel, girdle: Girdle, candidates: Candidates, shoulders: Shoulders, noise_mm: float
) -> PositionRows | None:
    """Lay out the measured positions of all postures; None where there are none. ``girdle``: (component, subjects)."""
    every = measured_places_mm(shoulders.motions)
    measured = {name: every[name] for name in POSITIONS if name in every and np.isfinite(every[name]).any()}
    return _laid_out(model, girdle, candidates, shoulders, noise_mm, measured) if measured else None


def planned_rows(
    model: AnyModel, girdle: Girdle, candidates: Candidates, shoulders: Shoulders, landmarks: Sequence[str]
) -> PositionRows:
    """Lay out positions that nobody has measured, to ``PALPATED_MM``: of what they would tell, whatever they are."""
    nowhere = dict.fromkeys(landmarks, np.zeros((3, len(shoulders.subject))))
    return _laid_out(model, girdle, candidates, shoulders, PALPATED_MM, nowhere)


def _laid_out(
    model: AnyModel,
    girdle: Girdle,
    candidates: Candidates,
    shoulders: Shoulders,
    noise_mm: float,
    measured: Places,
) -> PositionRows:
    seen = Seen(tuple(measured), take_problems(jax.tree.map(np.asarray, girdle), shoulders.subject))
    angles = shoulders.angles
    c_0, poses = seen.from_carriers(angles), jax.tree.map(np.asarray, bone_poses(seen.girdle, angles))
    places = np.concatenate([place.T for place in _from_carriers(measured).values()], axis=1)
    known = np.isfinite(places)
    root = np.linalg.cholesky(np.moveaxis(prior_of(model, shoulders.subjects), -1, 0))[shoulders.subject]
    columns, by_constant = columns_of(model, shoulders.subjects), seen.by_constant(poses)
    common = np.moveaxis(columns[:, ~_are_candidates(candidates, columns.shape[1])], -1, 0)[shoulders.subject]
    return PositionRows(
        values_mm=np.where(known, c_0 - np.where(known, places, 0.0), 0.0),
        measured=known,
        by_amplitude=candidates.by_amplitude(seen.by_channel(candidates.effects, angles)),
        by_constant=by_constant @ root,
        by_common=by_constant @ common,
        landmarks=tuple(measured),
        of_noise=np.broadcast_to(_of_noise(tuple(measured)), (len(known), *2 * known.shape[1:])),
        by_angle=seen.by_angle(angles, shoulders.measured),
        noise_mm=noise_mm,
    )


def _are_candidates(candidates: Candidates, count: int) -> Bool[np.ndarray, " sizes"]:
    """Tell which sizes of a person a candidate changes in all of them."""
    tried = {candidates.causes[effect.name] for effect in candidates.effects if effect.course is CONSTANT}
    of_sizes = [any(name.startswith(start) and _COMMON_OF[start] in tried for start in _COMMON_OF) for name in NAMES]
    return np.array(of_sizes + [False] * (count - len(of_sizes)))


def _carrier(name: str, measured: Sequence[str] | Places) -> str | None:
    return next((one for one in _CARRIERS[name] if one in measured), None)


def _of_noise(names: Sequence[str]) -> Float[np.ndarray, "n n"]:
    """Compute T T', T what each place does to the coordinates, which are seen from their carriers."""
    T = np.eye(len(names))
    for name in names:
        carrier = _carrier(name, names)
        if carrier is not None:
            T[names.index(name), names.index(carrier)] = -1.0
    return np.kron(T @ T.T, np.eye(3))


def _from_carriers(places: Places) -> dict[str, Float[np.ndarray, "3 *any"]]:
    """Subtract from each landmark the one that carries it."""
    found = {}
    for name, place in places.items():
        carrier = _carrier(name, places)
        found[name] = place if carrier is None else place - places[carrier]
    return found


@dataclass(frozen=True)
class Seen:
    """Some landmarks of girdles at their postures, each seen from the next one that carries it."""

    names: tuple[str, ...]
    girdle: Girdle

    def from_carriers(
        self, angles: Float[np.ndarray, "6 rows"], active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
    ) -> Float[np.ndarray, "rows n"]:
        """Compute c of the parameter set, with AA where it is on average."""
        found = positions_mm(bone_poses(active_effects.on(self.girdle), angles), _AA)
        return np.concatenate([one.T for one in _from_carriers({name: found[name] for name in self.names}).values()], 1)

    def by_constant(self, poses: BonePoses) -> Float[np.ndarray, "rows n constants"]:
        """Compute H."""
        every = _from_carriers({name: place_slopes(poses, name) for name in self.names})
        return np.moveaxis(np.concatenate(list(every.values())), -1, 0)

    def by_channel(
        self, effects: Sequence[Effect], angles: Float[np.ndarray, "6 rows"]
    ) -> Float[np.ndarray, "rows n channels"]:
        """Compute the slopes in the strength of every channel of every effect, where none is active."""
        found = []
        for effect in effects:
            if not effect.moves_landmarks:
                count = effect.course.channels(len(effect.directions))
                found += count * [np.zeros((angles.shape[1], 3 * len(self.names)))]
                continue
            for step in _STEP * np.eye(effect.course.channels(len(effect.directions))):
                there, back = (
                    self.from_carriers(angles, ActiveEffects((np.outer(one, np.ones(angles.shape[1])),), (effect,)))
                    for one in (step, -step)
                )
                found.append((there - back) / (2.0 * _STEP))
        return np.stack(found, axis=-1)

    def by_angle(
        self, angles: Float[np.ndarray, "6 rows"], measured: Bool[np.ndarray, "6 rows"]
    ) -> Float[np.ndarray, "rows n 6"]:
        """Compute the slopes in a degree of noise in every measured angle."""
        found = []
        for known, step in zip(measured, _STEP / DEG * np.eye(6), strict=True):
            there, back = (self.from_carriers(angles + one[:, None]) for one in (step, -step))
            found.append((there - back) / (2.0 * _STEP) * np.where(known, 1.0, _UNMEASURED_DEG)[:, None])
        return np.stack(found, axis=-1)
