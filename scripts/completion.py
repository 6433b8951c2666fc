"""The shipped parameter sets, completed from what is in print: numbers of a table, derived or assumed.

The thesis prints ellipsoid, clavicle, conoid length and scapula of R2, R4 and R6 (Tables 3.2, 3.3), and
landmarks and ellipsoid of one cadaver, dissected and in MRI (Tables 4.2, 4.5). The same cadaver is in DAS3,
with the conoid's attachments. What is missing is placed so that A1-A3 hold in a stated rest posture. In mm.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from models.export.toml import parameters_toml
from models.girdle import Girdle, bone_rotations, constraint_residuals_mm
from models.parameter_sets import shortest_conoid_mm
from motions.files import atomic_write
from motions.landmarks.frames import clavicle_frame, scapula_frame
from motions.rhythm import REST_DEG
from motions.rotations import DEG, cardan_from_rotation, rotate, rotation_from_vector

Vector = Float[np.ndarray, "3"]

DIGITS = 6
"""Decimals of a derived number, in mm and degrees: closes A1-A3 to 1e-6 mm, far below any measurement."""

POINT_DIGITS = 9
"""Decimals of a thorax point, so that it is on the ellipsoid and the geometric fit starts at D = 0."""

CONOID_ANGLE_DEG = 40.0
"""Between the conoid and the line from its clavicular attachment to AC, at rest. Assumed: R4 cannot reach all
postures with 8.2 mm (3.3.1) and is adapted to 10 +- 1 mm (Table 6.5), so its shortest conoid is between
8.2 and about 10 mm; 36 to 45 degrees give that, and 40 gives 9.27 mm."""

POINT_AZIMUTHS_DEG = (-40.0, 10.0, 45.0)
"""From lateral toward backward: origins of the serratus, where it wraps, under the scapula (thesis 6.2.6)."""

POINT_HEIGHTS_MM = tuple(np.linspace(-20.0, -200.0, 8))
"""Thorax y of the points of each column: about the ribs 1-9."""

_DAS3 = "DAS3 (Chadwick et al., IEEE Trans. Biomed. Eng. 61(7):1947-1956, 2014, doi 10.1109/TBME.2014.2309727)"
_DAS3_AC = np.array([207.7, -0.1, 28.2])
_DAS3_CLAVICLE_CONOID = np.array([136.5, 20.6, 13.6])
_DAS3_SCAPULA_CONOID = np.array([-53.6, -0.9, -26.6])
_DAS3_CONOID_LENGTH = 17.4
_DAS3_TS = np.array([-127.4, -22.8, -34.6])

_DISSECTION_SC = (20.3, -8.2, 12.4)

_POINTS_SOURCE = (
    "assumed: on the ellipsoid where the thesis says points were palpated (6.2.6), right side: columns at "
    f"azimuths {', '.join(f'{a:g}' for a in POINT_AZIMUTHS_DEG)} deg from lateral toward backward "
    "(x = A_x c cos, z = M_z + A_z c sin, c = sqrt(1 - ((y - M_y) / A_y)^2)), "
    f"{len(POINT_HEIGHTS_MM)} heights each, evenly from y = {POINT_HEIGHTS_MM[0]:g} to "
    f"{POINT_HEIGHTS_MM[-1]:g}; +-10 deg, +-20 mm"
)


@dataclass(frozen=True)
class Completed:
    """A complete set, ready to be written."""

    name: str
    title: str
    girdle: Girdle
    rest_deg: Float[np.ndarray, "6"]
    """The stated rest posture: clavicle (y, z, x), scapula (y, z, x)."""
    source: dict[str, str]


def completed_sets() -> tuple[Completed, ...]:
    """All shipped sets, from the printed numbers alone."""
    corrected = "Table 3.2, as corrected by the thesis: with the original 8.2 mm R4 cannot reach all postures (3.3.1)"
    table = "Table 3.2"
    return (
        _table_set("R2", (0.0, -296.0, 78.0), (153.0, 404.0, 130.0), 158.0, (119.0, 113.0, 105.0), 18.3, table),
        _table_set("R4", (0.0, -230.0, 54.0), (137.0, 314.0, 130.0), 145.0, (100.0, 110.0, 109.0), 13.2, corrected),
        _table_set("R6", (0.0, -158.0, 66.0), (133.0, 256.0, 111.0), 159.0, (130.0, 109.0, 98.0), 13.8, table),
        _cadaver_set(
            "breteler_dissection",
            "dissection",
            [_DISSECTION_SC, (165.0, 26.6, 71.4), (74.9, -11.2, 155.8), (102.5, -127.3, 155.7)],
            (0.0, -139.3, 68.0),
            (139.1, 198.2, 85.4),
        ),
        _cadaver_set(
            "breteler_mri",
            "MRI",
            [(21.1, -6.9, 12.8), (145.7, 67.5, 58.2), (67.5, 33.6, 151.0), (98.7, -85.1, 152.5)],
            (0.0, -107.6, 62.9),
            (137.5, 157.8, 94.6),
        ),
        _das3_set(),
    )


def write_sets(folder: str | os.PathLike[str]) -> None:
    """Write every shipped set as NAME.toml. InputError if the folder cannot be written to."""
    for completed in completed_sets():
        atomic_write(Path(folder) / f"{completed.name}.toml", toml_text(completed))


def thorax_points_mm(centre_mm: Float[Array, " 3"], semi_axes_mm: Float[Array, " 3"]) -> Float[np.ndarray, "3 points"]:
    """Points of the ellipsoid in columns of equal azimuth (of the parameter, not the normal)."""
    (_, M_y, M_z), (A_x, A_y, A_z) = np.asarray(centre_mm), np.asarray(semi_axes_mm)
    azimuth, y = (grid.ravel() for grid in np.meshgrid(np.radians(POINT_AZIMUTHS_DEG), POINT_HEIGHTS_MM))
    width = np.sqrt(1.0 - ((y - M_y) / A_y) ** 2)
    return np.stack([A_x * width * np.cos(azimuth), y, M_z + A_z * width * np.sin(azimuth)])


def clavicular_attachment_mm(scale: float) -> Vector:
    """DAS3's attachment in a clavicle frame with x through AC: the smallest rotation, then the scale."""
    axis = np.cross(_unit(_DAS3_AC), [1.0, 0.0, 0.0])
    sine = float(np.linalg.norm(axis))
    turn = rotation_from_vector(jnp.asarray(axis * (np.arcsin(sine) / sine)))
    return np.asarray(rotate(turn, jnp.asarray(_DAS3_CLAVICLE_CONOID))) * scale


def scapular_attachment_mm(girdle: Girdle, rest_deg: Float[np.ndarray, "6"]) -> Vector:
    """The attachment, scapula frame, that gives the conoid its length in the rest posture.

    With u from the clavicular attachment to AC and p from there to DAS3's scapular attachment (scaled by |AC-TS|),
    both thorax frame, and d the direction of p normal to u, the conoid is

        c = length (cos(psi) u / |u| + sin(psi) d),   psi = ``CONOID_ANGLE_DEG``

    and the attachment R_scapula_thorax (c - u). DAS3's attachment, as it stands, is 34-46 mm away; its direction
    makes the conoid resist axial rotation of the clavicle, as the thesis says it does (3.2.2).
    """
    R_thorax_clavicle, R_thorax_scapula = bone_rotations(jnp.asarray(rest_deg) / DEG)
    u = np.asarray(rotate(R_thorax_clavicle, girdle.ac_mm - girdle.clavicle_conoid_mm))
    size = np.linalg.norm(np.asarray(girdle.ts_mm)) / np.linalg.norm(_DAS3_TS)
    p = u + np.asarray(rotate(R_thorax_scapula, jnp.asarray(_DAS3_SCAPULA_CONOID * size)))
    along = _unit(u)
    across = _unit(p - (p @ along) * along)
    psi = np.radians(CONOID_ANGLE_DEG)
    conoid = float(girdle.conoid_length_mm) * (np.cos(psi) * along + np.sin(psi) * across)
    return np.asarray(R_thorax_scapula).T @ (conoid - u)


def close_at_rest(girdle: Girdle, rest_deg: Float[np.ndarray, "6"]) -> Girdle:
    """The girdle with its scapular attachment, const1 and const2 such that A1-A3 hold in the rest posture.

    The constants are of the printed digits, and const1 and const2 are taken from the printed attachment.
    """
    open_at_rest = replace(girdle, ts_distance_mm=jnp.zeros(()), ai_distance_mm=jnp.zeros(()))
    distances = _printed(constraint_residuals_mm(open_at_rest, jnp.asarray(rest_deg) / DEG))
    return replace(
        girdle,
        scapula_conoid_mm=jnp.asarray(_printed(scapular_attachment_mm(girdle, rest_deg))),
        ts_distance_mm=jnp.asarray(distances[0]),
        ai_distance_mm=jnp.asarray(distances[1]),
    )


def toml_text(completed: Completed) -> str:
    """The file of a set, in printed digits."""
    g = completed.girdle
    comment = (
        f"{completed.title}\n"
        "Written by scripts/complete_parameter_sets.py. Right shoulder, mm; frames as in the thesis, Appendix A."
    )
    points = np.round(thorax_points_mm(g.centre_mm, g.semi_axes_mm), POINT_DIGITS) + 0.0
    return parameters_toml(completed.name, comment, jax.tree.map(_printed, g), points, completed.source)


def _table_set(
    name: str,
    centre_mm: Sequence[float],
    semi_axes_mm: Sequence[float],
    clavicle_mm: float,
    scapula: tuple[float, float, float],
    conoid_mm: float,
    conoid_source: str,
) -> Completed:
    """R2, R4 or R6. scapula: |AC-TS| and |AI-TS| in mm and the angle AC-TS-AI in degrees (Table 3.2)."""
    ac_ts, ai_ts, angle_deg = scapula
    angle = np.radians(angle_deg)
    ts = np.array([-ac_ts, 0.0, 0.0])
    ai = ts + ai_ts * np.array([np.cos(angle), -np.sin(angle), 0.0])
    girdle = _unclosed(centre_mm, semi_axes_mm, _DISSECTION_SC, clavicle_mm, ts, ai, conoid_mm)
    girdle = close_at_rest(girdle, REST_DEG)
    at_rest = f"the rest posture {_posture(REST_DEG)}, the published mean with the arm hanging"
    source = {
        "thorax.centre_mm": "Table 3.3",
        "thorax.semi_axes_mm": "Table 3.3; its axis lengths are semi-axes",
        "thorax.points_mm": _POINTS_SOURCE,
        "clavicle.sc_mm": "assumed: that of another cadaver (Table 4.2, dissection), none printed; +-10 mm",
        "clavicle.length_mm": "Table 3.2",
        "clavicle.conoid_mm": _clavicular_source(scaled=True),
        "scapula.ts_mm": "derived: (-|AC-TS|, 0, 0) of Table 3.2",
        "scapula.ai_mm": "derived: TS + |AI-TS| (cos, -sin, 0) of the angle AC-TS-AI of Table 3.2",
        "scapula.conoid_mm": _scapular_source(at_rest, girdle),
        "constraint.ts_distance_mm": f"derived: signed distance of TS to the ellipsoid in {at_rest}",
        "constraint.ai_distance_mm": f"derived: signed distance of AI to the ellipsoid in {at_rest}",
        "constraint.conoid_length_mm": conoid_source,
    }
    return Completed(name, f"Cadaver {name} of the thesis (Tables 3.2 and 3.3).", girdle, REST_DEG, source)


def _cadaver_set(
    name: str,
    column: str,
    points_mm: Sequence[Sequence[float]],
    centre_mm: Sequence[float],
    semi_axes_mm: Sequence[float],
) -> Completed:
    """The cadaver of Tables 4.2 and 4.5, at rest where it was measured. points_mm: SC, AC, TS and AI."""
    SC, AC, TS, AI = (np.array(point) for point in points_mm)
    R_thorax_scapula = scapula_frame(AC, TS, AI)
    angles = [
        cardan_from_rotation(jnp.asarray(R))
        for R in (clavicle_frame(SC, AC, np.array([0.0, 1.0, 0.0])), R_thorax_scapula)
    ]
    rest_deg = _printed(jnp.concatenate(angles) * DEG)
    ts, ai = R_thorax_scapula.T @ (TS - AC), R_thorax_scapula.T @ (AI - AC)
    length = float(np.linalg.norm(AC - SC))
    girdle = _unclosed(centre_mm, semi_axes_mm, SC, length, ts, ai, _DAS3_CONOID_LENGTH)
    girdle = close_at_rest(girdle, rest_deg)
    table = f"Table 4.2, {column}"
    at_rest = f"the posture the cadaver was measured in, {_posture(rest_deg)}"
    source = {
        "thorax.centre_mm": f"Table 4.5, {column}",
        "thorax.semi_axes_mm": f"Table 4.5, {column}",
        "thorax.points_mm": _POINTS_SOURCE,
        "clavicle.sc_mm": f"{table} (SC-J)",
        "clavicle.length_mm": f"derived: |AC - SC-J| of {table}; AC is the landmark, not the joint",
        "clavicle.conoid_mm": _clavicular_source(scaled=True),
        "scapula.ts_mm": f"derived: {table}, in the scapula frame of Appendix A",
        "scapula.ai_mm": f"derived: {table}, in the scapula frame of Appendix A",
        "scapula.conoid_mm": _scapular_source(at_rest, girdle),
        "constraint.ts_distance_mm": f"derived: signed distance of TS to the ellipsoid in {at_rest}",
        "constraint.ai_distance_mm": f"derived: signed distance of AI to the ellipsoid in {at_rest}",
        "constraint.conoid_length_mm": f"published: conoid_length of {_DAS3}, the same cadaver",
    }
    title = f"The cadaver of Klein Breteler in the thesis, {column} (Tables 4.2 and 4.5)."
    return Completed(name, title, girdle, rest_deg, source)


def _das3_set() -> Completed:
    """The published DAS3 numbers as they stand. They are not closed in the rest posture of the other sets."""
    length = float(np.linalg.norm(_DAS3_AC))
    ts, ai = np.array([-127.4, -22.8, -34.6]), np.array([-125.7, -122.3, -27.5])
    girdle = _unclosed(
        (0, -148.6, 59.1),
        (147, 207.9, 94.4),
        (1.4, -15.2, 2.8),
        length,
        ts,
        ai,
        _DAS3_CONOID_LENGTH,
        scale=1.0,
    )
    girdle = replace(girdle, scapula_conoid_mm=jnp.asarray(_DAS3_SCAPULA_CONOID))
    at_rest = _DAS3_CONOID_LENGTH + float(constraint_residuals_mm(girdle, jnp.asarray(REST_DEG) / DEG)[2])
    apart = (
        f"in the rest posture {_posture(REST_DEG)} of the R sets the published attachments are "
        f"{at_rest:.1f} mm apart, in any posture at least {shortest_conoid_mm(girdle):.1f} mm"
    )
    contact = "published: {} of " + _DAS3 + ", a contact point of the scapula and not the landmark"
    on_surface = "derived: 0, the contact points of DAS3 are on its ellipsoid"
    source = {
        "thorax.centre_mm": f"published: centre of the thorax ellipsoid of {_DAS3}",
        "thorax.semi_axes_mm": f"published: thorax_radii of {_DAS3}",
        "thorax.points_mm": _POINTS_SOURCE,
        "clavicle.sc_mm": f"published: joint sc1 of {_DAS3}",
        "clavicle.length_mm": f"derived: |AC| of the clavicle frame of {_DAS3}",
        "clavicle.conoid_mm": _clavicular_source(scaled=False),
        "scapula.ts_mm": contact.format("TSprojection"),
        "scapula.ai_mm": contact.format("AIprojection"),
        "scapula.conoid_mm": f"published: conoid_insertion of {_DAS3}; {apart}",
        "constraint.ts_distance_mm": on_surface,
        "constraint.ai_distance_mm": on_surface,
        "constraint.conoid_length_mm": f"published: conoid_length of {_DAS3}; {apart}",
    }
    title = "The published numbers of DAS3, the same cadaver as breteler_dissection."
    return Completed("das3", title, girdle, REST_DEG, source)


def _unclosed(
    centre_mm: Sequence[float],
    semi_axes_mm: Sequence[float],
    sc_mm: Sequence[float] | Vector,
    clavicle_mm: float,
    ts_mm: Vector,
    ai_mm: Vector,
    conoid_mm: float,
    scale: float | None = None,
) -> Girdle:
    """The girdle in printed digits, its scapular attachment, const1 and const2 still 0.

    scale: of DAS3's clavicular attachment; by default the lengths of the two clavicles.
    """
    scale = clavicle_mm / float(np.linalg.norm(_DAS3_AC)) if scale is None else scale
    return Girdle(
        centre_mm=jnp.asarray(_printed(centre_mm)),
        semi_axes_mm=jnp.asarray(_printed(semi_axes_mm)),
        sc_mm=jnp.asarray(_printed(sc_mm)),
        ac_mm=jnp.asarray(_printed([clavicle_mm, 0.0, 0.0])),
        clavicle_conoid_mm=jnp.asarray(_printed(clavicular_attachment_mm(scale))),
        ts_mm=jnp.asarray(_printed(ts_mm)),
        ai_mm=jnp.asarray(_printed(ai_mm)),
        scapula_conoid_mm=jnp.zeros(3),
        ts_distance_mm=jnp.zeros(()),
        ai_distance_mm=jnp.zeros(()),
        conoid_length_mm=jnp.asarray(conoid_mm),
    )


def _clavicular_source(scaled: bool) -> str:
    attachment, ac = (", ".join(f"{x:g}" for x in v) for v in (_DAS3_CLAVICLE_CONOID, _DAS3_AC))
    scale = f", scaled by the length over {np.linalg.norm(_DAS3_AC):.1f} mm" if scaled else ""
    return (
        f"derived: conoid_origin ({attachment}) of {_DAS3}, turned by the smallest rotation that brings "
        f"its AC ({ac}) onto x{scale}"
    )


def _scapular_source(at_rest: str, girdle: Girdle) -> str:
    return (
        f"assumed: in {at_rest}, the conoid makes {CONOID_ANGLE_DEG:g} deg with the line from the clavicular "
        "attachment to AC, bent toward DAS3's scapular attachment scaled by |AC-TS|; the shortest conoid is then "
        f"{shortest_conoid_mm(girdle):.2f} mm. R4 at 8.2 mm cannot reach all postures (3.3.1) and is adapted "
        "to 10 +- 1 mm (Table 6.5): its shortest conoid is between 8.2 and about 10 mm, which 36-45 deg "
        "give; the same angle in every set"
    )


def _posture(angles_deg: Float[np.ndarray, "6"]) -> str:
    clavicle, scapula = (", ".join(f"{a:.10g}" for a in angles) for angles in np.split(angles_deg, 2))
    return f"clavicle ({clavicle}), scapula ({scapula}) deg"


def _unit(v: Vector) -> Vector:
    return v / np.linalg.norm(v)


def _printed(value: object) -> np.ndarray:
    """Rounded to the digits of the file, without negative zeros."""
    return np.round(np.asarray(value, dtype=float), DIGITS) + 0.0
