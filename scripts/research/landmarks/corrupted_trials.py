"""Simulated trials of one shoulder, with known faults in their landmarks."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.random import Generator

from models import load_model
from models.girdle import landmarks
from motions.motion_csv.cells import Side
from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.rotations import DEG, rotation_from_cardan

Lab = dict[str, Float[np.ndarray, "3 frames"]]

THORAX_MM = {
    "IJ": (0.0, 0.0, 0.0),
    "PX": (0.0, -165.0, -30.0),
    "C7": (0.0, 50.0, 125.0),
    "T8": (0.0, -150.0, 155.0),
}
"""Thorax landmarks, mm: the mean of thesis Table 4.2."""

IN_SCAPULA_MM = {"GH": (-10.0, -45.0, -15.0), "AA": (-8.0, -12.0, 32.0)}
HUMERUS_MM, ELBOW_MM = 290.0, 33.0
"""Distance from GH to the midpoint of the epicondyles, and from there to one of them."""

SIZE_SD = 0.07
"""SD of the size of persons, as a share of it; heights of 160 to 190 cm are within +- 9 %."""

REST_SD_DEG = 4.0
NOISES_MM = (0.3, 0.5, 1.0, 2.0, 3.0)
FRAMES = (12, 60, 200)
"""Numbers of frames: a palpated, a slow and a fast trial."""


@dataclass(frozen=True)
class Sound:
    """A trial without fault: landmarks in the laboratory frame with noise, the side, and the noise's SD."""

    lab_mm: Lab
    side: Side
    noise_mm: float


def sound_trial(rng: Generator, with_aa: bool) -> Sound:
    """Simulate a person of random size who raises and lowers an arm while the trunk sways in the laboratory."""
    frames, noise = int(rng.choice(FRAMES)), float(rng.choice(NOISES_MM))
    up = 0.5 * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, frames)))
    elevation = rng.uniform(5.0, 20.0) + rng.uniform(80.0, 125.0) * (
        up if frames > FRAMES[0] else np.linspace(0, 1, frames)
    )
    thorax = _in_thorax(rng, elevation)
    size = float(np.clip(rng.normal(1.0, SIZE_SD), 0.85, 1.2))
    side: Side = "left" if rng.random() < 0.5 else "right"
    mirror = np.array([-1.0 if side == "left" else 1.0, 1.0, 1.0])[:, None]
    R, origin = _sway(rng, frames)
    lab = {
        name: np.einsum("ijn,jn->in", R, size * mirror * xyz) + origin + noise * rng.standard_normal((3, frames))
        for name, xyz in thorax.items()
        if with_aa or name != "AA"
    }
    return Sound(lab, side, noise)


def _in_thorax(rng: Generator, elevation_deg: Float[np.ndarray, " frames"]) -> Lab:
    girdle, count, plane = load_model("R2").girdle, len(elevation_deg), float(rng.uniform(-10.0, 80.0))
    rest = np.repeat((REST_DEG + REST_SD_DEG * rng.standard_normal(6))[:, None], count, axis=1)
    coefficients = np.repeat(COEFFICIENTS[:, :, None], count, axis=2)
    angles = girdle_angles_deg(rest, np.full(count, plane), elevation_deg, coefficients) / float(DEG)
    at = landmarks(girdle.repeated(count), angles)
    R_scapula = np.asarray(rotation_from_cardan(angles[3:]))
    AC = np.asarray(at.AC)
    on_scapula = {name: AC + np.einsum("ijn,j->in", R_scapula, xyz) for name, xyz in IN_SCAPULA_MM.items()}
    R_humerus = _humerus(np.radians(plane), np.radians(elevation_deg), np.radians(20.0))
    elbow = on_scapula["GH"] - HUMERUS_MM * R_humerus[:, 1]
    fixed = {name: np.repeat(np.array(xyz)[:, None], count, axis=1) for name, xyz in THORAX_MM.items()}
    moving = {"SC": np.repeat(np.asarray(girdle.sc_mm)[:, None], count, axis=1), "AC": AC}
    moving |= {"TS": np.asarray(at.TS), "AI": np.asarray(at.AI)} | on_scapula
    return fixed | moving | {"EM": elbow - ELBOW_MM * R_humerus[:, 0], "EL": elbow + ELBOW_MM * R_humerus[:, 0]}


def _humerus(plane, elevation, axial) -> Float[np.ndarray, "3 3 frames"]:
    """Return Ry(plane) Rz(elevation) Ry(axial); angles in radians."""
    return np.einsum(
        "ijn,jkn,kln->iln",
        *(_turn(axis, *np.broadcast_arrays(a, elevation)) for axis, a in ((1, plane), (2, elevation), (1, axial))),
    )


def _turn(axis: int, angle, like) -> Float[np.ndarray, "3 3 frames"]:
    c, s, R = np.cos(angle), np.sin(angle), np.zeros((3, 3, *np.shape(like)))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[axis, axis], R[i, i], R[j, j], R[i, j], R[j, i] = 1.0, c, c, -s, s
    return R


def _sway(rng: Generator, frames: int):
    """Return a laboratory frame, with any axis up, in which the trunk leans and shifts by some centimetres."""
    t = np.linspace(0.0, 2.0 * np.pi, frames)
    leans = [np.radians(rng.uniform(2.0, 8.0)) * np.sin(t * rng.uniform(0.5, 2.0) + rng.uniform(0, 6)) for _ in "xyz"]
    R = np.einsum("ijn,jkn,kln->iln", *(_turn(axis, lean, t) for axis, lean in enumerate(leans)))
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    Q = Q * np.sign(np.linalg.det(Q))
    shift = np.stack([rng.uniform(10, 60) * np.sin(t * rng.uniform(0.5, 2.0) + rng.uniform(0, 6)) for _ in "xyz"])
    origin = rng.uniform(-1500.0, 1500.0, 3)[:, None]
    return np.einsum("ij,jkn->ikn", Q, R), origin + shift


@dataclass(frozen=True)
class Corrupted:
    """A trial with a fault, and the landmarks that the program has to name."""

    kind: str
    lab_mm: Lab
    side: Side
    noise_mm: float
    sound_mm: Lab
    wrong: tuple[str, ...]
    """Names of the faulty landmarks; ("axes",) where the whole trial is mirrored."""
    frames: slice


Fault = Callable[[Generator, Lab, str, slice], Lab]


def _moved(lab: Lab, name: str, frames: slice, place) -> Lab:
    new = np.array(lab[name])
    new[:, frames] = place if np.ndim(place) == 1 or np.shape(place)[1] == 1 else np.asarray(place)[:, frames]
    return lab | {name: new}


def _direction(rng: Generator):
    v = rng.standard_normal(3)
    return (v / np.linalg.norm(v))[:, None]


def ghost(rng: Generator, lab: Lab, name: str, frames: slice) -> Lab:
    """Replace the marker by another reflection, which moves with the body 0.15 to 1.5 m away."""
    return _moved(lab, name, frames, lab[name] + rng.uniform(150.0, 1500.0) * _direction(rng))


def zero(rng: Generator, lab: Lab, name: str, frames: slice) -> Lab:
    """Replace the marker by zeros or by a number that stands for a missing position."""
    value = float(rng.choice([0.0, -16512.0, 9999999.0]))
    return _moved(lab, name, frames, np.full((3, 1), value))


def constant(rng: Generator, lab: Lab, name: str, frames: slice) -> Lab:
    """Hold the marker at its position in the first faulty frame."""
    return _moved(lab, name, frames, lab[name][:, frames][:, :1])


def other_side(rng: Generator, lab: Lab, name: str, frames: slice) -> Lab:
    """Replace the landmark by its mirror image in the first frame: the one of the other shoulder, whose arm hangs."""
    IJ, C7, middle = lab["IJ"], lab["C7"], (lab["PX"] + lab["T8"]) / 2.0
    across = np.cross(C7 - IJ, middle - IJ, axis=0)
    across = across / np.linalg.norm(across, axis=0)
    y = (IJ + C7) / 2.0 - middle
    y = y / np.linalg.norm(y, axis=0)
    axes = np.stack([across, y, np.cross(across, y, axis=0)], axis=1)
    at_rest = axes[:, :, 0].T @ (lab[name] - IJ)[:, 0] * np.array([-1.0, 1.0, 1.0])
    return _moved(lab, name, frames, np.einsum("ijn,j->in", axes, at_rest) + IJ)


def spike(rng: Generator, lab: Lab, name: str, frames: slice) -> Lab:
    """Move the marker by 100 to 400 mm."""
    return _moved(lab, name, frames, lab[name] + rng.uniform(100.0, 400.0) * _direction(rng))


def unit(rng: Generator, lab: Lab, name: str, frames: slice) -> Lab:
    """Scale one marker to cm or m, as in a file merged from several."""
    return _moved(lab, name, frames, lab[name] * float(rng.choice([0.1, 0.001])))


FAULTS: dict[str, Fault] = {
    "ghost": ghost, "zero": zero, "constant": constant, "other_side": other_side, "spike": spike, "unit": unit,
}  # fmt: skip
_MIDLINE = ("IJ", "PX", "C7", "T8")


def corrupted_trial(rng: Generator, kind: str) -> Corrupted:
    """Simulate a trial with a fault of this kind, in a landmark and in frames drawn at random."""
    with_aa = bool(rng.random() < 0.3)
    sound = sound_trial(rng, with_aa)
    names = [name for name in sound.lab_mm if kind != "other_side" or name not in _MIDLINE]
    count = sound.lab_mm["IJ"].shape[1]
    whole = kind != "spike" and bool(rng.random() < 0.5)
    frames = slice(0, count) if whole else _part(rng, count, 0.05 if kind == "spike" else 0.45)
    if kind == "mirrored":
        lab = {name: xyz * np.array([1.0, 1.0, -1.0])[:, None] for name, xyz in sound.lab_mm.items()}
        return Corrupted(kind, lab, sound.side, sound.noise_mm, sound.lab_mm, ("axes",), slice(0, count))
    if kind == "swap":
        a, b = map(str, rng.choice(names, 2, replace=False))
        lab = _moved(_moved(sound.lab_mm, a, frames, sound.lab_mm[b]), b, frames, sound.lab_mm[a])
        return Corrupted(kind, lab, sound.side, sound.noise_mm, sound.lab_mm, (a, b), frames)
    name = str(rng.choice(names))
    return Corrupted(
        kind, FAULTS[kind](rng, sound.lab_mm, name, frames), sound.side, sound.noise_mm, sound.lab_mm, (name,), frames
    )


def _part(rng: Generator, count: int, most: float) -> slice:
    length = max(1, round(rng.uniform(0.02, most) * count))
    first = int(rng.integers(0, count - length + 1))
    return slice(first, first + length)
