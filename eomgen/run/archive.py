"""NumPy's .npz files with a digest, by which damage is detected.

A .npz is a zip file. Its checksums cover the contents of its members, but not their names or
positions. So the last member is a digest of the names, types, shapes and bytes of all others.
"""

import hashlib
import io
import math
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

Array = NDArray[Any]

DIGEST = "digest"
_SUFFIX = ".npy"


def packed(members: Mapping[str, Array]) -> bytes:
    """An archive of arrays, in their order; the same arrays give the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in (*members.items(), (DIGEST, np.array(_digest(members)))):
            stream = io.BytesIO()
            npy.write_array(stream, np.asarray(array), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(name + _SUFFIX), stream.getvalue())
    return buffer.getvalue()


def unpacked(data: bytes) -> dict[str, Array]:
    """The arrays of an archive, including its digest. They never need more memory than its size.

    Never executes code from the archive. Raises `ValueError`, or any error of `zipfile` and NumPy,
    if it is not such an archive.
    """
    members: dict[str, Array] = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(about.file_size for about in archive.infolist()) > len(data):
            raise ValueError("members share bytes, or hold more than the file")
        for about in archive.infolist():
            name = about.filename.removesuffix(_SUFFIX)
            if about.compress_type != zipfile.ZIP_STORED:
                raise ValueError("a member is compressed")
            if name in members or name == about.filename:
                raise ValueError("a member's name occurs twice, or does not end in .npy")
            members[name] = _array(archive.read(about))
    return members


def checked(members: dict[str, Array]) -> dict[str, Array]:
    """The arrays without the digest. Raises `ValueError` if it is missing or does not match."""
    rest = {name: array for name, array in members.items() if name != DIGEST}
    if DIGEST not in members or not np.array_equal(members[DIGEST], np.array(_digest(rest))):
        raise ValueError("the digest does not match the content")
    return rest


def _array(raw: bytes) -> Array:
    """An array from the bytes of a .npy file. Raises `ValueError` if its header does not match its
    size.
    """
    stream = io.BytesIO(raw)
    version = npy.read_magic(stream)
    if version != (1, 0):
        raise ValueError("not the first version of NumPy's format")
    shape, fortran, dtype = npy.read_array_header_1_0(stream)
    start = stream.tell()
    size = math.prod(shape)
    if dtype.hasobject or size > len(raw) or size * dtype.itemsize != len(raw) - start:
        raise ValueError("the header does not match the content")
    return np.ndarray(shape, dtype, raw, start, order="F" if fortran else "C").copy()


def _digest(members: Mapping[str, Array]) -> str:
    digest = hashlib.sha256()
    for name, array in members.items():
        content = array.tobytes()
        digest.update(repr((name, array.dtype.str, array.shape, len(content))).encode())
        digest.update(content)
    return digest.hexdigest()
