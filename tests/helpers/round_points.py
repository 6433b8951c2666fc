"""Points on a sphere and on a cylinder, with noise."""

import numpy as np


def sphere_points(noise: float, seed: int = 0, cap: float = 1.0) -> np.ndarray:
    """Return points on a sphere of radius 18.5 mm, the thesis's phantom; ``cap``: part of the sphere, 1 for all."""
    rng = np.random.default_rng(seed)
    direction = rng.standard_normal((3, 200))
    direction /= np.linalg.norm(direction, axis=0)
    direction = direction[:, direction[1] > -cap]
    points = np.array([170.0, -18.0, 65.0])[:, None] + 18.5 * direction
    return points + noise * rng.standard_normal(points.shape)


def cylinder_points(noise: float) -> np.ndarray:
    """Return points on a cylinder with the direction and radius of Table 4.4 (MRI)."""
    rng = np.random.default_rng(2)
    axis = np.array([-0.09, 0.94, 0.32])
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    angle, along = rng.uniform(0, 2 * np.pi, 80), rng.uniform(-60.0, 60.0, 80)
    points = np.array([[162.0], [-80.0], [55.4]]) + axis[:, None] * along
    points = points + 7.9 * (across[:, None] * np.cos(angle) + other[:, None] * np.sin(angle))
    return points + noise * rng.standard_normal(points.shape)
