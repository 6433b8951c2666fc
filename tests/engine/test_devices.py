"""Several devices in one process: the problems are shared out, and what comes back is the same."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

SAME_RAD = 1e-9

PROGRAM = """
import json
import jax
import numpy as np
from adapt.solvers.newton.postures import postures_kernel
from adapt.solvers.unmeasured import angle_weights
from models import load_model
from motions.rotations import DEG
from motions.rhythm_subjects import simulate_subjects

postures_kernel.chunk = 64
target = simulate_subjects(20, seed=2).angles_deg.T / DEG
count = target.shape[1]
girdle = load_model("R2").girdle.repeated(count)
used, put = set(), jax.device_put


def recorded(tree, device):
    used.add(str(device))
    return put(tree, device)


jax.device_put = recorded
start = (target, np.zeros((3, count)), np.zeros(count, bool))
given = girdle, target, angle_weights(np.ones(target.shape, bool)), start, np.full(count, 30.0)
found = postures_kernel.by_jax(*given).angles
expected = postures_kernel.by_machine(*given).angles
print(json.dumps({"devices": len(jax.devices()), "used": len(used), "off": float(np.abs(found - expected).max())}))
"""


def test_two_devices_share_the_problems_and_change_nothing():
    """JAX is told that the CPU is two devices; in a process of its own, because it asks that only once."""
    flags = f"{os.environ['XLA_FLAGS']} --xla_force_host_platform_device_count=2"
    environment = os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", PROGRAM]
    ended = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    said = json.loads(ended.stdout)
    assert (said["devices"], said["used"]) == (2, 2)
    assert said["off"] <= SAME_RAD
