"""Paths round a surface by OpenSim, in a process of its own (see in_opensim.py).

``python wrapped_in_opensim.py PROBLEMS.json`` prints the lengths in m of paths from p to q round a surface with centre
0. PROBLEMS.json is a list of [p, q, size], in m; size: three semi-axes of an ellipsoid, one radius of a sphere, or
radius and length of a cylinder along z.
"""

import json
import sys
from pathlib import Path

import opensim as osim


def surface(size: list[float]):
    if len(size) == 3:
        found = osim.WrapEllipsoid()
        found.set_dimensions(osim.Vec3(*size))
    elif len(size) == 2:
        found = osim.WrapCylinder()
        found.set_radius(size[0])
        found.set_length(size[1])
    else:
        found = osim.WrapSphere()
        found.set_radius(size[0])
    found.setName("surface")
    return found


def length_m(p: list[float], q: list[float], size: list[float]) -> float:
    model = osim.Model()
    ellipsoid = surface(size)
    model.getGround().addWrapObject(ellipsoid)
    body = osim.Body("body", 1.0, osim.Vec3(0.0), osim.Inertia(1.0))
    model.addBody(body)
    model.addJoint(osim.WeldJoint("weld", model.getGround(), body))
    muscle = osim.PathSpring("path", 1.0, 1.0, 0.0)
    path = muscle.updGeometryPath()
    path.appendNewPathPoint("p", body, osim.Vec3(*p))
    path.appendNewPathPoint("q", model.getGround(), osim.Vec3(*q))
    path.addPathWrap(ellipsoid)
    model.addForce(muscle)
    state = model.initSystem()
    model.realizePosition(state)
    return muscle.getLength(state)


if __name__ == "__main__":
    osim.Logger.removeFileSink()
    osim.Logger.setLevelString("error")
    print(json.dumps([length_m(*problem) for problem in json.loads(Path(sys.argv[1]).read_text())]))
