"""The parameter set of a person: numbers from landmarks and points, the rest carried or assumed from a generic set.

- SC: mean over the postures, thorax frame. Lengths: medians (``models.person.sizes``). Scapula frame (Appendix A):
  TS = (-|AC-TS|, 0, 0), and AI = (x, -y, 0) with x = -(|AC-TS|^2 + |AC-AI|^2 - |TS-AI|^2) / (2 |AC-TS|) and
  x^2 + y^2 = |AC-AI|^2.
- Thorax: the ellipsoid of least D for the person's points (``models.person.thorax_ellipsoid``), else the generic one.
- Conoid: carried by landmarks; on the scapula by surfaces where they are given (``models.person.attachments``).
- const1 and const2: the distances of TS and AI to the ellipsoid in a named posture at rest, so that A1 and A2 hold in
  this posture. A3 holds there through the axial rotation c of the clavicle, which nobody measured. With the scapular
  attachment p in the clavicle's frame before axial rotation, and the clavicular attachment k,

      |p - Rx(c) k|^2 = |p|^2 + |k|^2 - 2 (p_x k_x + P cos(c - c_0)),   P^2 = (p_y^2 + p_z^2) (k_y^2 + k_z^2).

  Where no c gives the carried conoid length, the set gets the nearest length that some c gives.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ADAPTED, ELLIPSOID
from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.person.attachments import ATTACHMENT_SD_MM, CONOID_SD_MM, ScapularSurfaces, with_carried_conoid
from models.person.sizes import ONE_POSTURE_MM, PALPATOR_MM, Size, bone_sizes, size_of
from models.person.thorax_ellipsoid import ThoraxFit, fit_thorax
from models.sets.set_geometry import FLATTEST_SCAPULA_MM, conoid_reach_mm
from motions.checks.rigidity import Rigidity, check_rigidity
from motions.landmarks.frames import clavicle_frame, scapula_frame

_UP = np.array([0.0, 1.0, 0.0])

_TRIAD = (("AC", "TS"), ("AC", "AI"), ("TS", "AI"))

ESTIMATED_LANDMARK_MM = 10.0
"""SD of SC estimated from IJ and of AC estimated from AA (``motions.landmarks``)."""

GENERIC_THORAX_MM = 15.0
"""Uncertainty of the distance between the person's chest and the generic ellipsoid under TS and AI: two fits of one
cadaver's thorax are up to 15 mm away from each other's points (``adapt.trust.thorax_plausibility``)."""


@dataclass(frozen=True)
class PersonSet:
    """A person's girdle, ready to be written to a file, with its sources, checks and notes for the reader."""

    girdle: Girdle
    points_mm: Float[np.ndarray, "3 points"]
    source: dict[str, str]
    rigidity: Rigidity
    sizes: dict[tuple[str, str], Size]
    thorax: ThoraxFit | None
    notes: tuple[str, ...]


def person_set(
    landmarks_mm: Mapping[str, Float[np.ndarray, "3 postures"]],
    generic: ParameterSet,
    rest: int,
    posture_names: tuple[str, ...],
    estimated: Mapping[str, str],
    thorax_points_mm: Float[np.ndarray, "3 points"] | None = None,
    surfaces: ScapularSurfaces | None = None,
) -> PersonSet:
    """Build the set of one person from landmarks in the thorax frame (SC, AC, TS, AI), right shoulder.

    ``rest``: index of the posture in which the chain closes. ``estimated``: estimated landmarks, each with the text
    that says how it was estimated. ``surfaces``: surfaces of the generic and the person's scapula, which carry the
    conoid's attachment there in place of the landmarks. ValueError where a landmark was not measured at rest, where AC,
    TS and AI lie on a line, or where the thorax points give no ellipsoid, or an ellipsoid with its centre in front of
    IJ.
    """
    at_rest = _at_rest(landmarks_mm, rest, posture_names[rest])
    rigidity = check_rigidity({name: p.T for name, p in landmarks_mm.items() if name not in estimated})
    of_bones = bone_sizes(check_rigidity({name: p.T for name, p in landmarks_mm.items()}, (("SC", "AC"), *_TRIAD)))
    of_bones |= {pair: size for pair, size in bone_sizes(rigidity).items() if pair in of_bones}
    ts, ai = _scapula(*(of_bones[pair].value_mm for pair in _TRIAD))
    SC = [size_of(row, PALPATOR_MM) for row in landmarks_mm["SC"]]
    thorax = None if thorax_points_mm is None else fit_thorax(thorax_points_mm, generic.girdle)
    if thorax is not None and thorax.centre_mm[2] <= 0.0:
        raise ValueError(
            f"the middle of the thorax lies {-float(thorax.centre_mm[2]):.0f} mm in front of IJ: its points are not in "
            "the frame of the landmarks, or left-handed"
        )
    girdle = replace(
        generic.girdle,
        centre_mm=generic.girdle.centre_mm if thorax is None else thorax.centre_mm,
        semi_axes_mm=generic.girdle.semi_axes_mm if thorax is None else thorax.semi_axes_mm,
        sc_mm=np.array([float(np.nanmean(row)) for row in landmarks_mm["SC"]]),
        ac_mm=np.array([of_bones["SC", "AC"].value_mm, 0.0, 0.0]),
        ts_mm=ts,
        ai_mm=ai,
    )
    girdle = with_carried_conoid(girdle, generic.girdle, surfaces)
    girdle, carried_mm = _closed_at_rest(girdle, at_rest)
    return PersonSet(
        girdle=girdle,
        points_mm=generic.points_mm if thorax_points_mm is None else thorax_points_mm,
        source=_sources(generic, of_bones, SC, thorax, thorax_points_mm, posture_names[rest], estimated, carried_mm)
        | ({} if surfaces is None else {"scapula.conoid_mm": _by_surfaces(generic)}),
        rigidity=rigidity,
        sizes=of_bones,
        thorax=thorax,
        notes=_notes(rigidity, posture_names, rest, thorax, float(girdle.conoid_length_mm), carried_mm),
    )


def _at_rest(landmarks_mm: Mapping[str, np.ndarray], rest: int, name: str) -> dict[str, Float[np.ndarray, "3"]]:
    found = {landmark: np.asarray(landmarks_mm[landmark][:, rest]) for landmark in ("SC", "AC", "TS", "AI")}
    missing = [landmark for landmark, p in found.items() if not np.isfinite(p).all()]
    if missing:
        raise ValueError(f"{' and '.join(missing)} were not measured in posture {name!r}, which is taken for rest")
    return found


def _scapula(ac_ts: float, ac_ai: float, ts_ai: float) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Compute TS and AI in the scapula frame (Appendix A) from three distances."""
    x = -(ac_ts**2 + ac_ai**2 - ts_ai**2) / (2.0 * ac_ts)
    off_line = ac_ai**2 - x**2
    if off_line < FLATTEST_SCAPULA_MM**2:
        raise ValueError("AC, TS and AI lie on a line")
    return np.array([-ac_ts, 0.0, 0.0]), np.array([x, -np.sqrt(off_line), 0.0])


def _closed_at_rest(girdle: Girdle, at: Mapping[str, Float[np.ndarray, "3"]]) -> tuple[Girdle, float]:
    """Return the girdle with const1, const2 and const3 of the posture at rest, and the carried conoid length, mm."""
    R_thorax_scapula = scapula_frame(at["AC"], at["TS"], at["AI"])
    R_thorax_clavicle = clavicle_frame(np.asarray(girdle.sc_mm), at["AC"], _UP)
    AC = girdle.sc_mm + R_thorax_clavicle @ girdle.ac_mm
    TS, AI = (AC + R_thorax_scapula @ p for p in (girdle.ts_mm, girdle.ai_mm))
    distances = signed_distance_mm(
        jnp.stack([jnp.asarray(TS), jnp.asarray(AI)], axis=1),
        jnp.asarray(girdle.centre_mm)[:, None],
        jnp.asarray(girdle.semi_axes_mm)[:, None],
    )
    attachment = R_thorax_clavicle.T @ (AC + R_thorax_scapula @ girdle.scapula_conoid_mm - girdle.sc_mm)
    carried = float(girdle.conoid_length_mm)
    nearest = float(np.clip(carried, *conoid_reach_mm(attachment, np.asarray(girdle.clavicle_conoid_mm))))
    ts_distance, ai_distance = (np.asarray(float(d)) for d in distances)
    closed = replace(
        girdle, ts_distance_mm=ts_distance, ai_distance_mm=ai_distance, conoid_length_mm=np.asarray(nearest)
    )
    return closed, carried


def _sources(generic, of_bones, SC, thorax, points, rest: str, estimated, carried_mm: float) -> dict[str, str]:
    """Write the source of each number, one line each. Measured and derived numbers say so, with the SD at the end."""

    def of_generic(key: str) -> str:
        return f"assumed: of {generic.name}, not of the person ({generic.source.get(key, 'source not stated')})"

    def measured(what: str, sizes: list[Size], landmarks: tuple[str, ...]) -> str:
        replaced = [f"{name} {estimated[name]}" for name in landmarks if name in estimated]
        sd = max(size.sd_mm for size in sizes)
        if replaced:
            return f"derived: {what} {sizes[0]}; {'; '.join(replaced)}; +-{max(sd, ESTIMATED_LANDMARK_MM):.1f} mm"
        return f"measured: {what} {sizes[0]}; +-{sd:.1f} mm"

    triad = [of_bones[pair] for pair in _TRIAD]
    if thorax is None:
        ellipsoid = dict.fromkeys(("thorax.centre_mm", "thorax.semi_axes_mm"))
        ellipsoid = {key: of_generic(key) for key in ellipsoid}
        wall = f"of {generic.name}; +-{GENERIC_THORAX_MM:.1f} mm"
    else:
        sd = dict(zip(ADAPTED[: len(ELLIPSOID)], thorax.fit.sd, strict=True))
        fitted = f"measured: least D of {points.shape[1]} points of the person, rms {thorax.fit.rms_mm:.1f} mm"
        ellipsoid = {
            "thorax.centre_mm": f"{fitted}; M_y and A_y correlate by {thorax.correlation:.2f}; "
            f"+-{max(sd['M_y'], sd['M_z']):.1f} mm",
            "thorax.semi_axes_mm": f"{fitted}; +-{max(sd[a] for a in ('A_x', 'A_y', 'A_z')):.1f} mm",
        }
        wall = f"of the person; +-{np.hypot(ONE_POSTURE_MM, thorax.fit.rms_mm):.1f} mm"
    at_rest = f"derived: signed distance in posture {rest}, taken for rest, to the ellipsoid {wall}"
    carried = f"derived: of {generic.name}, carried by landmarks"
    return {
        **ellipsoid,
        "thorax.points_mm": of_generic("thorax.points_mm")
        if thorax is None
        else f"measured: {points.shape[1]} points of the person",
        "clavicle.sc_mm": measured("mean in the thorax frame", SC, ("SC",)),
        "clavicle.length_mm": measured("median |AC-SC|", [of_bones["SC", "AC"]], ("SC", "AC")),
        "clavicle.conoid_mm": f"{carried} (ratio of the lengths); +-{ATTACHMENT_SD_MM:.1f} mm",
        "scapula.ts_mm": measured("median |AC-TS|", triad[:1], ("AC",)),
        "scapula.ai_mm": measured("medians |AC-TS|, |AC-AI| and |TS-AI|", triad, ("AC",)),
        "scapula.conoid_mm": f"{carried} (affine map of AC, TS, AI); +-{ATTACHMENT_SD_MM:.1f} mm",
        "constraint.ts_distance_mm": at_rest,
        "constraint.ai_distance_mm": at_rest,
        "constraint.conoid_length_mm": f"{carried}, {carried_mm:.1f} mm, as far as the chain closes in posture {rest}; "
        f"+-{CONOID_SD_MM:.1f} mm",
    }


def _by_surfaces(generic: ParameterSet) -> str:
    said = f"derived: of {generic.name}, carried by the surfaces of both scapulae, held at AC, TS and AI"
    return f"{said}; +-{ATTACHMENT_SD_MM:.1f} mm"


def _notes(rigidity: Rigidity, names, rest: int, thorax: ThoraxFit | None, conoid_mm, carried_mm) -> tuple[str, ...]:
    found = [
        f"{one.landmark} slipped by {one.size_mm:.0f} mm in posture {names[one.posture]}: left out of the lengths"
        + (", but this posture is taken for rest" if one.posture == rest else "")
        for one in rigidity.outliers
    ]
    if np.isnan(rigidity.noise_mm):
        found.append("fewer than 4 whole postures: whether a landmark slipped in one cannot be told")
    if thorax is not None and thorax.loose:
        found.append(
            f"the points on the thorax do not fix {', '.join(thorax.loose)}: M_y and A_y correlate by "
            f"{thorax.correlation:.2f}; measure points farther apart, down to the lowest ribs"
        )
    if abs(conoid_mm - carried_mm) > 0.05:
        found.append(
            f"the conoid of {carried_mm:.1f} mm does not close the chain at rest; {conoid_mm:.1f} mm, the nearest "
            "length that does, is taken"
        )
    return tuple(found)
