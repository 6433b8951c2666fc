# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
# pyright: reportGeneralTypeIssues=false, reportCallIssue=false, reportOperatorIssue=false
# (own_bones is None after a plain adaptation; pandas and SciPy type nearly every result as "Series | object")
"""Persons with own bones: simulated, and adapted with known scales."""

from dataclasses import replace
from types import SimpleNamespace

import jax
import numpy as np
from oracles import bones
from own_girdles import OWN, with_sizes

from adapt import adapt_subjects
from adapt.api import Adaptations
from adapt.own_bones.own_adaptation import People
from adapt.own_bones.scales import Scales
from adapt.solvers.posture_fits import fit_batch
from models import load_model
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle
from models.person.own_bones import spread_about
from motions import Motions
from motions.rhythm_subjects import add_noise, noise_free_subjects
from motions.rotations import DEG

R2 = load_model("R2")
NOISE_DEG = 1.5
SD = spread_about(R2).sd


def people(scales: Scales = Scales(noise_deg=NOISE_DEG), **sds: float) -> People:  # noqa: B008
    """Return the people of a run with known scales, for R2 and breteler_dissection."""
    known = dict.fromkeys(("R2", "breteler_dissection"), scales)
    return People(sds, known, {name: {} for name in known})


def adapted(motions: Motions, own: object = None, model=R2, **how) -> Adaptations:
    return adapt_subjects(motions, model, held_out=(), own_bones=people() if own is None else own, **how)


def of_subject(motions: Motions, name: str) -> Motions:
    return motions.select(motions.subject == name)


def simulated(persons: int, factor: float = 1.0, noise_deg: float = NOISE_DEG, seed: int = 1) -> SimpleNamespace:
    """Simulate persons with own bones, their closed postures nearest to the rhythm, and these motions with noise.

    The sizes have the SDs of the prior, those of bones and frames times ``factor``.
    """
    generator = np.random.default_rng(seed)
    scale = np.where([name in ADAPTED for name in OWN], 1.0, factor)
    sizes = (SD * scale)[:, None] * generator.standard_normal((len(OWN), persons))
    wanted = noise_free_subjects(persons, generator)
    each = [with_sizes(bones(R2.girdle), dict(zip(OWN, own, strict=True))) for own in sizes.T]
    girdle = Girdle(**{key: np.stack([getattr(b, key) for b in each], axis=-1) for key in vars(each[0])})
    of_row = np.repeat(np.arange(persons), len(wanted.posture) // persons)
    chain = jax.tree.map(lambda x: x[..., of_row], girdle)
    fitted = fit_batch(chain, wanted.angles_deg.T / DEG, np.ones((6, len(of_row)), bool))
    true = replace(wanted, angles_deg=fitted.angles.T * DEG).select(fitted.status == "ok")
    there = np.isin(wanted.subjects, true.subjects)  # some simulated girdles close in no posture
    return SimpleNamespace(sizes=sizes[:, there], true=true, motions=add_noise(true, noise_deg, generator))
