"""Kernels of the fast paths as machine code, by XLA and by NumPy; independence of batch, threads and shapes; the cache;
XLA as the fallback without machine code."""

import logging
import sys

import jax
import llvmlite.binding as llvm
import numpy as np
import platformdirs
import pytest
from lagrangian import conditions

from adapt.engine import kernel, machine_code, object_cache
from adapt.engine.batching import take_problems
from adapt.engine.kernel import Kernel
from adapt.engine.machine_code import MachineCodeError
from adapt.solvers.newton.postures import OFFSETS_DEG, lowest_kernel, postures_kernel
from adapt.solvers.newton.subjects import subjects_kernel
from adapt.solvers.objective import WEIGHT, mean_square_deg2
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems, problems_of, select_problems, subject_problem
from adapt.solvers.rows import posture_rows
from adapt.solvers.solution import (
    CONSTRAINT_TOLERANCE_MM,
    STATIONARITY_TOLERANCE,
    THETA_TOLERANCE,
)
from adapt.solvers.unmeasured import angle_weights
from models import load_model
from motions import Motions
from motions.rhythm_subjects import simulate_subjects
from motions.rotations import DEG

SAME_RAD = 1e-9
SAME_RELATIVE = 1e-10
"""Relative tolerance for a parameter: rounding, which the flat direction of the ellipsoid enlarges some 1e4 times."""

SAME_CONDITION = 1e-10
"""Tolerance for residuals (mm) and gradients (E per mm): the multipliers of foot points without a final polishing step
have rounding errors of 1e-11 mm^2."""

SUBJECTS = 11
"""Number of subjects, not a multiple of the eight problems of a block."""


def ragged() -> Motions:
    """Simulate subjects with 14, 9 and 5 postures in turn, with some unmeasured angles."""
    motions = simulate_subjects(SUBJECTS, seed=6)
    place = np.arange(len(motions.posture)) % 14
    number = np.arange(len(motions.posture)) // 14
    motions.angles_deg[(place == 3) & (number % 2 == 0), 2] = np.nan
    return motions.select(place < np.array([14, 9, 5])[number % 3])


@pytest.fixture(scope="module")
def data() -> Problems:
    return problems_of(posture_rows(ragged()), [load_model("R6")])


def arguments(data: Problems, iterations: float = 60.0):
    count, postures = data.counted.shape[1], data.counted.shape[0]
    fixed = subject_problem(data, np.full(count, WEIGHT))
    theta = np.clip(data.girdle.adapted_mm, *data.bounds_mm)
    start = theta, data.angles, np.zeros((3, postures, count)), np.zeros(count, bool)
    return fixed, start, np.full(count, iterations)


def posture_arguments(iterations: float = 30.0):
    target = simulate_subjects(3, seed=7).angles_deg.T / DEG
    count = target.shape[1]
    girdle = load_model("R4").girdle.repeated(count)
    measured = np.ones(target.shape, bool)
    measured[2, ::3] = False
    start = target, np.zeros((3, count)), np.zeros(count, bool)
    return girdle, target, angle_weights(measured), start, np.full(count, iterations)


def by_three_engines(kernel: Kernel, given):
    """Run a kernel by machine code, by NumPy (its Python text), and by XLA."""
    with np.errstate(all="ignore"):
        return kernel.native(*given), kernel.function(*given), kernel.by_jax(*given)


def test_subjects_by_three_engines(data):
    found, *others = by_three_engines(subjects_kernel, arguments(data))
    assert found.converged.all()
    for other in others:
        np.testing.assert_array_equal(found.converged, other.converged)
        np.testing.assert_allclose(found.theta, other.theta, rtol=SAME_RELATIVE, atol=0.0)
        np.testing.assert_allclose(found.angles, other.angles, rtol=0.0, atol=SAME_RAD)


def test_postures_by_three_engines():
    found, *others = by_three_engines(postures_kernel, posture_arguments())
    ended = found.converged
    assert ended.mean() > 0.8  # with one round from one start
    for other in others:
        np.testing.assert_array_equal(ended, other.converged)
        np.testing.assert_allclose(found.angles[:, ended], other.angles[:, ended], rtol=0.0, atol=SAME_RAD)


def test_the_lowest_from_two_starts_by_three_engines():
    girdle, target, weights, _, most = posture_arguments()
    steps = np.full(len(most), 3.0), np.full(len(most), 1.0)
    given = girdle, target, weights, (target, target), steps, most
    (found, settled, apart), *others = by_three_engines(lowest_kernel, given)
    assert settled.mean() > 0.9
    for other, *truths in others:
        np.testing.assert_array_equal(truths, (settled, apart))
        np.testing.assert_allclose(found.angles[:, settled], other.angles[:, settled], rtol=0.0, atol=SAME_RAD)


def test_the_lowest_from_two_starts_is_the_lower_of_two_fits():
    """Check the kernel with two starts against fits from each start alone.

    The starts lie 40 degrees from any closed chain, where the two fits often end in different local minima.
    """
    target = simulate_subjects(8, seed=9).angles_deg.T / DEG
    target = target + np.random.default_rng(1).normal(size=target.shape) * 20.0 / DEG
    count = target.shape[1]
    girdle = load_model("R4").girdle.repeated(count)
    weights, most, closed = angle_weights(np.ones(target.shape, bool)), np.full(count, 400.0), np.full(count, 6.0)
    starts = tuple(target + offset[:, None] / DEG for offset in OFFSETS_DEG[:2])

    def fitted(*two: np.ndarray):
        return lowest_kernel.native(girdle, target, weights, two, (closed, closed), most)

    (both, settled, apart), each = fitted(*starts), [fitted(one, one) for one in starts]
    ended = settled & each[0][1] & each[1][1]
    assert ended.mean() > 0.8  # ``fit_batch`` would continue the rest by projections
    assert (apart & ended).sum() > 3
    j = np.stack([one.j_deg2 for one, *_ in each])
    np.testing.assert_allclose(both.j_deg2[ended], j.min(axis=0)[ended], rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(apart[ended], (np.abs(j[1] - j[0]) > 1e-6)[ended])
    assert not any(one.any() for *_, one in each)
    expected = mean_square_deg2(both.angles, target, weights)
    np.testing.assert_allclose(both.j_deg2, expected, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("iterations", [2.0, 60.0])
def test_the_conditions_are_those_of_the_definition(data, iterations):
    """Check ``residual_mm``, ``stationarity`` and ``slope`` against automatic derivatives of E + lambda'g at the point
    where the iterations stopped, before convergence and after it."""
    problem, *rest = arguments(data, iterations)
    found = subjects_kernel.native(problem, *rest)
    residual, by_angle, by_theta = map(np.asarray, conditions(problem, *found[:3]))
    held = (found.theta <= problem.lower) & (by_theta > 0.0) | (found.theta >= problem.upper) & (by_theta < 0.0)
    expected = {
        "residual_mm": residual,
        "stationarity": np.abs(by_angle).max(axis=0) / float(DEG),
        "slope": np.where(held, 0.0, by_theta),
    }
    for name, value in expected.items():
        scale = max(1.0, np.abs(value).max())
        np.testing.assert_allclose(getattr(found, name), value, rtol=0.0, atol=SAME_CONDITION * scale, err_msg=name)
    closed, still, flat = (np.abs(value) for value in expected.values())
    closed, still = (np.where(problem.counted, one, 0.0).max(axis=-2) for one in (closed.max(axis=0), still))
    ended = (closed <= CONSTRAINT_TOLERANCE_MM) & (still <= STATIONARITY_TOLERANCE)
    np.testing.assert_array_equal(found.converged, ended & (flat.max(axis=0) <= THETA_TOLERANCE))
    assert found.converged.all() == (iterations == 60.0)


def test_a_problem_is_the_same_alone_and_in_any_company(data):
    """Check bitwise equality of a problem alone, in a small batch, and in a batch large enough for every core."""
    among = subjects_kernel.native(*arguments(data))
    many = subjects_kernel.native(*arguments(select_problems(data, np.arange(300) % SUBJECTS)))
    for k in range(SUBJECTS):
        alone = subjects_kernel.native(*arguments(select_problems(data, np.array([k]))))
        for name in ("theta", "angles", "multipliers", "residual_mm", "slope", "converged"):
            np.testing.assert_array_equal(getattr(alone, name)[..., 0], getattr(among, name)[..., k])
            np.testing.assert_array_equal(getattr(many, name)[..., k::SUBJECTS][..., 0], getattr(among, name)[..., k])


def test_one_bad_problem_harms_no_other(data):
    good = subjects_kernel.native(*arguments(data))
    data.angles[1, 0, 4] = np.nan
    found = subjects_kernel.native(*arguments(data))
    data.angles[1, 0, 4] = 0.1
    rest = np.arange(SUBJECTS) != 4
    assert not found.converged[4]
    np.testing.assert_array_equal(found.theta[:, rest], good.theta[:, rest])


def test_few_and_no_problems():
    given = posture_arguments()
    whole = postures_kernel.native(*given)
    for count in (0, 1, 7, 8, 9):
        part = postures_kernel.native(*take_problems(given, np.arange(count)))
        np.testing.assert_array_equal(part.angles, whole.angles[:, :count])


def test_a_wrong_shape_is_an_error():
    given = posture_arguments()
    with pytest.raises(ValueError, match="shape"):
        postures_kernel.native(given[0], given[1][:5], *given[2:])


# --- the cache ------------------------------------------------------------------------------------------------------


def doubled(x):
    return x * 2.0


def test_one_compilation_serves_every_length_and_the_next_run(tmp_path, monkeypatch):
    compiled, original = [], object_cache.emit_object
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda _: tmp_path)
    monkeypatch.setattr(object_cache, "emit_object", lambda text: compiled.append(text) or original(text))
    one = Kernel("doubled", doubled, ("",), "", 64)
    for count in (1, 8, 13, 1000):
        np.testing.assert_array_equal(one.native(np.arange(float(count))), 2.0 * np.arange(count))
    np.testing.assert_array_equal(Kernel("doubled", doubled, ("",), "", 64).native(np.ones(3)), [2.0, 2.0, 2.0])
    assert len(compiled) == 1
    (kept,) = (tmp_path / "machine").iterdir()
    for damage in (b"", b"nothing", kept.read_bytes()[:-1], b"x" + kept.read_bytes()[1:]):
        kept.write_bytes(damage)
        np.testing.assert_array_equal(Kernel("doubled", doubled, ("",), "", 64).native(np.ones(1)), [2.0])
    assert len(compiled) == 5


def test_a_cache_that_cannot_be_written_to_costs_no_more_than_time(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda _: tmp_path / "file")
    np.testing.assert_array_equal(Kernel("doubled", doubled, ("",), "", 64).native(np.ones(2)), [2.0, 2.0])


@pytest.mark.parametrize("changed", ["motions/arrays.py", "models/effects/effect.py", "adapt/solvers/deep/er.py"])
def test_the_key_of_the_cached_code_covers_every_source_file_at_any_depth(changed, tmp_path):
    files = {"motions/arrays.py", "models/girdle.py", "models/effects/effect.py", "adapt/engine/kernel.py", changed}
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1\n")
    before = object_cache.source_digest(tmp_path)
    assert object_cache.source_digest(tmp_path) == before
    (tmp_path / changed).write_text("x = 2\n")
    after = object_cache.source_digest(tmp_path)
    assert after != before
    (tmp_path / changed).rename((tmp_path / changed).with_name("elsewhere.py"))
    assert object_cache.source_digest(tmp_path) not in (before, after)


def test_the_key_of_the_cached_code_is_that_of_this_checkout():
    assert (object_cache._ROOT / "adapt" / "engine" / "kernel.py").samefile(kernel.__file__)
    rooms = [object_cache._ROOT / package for package in object_cache._PACKAGES]
    assert all((room / "__init__.py").exists() for room in rooms)


def test_every_compiled_text_is_in_the_key_of_the_cached_code():
    """Check that every file with a ``Kernel`` lies in a package that the key covers.

    The exception is ``doctor``, whose kernels are not cached. The import order of the packages, which a house test
    checks, ensures that they import nothing else.
    """
    rooms = [object_cache._ROOT / package for package in object_cache._PACKAGES]
    texts = {one: one.read_text() for one in (object_cache._ROOT / "adapt").rglob("*.py") if one.name != "doctor.py"}
    made = [one for one, text in texts.items() if " Kernel(" in text]
    assert made
    assert all(any(one.is_relative_to(room) for room in rooms) for one in made)


# --- without machine code --------------------------------------------------------------------------------------------


def fail(*_, **__):
    raise RuntimeError("as LLVM says it")


def llvmlite_is_missing(monkeypatch):
    for name in ("llvmlite", "llvmlite.binding"):
        monkeypatch.setitem(sys.modules, name, None)


def the_processor_is_unknown(monkeypatch):
    monkeypatch.setattr(machine_code, "_target_machine", machine_code._target_machine.__wrapped__)
    monkeypatch.setattr(llvm.Target, "from_default_triple", fail)


def compiling_fails(monkeypatch):
    monkeypatch.setattr(llvm, "parse_assembly", fail)


def linking_fails(monkeypatch):
    monkeypatch.setattr(llvm, "JITLibraryBuilder", fail)


@pytest.mark.parametrize("damage", [llvmlite_is_missing, the_processor_is_unknown, compiling_fails, linking_fails])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_xla_does_it_where_there_is_no_machine_code(damage, dtype, tmp_path, monkeypatch, caplog):
    """Check the fallback to XLA: one note at level INFO, not visible by default, and no second attempt to compile."""
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda _: tmp_path)
    kernel._note_fallback.cache_clear()
    damage(monkeypatch)
    one = Kernel("doubled", doubled, ("",), "", 64)
    with pytest.raises(MachineCodeError):
        one.native(np.ones(3, dtype))
    with caplog.at_level(logging.INFO, logger=kernel.__name__):
        for count in (0, 1, 100):
            found = one(np.arange(count, dtype=dtype))
            assert found.dtype == dtype
            np.testing.assert_array_equal(found, 2.0 * np.arange(count))
    assert [record.levelname for record in caplog.records] == ["INFO"]
    monkeypatch.undo()
    assert one._left_to_xla == {dtype}


def test_machine_code_runs_beside_a_gpu_too(monkeypatch):
    """Check that a kernel prefers machine code where JAX has a GPU, which is slower: docs/research/performance.md."""
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    monkeypatch.setattr(Kernel, "by_jax", fail)
    np.testing.assert_array_equal(Kernel("doubled", doubled, ("",), "", 64)(np.arange(9.0)), 2.0 * np.arange(9))


def test_a_fault_in_the_text_is_no_reason_to_leave_it_to_xla():
    with pytest.raises(AttributeError):
        Kernel("wrong", lambda x: x.no_such_thing, ("",), "", 64)(np.ones(3))


def test_the_fast_paths_without_llvmlite_have_the_same_results(data, monkeypatch):
    postures, subjects = posture_arguments(), arguments(data)
    measured = np.isfinite(postures[1])
    expected = (
        postures_kernel(*postures),
        subjects_kernel(*subjects),
        fit_batch(*postures[:2], measured),
    )
    for one in (postures_kernel, lowest_kernel, subjects_kernel):
        monkeypatch.setattr(one, "_functions", {})
        monkeypatch.setattr(one, "_left_to_xla", set())
    llvmlite_is_missing(monkeypatch)
    swept, adapted, fitted = (
        postures_kernel(*postures),
        subjects_kernel(*subjects),
        fit_batch(*postures[:2], measured),
    )
    ended = expected[0].converged
    np.testing.assert_array_equal(swept.converged, ended)
    np.testing.assert_allclose(swept.angles[:, ended], expected[0].angles[:, ended], rtol=0.0, atol=SAME_RAD)
    np.testing.assert_array_equal(adapted.converged, expected[1].converged)
    np.testing.assert_allclose(adapted.theta, expected[1].theta, rtol=SAME_RELATIVE, atol=0.0)
    np.testing.assert_allclose(adapted.angles, expected[1].angles, rtol=0.0, atol=SAME_RAD)
    np.testing.assert_array_equal(fitted.status, expected[2].status)
    np.testing.assert_allclose(fitted.angles, expected[2].angles, rtol=0.0, atol=SAME_RAD)
    assert all(one._left_to_xla for one in (postures_kernel, subjects_kernel))
