"""A marker on the skin lags behind the scapula, but not on the way that the scapula turns: a second course of the lag.

Beside a locator that palpates the scapula, a cluster on the acromion shows too little lateral rotation, most above 90
deg, and may show too much tipping (Meskers et al. 2007, van Andel et al. 2009, Warner et al. 2012).
"""

from dataclasses import replace

from models.effects.course import OverElevation
from models.effects.measurement import skin_artefact
from models.effects.prior import EffectPrior

BENT = OverElevation(sd=(1.0, 0.5, 0.2))
"""The second term is 0.1 of the first in flexion as Cereatti 2017 measured it, -0.5 of a lag that begins at 90 deg."""

EFFECT = replace(
    skin_artefact.EFFECT,
    name=f"{skin_artefact.EFFECT.name}:elevation",
    what="a skin marker lags the scapula in any direction, more and more with elevation",
    unit="deg",
    strength_unit="",
    directions=("about x", "about y", "about z"),
    course=BENT,
    prior=EffectPrior(
        scale=(2.8, 1.9, 3.0),
        sign=(0, 0, 1),
        source=f"{skin_artefact.SIZE_DEG} deg together, as the lag on the scapula's own way: {skin_artefact.SOURCE}; "
        "shared out as lateral rotation 6.5 (Meskers 2007), tipping up to 7.2 (Warner 2012), protraction assumed less",
    ),
)
