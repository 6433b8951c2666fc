"""Simulated persons whose sizes differ from a cadaver's: their motions, and landmarks as a palpator records them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.random import PCG64, Generator

from adapt.engine.batching import take_problems
from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from models.adapted_parameters import ADAPTED, PERSON_SD_MM
from models.girdle import Girdle, landmarks
from models.parameter_sets import ParameterSet
from models.person.sizes import PALPATOR_MM
from motions.rhythm_subjects import add_noise, noise_free_subjects
from motions.rotations import DEG
from motions.table import Motions

OTHER_SIZE = (0.08, 0.16)
"""Range of the relative size difference of a bone: one to two SDs between people (``models.effects.bones``)."""

_DRAWN = 2
"""Persons drawn for each person wanted: where the bones fit each other badly the chain does not close, and the person
is left out."""

THORAX_MM = {"IJ": (0.0, 0.0, 0.0), "C7": (0.0, 40.0, 120.0), "PX": (0.0, -170.0, -10.0), "T8": (0.0, -150.0, 130.0)}
"""Thorax landmarks, mm, whose thorax frame is the identity at the origin."""

CHEST_SHARE = 0.5
"""Share of the ellipsoid's published differences between people (Table 6.5), which include measurement noise."""


RIBS_MM = 3.0
"""SD of a coordinate of a point palpated on the ribs through the skin. Assumed: three times the palpator's."""

_AZIMUTHS_DEG, _HEIGHTS_MM = (-60.0, -30.0, 0.0, 25.0, 50.0), (-30.0, -70.0, -110.0, -150.0, -190.0)
"""Azimuths (from lateral toward backward) and thorax y of the points on front, side and back."""


@dataclass(frozen=True)
class Persons:
    """Subjects that move as their own girdle lets them, and their palpated landmarks and points."""

    motions: Motions
    palpated: dict[str, dict[str, Float[np.ndarray, "postures 3"]]]
    """Landmarks with noise by subject and name, in the postures of the first motion."""
    points_mm: dict[str, Float[np.ndarray, "3 points"]]
    """Points on the thorax of each subject, thorax frame, with noise."""
    landmarks_mm: dict[str, Float[np.ndarray, "postures 3"]]
    """TS and AI in every posture of the motions, palpated anew in each, thorax frame."""


def simulate_persons(cadaver: ParameterSet, count: int, noise_deg: float, seed: int) -> Persons:
    """Simulate persons whose clavicle, scapula and thorax differ from the cadaver's.

    A bone is the cadaver's bone, larger or smaller by a share in ``OTHER_SIZE``, with its attachments. The ellipsoid
    differs with ``CHEST_SHARE`` of ``PERSON_SD_MM``.
    """
    generator = Generator(PCG64(seed))
    wanted = noise_free_subjects(_DRAWN * count, generator)
    count, most = _DRAWN * count, count
    clavicle, scapula = 1.0 + generator.uniform(*OTHER_SIZE, (2, count)) * generator.choice([-1.0, 1.0], (2, count))
    girdle = sized(cadaver.girdle, clavicle, scapula)
    apart = CHEST_SHARE * PERSON_SD_MM[:, None] * generator.standard_normal((len(ADAPTED), count))
    girdle = girdle.with_adapted(np.asarray(girdle.adapted_mm) + apart)
    number = {name: k for k, name in enumerate(wanted.subjects)}
    row = np.array([number[name] for name in wanted.subject.tolist()])
    of_row = take_problems(girdle, row)
    fitted = fit_batch(of_row, wanted.angles_deg.T / DEG, np.ones((6, len(row)), bool))
    ok = fitted.status == status.OK
    moving = [name for name in wanted.subjects if ok[wanted.subject == name].all()][:most]
    ok &= np.isin(wanted.subject, moving)
    closed = replace(wanted, angles_deg=fitted.angles.T * DEG).select(ok)
    palpated = _palpated(take_problems(of_row, ok), closed, generator)
    points = {name: _on_thorax(take_problems(girdle, number[name]), generator) for name in moving}
    noisy = add_noise(closed, noise_deg, generator)
    at = landmarks(take_problems(of_row, ok), jnp.asarray(closed.angles_deg.T / DEG))
    along = {name: np.asarray(xyz).T for name, xyz in (("TS", at.TS), ("AI", at.AI))}
    along = {name: xyz + PALPATOR_MM * generator.standard_normal(xyz.shape) for name, xyz in along.items()}
    return Persons(noisy, palpated, points, along)


def sized(girdle: Girdle, clavicle: Float[np.ndarray, " n"], scapula: Float[np.ndarray, " n"]) -> Girdle:
    """Scale the bones of a girdle by these factors; its SC joint and its thorax stay."""
    many = girdle.repeated(len(clavicle))
    return replace(
        many,
        ac_mm=many.ac_mm * clavicle,
        clavicle_conoid_mm=many.clavicle_conoid_mm * clavicle,
        ts_mm=many.ts_mm * scapula,
        ai_mm=many.ai_mm * scapula,
        scapula_conoid_mm=many.scapula_conoid_mm * scapula,
        conoid_length_mm=many.conoid_length_mm * scapula,
    )


def _palpated(of_row: Girdle, closed: Motions, generator: Generator) -> dict[str, dict[str, np.ndarray]]:
    """Return the landmarks in the first motion of each subject, thorax frame, with the palpator's noise."""
    at = landmarks(of_row, jnp.asarray(closed.angles_deg.T / DEG))
    position = {"SC": of_row.sc_mm, "AC": at.AC, "TS": at.TS, "AI": at.AI}
    found = {}
    for subject in closed.subjects:
        mine = np.flatnonzero((closed.subject == subject) & (closed.motion == closed.motion[0]))
        exact = {name: np.asarray(xyz)[:, mine].T for name, xyz in position.items()}
        exact |= {name: np.tile(xyz, (len(mine), 1)) for name, xyz in THORAX_MM.items()}
        found[subject] = {n: p + PALPATOR_MM * generator.standard_normal(p.shape) for n, p in exact.items()}
    return found


def _on_thorax(girdle: Girdle, generator: Generator) -> Float[np.ndarray, "3 points"]:
    """Return palpated points on the ellipsoid of one girdle."""
    (_, M_y, M_z), (A_x, A_y, A_z) = np.asarray(girdle.centre_mm), np.asarray(girdle.semi_axes_mm)
    azimuth, y = (grid.ravel() for grid in np.meshgrid(np.radians(_AZIMUTHS_DEG), _HEIGHTS_MM))
    width = np.sqrt(np.maximum(1.0 - ((y - M_y) / A_y) ** 2, 0.0))
    points = np.stack([A_x * width * np.cos(azimuth), y, M_z + A_z * width * np.sin(azimuth)])
    return points + RIBS_MM * generator.standard_normal(points.shape)


def point_table(persons: Persons) -> pd.DataFrame:
    """Tabulate the points, as ``girdle model --points`` reads them."""
    blocks = [
        pd.DataFrame({"subject": name, "surface": "thorax"} | {f"{axis}_mm": p[k] for k, axis in enumerate("xyz")})
        for name, p in persons.points_mm.items()
    ]
    return pd.concat(blocks, ignore_index=True)


def landmark_table(persons: Persons, subjects: Sequence[str] | None = None) -> pd.DataFrame:
    """Tabulate the palpated landmarks, as ``girdle model`` and ``girdle convert`` read them."""
    blocks = []
    for subject in subjects or persons.motions.subjects:
        of = persons.palpated[subject]
        count = len(of["SC"])
        columns: dict[str, object] = {"subject": [subject] * count, "posture": np.arange(1, count + 1)}
        columns |= {f"{name}_{axis}_mm": of[name][:, k] for name in of for k, axis in enumerate("xyz")}
        blocks.append(pd.DataFrame(columns))
    return pd.concat(blocks, ignore_index=True)
