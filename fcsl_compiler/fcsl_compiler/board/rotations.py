# SPDX-License-Identifier: Apache-2.0
"""How a device is mounted: rotations from its axes to those of the body."""

from __future__ import annotations

import itertools
import math

from ..model.types import F64, Array
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode

#: 3x3, row by row.
Matrix = tuple[float, ...]

IDENTITY: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_TOLERANCE = 1e-6

_HALF = math.sqrt(0.5)
#: Of the multiples of 45 degrees; exact where the cosine is a whole number.
_COSINES = (1.0, _HALF, 0.0, -_HALF, -1.0, -_HALF, 0.0, _HALF)


def product(a: Matrix, b: Matrix) -> Matrix:
    """The matrix a·b."""
    # No sum(): it rounds differently in Python 3.12. Adding 0.0 makes 0.0 of -0.0: equal rotations have equal bits.
    return tuple(
        a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j] + 0.0 for i in range(3) for j in range(3)
    )


def determinant(m: Matrix) -> float:
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6])


def from_angles(roll: int, pitch: int, yaw: int) -> Matrix:
    """Rz(yaw) · Ry(pitch) · Rx(roll); multiples of 45 degrees."""
    (cr, sr), (cp, sp), (cy, sy) = map(_cos_sin, (roll, pitch, yaw))
    about_x = (1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr)
    about_y = (cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp)
    about_z = (cy, -sy, 0.0, sy, cy, 0.0, 0.0, 0.0, 1.0)
    return product(about_z, product(about_y, about_x))


def _cos_sin(degrees: int) -> tuple[float, float]:
    eighth = degrees // 45
    return _COSINES[eighth % 8], _COSINES[(eighth - 2) % 8]


def _name(angles: tuple[int, int, int]) -> str:
    words = [f"{axis}_{angle}" for axis, angle in zip(("roll", "pitch", "yaw"), angles, strict=True) if angle]
    return "_".join(words) or "none"


#: Angles (roll, pitch, yaw) by name, such as roll_180_yaw_90: the names of ArduPilot and MAVLink.
NAMED: dict[str, tuple[int, int, int]] = {
    _name((roll, pitch, yaw)): (roll, pitch, yaw) for roll, pitch, yaw in itertools.product(range(0, 360, 45), repeat=3)
}


def matrix_problem(m: Matrix) -> str:
    """Why a matrix is no rotation; "" if it is one."""
    rows = (m[0:3], m[3:6], m[6:9])
    for i, row in enumerate(rows):
        length = math.hypot(*row)
        if abs(length - 1.0) > _TOLERANCE:
            return f"row {i + 1} has the length {length:.7g}, not 1"
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if abs(sum(a * b for a, b in zip(rows[i], rows[j], strict=True))) > _TOLERANCE:
            return f"rows {i + 1} and {j + 1} are not orthogonal"
    return "" if determinant(m) > 0.0 else "its determinant is -1: it is a reflection"


def read_rotation(node: JsonNode | None, reader: ConfigReader) -> Matrix | None:
    """A name or a 3x3 matrix; without a node the identity. None after reporting an error."""
    if node is None:
        return IDENTITY
    if node.kind == "array":
        return _matrix(node, reader)
    text = reader.string(node, "`rotation`", "roll_180_yaw_90")
    if text is None:
        return None
    if text not in NAMED:
        fix = "angles are multiples of 45 from 45 to 315, in the order roll, pitch, yaw; or write a 3x3 matrix"
        reader.sink.error("E510", f"no rotation `{text}`", node.span, help=fix)
        return None
    return from_angles(*NAMED[text])


def _matrix(node: JsonNode, reader: ConfigReader) -> Matrix | None:
    values = reader.value(node, Array(F64, (3, 3)), "`rotation`")
    if values is None:
        return None
    m = tuple(map(float, values))
    problem = matrix_problem(m)
    if problem:
        fix = "write the body's axes in the device's, row by row, with 7 digits"
        reader.sink.error("E510", f"the matrix is no rotation: {problem}", node.span, help=fix)
        return None
    return m
