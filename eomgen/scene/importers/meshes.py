"""The corners of meshes that a robot file names, and where these files are.

Only files in the robot file's own folder and in allowed folders are read, and none from a network.
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import numpy.typing as npt

from eomgen.base.errors import EomgenError, RunError
from eomgen.base.files import read_plain
from eomgen.scene.importers.collada import corners_of as collada_corners

Array = npt.NDArray[np.float64]
LARGEST_MESH = 100_000_000
LARGEST = 1e30
"""Greatest coordinate of a mesh, in its own unit."""
HEADER = 84
"""Bytes of a binary STL file before its triangles: 80 of text and their number."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("about", "<u2")])
_CORNER = re.compile(rb"^[ \t]*v(?:ertex)?[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
"""A corner of a mesh in text: "vertex x y z" of STL, "v x y z" of OBJ."""


ABSENT, OUTSIDE = "is not there", "is outside of the file's folder"
_DRIVE = re.compile(r"/+[A-Za-z]:")
ELSEWHERE = (ABSENT, OUTSIDE)
"""Reasons that another folder would help against."""


class MeshError(Exception):
    """Why a mesh is not read, as words after its name."""


def find_file(name: str, folders: Sequence[Path]) -> Path:
    """The file that a robot file calls `name`, in one of the folders or below it.

    Of `package://PACKAGE/PATH` it is PACKAGE/PATH or PATH in a folder. Raises `MeshError`.
    """
    try:
        parts = urlsplit(name)
    except ValueError:  # an address of the network that is none
        raise MeshError("is not a file") from None
    if parts.scheme in ("package", "model"):
        rest = unquote(parts.path).lstrip("/")
        tried = [folder / way for folder in folders for way in (f"{parts.netloc}/{rest}", rest)]
    elif parts.scheme in ("", "file"):
        tried = [folder / local(unquote(parts.path)) for folder in folders]
    else:
        raise MeshError("is not a file")
    for path in tried:
        try:
            if path.is_file():
                if any(path.resolve().is_relative_to(folder.resolve()) for folder in folders):
                    return path
                raise MeshError(OUTSIDE)
        except (OSError, ValueError):
            continue
    raise MeshError(ABSENT)


def local(path: str, system: str = os.name) -> str:
    """The path of an address `file:` on a system: of Windows, C:/x.stl for /C:/x.stl."""
    return path.lstrip("/") if system == "nt" and _DRIVE.match(path) else path


def corners_of(path: Path) -> Array:
    """The corners (k, 3) of a mesh, STL, OBJ or COLLADA, in its own unit. Raises `MeshError`."""
    kind = path.suffix.lower()
    if kind not in (".stl", ".obj", ".dae"):
        raise MeshError("is not STL, OBJ or DAE")
    try:
        data = read_plain(path, LARGEST_MESH, name=path.name, error=RunError)
    except EomgenError:
        raise MeshError("cannot be read") from None
    try:
        if kind == ".dae":
            corners = collada_corners(data)
        else:
            corners = _binary(data) if kind == ".stl" and _is_binary(data) else _text(data)
    except (ValueError, TypeError):
        raise MeshError("has corners that are not numbers") from None
    if not len(corners) or not (np.abs(corners) < LARGEST).all():
        raise MeshError("has no corners, or some that are not finite")
    return corners


def _is_binary(data: bytes) -> bool:
    """Whether a file is as long as its number of triangles says; text begins with "solid"."""
    if len(data) < HEADER:
        return False
    count = int.from_bytes(data[80:HEADER], "little")
    exact = len(data) == HEADER + count * TRIANGLE.itemsize
    return exact or not data.lstrip().startswith(b"solid")


def _binary(data: bytes) -> Array:
    count = min(
        int.from_bytes(data[80:HEADER], "little"), (len(data) - HEADER) // TRIANGLE.itemsize
    )
    found = np.frombuffer(data, TRIANGLE, count, HEADER)["corners"].reshape(-1, 3)
    return found.astype(np.float64)


def _text(data: bytes) -> Array:
    return np.array(_CORNER.findall(data)).astype(np.float64).reshape(-1, 3)
