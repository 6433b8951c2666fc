"""The simulated reference worlds against the library, without shared code: closed chain, effects, signs and units."""

import ast
import json
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from small_worlds import HAVE_STRENGTHS

from models import load_model
from models.effects import EFFECTS, ActiveEffects
from motions import read_motions
from motions.errors import InputWarning
from motions.rotations import DEG
from scripts.research.named_causes import synthetic_a
from scripts.research.named_causes.blind.cases import LISTED, world_of
from scripts.research.named_causes.blind.cases import Case as BlindCase
from scripts.research.named_causes.blind.lines import true_directions
from scripts.research.named_causes.synthetic_a import chain, make_world
from scripts.research.named_causes.synthetic_b.effects import SIZES
from scripts.research.named_causes.synthetic_b.mistakes import OUTSIDE_SIZES
from scripts.research.named_causes.synthetic_b.worlds import Case, write_case

MODELS = Path(__file__).parents[2] / "models" / "sets"

SAME_MM = 1e-3
"""Tolerance: angles have four decimals, and errors of 1e-4 degrees act on several arms of up to 200 mm."""

SEEN_MM = 0.5
"""Least residual that an effect must cause."""

ADAPTED = ("M_y", "M_z", "A_x", "A_y", "A_z", "conoid_length")


@pytest.mark.parametrize("model", sorted(MODELS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_parameter_set_makes_a_world(model: Path) -> None:
    world = make_world("none", model, subjects=4, seed=0)
    assert len(world.table) + len(world.truth["dropped"]) == 56
    assert len(world.table) > 45
    assert np.max(np.abs(world.closure_mm)) < chain.CLOSED_MM


def test_the_world_shares_no_code_with_what_it_tests() -> None:
    files = sorted(Path(synthetic_a.__file__).parent.glob("*.py"))
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
    imported = {a.name for node in nodes if isinstance(node, ast.Import) for a in node.names}
    imported |= {node.module or "." for node in nodes if isinstance(node, ast.ImportFrom)}
    foreign = {name for name in imported if not name.startswith("scripts.research.named_causes.synthetic_a.")}
    assert {name.split(".")[0] for name in foreign} - set(sys.stdlib_module_names) == {"numpy", "pandas"}


@pytest.mark.parametrize("label", LISTED)
def test_every_world_with_a_listed_effect_has_its_directions(label: str) -> None:
    world = world_of(BlindCase("three", label, 0))
    found = true_directions(label, world.truth["effects"][label], tuple(world.table["subject"].unique()))
    assert tuple(found) == (() if label == "skin_artefact" else EFFECTS[label].directions)


def residuals_mm(folder: Path, with_effects: bool = False) -> np.ndarray:
    """Compute A1-A3 of the base model with each subject's true parameters, (3, rows), optionally with the effects in
    their true strengths."""
    truth = json.loads((folder / "truth.json").read_text())
    girdle = load_model(truth["model"]).girdle
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # a large lag of the estimate looks like another sign
        motions = read_motions(folder / "motions.csv")
    found = []
    for subject in truth["subjects"]:
        own = motions.select(motions.subject == subject["subject"])
        theta = np.array([[subject[f"{name}_mm"]] for name in ADAPTED])
        adapted = girdle.repeated(len(own.posture)).with_adapted(theta)
        active = truth["strengths"][subject["subject"]] if with_effects else {}
        strengths = tuple(np.array(list(by_direction.values())) for by_direction in active.values())
        effects = ActiveEffects(strengths, tuple(EFFECTS[name] for name in active))
        found.append(effects.on(adapted).residuals_mm(own.angles_deg.T / DEG))
    return np.concatenate(found, axis=1)


def made(folder: Path, *names: str, **how) -> Path:
    write_case(folder / "one" / "case", list(names), Case(**{"model": "R2", "seed": 3, "subjects": 1, **how}))
    return folder / "one" / "case"


def test_without_effect_and_noise_the_chain_is_closed(tmp_path):
    """The library's chain closes at the postures that the reference world's own chain has closed."""
    assert np.abs(residuals_mm(made(tmp_path, subjects=3, noise_deg=0.0))).max() < SAME_MM


@pytest.mark.parametrize("name", [*SIZES, *OUTSIDE_SIZES])
def test_every_effect_opens_the_chain_of_the_base_model(tmp_path, name):
    folder = made(tmp_path, name, noise_deg=0.0)
    assert np.abs(residuals_mm(folder)).max() > SEEN_MM
    assert json.loads((folder / "truth.json").read_text())["label"] == name


@pytest.mark.parametrize("name", HAVE_STRENGTHS)
def test_with_the_strengths_that_the_truth_tells_the_library_closes_the_chain(tmp_path, name):
    """Directions, signs and units agree: the library's effect, with the true strengths, removes the whole gap."""
    folder = made(tmp_path, name, subjects=2, noise_deg=0.0)
    assert np.abs(residuals_mm(folder, with_effects=True)).max() < SAME_MM
