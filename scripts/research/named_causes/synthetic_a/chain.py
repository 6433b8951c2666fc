"""The closed chain of thorax, clavicle and scapula, read from a parameter set as plain data."""

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from scripts.research.named_causes.synthetic_a.conventions import Array, Mask
from scripts.research.named_causes.synthetic_a.rotations import apply, cardan_axes, rotation_from_cardan
from scripts.research.named_causes.synthetic_a.thorax import surface_distance

CLOSED_MM = 1e-9
"""Largest residual of a closed chain; double precision leaves about 1e-13 mm."""


@dataclass(frozen=True)
class Chain:
    """Geometry of n postures, in mm, each with its own numbers; the first axis of every array is the posture."""

    centre: Array
    semi: Array
    exponent: Array
    R_thorax_surface: Array
    sc: Array
    length: Array
    ac_shift: Array
    """Displacement of the AC centre, in the clavicle frame."""
    clavicle_conoid: Array
    ts: Array
    ai: Array
    scapula_conoid: Array
    targets: Array
    """Distance of TS, distance of AI, length of the conoid (n, 3)."""

    def rows(self, keep: Mask) -> "Chain":
        """Select some of the postures."""
        return Chain(**{f.name: getattr(self, f.name)[keep] for f in fields(self)})

    def points(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Compute SC, AC, TS, AI (n, 3) in the thorax frame, mm, at angles q (n, 6) in rad."""
        R_C, R_S = rotation_from_cardan(q[:, :3]), rotation_from_cardan(q[:, 3:])
        ac = self.sc + apply(R_C, self.clavicle_end())
        return self.sc, ac, ac + apply(R_S, self.ts), ac + apply(R_S, self.ai)

    def clavicle_end(self) -> Array:
        """Return AC in the clavicle frame (n, 3)."""
        return self.ac_shift + self.length[:, None] * np.array([1.0, 0.0, 0.0])

    def gap(self, q: Array) -> tuple[Array, Array]:
        """Compute the residuals of A1-A3 (n, 3) in mm and their derivatives (n, 3, 6) in mm/rad, at q (n, 6) in rad."""
        R_C, R_S = rotation_from_cardan(q[:, :3]), rotation_from_cardan(q[:, 3:])
        axes_C, axes_S = cardan_axes(q[:, :3], R_C), cardan_axes(q[:, 3:], R_S)
        end = apply(R_C, self.clavicle_end())
        ac = self.sc + end
        gap, slope = [], []
        for arm in (apply(R_S, self.ts), apply(R_S, self.ai)):
            local = apply(np.swapaxes(self.R_thorax_surface, 1, 2), ac + arm - self.centre)
            distance, normal = surface_distance(local, self.semi, self.exponent)
            n = apply(self.R_thorax_surface, normal)[:, None]
            gap.append(distance)
            slope.append(_turn(n, axes_C, end, axes_S, arm))
        arm, root = apply(R_S, self.scapula_conoid), apply(R_C, self.clavicle_conoid)
        conoid = end + arm - root
        length = np.linalg.norm(conoid, axis=-1)
        gap.append(length)
        slope.append(_turn((conoid / length[:, None])[:, None], axes_C, end - root, axes_S, arm))
        return np.stack(gap, -1) - self.targets, np.stack(slope, 1)

    def close(self, wish: Array) -> tuple[Array, Array]:
        """Find the closed posture near `wish` (n, 6), rad, by damped least-norm Gauss-Newton steps; return it and its
        residuals in mm."""
        q = wish.copy()
        gap, G = self.gap(q)
        for _ in range(60):
            going = np.max(np.abs(gap), axis=-1) > 1e-12
            if not going.any():
                break
            g, Gg = gap[going], G[going]
            size = np.linalg.norm(g, axis=-1)[:, None, None]
            GG = Gg @ np.swapaxes(Gg, 1, 2) + 5.0 * np.minimum(size, 10.0) * np.eye(3)
            step = np.einsum("nij,ni->nj", Gg, np.linalg.solve(GG, g[:, :, None])[:, :, 0])
            step *= np.minimum(1.0, 0.25 / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-30))
            q[going] -= step
            gap[going], G[going] = self.rows(going).gap(q[going])
        return q, gap


def _turn(n: Array, axes_C: Array, arm_C: Array, axes_S: Array, arm_S: Array) -> Array:
    """Compute the derivative (n, 6), along n, of a point at the end of a clavicle arm and a scapula arm."""
    by_C = np.sum(n * np.cross(axes_C, arm_C[:, None]), axis=-1)
    return np.concatenate([by_C, np.sum(n * np.cross(axes_S, arm_S[:, None]), axis=-1)], -1)


def read_chain(path: str | Path, n: int) -> tuple[str, Chain]:
    """Read name and geometry of a parameter set (TOML), the same for all n postures."""
    data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    thorax, clavicle, scapula, constraint = (data[k] for k in ("thorax", "clavicle", "scapula", "constraint"))
    targets = [constraint[k] for k in ("ts_distance_mm", "ai_distance_mm", "conoid_length_mm")]

    def tile(value: Any) -> Array:
        return np.tile(np.asarray(value, dtype=np.float64), (n,) + (1,) * np.ndim(value))

    chain = Chain(
        centre=tile(thorax["centre_mm"]),
        semi=tile(thorax["semi_axes_mm"]),
        exponent=np.full(n, 2.0),
        R_thorax_surface=tile(np.eye(3)),
        sc=tile(clavicle["sc_mm"]),
        length=np.full(n, float(clavicle["length_mm"])),
        ac_shift=np.zeros((n, 3)),
        clavicle_conoid=tile(clavicle["conoid_mm"]),
        ts=tile(scapula["ts_mm"]),
        ai=tile(scapula["ai_mm"]),
        scapula_conoid=tile(scapula["conoid_mm"]),
        targets=tile(targets),
    )
    return data["name"], chain
