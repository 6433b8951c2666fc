"""Measured positions of landmarks as rows of the linear model: direct measurements of joints and frames in motion.

The position c = p_m - p_p of a landmark m is relative to the next measured landmark p that carries it (to the thorax
where none was), in the thorax frame and at the angles as they were measured. The closed chain is not in this model:

    c = c_0 + A a_s + H x_s + curves + noise,    x_s = S u_s + C h,  h and u_s ~ N(0, 1)

The parameter set gives c_0, and A is the derivative of c with respect to all amplitudes. The vector x_s has the
constants of the person (``adapt.evaluation.person_constants``): the places of SC, AC, TS, AI and AA in their bones. Its
covariance is S S' up to a scale that is learnt (``Discrepancy.people``). The part of a constant that all persons have
in common is a cause where a candidate changes it (``_COMMON_OF``); C h has the common parts that no candidate changes,
as of AA, which no parameter set has. The noise of a coordinate is that of one place, or of two where a landmark is
relative to another, and that of the measured angles times their lever arms.
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
from models.effects.basis import CONSTANT
from models.effects.extended_girdle import NO_ACTIVE_EFFECTS
from models.girdle import Girdle, bone_rotations
from models.person.family import AnyModel
from models.person.own_bones import NAMES
from models.person.positions.landmark_positions import POSITIONS, BonePoses, bone_poses, positions_mm
from motions.landmarks.sampled_postures import measured_places_mm
from motions.rotations import DEG

_OF_SCAPULA = ("TS", "AI", "AA")

_CARRIERS: Mapping[str, tuple[str, ...]] = {"SC": (), "AC": ("SC",), **dict.fromkeys(_OF_SCAPULA, ("AC", "SC"))}
"""Landmarks that carry each landmark, the next one first."""

TURN_THE_SCAPULA_FRAME = ("skin_artefact", "scapula_landmark_bias")
"""Causes that turn the measured frame of the scapula relative to the bone."""

_STEP = 1e-3
"""Step of a strength (mm, deg) or an angle (deg) in central differences, whose error is some 1e-7 of the derivative."""

_UNMEASURED_DEG = 20.0
"""SD of an unmeasured angle about its mean at rest, over a motion (axial rotation of the clavicle, 17-35 deg over
elevation: Ludewig 2009, Matsuki 2014)."""

_OPEN = 10.0
"""Factor on the SD of a constant that leaves the constant free."""

PALPATED_MM = 3.0
"""SD of a coordinate of a palpated landmark (de Groot 1997: 1-4 mm, one palpator)."""

_AA = {"AA": np.array([[-5.0], [-25.0], [22.0]])}
"""Mean place of AA in the scapula relative to AC, mm, from bone pins (six shoulders of Moissenet 2023, to some 10 mm).
Effects on AA are computed at this place; the place in a person is a constant of the person."""


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
"""Cause that changes a size in all persons alike, by the beginning of the size's name (``models.person.own_bones``)."""


@dataclass(frozen=True)
class PositionRows:
    """Measured coordinates, n per posture."""

    values_mm: Float[np.ndarray, "rows n"]
    """Coordinates c_0 of the parameter set less the measured coordinates; 0 where not measured."""
    measured: Bool[np.ndarray, "rows n"]
    by_amplitude: Float[np.ndarray, "rows n amplitudes"]
    by_constant: Float[np.ndarray, "rows n constants"]
    """Product H S."""
    by_common: Float[np.ndarray, "rows n common"]
    """Product H C."""
    landmarks: tuple[str, ...]
    """Measured landmarks, three coordinates each; empty after ``beside_angles_of_them``."""
    of_noise: Float[np.ndarray, "rows n n"]
    """Covariance of the coordinates if each coordinate of a place has noise of SD 1: the noise of a place is in the
    coordinates of its landmark, and of all landmarks relative to it."""
    by_angle: Float[np.ndarray, "rows n 6"]
    """Change of the coordinates, mm, per degree of noise in each measured angle, and per ``_UNMEASURED_DEG`` degrees in
    each unmeasured angle."""
    noise_mm: float
    """SD of a coordinate of one place."""
    noise_in_y: Float[np.ndarray, "rows 3 6"] | None = None
    """Change of y per degree of noise in each measured angle; None where the positions do not share that noise."""

    def amplitudes(self, where: Int[np.ndarray, " own"]) -> "PositionRows":
        """Select some of the amplitudes."""
        return replace(self, by_amplitude=self.by_amplitude[..., where])

    def carried(self, candidates: Candidates) -> "PositionRows":
        """Let the landmarks of the scapula move with the measured frame, as a cluster on the skin carries them.

        Causes that turn this frame relative to the bone then do not show in the landmarks.
        """
        turning = [one.name for one in candidates.effects if one.cause in TURN_THE_SCAPULA_FRAME]
        of_scapula = np.repeat([name in _OF_SCAPULA for name in self.landmarks], 3)
        by_amplitude = self.by_amplitude.copy()
        by_amplitude[:, np.flatnonzero(of_scapula)[:, None], candidates.where(turning)] = 0.0
        return replace(self, by_amplitude=by_amplitude)

    def beside_angles_of_them(
        self, angles: Float[np.ndarray, "6 rows"], ac_is_on_the_bone: bool = True
    ) -> "PositionRows | None":
        """Keep the information that is not in angles computed from these landmarks.

        The movement of SC remains, and the movement of AC along the clavicle unless skin carried AC. The places in the
        bones are left free, because their information is in ``measured_sizes``. None where SC was not measured.
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
    """Lay out positions that are not measured yet, with the noise ``PALPATED_MM``, to find the information in them,
    whatever their values."""
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
    """Mark the sizes of a person that a candidate changes in all persons alike."""
    tried = {candidates.causes[effect.name] for effect in candidates.effects if effect.basis is CONSTANT}
    of_sizes = [any(name.startswith(start) and _COMMON_OF[start] in tried for start in _COMMON_OF) for name in NAMES]
    return np.array(of_sizes + [False] * (count - len(of_sizes)))


def _carrier(name: str, measured: Sequence[str] | Places) -> str | None:
    return next((one for one in _CARRIERS[name] if one in measured), None)


def _of_noise(names: Sequence[str]) -> Float[np.ndarray, "n n"]:
    """Compute T T' of all coordinates, where T maps places to places relative to their carriers."""
    T = np.eye(len(names))
    for name in names:
        carrier = _carrier(name, names)
        if carrier is not None:
            T[names.index(name), names.index(carrier)] = -1.0
    return np.kron(T @ T.T, np.eye(3))


def _from_carriers(places: Places) -> dict[str, Float[np.ndarray, "3 *any"]]:
    """Subtract from each landmark the landmark that carries it."""
    found = {}
    for name, place in places.items():
        carrier = _carrier(name, places)
        found[name] = place if carrier is None else place - places[carrier]
    return found


@dataclass(frozen=True)
class Seen:
    """Some landmarks of girdles at their postures, each relative to the next one that carries it."""

    names: tuple[str, ...]
    girdle: Girdle

    def from_carriers(
        self, angles: Float[np.ndarray, "6 rows"], active_effects: ActiveEffects = NO_ACTIVE_EFFECTS
    ) -> Float[np.ndarray, "rows n"]:
        """Compute c of the parameter set, with AA at its mean place."""
        found = positions_mm(bone_poses(active_effects.on(self.girdle), angles), _AA)
        return np.concatenate([one.T for one in _from_carriers({name: found[name] for name in self.names}).values()], 1)

    def by_constant(self, poses: BonePoses) -> Float[np.ndarray, "rows n constants"]:
        """Compute H, the derivatives of c with respect to the constants."""
        every = _from_carriers({name: place_slopes(poses, name) for name in self.names})
        return np.moveaxis(np.concatenate(list(every.values())), -1, 0)

    def by_channel(
        self, effects: Sequence[Effect], angles: Float[np.ndarray, "6 rows"]
    ) -> Float[np.ndarray, "rows n channels"]:
        """Compute the derivatives with respect to the strength of every channel of every effect, at strength 0."""
        found = []
        for effect in effects:
            if not effect.moves_landmarks:
                count = effect.basis.channels(len(effect.directions))
                found += count * [np.zeros((angles.shape[1], 3 * len(self.names)))]
                continue
            for step in _STEP * np.eye(effect.basis.channels(len(effect.directions))):
                there, back = (
                    self.from_carriers(angles, ActiveEffects((np.outer(one, np.ones(angles.shape[1])),), (effect,)))
                    for one in (step, -step)
                )
                found.append((there - back) / (2.0 * _STEP))
        return np.stack(found, axis=-1)

    def by_angle(
        self, angles: Float[np.ndarray, "6 rows"], measured: Bool[np.ndarray, "6 rows"]
    ) -> Float[np.ndarray, "rows n 6"]:
        """Compute the derivatives per degree of noise in a measured angle, and per ``_UNMEASURED_DEG`` in another."""
        found = []
        for known, step in zip(measured, _STEP / DEG * np.eye(6), strict=True):
            there, back = (self.from_carriers(angles + one[:, None]) for one in (step, -step))
            found.append((there - back) / (2.0 * _STEP) * np.where(known, 1.0, _UNMEASURED_DEG)[:, None])
        return np.stack(found, axis=-1)
