"""Several devices in one process share the problems, and the results stay the same."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

SAME = 1e-9
"""Tolerance for results, relative to the largest number of an array."""

PROGRAM = """
import json
import jax
import numpy as np
from adapt.solvers.projection.thorax_term import thorax_kernel
from models import load_model

thorax_kernel.chunk = 64
count, random = 280, np.random.default_rng(2)
model = load_model("R2")
points = model.points_mm[..., None] + random.normal(scale=20.0, size=(*model.points_mm.shape, count))
theta = model.girdle.adapted_mm[:, None] + random.normal(size=(6, count))
used, put = set(), jax.device_put


def recorded(tree, device):
    used.add(str(device))
    return put(tree, device)


jax.device_put = recorded
one = np.ones(points.shape[1:])
given = model.girdle.repeated(count), points, one, 0.0 * one, theta
found, expected = thorax_kernel.by_jax(*given), thorax_kernel.native(*given)
off = max(float(np.abs(one - other).max() / np.abs(other).max()) for one, other in zip(found, expected))
print(json.dumps({"devices": len(jax.devices()), "used": len(used), "off": off}))
"""


def test_two_devices_share_the_problems_and_change_nothing():
    """Check a batch on a CPU that XLA divides into two devices; in a new process, because XLA reads this only once."""
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count=2"
    environment = os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", PROGRAM]
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    said = json.loads(ended.stdout)
    assert (said["devices"], said["used"]) == (2, 2)
    assert said["off"] <= SAME
