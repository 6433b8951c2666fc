"""Option words and default values of the command line equal those of the modules that define them."""

import pytest

from adapt.cli import choices
from adapt.diagnosis.position_findings import USES
from adapt.output.large_runs.chunked_run import LANES
from adapt.solvers.objective import DEFAULT_OBJECTIVE, OBJECTIVES, WEIGHT
from adapt.tables.muscle_tables import BODY_MASS_KG
from models import model_names
from models.effects.amplitudes import OPTION
from models.effects.basis import FULL_ELEVATION_DEG
from models.person.contours.band import HALF_WIDTH_PX, VECTOR_PX
from motions.landmarks.acromion import ROTATIONS
from motions.landmarks.estimated_landmarks import GH_OFFSETS, OFFSETS
from motions.landmarks.mapping import UNITS_MM
from motions.landmarks.sampled_postures import CLAVICLE_Z

AT_HOME = {
    "WEIGHT": WEIGHT,
    "OBJECTIVES": OBJECTIVES,
    "DEFAULT_OBJECTIVE": DEFAULT_OBJECTIVE,
    "LANES": LANES,
    "POSITION_USES": USES,
    "BODY_MASS_KG": BODY_MASS_KG,
    "EFFECT_OPTION": OPTION,
    "FULL_ELEVATION_DEG": FULL_ELEVATION_DEG,
    "ROTATIONS": ROTATIONS,
    "OFFSETS": OFFSETS,
    "GH_OFFSETS": GH_OFFSETS,
    "UNITS_MM": UNITS_MM,
    "CLAVICLE_Z": CLAVICLE_Z,
    "HALF_WIDTH_PX": HALF_WIDTH_PX,
    "VECTOR_PX": VECTOR_PX,
}

HERE_ALONE = {"DEFAULT_MODEL", "ANGLE_CHOICES", "SIX", "FIVE", "NO_EFFECT"}


@pytest.mark.parametrize("name", AT_HOME)
def test_a_choice_is_that_of_its_home(name):
    at_home = AT_HOME[name]
    assert getattr(choices, name) == (tuple(at_home) if isinstance(at_home, dict | tuple) else at_home)


def test_every_choice_is_compared():
    assert {name for name in vars(choices) if name.isupper()} == {*AT_HOME, *HERE_ALONE}


def test_the_default_model_is_shipped():
    assert choices.DEFAULT_MODEL in model_names()
