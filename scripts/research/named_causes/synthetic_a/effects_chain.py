"""The listed effects that change the chain."""

from dataclasses import replace

import numpy as np

from scripts.research.named_causes.synthetic_a.chain import Chain
from scripts.research.named_causes.synthetic_a.conventions import DEG
from scripts.research.named_causes.synthetic_a.courses import Change, Draw
from scripts.research.named_causes.synthetic_a.rotations import apply, rotation_from_vector


def scapulothoracic_gap(w: Draw) -> Change:
    """AI leaves the thorax by the amplitude at full elevation, TS by a fraction of either sign, mm."""
    fraction = w.rng.uniform(-0.8, 0.8) + 0.1 * w.rng.standard_normal(w.postures.subjects)
    w.notes["ts_fraction_by_subject"] = fraction
    ai = w.level("power", "smoothstep")
    more = np.stack([fraction[w.postures.subject] * ai, ai, 0.0 * ai], -1)
    return Change(chain=lambda c: replace(c, targets=c.targets + more))


def conoid_strain(w: Draw) -> Change:
    """The conoid becomes longer by the amplitude at full elevation, never shorter, mm."""
    more = np.maximum(w.level("hinge", "late"), 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    return Change(chain=lambda c: replace(c, targets=c.targets + more))


def ac_translation(w: Draw) -> Change:
    """The AC centre moves in the clavicle frame, mostly forward or backward, mm."""
    shift = w.level("sigmoid", "wiggle")[:, None] * w.direction((0.0, 0.0, 1.0), 0.3)
    return Change(chain=lambda c: replace(c, ac_shift=c.ac_shift + shift))


def sc_translation(w: Draw) -> Change:
    """The SC centre moves in the thorax frame, in any direction, mm."""
    shift = w.level("saturating", "cosine")[:, None] * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(chain=lambda c: replace(c, sc=c.sc + shift))


def thorax_tilt(w: Draw) -> Change:
    """The axes of the thorax are turned, mostly about x, deg.

    The pivot lies 100 mm below IJ, where the scapula is, and the centre stays in the midline: a turn about the centre
    of a long thorax would push its wall 20 mm through the scapula.
    """
    R = rotation_from_vector(w.constant()[:, None] * DEG * w.direction((1.0, 0.0, 0.0), 0.35))

    def tilt(c: Chain) -> Chain:
        arm = c.centre.copy()
        arm[:, 1] += 100.0
        arm[:, [0, 2]] = 0.0
        centre = c.centre + apply(R, arm) - arm
        centre[:, 0] = c.centre[:, 0]
        return replace(c, centre=centre, R_thorax_surface=c.R_thorax_surface @ R)

    return Change(chain=tilt)


def thorax_asymmetry(w: Draw) -> Change:
    """The centre of the thorax lies beside the midline, mm."""
    shift = w.constant()[:, None] * np.array([1.0, 0.0, 0.0])
    return Change(chain=lambda c: replace(c, centre=c.centre + shift))


def thorax_shape(w: Draw) -> Change:
    """The thorax is a superquadric of exponent 2 + amplitude with the same semi-axes."""
    exponent = np.maximum(2.0 + w.constant(), 1.2)
    return Change(chain=lambda c: replace(c, exponent=exponent))


def clavicle_length(w: Draw) -> Change:
    """The shaft of the clavicle is longer or shorter, %.

    The conoid attachment keeps its distance from AC, or its share of the length, or something between.
    """
    share = w.rng.uniform(0.65, 1.0)
    w.notes["attachment_moves_by"] = share

    def lengthen(c: Chain) -> Chain:
        more = c.length * w.constant() / 100.0
        conoid = c.clavicle_conoid + share * more[:, None] * np.array([1.0, 0.0, 0.0])
        return replace(c, length=c.length + more, clavicle_conoid=conoid)

    return Change(chain=lengthen)


def scapula_size(w: Draw) -> Change:
    """The blade of the scapula is larger or smaller, %: its height nearly as its width, the coracoid by a share."""
    height = 1.0 + 0.15 * w.rng.standard_normal(w.postures.subjects)
    coracoid = w.rng.uniform(0.4, 1.0)
    w.notes |= {"height_share_by_subject": height, "coracoid_share": coracoid}
    share = np.ones((len(w.postures.subject), 3))
    share[:, 1] = height[w.postures.subject]
    more = w.constant()[:, None] / 100.0 * share
    return Change(
        chain=lambda c: replace(
            c,
            ts=c.ts * (1.0 + more),
            ai=c.ai * (1.0 + more),
            scapula_conoid=c.scapula_conoid * (1.0 + coracoid * more),
        )
    )
