"""The shipped parameter sets, completed: each number is from a published table, derived or assumed.

The thesis prints ellipsoid, clavicle, conoid length and scapula of R2, R4 and R6 (Tables 3.2, 3.3), and
landmarks and ellipsoid of one cadaver, dissected and in MRI (Tables 4.2, 4.5). The same cadaver is in DAS3,
with the conoid's attachments. One ``Rule`` sets the missing numbers; scripts/research/thesis/study_completion.py
compares rules on measured shoulders. Lengths are in mm.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from models.export.toml import parameters_toml
from models.girdle import Girdle, bone_rotations, constraint_residuals_mm
from models.muscles.das3_frames import (
    Pose,
    clavicle_in_thorax,
    scapula_in_thorax,
)
from models.muscles.muscle_lines import published_lines
from motions.files import atomic_write
from motions.landmarks.frames import clavicle_frame, scapula_frame
from motions.rhythm import REST_DEG
from motions.rotations import DEG, cardan_from_rotation

Vector = Float[np.ndarray, "3"]
Posture = Float[np.ndarray, "6"]

DIGITS = 6
"""Decimals of a derived number, in mm and degrees. A1-A3 then close to 1e-6 mm, far below any error of measurement."""

POSTURE_DIGITS = 2
"""Decimals of a rest posture that was searched for, in degrees: as many as the published posture has."""

POINT_DIGITS = 9
"""Decimals of a thorax point: enough for the point to be on the ellipsoid and the geometric fit to start at D = 0."""

POINT_AZIMUTHS_DEG = (-40.0, 10.0, 45.0)
"""Azimuths from lateral toward backward: serratus origins, serratus wrap, under the scapula (thesis 6.2.6)."""

POINT_HEIGHTS_MM = tuple(np.linspace(-20.0, -200.0, 8))
"""Thorax y of the points of each column: approximately the heights of ribs 1-9."""

_Y_THORAX = np.array([0.0, 1.0, 0.0])

_DAS3 = "DAS3 (Chadwick et al., IEEE Trans. Biomed. Eng. 61(7):1947-1956, 2014, doi 10.1109/TBME.2014.2309727)"
_LICENCE = """\
Licence of these numbers: none is known. dasproject/DAS3 has no licence file, its release on SimTK reserves all rights;
two of its authors publish the converted model under MIT. No Apache licence was found. See NOTICE and docs/release.md.\
"""
_CADAVER, _LANDMARKS = (published_lines()[part] for part in ("cadaver", "das3"))
"""The cadaver of Table 4.2 (dissection, thorax frame), and its landmarks that define the frames of DAS3."""
_DAS3_CLAVICLE_CONOID = np.array([136.5, 20.6, 13.6])
_DAS3_SCAPULA_CONOID = np.array([-53.6, -0.9, -26.6])
_DAS3_CONOID_LENGTH = 17.4
_DAS3_CONTACTS = (np.array([-127.4, -22.8, -34.6]), np.array([-125.7, -122.3, -27.5]))

_DSEM = "the input file of the Delft shoulder and elbow model for the cadaver, as public code for DAS3 quotes it"
AC_JOINT_MM = np.array([176.6, 14.3, 73.1])
"""AC joint of the cadaver, from the same input file."""

_DISSECTION = {name: np.array(_CADAVER[f"{name.lower()}_mm"]) for name in ("SC", "AC", "TS", "AI")}
_MRI = {
    "SC": np.array([21.1, -6.9, 12.8]),
    "AC": np.array([145.7, 67.5, 58.2]),
    "TS": np.array([67.5, 33.6, 151.0]),
    "AI": np.array([98.7, -85.1, 152.5]),
}
"""Skeletal points of Table 4.2 in the thorax frame; "SC" is the table's SC-J."""

LEAST_DISTANCES_MM = (0.1, 0.1)
"""Least distances of TS and AI to the ellipsoid: Eq. 6.2 has a distance, so neither may be inside the thorax.

A tenth of a mm covers the rounding of the posture.
"""

_POINTS_SOURCE = (
    "assumed: on the ellipsoid where the thesis says points were palpated (6.2.6), right side: columns at "
    f"azimuths {', '.join(f'{a:g}' for a in POINT_AZIMUTHS_DEG)} deg from lateral toward backward "
    "(x = A_x c cos, z = M_z + A_z c sin, c = sqrt(1 - ((y - M_y) / A_y)^2)), "
    f"{len(POINT_HEIGHTS_MM)} heights each, evenly from y = {POINT_HEIGHTS_MM[0]:g} to "
    f"{POINT_HEIGHTS_MM[-1]:g}; +-10 deg, +-20 mm"
)


def das3_conoid_mm() -> tuple[Vector, Vector]:
    """Return DAS3's conoid attachments on clavicle and scapula, in the thorax frame, in the cadaver's measured posture.

    Each attachment is taken in its own DAS3 frame: the clavicle's from DAS3's SC, the scapula's from the AC joint with
    axes through TS, AI and AA. The attachments are then 19.3 mm apart, and the conoid length is 17.4 mm. With AA as the
    scapula's origin, where DAS3 has it, they would be 46.4 mm apart.
    """
    scapula = scapula_in_thorax(_LANDMARKS, "aa")._replace(origin_mm=AC_JOINT_MM)
    return _outward(clavicle_in_thorax(_LANDMARKS, "joint_sc"), _DAS3_CLAVICLE_CONOID), _outward(
        scapula, _DAS3_SCAPULA_CONOID
    )


def _outward(pose: Pose, point_mm: Vector) -> Vector:
    return pose.outward(point_mm[:, None])[:, 0]


def _inward(pose: Pose, point_mm: Vector) -> Vector:
    return pose.inward(point_mm[:, None])[:, 0]


def attachment_shares() -> tuple[Vector, Vector]:
    """Return DAS3's attachments in the frames of Appendix A, divided by |AC-SC| (clavicle) and |AC-TS| (scapula)."""
    SC, AC, TS, _ = _DISSECTION.values()
    on_clavicle, on_scapula = das3_conoid_mm()
    in_clavicle = _inward(clavicle_in_thorax(_CADAVER), on_clavicle)
    in_scapula = _inward(scapula_in_thorax(_CADAVER), on_scapula)
    return in_clavicle / np.linalg.norm(AC - SC), in_scapula / np.linalg.norm(AC - TS)


@dataclass(frozen=True)
class Rule:
    """Rule for the unpublished numbers of R2, R4 and R6. The default values are as shipped; the study varies them."""

    sc_mm: Sequence[float] = tuple(_DISSECTION["SC"])
    least_mm: tuple[float, float] | None = LEAST_DISTANCES_MM
    """Least distances of TS and AI to the ellipsoid, outside positive. The rest posture is then the one closest to the
    mean posture (sum of the six squared angles) that keeps them. None: the rest posture is the mean posture, whatever
    the distances are there."""
    on_clavicle: Sequence[float] = tuple(attachment_shares()[0])
    """Clavicular attachment in the clavicle frame, divided by the length of the clavicle."""
    hangs: bool = True
    """True where the conoid hangs straight down from the clavicle (thorax -y) at rest; else its direction is the one
    from DAS3's clavicular attachment to the scapular one."""
    forward_deg: float = 0.0
    """Angle by which the conoid is then turned about the clavicle's axis, its lower end forward."""


SHIPPED = Rule()


@dataclass(frozen=True)
class Completed:
    """A complete parameter set, ready to be written."""

    name: str
    title: str
    girdle: Girdle
    rest_deg: Posture
    """Rest posture: clavicle (y, z, x), scapula (y, z, x)."""
    source: dict[str, str]


def completed_sets() -> tuple[Completed, ...]:
    """Complete all shipped sets from the printed numbers."""
    dissection = _dissection_set()
    return (*table_sets(SHIPPED), dissection, _mri_set(dissection.girdle), _das3_set())


def table_sets(rule: Rule) -> tuple[Completed, ...]:
    """Complete R2, R4 and R6 by one rule."""
    corrected = "Table 3.2, as corrected by the thesis: with the original 8.2 mm R4 cannot reach all postures (3.3.1)"
    table = "Table 3.2"
    return (
        _table_set("R2", (-296.0, 78.0), (153.0, 404.0, 130.0), 158.0, (119.0, 113.0, 105.0), (18.3, table), rule),
        _table_set("R4", (-230.0, 54.0), (137.0, 314.0, 130.0), 145.0, (100.0, 110.0, 109.0), (13.2, corrected), rule),
        _table_set("R6", (-158.0, 66.0), (133.0, 256.0, 111.0), 159.0, (130.0, 109.0, 98.0), (13.8, table), rule),
    )


def write_sets(folder: str | os.PathLike[str]) -> None:
    """Write every shipped set as NAME.toml. InputError if the folder cannot be written to."""
    for completed in completed_sets():
        atomic_write(Path(folder) / f"{completed.name}.toml", toml_text(completed))


def thorax_points_mm(centre_mm: Float[Array, " 3"], semi_axes_mm: Float[Array, " 3"]) -> Float[np.ndarray, "3 points"]:
    """Compute points of the ellipsoid in columns of equal azimuth (of the parameter, not of the normal)."""
    (_, M_y, M_z), (A_x, A_y, A_z) = np.asarray(centre_mm), np.asarray(semi_axes_mm)
    azimuth, y = (grid.ravel() for grid in np.meshgrid(np.radians(POINT_AZIMUTHS_DEG), POINT_HEIGHTS_MM))
    width = np.sqrt(1.0 - ((y - M_y) / A_y) ** 2)
    return np.stack([A_x * width * np.cos(azimuth), y, M_z + A_z * width * np.sin(azimuth)])


def own_rest_deg(girdle: Girdle, least_mm: tuple[float, float]) -> Posture:
    """Find the rest posture: the one closest to the mean posture that keeps TS and AI at least this far off the thorax.

    The distance between postures is the sum of the six squared angle differences. ValueError if no posture does.
    """
    least = replace(girdle, ts_distance_mm=jnp.asarray(least_mm[0]), ai_distance_mm=jnp.asarray(least_mm[1]))
    found = minimize(
        lambda angles_deg: np.sum((angles_deg - REST_DEG) ** 2),
        REST_DEG,
        jac=lambda angles_deg: 2.0 * (angles_deg - REST_DEG),
        constraints={"type": "ineq", "fun": lambda angles_deg: _residuals_mm(least, angles_deg)[:2]},
        method="SLSQP",
        options={"ftol": 1e-9, "maxiter": 1000},
    )
    if not found.success:
        raise ValueError(f"TS and AI are {least_mm} mm off in no posture: {found.message}")
    return np.round(found.x, POSTURE_DIGITS) + 0.0


def scapular_attachment_mm(girdle: Girdle, rest_deg: Posture, rule: Rule = SHIPPED) -> Vector:
    """Compute the scapular attachment that gives the conoid its length and the rule's direction d at rest.

    With u from the clavicular attachment to AC in the thorax frame, the attachment in the scapula frame is
    R_scapula_thorax (length d - u).
    """
    R_thorax_clavicle, R_thorax_scapula = (np.asarray(R) for R in bone_rotations(jnp.asarray(rest_deg) / DEG))
    u = R_thorax_clavicle @ np.asarray(girdle.ac_mm - girdle.clavicle_conoid_mm)
    d = -_Y_THORAX
    if not rule.hangs:
        d = _unit(u + R_thorax_scapula @ (attachment_shares()[1] * np.linalg.norm(np.asarray(girdle.ts_mm))))
    d = Rotation.from_rotvec(np.radians(rule.forward_deg) * R_thorax_clavicle[:, 0]).apply(d)
    return R_thorax_scapula.T @ (float(girdle.conoid_length_mm) * d - u)


def close_at_rest(girdle: Girdle, rest_deg: Posture, rule: Rule = SHIPPED) -> Girdle:
    """Set the scapular attachment, const1 and const2 of a girdle so that A1-A3 hold in the rest posture.

    All are rounded to the printed digits; const1 and const2 follow from the rounded attachment.
    """
    open_at_rest = replace(girdle, ts_distance_mm=jnp.zeros(()), ai_distance_mm=jnp.zeros(()))
    distances = _printed(_residuals_mm(open_at_rest, rest_deg))
    return replace(
        girdle,
        scapula_conoid_mm=jnp.asarray(_printed(scapular_attachment_mm(girdle, rest_deg, rule))),
        ts_distance_mm=jnp.asarray(distances[0]),
        ai_distance_mm=jnp.asarray(distances[1]),
    )


def _residuals_mm(girdle: Girdle, angles_deg: Posture) -> Vector:
    return constraint_residuals_mm(jax.tree.map(np.asarray, girdle), np.asarray(angles_deg) / DEG)


def toml_text(completed: Completed) -> str:
    """Write a set as the text of its file, with the printed digits."""
    g = completed.girdle
    comment = (
        f"{completed.title}\n"
        "Written by scripts/complete_parameter_sets.py. Right shoulder, mm; frames as in the thesis, Appendix A."
    )
    points = np.round(thorax_points_mm(g.centre_mm, g.semi_axes_mm), POINT_DIGITS) + 0.0
    return parameters_toml(completed.name, comment, jax.tree.map(_printed, g), points, completed.source)


def _table_set(
    name: str,
    centre_mm: tuple[float, float],
    semi_axes_mm: Sequence[float],
    clavicle_mm: float,
    scapula: tuple[float, float, float],
    conoid: tuple[float, str],
    rule: Rule,
) -> Completed:
    """Complete R2, R4 or R6. centre_mm: M_y and M_z; scapula: |AC-TS| and |AI-TS| in mm and the angle AC-TS-AI in
    degrees (Table 3.2); conoid: its length and the source of the length."""
    ac_ts, ai_ts, angle_deg = scapula
    angle = np.radians(angle_deg)
    ts = np.array([-ac_ts, 0.0, 0.0])
    ai = ts + ai_ts * np.array([np.cos(angle), -np.sin(angle), 0.0])
    on_clavicle = clavicle_mm * np.asarray(rule.on_clavicle)
    girdle = _unclosed((0.0, *centre_mm), semi_axes_mm, rule.sc_mm, clavicle_mm, on_clavicle, ts, ai, conoid[0])
    rest_deg = REST_DEG if rule.least_mm is None else own_rest_deg(girdle, rule.least_mm)
    at_rest = f"the set's rest posture {_posture(rest_deg)}"
    source = _measured_sources("Table 3.3", at_rest) | {
        "thorax.semi_axes_mm": "Table 3.3; its axis lengths are semi-axes",
        "clavicle.sc_mm": "assumed: that of another cadaver (Table 4.2, dissection), none printed; +-10 mm",
        "clavicle.length_mm": "Table 3.2",
        "scapula.ts_mm": "derived: (-|AC-TS|, 0, 0) of Table 3.2; +-2 mm",
        "scapula.ai_mm": "derived: TS + |AI-TS| (cos, -sin, 0) of the angle AC-TS-AI of Table 3.2; +-2 mm",
        "constraint.conoid_length_mm": conoid[1],
    }
    for key, landmark in (("constraint.ts_distance_mm", "TS"), ("constraint.ai_distance_mm", "AI")):
        source[key] = (
            f"derived: signed distance of {landmark} to the ellipsoid in {at_rest}: of the postures with neither TS "
            f"nor AI inside the ellipsoid the closest to the published mean one, {_posture(REST_DEG)}; +-10 mm"
        )
    title = f"Cadaver {name} of the thesis (Tables 3.2 and 3.3)."
    return Completed(name, title, close_at_rest(girdle, rest_deg, rule), rest_deg, source)


def _cadaver(
    points_mm: Mapping[str, Vector], centre_mm: Sequence[float], semi_axes_mm: Sequence[float], on_clavicle: Vector
) -> tuple[Girdle, Posture]:
    """Return the cadaver of Tables 4.2 and 4.5 before its chain is closed, and its measured posture.

    on_clavicle: the clavicular attachment divided by the length of the clavicle.
    """
    SC, AC, TS, AI = points_mm.values()
    R_thorax_scapula = scapula_frame(AC, TS, AI)
    angles = [cardan_from_rotation(jnp.asarray(R)) for R in (clavicle_frame(SC, AC, _Y_THORAX), R_thorax_scapula)]
    ts, ai = R_thorax_scapula.T @ (TS - AC), R_thorax_scapula.T @ (AI - AC)
    length = float(np.linalg.norm(AC - SC))
    girdle = _unclosed(centre_mm, semi_axes_mm, SC, length, length * on_clavicle, ts, ai, _DAS3_CONOID_LENGTH)
    return girdle, _printed(jnp.concatenate(angles) * DEG)


def _dissection_set() -> Completed:
    """Complete the dissected cadaver, which rests in its measured posture, upright."""
    ellipsoid = _CADAVER["centre_mm"], _CADAVER["semi_axes_mm"]
    girdle, rest_deg = _cadaver(_DISSECTION, *ellipsoid, np.asarray(SHIPPED.on_clavicle))
    source = _cadaver_sources("dissection", rest_deg)
    title = "The cadaver of Klein Breteler in the thesis, dissection (Tables 4.2 and 4.5)."
    return Completed("breteler_dissection", title, close_at_rest(girdle, rest_deg), rest_deg, source)


def _mri_set(dissection: Girdle) -> Completed:
    """Complete the same cadaver on its back, with the attachments of the dissection; its conoid is slack there."""
    girdle, rest_deg = _cadaver(_MRI, (0.0, -107.6, 62.9), (137.5, 157.8, 94.6), np.asarray(SHIPPED.on_clavicle))
    scale = float(np.linalg.norm(np.asarray(girdle.ts_mm)) / np.linalg.norm(np.asarray(dissection.ts_mm)))
    on_scapula = _printed(np.asarray(dissection.scapula_conoid_mm) * scale)
    girdle = replace(close_at_rest(girdle, rest_deg), scapula_conoid_mm=jnp.asarray(on_scapula))
    apart = _DAS3_CONOID_LENGTH + _residuals_mm(girdle, rest_deg)[2]
    source = _cadaver_sources("MRI", rest_deg) | {
        "scapula.conoid_mm": (
            "derived: that of breteler_dissection, the same cadaver, scaled by |AC-TS|. Where the cadaver was "
            f"measured, on its back in {_posture(rest_deg)}, they are {apart:.1f} mm apart, the conoid slack; +-8 mm"
        )
    }
    title = "The cadaver of Klein Breteler in the thesis, MRI (Tables 4.2 and 4.5)."
    return Completed("breteler_mri", title, girdle, rest_deg, source)


def _das3_set() -> Completed:
    """Convert the published DAS3 numbers from their own frames into those of Appendix A. The chain closes to 2 mm."""
    SC, AC, TS, AI = np.array(_LANDMARKS["joint_sc_mm"]), *list(_DISSECTION.values())[1:]
    R_thorax_clavicle, R_thorax_scapula = clavicle_frame(SC, AC, _Y_THORAX), scapula_frame(AC, TS, AI)
    on_clavicle, on_scapula = das3_conoid_mm()
    ts, ai = (R_thorax_scapula.T @ (_outward(scapula_in_thorax(_LANDMARKS, "aa"), one) - AC) for one in _DAS3_CONTACTS)
    girdle = _unclosed(
        (0.0, -148.6, 59.1),
        (147.0, 207.9, 94.4),
        SC,
        float(np.linalg.norm(AC - SC)),
        R_thorax_clavicle.T @ (on_clavicle - SC),
        ts,
        ai,
        _DAS3_CONOID_LENGTH,
    )
    girdle = replace(girdle, scapula_conoid_mm=jnp.asarray(_printed(R_thorax_scapula.T @ (on_scapula - AC))))
    angles = [cardan_from_rotation(jnp.asarray(R)) * DEG for R in (R_thorax_clavicle, R_thorax_scapula)]
    rest_deg = _printed(jnp.concatenate(angles))
    off = ", ".join(f"{x:+.1f}" for x in _residuals_mm(girdle, rest_deg))
    at_rest = f"the posture the cadaver was measured in, {_posture(rest_deg)}"
    to_ours = f"brought into the frame of Appendix A in {at_rest}; A1-A3 are {off} mm there"
    contact = (
        "derived: {} of " + _DAS3 + f", a contact point and not the landmark, from AA in axes through TS, AI and AA "
        f"({_DSEM}), {to_ours}; +-2 mm"
    )
    on_surface = "derived: 0, the contact points of DAS3 are on its ellipsoid; +-2 mm"
    source = {
        "thorax.centre_mm": f"published: centre of the thorax ellipsoid of {_DAS3}",
        "thorax.semi_axes_mm": f"published: thorax_radii of {_DAS3}",
        "thorax.points_mm": _POINTS_SOURCE,
        "clavicle.sc_mm": f"published: joint sc1 of {_DAS3}",
        "clavicle.length_mm": "derived: |AC - sc1|, AC of the same cadaver (Table 4.2, dissection). DAS3 hangs its "
        "scapula at AA instead",
        "clavicle.conoid_mm": f"derived: conoid_origin of {_DAS3}, from sc1 in axes along SC-AC ({_DSEM}), {to_ours}; "
        "+-2 mm",
        "scapula.ts_mm": contact.format("TSprojection"),
        "scapula.ai_mm": contact.format("AIprojection"),
        "scapula.conoid_mm": f"derived: conoid_insertion of {_DAS3}, from the AC joint in axes through TS, AI and AA "
        f"({_DSEM}), {to_ours}; +-8 mm",
        "constraint.ts_distance_mm": on_surface,
        "constraint.ai_distance_mm": on_surface,
        "constraint.conoid_length_mm": f"published: conoid_length of {_DAS3}",
    }
    title = f"The numbers of DAS3, the same cadaver as breteler_dissection.\n{_LICENCE}"
    return Completed("das3", title, girdle, rest_deg, source)


def _unclosed(
    centre_mm: Sequence[float],
    semi_axes_mm: Sequence[float],
    sc_mm: Sequence[float] | Vector,
    clavicle_mm: float,
    on_clavicle_mm: Vector,
    ts_mm: Vector,
    ai_mm: Vector,
    conoid_mm: float,
) -> Girdle:
    """Make the girdle in printed digits; its scapular attachment, const1 and const2 are still 0."""
    return Girdle(
        centre_mm=jnp.asarray(_printed(centre_mm)),
        semi_axes_mm=jnp.asarray(_printed(semi_axes_mm)),
        sc_mm=jnp.asarray(_printed(sc_mm)),
        ac_mm=jnp.asarray(_printed([clavicle_mm, 0.0, 0.0])),
        clavicle_conoid_mm=jnp.asarray(_printed(on_clavicle_mm)),
        ts_mm=jnp.asarray(_printed(ts_mm)),
        ai_mm=jnp.asarray(_printed(ai_mm)),
        scapula_conoid_mm=jnp.zeros(3),
        ts_distance_mm=jnp.zeros(()),
        ai_distance_mm=jnp.zeros(()),
        conoid_length_mm=jnp.asarray(conoid_mm),
    )


def _cadaver_sources(column: str, rest_deg: Posture) -> dict[str, str]:
    at_rest = f"the posture the cadaver was measured in, {_posture(rest_deg)}"
    table = f"Table 4.2, {column}"
    distance = "derived: signed distance of {} to the ellipsoid in " + at_rest + "; +-3 mm"
    return _measured_sources(f"Table 4.5, {column}", at_rest) | {
        "clavicle.sc_mm": f"{table} (SC-J)",
        "clavicle.length_mm": f"derived: |AC - SC-J| of {table}; AC is the landmark, not the joint",
        "scapula.ts_mm": f"derived: {table}, in the scapula frame of Appendix A; +-2 mm",
        "scapula.ai_mm": f"derived: {table}, in the scapula frame of Appendix A; +-2 mm",
        "constraint.ts_distance_mm": distance.format("TS"),
        "constraint.ai_distance_mm": distance.format("AI"),
        "constraint.conoid_length_mm": f"published: conoid_length of {_DAS3}, the same cadaver",
    }


def _measured_sources(ellipsoid: str, at_rest: str) -> dict[str, str]:
    """Return the sources that the sets of the thesis have in common."""
    return {
        "thorax.centre_mm": ellipsoid,
        "thorax.semi_axes_mm": ellipsoid,
        "thorax.points_mm": _POINTS_SOURCE,
        "clavicle.conoid_mm": f"derived: conoid_origin of {_DAS3}, from sc1 in axes along SC-AC ({_DSEM}), brought "
        "into the frame of Appendix A by Table 4.2, dissection, and scaled by the length of the clavicle; +-8 mm",
        "scapula.conoid_mm": f"assumed: in {at_rest}, the conoid hangs straight down from the clavicle. In DAS3 it is "
        "21 deg from there, its lower end backward; of measured shoulders hanging predicts unseen motions better "
        "(docs/research/completion.md); +-8 mm",
    }


def _posture(angles_deg: Posture) -> str:
    clavicle, scapula = (", ".join(f"{a:.10g}" for a in angles) for angles in np.split(angles_deg, 2))
    return f"clavicle ({clavicle}), scapula ({scapula}) deg"


def _unit(v: Vector) -> Vector:
    return v / np.linalg.norm(v)


def _printed(value: object) -> np.ndarray:
    """Round to the digits of the file, without negative zeros."""
    return np.round(np.asarray(value, dtype=float), DIGITS) + 0.0
