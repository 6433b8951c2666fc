"""The girdle as a closed chain at one instant, and the closed posture nearest to a wished-for one."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Array = NDArray[np.float64]

# Clavicle y, z and scapula z are the free coordinates and follow their course; the other three give way to the chain.
FOLLOW_DEG = np.array([1.5, 1.5, 3.0, 3.0, 1.5, 3.0])
STRAY_DEG = np.array([15.0, 15.0, 30.0, 20.0, 15.0, 20.0])  # a posture farther from the wish than this is not real


@dataclass(frozen=True)
class Girdle:
    """One shoulder girdle at one instant: every length that closes the chain (mm)."""

    centre: Array
    axes: Array
    tilt: Array  # columns: the ellipsoid's axes in the thorax frame
    bulge_mm: float  # largest height of the rib cage above the ellipsoid
    bulge_azimuth: float  # rad, from lateral toward backward: position of the rib angle
    sc: Array
    length: float
    clavicle_conoid: Array
    ac_shift: Array  # displacement of the acromion from the clavicle's end, clavicle frame
    ts: Array
    ai: Array
    scapula_conoid: Array
    ts_distance: float
    ai_distance: float
    conoid_length: float


def load_girdle(path: Path) -> Girdle:
    """Read a parameter set: the cadaver's girdle, without any effect."""
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    thorax, clavicle, scapula, constraint = (data[key] for key in ("thorax", "clavicle", "scapula", "constraint"))
    return Girdle(
        centre=np.array(thorax["centre_mm"]),
        axes=np.array(thorax["semi_axes_mm"]),
        tilt=np.eye(3),
        bulge_mm=0.0,
        bulge_azimuth=0.9,
        sc=np.array(clavicle["sc_mm"]),
        length=clavicle["length_mm"],
        clavicle_conoid=np.array(clavicle["conoid_mm"]),
        ac_shift=np.zeros(3),
        ts=np.array(scapula["ts_mm"]),
        ai=np.array(scapula["ai_mm"]),
        scapula_conoid=np.array(scapula["conoid_mm"]),
        ts_distance=constraint["ts_distance_mm"],
        ai_distance=constraint["ai_distance_mm"],
        conoid_length=constraint["conoid_length_mm"],
    )


def cardan(degrees: Array) -> Array:
    """Compute the rotation matrices Ry(a) Rz(b) Rx(c) of angles (..., 3) in deg."""
    a, b, c = np.moveaxis(np.radians(degrees), -1, 0)
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    rows = [
        [ca * cb, sa * sc - ca * sb * cc, sa * cc + ca * sb * sc],
        [sb, cb * cc, -cb * sc],
        [-sa * cb, ca * sc + sa * sb * cc, ca * cc - sa * sb * sc],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def cardan_angles(matrix: Array) -> Array:
    """Compute the angles (deg) of Ry(a) Rz(b) Rx(c)."""
    a = np.arctan2(-matrix[..., 2, 0], matrix[..., 0, 0])
    b = np.arcsin(np.clip(matrix[..., 1, 0], -1.0, 1.0))
    c = np.arctan2(-matrix[..., 1, 2], matrix[..., 1, 1])
    return np.degrees(np.stack([a, b, c], axis=-1))


def surface_distance(points: Array, girdle: Girdle) -> Array:
    """Compute the signed distance (outside positive) of points (..., 3) to the rib cage.

    The closest point of the ellipsoid is a^2 p / (a^2 + t); its equation in t is convex and decreasing, so that
    Newton's method from the lower bound converges monotonically. A rib cage that bulges out of the ellipsoid reduces
    the distance.
    """
    p = (points - girdle.centre) @ girdle.tilt
    a2 = girdle.axes**2
    t = np.max(girdle.axes * np.abs(p) - a2, axis=-1)
    for _ in range(60):
        q = a2 * p**2 / (a2 + t[..., None]) ** 2
        step = (q.sum(-1) - 1.0) / (2.0 * (q / (a2 + t[..., None])).sum(-1))
        t = t + step
        if np.max(np.abs(step)) < 1e-9:
            break
    foot = a2 * p / (a2 + t[..., None])
    distance = np.sign(t) * np.linalg.norm(p - foot, axis=-1)
    return distance - girdle.bulge_mm * bulge(foot / girdle.axes, girdle.bulge_azimuth)


def bulge(unit: Array, azimuth: float) -> Array:
    """Compute the height of the rib cage on the unit sphere: high at the rib angle, low at the spine and at the top."""
    around = np.arctan2(unit[..., 2], unit[..., 0])
    rib_angle = np.exp(-(((around - azimuth) / 0.35) ** 2))
    spine = np.exp(-(((around - 1.6) / 0.35) ** 2))
    upper = 1.0 / (1.0 + np.exp(-(unit[..., 1] - 0.45) / 0.12))
    return rib_angle - 0.8 * spine - 0.7 * upper


def points_of(degrees: Array, girdle: Girdle) -> dict[str, Array]:
    """Compute the positions of the landmarks and of the two conoid attachments, thorax frame."""
    R_clavicle, R_scapula = cardan(degrees[..., :3]), cardan(degrees[..., 3:])
    ac = girdle.sc + R_clavicle @ (np.array([girdle.length, 0.0, 0.0]) + girdle.ac_shift)
    return {
        "SC": np.broadcast_to(girdle.sc, ac.shape),
        "AC": ac,
        "TS": ac + R_scapula @ girdle.ts,
        "AI": ac + R_scapula @ girdle.ai,
        "conoid_clavicle": girdle.sc + R_clavicle @ girdle.clavicle_conoid,
        "conoid_scapula": ac + R_scapula @ girdle.scapula_conoid,
    }


def chain(degrees: Array, girdle: Girdle) -> Array:
    """Compute the three constraint residuals (mm): TS distance, AI distance, conoid length."""
    at = points_of(degrees, girdle)
    conoid = np.linalg.norm(at["conoid_scapula"] - at["conoid_clavicle"], axis=-1)
    distance = surface_distance(np.stack([at["TS"], at["AI"]]), girdle)
    wanted = [girdle.ts_distance, girdle.ai_distance, girdle.conoid_length]
    return np.stack([distance[0], distance[1], conoid], axis=-1) - wanted


def chain_slope(degrees: Array, girdle: Girdle) -> Array:
    """Compute central differences of the residuals, (3, 6), mm per degree."""
    h = 1e-4
    steps = h * np.eye(6)
    return ((chain(degrees + steps, girdle) - chain(degrees - steps, girdle)) / (2.0 * h)).T


def close_chain(wish: Array, start: Array, girdle: Girdle) -> Array | None:
    """Find the closed posture nearest to the wished-for course, or None if the chain does not close near it."""
    found = minimize(
        lambda q: float(np.sum(((q - wish) / FOLLOW_DEG) ** 2)),
        start,
        jac=lambda q: 2.0 * (q - wish) / FOLLOW_DEG**2,
        method="SLSQP",
        constraints={"type": "eq", "fun": lambda q: chain(q, girdle), "jac": lambda q: chain_slope(q, girdle)},
        options={"maxiter": 80, "ftol": 1e-5},
    )
    q, gap = found.x, chain(found.x, girdle)
    for _ in range(8):  # Newton steps, because SLSQP stops at approximately 1e-4 mm
        if np.max(np.abs(gap)) < 1e-9 or not np.all(np.abs(q - wish) < STRAY_DEG):
            break
        q = q - np.linalg.pinv(chain_slope(q, girdle)) @ gap
        gap = chain(q, girdle)
    return q if np.max(np.abs(gap)) < 1e-9 and np.all(np.abs(q - wish) < STRAY_DEG) else None
