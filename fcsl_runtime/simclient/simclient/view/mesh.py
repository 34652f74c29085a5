# SPDX-License-Identifier: Apache-2.0
"""The size of a mesh file (.stl, .obj, .glb), which may come from anywhere: nothing but its extent is read here."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ..bag import Array

FILE_BYTES_MAX = 64 * 1024 * 1024
_STL_HEAD, _STL_TRIANGLE = 84, np.dtype([("numbers", "<f4", 12), ("attribute", "<u2")])
_GLB_HEAD, _GLB_CHUNK = struct.Struct("<4sII"), struct.Struct("<I4s")


def extent_of(path: Path) -> float:
    """The largest extent of the mesh in its own units, above 0. Raises OSError, and ValueError with the cause.

    Of a .glb, the transforms of nodes are not applied.
    """
    if not path.is_file():
        raise ValueError("no such file")
    if path.stat().st_size > FILE_BYTES_MAX:
        raise ValueError(f"more than {FILE_BYTES_MAX} bytes")
    data = path.read_bytes()
    try:
        corners = {".stl": _stl, ".obj": _obj, ".glb": _glb}[path.suffix.lower()](data)
    except (KeyError, IndexError, TypeError, ValueError, struct.error, RecursionError):
        raise ValueError("not a mesh of this kind") from None
    if not len(corners) or not np.isfinite(corners).all():
        raise ValueError("a mesh without corners")
    extent = float(np.ptp(corners, axis=0).max())
    if not extent > 0.0:
        raise ValueError("a mesh without extent")
    return extent


def _stl(data: bytes) -> Array:
    """Corners, shape (N, 3), of a binary or a text file."""
    count = int.from_bytes(data[80:_STL_HEAD], "little")
    if len(data) == _STL_HEAD + count * _STL_TRIANGLE.itemsize:
        triangles = np.frombuffer(data, _STL_TRIANGLE, offset=_STL_HEAD)
        return triangles["numbers"][:, 3:].reshape(-1, 3).astype(np.float64)
    return _lines(data, b"vertex")


def _obj(data: bytes) -> Array:
    return _lines(data, b"v")


def _lines(data: bytes, word: bytes) -> Array:
    """The three numbers of each line that begins with `word`."""
    split = (line.split() for line in data.splitlines())
    return np.array([[float(text) for text in words[1:4]] for words in split if words[:1] == [word]]).reshape(-1, 3)


def _glb(data: bytes) -> Array:
    """The bounds that a glTF file must say of its positions."""
    magic, version, _ = _GLB_HEAD.unpack_from(data)
    size, kind = _GLB_CHUNK.unpack_from(data, _GLB_HEAD.size)
    if (magic, version, kind) != (b"glTF", 2, b"JSON"):
        raise ValueError
    begin = _GLB_HEAD.size + _GLB_CHUNK.size
    document: Any = json.loads(data[begin : begin + size])
    numbers = {primitive["attributes"]["POSITION"] for mesh in document["meshes"] for primitive in mesh["primitives"]}
    bounds = [document["accessors"][number][side] for number in numbers for side in ("min", "max")]
    return np.array(bounds, dtype=np.float64).reshape(-1, 3)
