"""Image slices of a tomographic scan: grey levels, and the position of each pixel in mm. Read by pydicom and Pillow.

A DICOM file states positions: pixel (x, y) is at ImagePositionPatient + x dx r + y dy c, with r and c the two
directions of ImageOrientationPatient, and dy and dx the PixelSpacing. The frame is the patient's (left, back, up),
right-handed. The slices are sorted by position. Positions in other images follow from --pixel-mm and --slice-mm: x to
the right, y down, z away from the viewer from slice to slice, right-handed too.
"""

import importlib.util
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError, pip_install
from motions.files import unreadable

_EXTRA = {"pydicom": "pydicom", "PIL": "pillow", "shapely": "shapely"}
"""Modules of the extra ``contour``, and the packages that provide them."""

_ENDINGS = (".dcm", ".ima", ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", "")
"""Endings of the files of a folder that are read as slices."""

_SAME_PLACE = 1e-3
"""Difference below which pixel vectors and positions (mm) count as equal, because DICOM writes them as decimals."""

_ONE_SLICE_A_FILE = "Export the series as one grey image a slice"


@dataclass(frozen=True, eq=False)
class ImageSlice:
    """One image slice and the positions of its pixels."""

    file: str
    grey: Float[np.ndarray, "rows columns"]
    origin_mm: Float[np.ndarray, "3"]
    """Position of the middle of pixel (0, 0)."""
    x_mm: Float[np.ndarray, "3"]
    """Vector from a pixel to the next pixel in its row."""
    y_mm: Float[np.ndarray, "3"]
    """Vector from a pixel to the next pixel in its column."""

    def to_mm(self, points_px: Float[np.ndarray, "2 n"]) -> Float[np.ndarray, "3 n"]:
        """Convert points in pixels to positions in mm."""
        x, y = points_px
        return self.origin_mm[:, None] + self.x_mm[:, None] * x + self.y_mm[:, None] * y


def require_extra() -> None:
    """Raise InputError if a package of the extra ``contour`` is not installed."""
    missing = [package for module, package in _EXTRA.items() if importlib.util.find_spec(module) is None]
    if missing:
        cause = f"contours need {' and '.join(missing)}, not installed here"
        raise InputError("girdle contour", None, cause, f"Install: {pip_install(*missing)}")


def read_slices(
    paths: Sequence[Path], pixel_mm: float | None = None, slice_mm: float | None = None
) -> list[ImageSlice]:
    """Read slices, one per file, in the order of their positions; a folder stands for all its files.

    ``pixel_mm`` and ``slice_mm`` hold for images that state no positions. Such images are in natural order of their
    names: numbers in the names count as numbers. InputError where a file is no slice, or where the slices do not form
    one stack.
    """
    require_extra()
    files = sorted(_files(paths), key=_natural)
    dicom = [_is_dicom(path) for path in files]
    if all(dicom):
        return _stacked([_dicom(path) for path in files])
    if any(dicom):
        one = files[dicom.index(False)]
        raise InputError(str(one), None, "this is no DICOM file, and others are", "Give slices of one kind")
    return _placed([_image(path) for path in files], pixel_mm, slice_mm)


def _files(paths: Iterable[Path]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = [one for one in path.iterdir() if one.is_file() and one.suffix.lower() in _ENDINGS]
            if not inside:
                raise InputError(str(path), None, "there is no image in this folder", "Give DICOM or PNG files")
            found += inside
        else:
            found.append(path)
    return found


def _natural(path: Path) -> list[tuple[int, str]]:
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"(\d+)", path.name)]


def _is_dicom(path: Path) -> bool:
    from pydicom.misc import is_dicom

    try:
        return is_dicom(path)
    except OSError as error:
        raise unreadable(path, error) from error


def _dicom(path: Path) -> ImageSlice:
    import pydicom

    file = str(path)
    try:
        read = pydicom.dcmread(path)
        grey = np.asarray(read.pixel_array, float)
        position, (dy, dx) = np.array(read.ImagePositionPatient, float), np.array(read.PixelSpacing, float)
        row, column = np.array(read.ImageOrientationPatient, float).reshape(2, 3)
    except AttributeError as error:
        cause = f"it does not say where its pixels are or has none ({error})"
        raise InputError(file, None, cause, "Export the series of slices, not a report or a view") from error
    except Exception as error:  # pydicom's decoders raise exceptions of many types
        remedy = "Export the series uncompressed (Explicit VR Little Endian)"
        raise InputError(file, None, f"the image cannot be decoded ({error})", remedy) from error
    if grey.ndim != 2:
        raise InputError(file, None, "it holds several frames, or colours", _ONE_SLICE_A_FILE)
    return ImageSlice(file, grey, position, dx * row, dy * column)


def _image(path: Path) -> ImageSlice:
    from PIL import Image

    try:
        with Image.open(path) as opened:
            grey = np.asarray(opened if opened.mode in ("F", "I", "I;16", "I;16B", "L") else opened.convert("L"), float)
    except Exception as error:  # Pillow's decoders raise exceptions of many types
        raise InputError(str(path), None, "this is no image that can be read", "Give DICOM or PNG files") from error
    nothing = np.full(3, np.nan)
    return ImageSlice(str(path), grey, nothing, nothing, nothing)


def _placed(slices: list[ImageSlice], pixel_mm: float | None, slice_mm: float | None) -> list[ImageSlice]:
    if pixel_mm is None or slice_mm is None:
        cause = "the images do not say how large a pixel is, and how far apart slices are"
        raise InputError(slices[0].file, None, cause, "Say --pixel-mm and --slice-mm")
    x, y, z = np.diag([pixel_mm, pixel_mm, slice_mm])
    _check_shapes(slices)
    return [replace(one, origin_mm=k * z, x_mm=x, y_mm=y) for k, one in enumerate(slices)]


def _stacked(slices: list[ImageSlice]) -> list[ImageSlice]:
    """Check that slices with positions form one stack, and sort them along the normal of the first slice."""
    first = slices[0]
    for one in slices:
        if not (
            np.allclose(one.x_mm, first.x_mm, atol=_SAME_PLACE) and np.allclose(one.y_mm, first.y_mm, atol=_SAME_PLACE)
        ):
            cause = f"its pixels lie otherwise than those of {first.file}"
            raise InputError(one.file, None, cause, "Give the slices of one series")
    _check_shapes(slices)
    normal = np.cross(first.x_mm, first.y_mm)
    height = [float(one.origin_mm @ normal / np.linalg.norm(normal)) for one in slices]
    order = np.argsort(height)
    for before, after in pairwise(order.tolist()):
        if height[after] - height[before] < _SAME_PLACE:
            cause = f"it is in the same place as {slices[before].file}"
            raise InputError(slices[after].file, None, cause, "Give each slice once, of one series")
    return [slices[k] for k in order]


def _check_shapes(slices: Sequence[ImageSlice]) -> None:
    for one in slices:
        if one.grey.shape != slices[0].grey.shape:
            (rows, columns), (y, x) = one.grey.shape, slices[0].grey.shape
            cause = f"it has {columns} x {rows} pixels and {slices[0].file} {x} x {y}"
            raise InputError(one.file, None, cause, "Give the slices of one series")
