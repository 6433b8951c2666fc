"""Few lanes by numpy, many by compiled programs: one text, so the same results."""

import jax
import numpy as np
import pytest

from adapt import adaptation, fit
from adapt.adaptation import lanes, solved_from_geometric_fit
from adapt.batch import pack
from adapt.fit import fit_lanes
from models import load_model
from motions.rotations import DEG
from motions.simulation import simulate_subjects

SAME_RAD = 1e-9
SAME_RELATIVE = 1e-10
"""Of a parameter: rounding, times the 1e4 or so by which the ellipsoid's free direction is loose."""


def test_posture_fits(monkeypatch):
    target = simulate_subjects(2, seed=6).angles_deg.T / DEG
    count = target.shape[1]
    girdle = jax.tree.map(lambda x: np.repeat(np.asarray(x)[..., None], count, axis=-1), load_model("R2").girdle)
    measured = np.isfinite(target)
    at_once = fit_lanes(girdle, target, measured)
    monkeypatch.setattr(fit, "_AT_ONCE", 0)
    compiled = fit_lanes(girdle, target, measured)
    assert at_once.status.tolist() == compiled.status.tolist() == ["ok"] * count
    np.testing.assert_allclose(compiled.angles, at_once.angles, rtol=0.0, atol=SAME_RAD)
    np.testing.assert_allclose(compiled.j_deg2, at_once.j_deg2, rtol=1e-12)


@pytest.mark.filterwarnings("ignore")
def test_adaptations(monkeypatch):
    data = lanes(pack(simulate_subjects(3, seed=6)), [load_model("R2")])
    at_once = solved_from_geometric_fit(data)
    monkeypatch.setattr(adaptation, "_AT_ONCE", 0)
    compiled = solved_from_geometric_fit(data)
    assert at_once.converged.all()
    assert compiled.converged.all()
    np.testing.assert_allclose(compiled.theta, at_once.theta, rtol=SAME_RELATIVE)
    np.testing.assert_allclose(compiled.angles, at_once.angles, rtol=0.0, atol=SAME_RAD)
