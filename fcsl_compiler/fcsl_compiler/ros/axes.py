# SPDX-License-Identifier: Apache-2.0
"""Changes of axes; no other module changes axes. Each change is a small matrix, applied in a fixed order.

ROS uses ENU (x east, y north, z up) for world vectors and FLU (x forward, y left, z up) for body vectors; aerospace
uses NED and FRD. An orientation rotates body vectors into world axes, so its axes are a pair, such as `ned/frd`.
Quaternions are w, x, y, z here and x, y, z, w in ROS messages (`XYZW`).

Changes of vectors and covariances only swap elements and change signs, which is exact. A change of a quaternion's world
axes multiplies by sqrt(1/2), so each element is rounded twice. `q` and `-q` are the same orientation; the change there
and back keeps the sign.
"""

from __future__ import annotations

from .message_fields import Kind

#: Row i gives element i of the result as the sum of row[j] * value[j] over all j with row[j] != 0, in order.
Matrix = tuple[tuple[float, ...], ...]
Quaternion = tuple[float, float, float, float]

#: Indices of w, x, y, z in a geometry_msgs/Quaternion.
XYZW = (3, 0, 1, 2)

_IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
#: From ROS's axes to the named ones; each matrix is its own inverse.
_WORLD: dict[str, Matrix] = {"enu": _IDENTITY, "ned": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))}
_BODY: dict[str, Matrix] = {"flu": _IDENTITY, "frd": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))}

_SQRT_HALF = float.fromhex("0x1.6a09e667f3bcdp-1")
#: The same as quaternions: NED is ENU turned by 180 degrees about the bisector of x and y, FRD is FLU turned so about
#: x.
_WORLD_TURN: dict[str, Quaternion] = {"enu": (1.0, 0.0, 0.0, 0.0), "ned": (0.0, _SQRT_HALF, _SQRT_HALF, 0.0)}
_BODY_TURN: dict[str, Quaternion] = {"flu": (1.0, 0.0, 0.0, 0.0), "frd": (0.0, 1.0, 0.0, 0.0)}


class AxesError(ValueError):
    """Axes that do not fit each other or the kind of value."""


def conversion(kind: Kind, count: int, source: str, target: str) -> Matrix:
    """The matrix that converts `count` numbers of one `kind` from the axes `source` to `target`.

    The empty string means ROS's axes. Raises AxesError.
    """
    for word in (source, target):
        if word and word not in kind.axes:
            choices = f"the axes of {kind.value} are {', '.join(kind.axes)}" if kind.axes else "they have no axes"
            raise AxesError(f"axes `{word}` of {kind.value}: {choices}")
    if kind is Kind.QUATERNION:
        return _quaternion(source or "enu/flu", target or "enu/flu")
    if not source and not target:
        return identity(count)
    blocks = 2 if kind is Kind.VECTORS or count == 36 else 1
    matrix = _blocks(_vector(source, target), blocks)
    return _both_sides(matrix) if kind is Kind.COVARIANCE else matrix


def mounting(kind: Kind, count: int, matrix: tuple[float, ...]) -> Matrix:
    """The matrix that turns `count` numbers of one `kind` from the axes of a sensor into those of the body that it sits
    on. `matrix`, 3x3 row by row, turns vectors so. An orientation is that of the body instead of the sensor's.

    Raises AxesError.
    """
    if kind is Kind.QUATERNION:
        back = _conjugate(_quaternion_of(matrix))
        return tuple(zip(*(_multiply(_unit(i), back) for i in range(4)), strict=True))
    if not kind.axes:
        raise AxesError(f"a `rotation` of {kind.value}: they have no axes")
    rows: Matrix = (matrix[0:3], matrix[3:6], matrix[6:9])
    turned = _blocks(rows, 2 if kind is Kind.VECTORS or count == 36 else 1)
    return _both_sides(turned) if kind is Kind.COVARIANCE else turned


def identity(count: int) -> Matrix:
    return tuple(tuple(float(i == j) for j in range(count)) for i in range(count))


def permutation(order: tuple[int, ...]) -> Matrix:
    """The matrix for which element i of the result is element order[i]."""
    return tuple(tuple(float(j == at) for j in range(len(order))) for at in order)


def inverse(matrix: Matrix) -> Matrix:
    """The transpose, since all matrices of this module are orthogonal."""
    return tuple(zip(*matrix, strict=True))


def product(a: Matrix, b: Matrix) -> Matrix:
    """First b, then a."""
    columns = inverse(b)
    return tuple(tuple(_dot(row, column) for column in columns) for row in a)


def _dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    total = 0.0
    for x, y in zip(a, b, strict=True):
        total += x * y
    return total


def _vector(source: str, target: str) -> Matrix:
    for family in (_WORLD, _BODY):
        if source in ("", *family) and target in ("", *family):
            ros = next(iter(family))
            return product(family[target or ros], family[source or ros])
    raise AxesError(
        f"`{source}` and `{target}`: one is of the world, the other of a body; only an orientation relates them"
    )


def _blocks(matrix: Matrix, count: int) -> Matrix:
    """Block-diagonal: `matrix` for each of `count` consecutive vectors."""
    size = len(matrix)
    rows = []
    for block in range(count):
        before, behind = (0.0,) * (size * block), (0.0,) * (size * (count - 1 - block))
        rows += [(*before, *row, *behind) for row in matrix]
    return tuple(rows)


def _both_sides(matrix: Matrix) -> Matrix:
    """C → M C Mᵀ, as a matrix on the elements of C in row-major order."""
    return tuple(tuple(x * y for x in left for y in right) for left in matrix for right in matrix)


def _quaternion(source: str, target: str) -> Matrix:
    """q → w q b: w rotates the world axes, b the body axes back."""
    source_world, source_body = source.split("/")
    target_world, target_body = target.split("/")
    world = _multiply(_WORLD_TURN[target_world], _conjugate(_WORLD_TURN[source_world]))
    body = _multiply(_BODY_TURN[source_body], _conjugate(_BODY_TURN[target_body]))
    if source_world == target_world:
        world = _WORLD_TURN["enu"]
    columns = [_multiply(_multiply(world, _unit(i)), body) for i in range(4)]
    return tuple(zip(*columns, strict=True))


def _quaternion_of(m: tuple[float, ...]) -> Quaternion:
    """The rotation of a matrix. Of the four ways to begin, the one without cancellation (Shepperd)."""
    squares = (1 + m[0] + m[4] + m[8], 1 + m[0] - m[4] - m[8], 1 - m[0] + m[4] - m[8], 1 - m[0] - m[4] + m[8])
    largest = squares.index(max(squares))
    x, y, z = m[7] - m[5], m[2] - m[6], m[3] - m[1]
    xy, xz, yz = m[3] + m[1], m[2] + m[6], m[7] + m[5]
    sums = ((squares[0], x, y, z), (x, squares[1], xy, xz), (y, xy, squares[2], yz), (z, xz, yz, squares[3]))[largest]
    twice = 2.0 * squares[largest] ** 0.5
    return (sums[0] / twice, sums[1] / twice, sums[2] / twice, sums[3] / twice)


def _unit(i: int) -> Quaternion:
    w, x, y, z = (float(i == j) for j in range(4))
    return (w, x, y, z)


def _conjugate(q: Quaternion) -> Quaternion:
    return (q[0], -q[1], -q[2], -q[3])


def _multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton's product."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )
