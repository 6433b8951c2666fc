"""Table of `girdle drive`: postures driven by their free coordinates, and the free coordinates of postures."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float, Shaped

from adapt.engine.batching import in_chunks
from models.drive import DRIVEN, Driven, drive, free_coordinates_mm
from models.girdle import Girdle, constraint_residuals_mm, landmarks
from models.parameter_sets import ParameterSet
from motions.formats.angle_table import ORIGIN
from motions.formats.free_coordinates import COORDINATE_COLUMNS, coordinates_mm
from motions.motion_csv.columns import ANGLE_COLUMNS
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import Motions

OK, NOT_KNOWN = DRIVEN[0], DRIVEN[-1]


@dataclass(frozen=True)
class DrivenPostures:
    """Postures of ``motions`` with one model."""

    model: ParameterSet
    motions: Motions
    coordinates_mm: Float[np.ndarray, "3 postures"]
    """AC_y, AC_z, TS_x, thorax frame."""
    angles: Float[np.ndarray, "6 postures"]
    """Angles, rad; NaN where the status is not ``ok``."""
    residual_mm: Float[np.ndarray, "3 postures"]
    """Constraint residuals A1-A3: 0 in a driven posture; in a measured posture the distance from closing the chain."""
    status: Shaped[np.ndarray, " postures"]
    """Status, one of ``models.drive.DRIVEN``."""

    @property
    def table(self) -> pd.DataFrame:
        """Table with the columns of ``driven.csv``."""
        own = self.motions
        names = {"model": self.model.name, "subject": own.subject, "motion": own.motion, "posture": own.posture}
        angles = dict(zip(ANGLE_COLUMNS, self.angles * float(DEG), strict=True))
        residuals = {f"a{k + 1}_mm": one for k, one in enumerate(self.residual_mm)}
        coordinates = dict(zip(COORDINATE_COLUMNS, self.coordinates_mm, strict=True))
        elevation = {"humerus_elevation_deg": own.humerus_elevation_deg}
        return pd.DataFrame({**names, **elevation, **coordinates, **angles, **residuals, "status": self.status})

    @property
    def as_motions(self) -> Motions | None:
        """Postures with status ``ok`` as simulated motions with the landmarks of the girdle; None where there is
        none."""
        good = np.flatnonzero(self.status == OK)
        if not len(good):
            return None
        at = landmarks(self.model.girdle.repeated(len(good)), self.angles[:, good])
        own = self.motions.take(good)
        origin = f"simulated: {self.model.name} driven by AC_y, AC_z, TS_x"
        return Motions(
            subject=own.subject,
            motion=own.motion,
            posture=own.posture,
            humerus_elevation_deg=own.humerus_elevation_deg,
            angles_deg=self.angles[:, good].T * DEG,
            landmarks_mm={name: np.asarray(getattr(at, name)).T for name in ("AC", "TS", "AI")},
            extra=pd.DataFrame({ORIGIN: [origin] * len(good)}),
        )

    @property
    def failed(self) -> dict[str, str]:
        """Numbers of missing postures with their statuses, by subject."""
        found = {}
        for name in self.motions.subjects:
            words = self.status[self.motions.subject == name]
            wrong = [word for word in DRIVEN[1:] if (words == word).any()]
            if wrong:
                said = ", ".join(f"{(words == word).sum()} {word}" for word in wrong)
                found[name] = f"{said} of {len(words)} postures"
        return found


def driven_postures(motions: Motions, model: ParameterSet) -> DrivenPostures:
    """Drive the girdle by the coordinates of AC and TS in the motions (thesis 3.2.2, 6.2.3).

    The branch is the one nearest to the posture's own angles; for angles that the motions lack, the hanging arm's are
    used.
    """
    mm = coordinates_mm(motions)
    start_deg = np.where(np.isfinite(motions.angles_deg), motions.angles_deg, REST_DEG)
    driven = drive_each(model.girdle.repeated(mm.shape[1]), mm, start_deg.T / DEG)
    return _postures(motions, model, mm, np.asarray(driven.angles), driven.words)


_AT_ONCE = 64
"""Number of postures per call of the compiled program, which serves any number of postures; its compilation takes some
5 s."""


def drive_each(
    girdle: Girdle, coordinates_mm: Float[np.ndarray, "3 postures"], start: Float[np.ndarray, "6 postures"]
) -> Driven:
    """Drive one girdle per posture by its free coordinates, mm, from a start, rad (:func:`models.drive.drive`)."""
    return in_chunks(drive, _AT_ONCE, girdle, coordinates_mm, start)


def coordinates_of_postures(motions: Motions, model: ParameterSet) -> DrivenPostures:
    """Compute the free coordinates of the girdle at the measured angles, with the chain left open: the inverse of
    driving."""
    angles = motions.angles_deg.T / DEG
    words = np.where(np.isfinite(angles).all(axis=0), OK, NOT_KNOWN)
    return _postures(motions, model, np.asarray(free_coordinates_mm(model.girdle, angles)), angles, words)


def _postures(motions: Motions, model: ParameterSet, mm, angles, words) -> DrivenPostures:
    residual_mm = constraint_residuals_mm(model.girdle.repeated(len(words)), angles)
    return DrivenPostures(model, motions, mm, angles, np.asarray(residual_mm), words)
