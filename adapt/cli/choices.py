"""Default values and words of the options, as the help shows them.

The modules that define them need NumPy, JAX and pandas, which take two seconds to import; ``girdle --help`` and a usage
error need none of these. ``tests/cli/test_choices.py`` compares every value here with its definition.
"""

DEFAULT_MODEL = "R2"

WEIGHT = 10.0

OBJECTIVES = (
    *("mm2_deg2", "cm2_deg2", "cm2_rad2", "rms_cm_rad", "rms_mm_deg", "mm_deg2", "cm_deg2"),
    *("sum_mm2_deg2", "sum_cm2_deg2", "sum_mm_deg2", "sum_mm2_sum_deg2", "mm2_sum_deg2", "mm2_deg2_landmarks"),
)

DEFAULT_OBJECTIVE = OBJECTIVES[0]

LANES = 512

NO_EFFECT = "none"
"""Value of ``girdle simulate --effect`` for no effect; defined here."""

ANGLE_CHOICES = SIX, FIVE = ("six", "five")
"""Angles in J: all measured ones, or all but the axial rotation of the clavicle, which is an estimate where the
clavicle has two landmarks (thesis 6.2.2). Defined here."""

POSITION_USES = ("use", "check", "ignore")

BODY_MASS_KG = 75.0

EFFECT_OPTION = "--effect"

FULL_ELEVATION_DEG = 150.0

ROTATIONS = ("kolz2020",)

OFFSETS = ("kaptein1999",)

GH_OFFSETS = ("kaptein1999",)

UNITS_MM = ("mm", "cm", "m", "inch")

CLAVICLE_Z = ("thorax", "global")

HALF_WIDTH_PX = 5.0

VECTOR_PX = 0.5
