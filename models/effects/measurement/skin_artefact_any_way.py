"""A marker on the skin lags behind the scapula in any direction, not only along its rotation: the lag's second basis.

Compared with a locator that palpates the scapula, a cluster on the acromion shows too little lateral rotation, most of
all above 90 deg, and may show too much tipping (Meskers et al. 2007, van Andel et al. 2009, Warner et al. 2012).
"""

from dataclasses import replace

from models.effects.basis import OverElevation
from models.effects.measurement import skin_artefact
from models.effects.prior import EffectPrior

BENT = OverElevation(sd=(1.0, 0.5, 0.2))
"""Basis of the lag. The second term is 0.1 times the first in the flexion of Cereatti 2017, and -0.5 times for a lag
that begins at 90 deg."""

EFFECT = replace(
    skin_artefact.EFFECT,
    name=f"{skin_artefact.EFFECT.name}:elevation",
    what="a skin marker lags the scapula in any direction, more and more with elevation",
    unit="deg",
    strength_unit="",
    directions=("about x", "about y", "about z"),
    basis=BENT,
    prior=EffectPrior(
        scale=(2.8, 1.9, 3.0),
        sign=(0, 0, 1),
        source=f"{skin_artefact.SIZE_DEG} deg together, as the lag on the scapula's own way: {skin_artefact.SOURCE}; "
        "shared out as lateral rotation 6.5 (Meskers 2007), tipping up to 7.2 (Warner 2012), protraction assumed less",
    ),
)
