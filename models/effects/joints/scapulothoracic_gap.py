"""The distances of TS and AI to the thorax change: the muscle between scapula and ribs gets thinner or thicker."""

from dataclasses import replace

from models.effects.basis import ELEVATION
from models.effects.effect import Effect, Rotations
from models.effects.prior import EffectPrior
from models.girdle import Girdle


def _adjust(girdle: Girdle, rotations: Rotations, mm) -> tuple[Girdle, Rotations]:
    ts, ai = girdle.ts_distance_mm + mm[0], girdle.ai_distance_mm + mm[1]
    return replace(girdle, ts_distance_mm=ts, ai_distance_mm=ai), rotations


EFFECT = Effect(
    name="scapulothoracic_gap",
    plain_name="scapula lifts off the thorax",
    what="TS and AI distance to the thorax change with elevation",
    unit="mm",
    directions=("TS", "AI"),
    basis=ELEVATION,
    may_follow=("scapula_y", "scapula_z", "scapula_x"),
    adjust=_adjust,
    prior=EffectPrior(
        scale=(2.0, 3.0),
        source="no healthy figure found; bone pins of four shoulders: TS 1.4 and AI 2.0 mm RMS where SC and AC are as "
        "measured; with all that other causes do 3-5 mm SD",
    ),
    moves_landmarks=False,
)
