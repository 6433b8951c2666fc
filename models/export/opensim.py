"""Export of a girdle as an OpenSim 4 model (.osim): bones, ScapulothoracicJoint on the ellipsoid, AC and conoid.

OpenSim's axes are the ISB's (x forward, y up, z right), in metres: v_opensim = Q v / 1000, that is (-z, y, x) in our
axes, for every bone. So the clavicle's coordinates are the thesis's angles: Y, Z' and X'' are OpenSim's y, -x and z.

Both mechanisms have three degrees of freedom, but they differ. In girdle, TS and AI keep their distances to the
ellipsoid (A1, A2). OpenSim's joint (Seth et al., Nonlinear Dyn. 62 (2010) 291-303) keeps one point of the scapula on
the ellipsoid, turns the scapula with the surface and lets it wing. This point is the surface point nearest to halfway
TS-AI at rest. TS and AI become markers; a comment has their distances. Masses are placeholders: kinematics only.

OpenSim 4.6 opens the model of every set and closes its chain (tests/models/test_opensim.py).
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from models.ellipsoid import closest_point
from models.girdle import Girdle, bone_rotations, chain_landmarks
from models.parameter_sets import ParameterSet
from motions.rhythm import REST_DEG
from motions.rotations import DEG, rotation_from_cardan
from motions.table import ANGLES

Vector = Float[np.ndarray, "3"]
Matrix = Float[np.ndarray, "3 3"]

Q: Matrix = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Rotation to OpenSim's axes: v_opensim = Q v."""

SCAPULA_COORDINATES = ("scapula_abduction", "scapula_elevation", "scapula_upward_rot", "scapula_winging")
"""Names of the joint's coordinates in published models, in the joint's order."""

_PLACEHOLDER_KG = 0.1
_AXES = {"y": "0 1 0", "z": "-1 0 0", "x": "0 0 1"}
"""Axes of the thesis as vectors in OpenSim's axes."""


def opensim_model(parameters: ParameterSet) -> str:
    """Return the text of the .osim file of a parameter set, at rest (de Groot's mean posture)."""
    girdle = parameters.girdle
    document = ET.Element("OpenSimDocument", Version="40000")
    model = ET.SubElement(document, "Model", name=re.sub(r"[\\/*+\s]", "_", parameters.name))  # not allowed in names
    model.append(ET.Comment(_comment(girdle)))
    _text(model, "length_units", "meters")
    _text(model, "force_units", "N")
    bodies = _set(model, "BodySet")
    _thorax(bodies, girdle)
    for name in ("clavicle", "scapula"):
        _body(bodies, name)
    joints = _set(model, "JointSet")
    ground = ET.SubElement(joints, "WeldJoint", name="ground_thorax")
    _frames(ground, ("/ground", np.zeros(3), np.zeros(3)), ("/bodyset/thorax", np.zeros(3), np.zeros(3)))
    _sternoclavicular(joints, girdle)
    _scapulothoracic(joints, girdle)
    constraints = _set(model, "ConstraintSet")
    _constraint(constraints, "PointConstraint", "acromioclavicular", girdle.ac_mm, np.zeros(3))
    conoid = _constraint(
        constraints, "ConstantDistanceConstraint", "conoid", girdle.clavicle_conoid_mm, girdle.scapula_conoid_mm
    )
    _text(conoid, "constant_distance", _numbers([float(girdle.conoid_length_mm) / 1000.0]))
    markers = _set(model, "MarkerSet")
    for name, body, point in (
        ("SC", "clavicle", np.zeros(3)),
        ("AC", "scapula", np.zeros(3)),
        ("TS", "scapula", girdle.ts_mm),
        ("AI", "scapula", girdle.ai_mm),
    ):
        marker = ET.SubElement(markers, "Marker", name=name)
        _text(marker, "socket_parent_frame", f"/bodyset/{body}")
        _text(marker, "location", _metres(point))
        _text(marker, "fixed", "true")
    ET.indent(document, "\t")
    return '<?xml version="1.0" encoding="UTF-8" ?>\n' + ET.tostring(document, encoding="unicode") + "\n"


def contact(girdle: Girdle) -> tuple[Float[np.ndarray, "2"], Vector, Matrix]:
    """Compute the joint at rest: its first two coordinates (rad), and origin (mm) and axes of its frame in the scapula.

    In OpenSim's axes, with radii (r_x, r_y, r_z), the joint's origin in the thorax is

        centre + (r_x sin q1 cos q2, r_y sin q2, r_z cos q1 cos q2)

    and the joint's axes are Ry(q1) Rx(-q2) Rz(q3), without winging (ScapulothoracicJoint.cpp,
    MobilizedBody::Ellipsoid).
    """
    R_thorax_clavicle, R_thorax_scapula = bone_rotations(REST_DEG / DEG)
    at = chain_landmarks(girdle, R_thorax_clavicle, R_thorax_scapula)
    from_centre = closest_point((at.TS + at.AI) / 2.0 - girdle.centre_mm, girdle.semi_axes_mm)
    x, y, z = Q @ np.asarray(from_centre) / radii_mm(girdle)
    q = np.array([np.arctan2(x, z), np.arcsin(y)])
    R_thorax_joint = rotation_from_cardan(np.array([q[0], 0.0, -q[1]]))
    R_scapula_thorax = Q @ np.asarray(R_thorax_scapula).T @ Q.T
    origin_mm = Q @ np.asarray(girdle.centre_mm + from_centre - at.AC)
    return q, R_scapula_thorax @ origin_mm, R_scapula_thorax @ R_thorax_joint


def radii_mm(girdle: Girdle) -> Vector:
    """Return the semi-axes along OpenSim's axes."""
    return np.abs(Q) @ np.asarray(girdle.semi_axes_mm)


def _comment(girdle: Girdle) -> str:
    return (
        " Written by girdle. Right shoulder, kinematics only: masses are placeholders. In the "
        f"model of girdle TS and AI stay {float(girdle.ts_distance_mm):.3f} and {float(girdle.ai_distance_mm):.3f} mm "
        "outside the ellipsoid (negative: inside); OpenSim's ScapulothoracicJoint keeps one point of the bone on it. "
    )


def _thorax(bodies: ET.Element, girdle: Girdle) -> None:
    thorax = _body(bodies, "thorax")
    wraps = _set(thorax, "WrapObjectSet")
    ellipsoid = ET.SubElement(wraps, "WrapEllipsoid", name="thorax_ellipsoid")
    _text(ellipsoid, "xyz_body_rotation", "0 0 0")
    _text(ellipsoid, "translation", _metres(girdle.centre_mm))
    _text(ellipsoid, "dimensions", _numbers(radii_mm(girdle) / 1000.0))


def _body(bodies: ET.Element, name: str) -> ET.Element:
    body = ET.SubElement(bodies, "Body", name=name)
    _text(body, "mass", f"{_PLACEHOLDER_KG}")
    _text(body, "mass_center", "0 0 0")
    _text(body, "inertia", "0.0001 0.0001 0.0001 0 0 0")
    return body


def _sternoclavicular(joints: ET.Element, girdle: Girdle) -> None:
    """Add the joint SC, R = Ry(a) Rz(b) Rx(c): coordinates clavicle_y, clavicle_z, clavicle_x, the thesis's angles."""
    joint = ET.SubElement(joints, "CustomJoint", name="sternoclavicular")
    names = ANGLES[:3]
    _coordinates(joint, zip(names, (REST_DEG / float(DEG))[:3], strict=True))
    parent = ("/bodyset/thorax", np.asarray(girdle.sc_mm), np.zeros(3))
    _frames(joint, parent, ("/bodyset/clavicle", np.zeros(3), np.zeros(3)))
    transform = ET.SubElement(joint, "SpatialTransform")
    for number, name in enumerate(names, 1):
        axis = ET.SubElement(transform, "TransformAxis", name=f"rotation{number}")
        _text(axis, "coordinates", name)
        _text(axis, "axis", _AXES[name[-1]])
        _text(ET.SubElement(axis, "LinearFunction", name="function"), "coefficients", "1 0")
    for number, direction in enumerate(("1 0 0", "0 1 0", "0 0 1"), 1):
        axis = ET.SubElement(transform, "TransformAxis", name=f"translation{number}")
        _text(axis, "coordinates", "")
        _text(axis, "axis", direction)
        _text(ET.SubElement(axis, "Constant", name="function"), "value", "0")


def _scapulothoracic(joints: ET.Element, girdle: Girdle) -> None:
    joint = ET.SubElement(joints, "ScapulothoracicJoint", name="scapulothoracic")
    q, origin_mm, R_scapula_joint = contact(girdle)
    _coordinates(joint, zip(SCAPULA_COORDINATES, (*q, 0.0, 0.0), strict=True))
    parent = ("/bodyset/thorax", np.asarray(girdle.centre_mm), np.zeros(3))
    _frames(joint, parent, ("/bodyset/scapula", Q.T @ origin_mm, body_fixed_xyz(R_scapula_joint)))
    _text(joint, "thoracic_ellipsoid_radii_x_y_z", _numbers(radii_mm(girdle) / 1000.0))
    _text(joint, "scapula_winging_axis_origin", "0 0")
    _text(joint, "scapula_winging_axis_direction", "0")


def body_fixed_xyz(R: Matrix) -> Vector:
    """Compute (a, b, c) of R = Rx(a) Ry(b) Rz(c), radians: OpenSim's orientation of an offset frame."""
    return np.array([np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])])


def _coordinates(joint: ET.Element, defaults: Iterable[tuple[str, float]]) -> None:
    coordinates = ET.SubElement(joint, "coordinates")
    for name, value in defaults:
        coordinate = ET.SubElement(coordinates, "Coordinate", name=name)
        _text(coordinate, "default_value", _numbers([value]))
        _text(coordinate, "range", _numbers([-np.pi, np.pi]))
        _text(coordinate, "clamped", "false")
        _text(coordinate, "locked", "false")


def _frames(joint: ET.Element, parent: tuple[str, Vector, Vector], child: tuple[str, Vector, Vector]) -> None:
    """Add the two frames of a joint: body, origin there (mm, our axes), orientation there (rad, body-fixed x-y-z)."""
    names = [f"{body.rpartition('/')[2]}_offset" for body, _, _ in (parent, child)]
    _text(joint, "socket_parent_frame", names[0])
    _text(joint, "socket_child_frame", names[1])
    frames = ET.SubElement(joint, "frames")
    for name, (body, origin_mm, orientation) in zip(names, (parent, child), strict=True):
        frame = ET.SubElement(frames, "PhysicalOffsetFrame", name=name)
        _text(frame, "socket_parent", body)
        _text(frame, "translation", _metres(origin_mm))
        _text(frame, "orientation", _numbers(orientation))


def _constraint(constraints: ET.Element, kind: str, name: str, in_clavicle_mm, in_scapula_mm) -> ET.Element:
    constraint = ET.SubElement(constraints, kind, name=name)
    _text(constraint, "socket_body_1", "/bodyset/clavicle")
    _text(constraint, "socket_body_2", "/bodyset/scapula")
    _text(constraint, "location_body_1", _metres(in_clavicle_mm))
    _text(constraint, "location_body_2", _metres(in_scapula_mm))
    return constraint


def _set(parent: ET.Element, kind: str) -> ET.Element:
    """Add a set to ``parent`` and return its element for objects."""
    return ET.SubElement(ET.SubElement(parent, kind, name=kind.lower()), "objects")


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, tag).text = text


def _metres(vector_mm) -> str:
    return _numbers(Q @ np.asarray(vector_mm) / 1000.0)


def _numbers(values) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
