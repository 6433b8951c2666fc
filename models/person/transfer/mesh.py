"""Triangulated surface of a bone: reading of files (STL, PLY, VTP), evenly spread points, distances to the surface."""

import importlib.util
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from motions.errors import InputError, pip_install
from motions.files import read_by_child, read_bytes

Points = Float[np.ndarray, "3 points"]

ENDINGS = (".stl", ".ply", ".vtp")

EXTENT_MM = (30.0, 700.0)
"""Limits of the longest extent of a bone of the girdle or the arm, assumed: a smaller extent is in centimetres or
metres, a larger one is not a bone's. A clavicle grows 8.4 mm a year from birth and has 149-161 mm at 18 (McGraw et al.,
J. Pediatr. Orthop. 29 (2009) 937-943), a humerus of a man 307 +- 21 mm (``motions.checks.distances``)."""

_STL_HEADER, _STL_FACET = 84, 50
"""Bytes of a binary STL before its facets, and bytes per facet."""

_INFLATED = 1000
"""Maximum number of points or faces per byte of a compressed file; a header that states more is wrong."""

_PATIENCE_S, _BYTES_A_SECOND = 60.0, 1e6
"""Time limit for vtk: a constant, plus the size of the file over this rate. After a start of 0.5 s, vtk takes less than
1 s per MB."""

_DENSE = 20_000
"""Number of pairs of triangle and point processed together: some 50 MB."""


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles, mm."""

    corners: Float[np.ndarray, "3 corners"]
    triangles: Int[np.ndarray, "triangles 3"]
    """Indices of the corners of each triangle."""

    def spread(self, count: int, seed: int = 0) -> Points:
        """Draw random points evenly over the surface."""
        A, B, C = (self.corners[:, self.triangles[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(B - A, C - A, axis=0), axis=0)
        rng = np.random.default_rng(seed)
        which = rng.choice(len(area), count, p=area / area.sum())
        u, v = np.sqrt(rng.uniform(size=count)), rng.uniform(size=count)
        return (1.0 - u) * A[:, which] + u * (1.0 - v) * B[:, which] + u * v * C[:, which]

    def distances_mm(self, points: Points) -> Float[np.ndarray, " points"]:
        """Compute the unsigned distances of points to the surface."""
        step = max(1, _DENSE // len(self.triangles))
        A, B, C = (self.corners[:, self.triangles[:, k]] for k in range(3))
        parts = [points[:, k : k + step] for k in range(0, points.shape[1], step)]
        return np.concatenate([np.zeros(0), *(_to_triangles(part, A, B, C).min(axis=1) for part in parts)])


def _to_triangles(points: Points, A: Points, B: Points, C: Points) -> Float[np.ndarray, "points triangles"]:
    """Compute the distance of each point to each triangle: to its plane if above its inside, else to an edge."""
    p = points[:, :, None]
    normal = np.cross(B - A, C - A, axis=0)
    length = np.linalg.norm(normal, axis=0)
    n = normal / np.where(length > 0.0, length, 1.0)
    height = np.einsum("it,ipt->pt", n, p - A[:, None])
    edges = ((A, B), (B, C), (C, A))
    inside = np.ones(height.shape, bool)
    to_edge = np.full(height.shape, np.inf)
    for start, end in edges:
        along = end - start
        inside &= np.einsum("it,ipt->pt", np.cross(n, along, axis=0), p - start[:, None]) >= 0.0
        to_edge = np.minimum(to_edge, to_segments(points, start, end))
    return np.where(inside & (length > 0.0), np.abs(height), to_edge)


def to_segments(points: Points, starts: Points, ends: Points) -> Float[np.ndarray, "points segments"]:
    """Compute the distance of each point to each segment; a segment of length 0 counts as a point."""
    along = ends - starts
    square = (along**2).sum(axis=0)
    from_start = points[:, :, None] - starts[:, None]
    share = np.einsum("is,ips->ps", along, from_start) / np.where(square > 0.0, square, 1.0)
    nearest = np.clip(share, 0.0, 1.0)[None] * along[:, None]
    return np.linalg.norm(from_start - nearest, axis=0)


def read_mesh(path: Path, unit_mm: float = 1.0) -> Mesh:
    """Read a surface of triangles; faces with more corners are split, equal corners merged.

    ``unit_mm``: millimetres per unit of the file, because the file does not state its unit. InputError where the file
    cannot be read, holds no triangle, or has a size that no bone has. Needs vtk, the extra ``surface``.
    """
    kind = path.suffix.lower()
    if kind not in ENDINGS:
        cause = f"surfaces that end in {kind!r} are not read"
        raise InputError(str(path), None, cause, f"Give one that ends in {', '.join(ENDINGS)}")
    content = read_bytes(path)
    _check_head(path, kind, content)
    read = _by_vtk(path, len(content))
    mesh = Mesh(unit_mm * read["corners"].T, read["triangles"])
    if not len(mesh.triangles) or not np.isfinite(mesh.corners).all():
        raise InputError(str(path), None, "there is no whole surface of triangles in it", "Export it anew")
    extent, (least, most) = float(np.ptp(mesh.corners, axis=1).max()), EXTENT_MM
    if not least <= extent <= most:
        cause = f"the surface is {extent:.3g} mm long, and bones here have {least:g} to {most:g} mm"
        raise InputError(str(path), None, cause, "Say the unit of the file: --surface-unit cm or m")
    return mesh


def _check_head(path: Path, kind: str, content: bytes) -> None:
    """Raise InputError where the header is not of this kind of file, or states more than the file can hold."""
    wrong = ""
    if kind == ".stl":
        count = int.from_bytes(content[_STL_HEADER - 4 : _STL_HEADER], "little")
        binary = len(content) == _STL_HEADER + _STL_FACET * count
        if not binary and not (content.lstrip()[:5] == b"solid" and b"facet" in content):
            wrong = "this is neither a binary STL of the length that it states nor one in text"
    elif kind == ".ply":
        wrong = _beyond(content, rb"element\s+\w+\s+(\d+)", 1) if content[:3] == b"ply" else "this is no PLY file"
    elif b"VTKFile" in content[:2000] and b"PolyData" in content[:2000]:
        wrong = _beyond(content, rb'NumberOf\w+="\s*(\d+)', _INFLATED)
    else:
        wrong = "this is no VTP file (XML, PolyData)"
    if wrong:
        raise InputError(str(path), None, wrong, "Export the surface anew")


def _beyond(content: bytes, pattern: bytes, times: int) -> str:
    stated = max((int(number) for number in re.findall(pattern, content)), default=0)
    return f"it states {stated} points or faces, more than it can hold" if stated > times * len(content) else ""


def _by_vtk(path: Path, size: int) -> dict[str, np.ndarray]:
    """Read a surface by ``mesh_child``, in a process of its own.

    Fuzzing found a PLY file, with wrong words in its header, on which vtk frees memory twice.
    """
    if importlib.util.find_spec("vtkmodules") is None:
        cause = "surfaces need vtk, which is not installed"
        raise InputError(str(path), None, cause, f"Install it: {pip_install('vtk')}")
    patience_s = _PATIENCE_S + size / _BYTES_A_SECOND
    return read_by_child(Path(__file__).with_name("mesh_child.py"), path, "vtk", "Export the surface anew", patience_s)
