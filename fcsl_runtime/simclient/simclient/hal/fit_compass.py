# SPDX-License-Identifier: Apache-2.0
"""Hard and soft iron of a compass from readings of a vehicle that is turned: matrix · (reading - offset) lies on a sphere.

First an ellipsoid by linear least squares (x'Qx + b'x = 1), then the distances from the sphere are minimized. The matrix is symmetric,
so it does not rotate; its determinant is 1, so it keeps the strength of the field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .least_squares import Vector, minimize

#: Row and column of the six numbers of a symmetric matrix.
_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
_DIRECTIONS = 48


@dataclass(frozen=True)
class CompassFit:
    """`field`: the radius of the sphere, in T; `residual`: root mean square of the distances from it, as a part of `field`;
    `coverage`: the part of all directions that the readings had, 0 to 1."""

    offset: Vector
    matrix: Vector
    field: float
    residual: float
    coverage: float


def fit_compass(readings: Vector) -> CompassFit | None:
    """`readings`: n × 3. None where they lie on no ellipsoid."""
    middle, size = _middle_and_size(readings)
    if len(readings) < 9 or size == 0.0:
        return None
    points = (readings - middle) / size
    start = _algebraic(points)
    if start is None:
        return None
    found = minimize(lambda parameters: _distances(points, parameters), start)
    matrix, offset = _symmetric(found[:6]), found[6:]
    if np.linalg.eigvalsh(matrix)[0] <= 0.0:
        return None
    factor = np.linalg.det(matrix) ** (1.0 / 3.0)
    residual = float(np.sqrt(np.mean(_distances(points, found)[0] ** 2)))
    part = coverage((points - offset) @ matrix)
    return CompassFit(middle + size * offset, matrix / factor, float(size / factor), residual, part)


def coverage(vectors: Vector) -> float:
    """The part of evenly spread directions that has a vector near."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    nearest = (vectors[lengths[:, 0] > 0.0] / lengths[lengths[:, 0] > 0.0]) @ _spread().T
    return len(np.unique(nearest.argmax(axis=1))) / _DIRECTIONS if len(nearest) else 0.0


def turned_coverage(readings: Vector, field_min: float) -> float:
    """A first guess of the coverage while the vehicle is turned; 0 before every axis has seen both ends of a field."""
    middle, _ = _middle_and_size(readings)
    half = (readings.max(axis=0) - readings.min(axis=0)) / 2.0
    return coverage((readings - middle) / half) if (half >= field_min).all() else 0.0


def _middle_and_size(readings: Vector) -> tuple[Vector, float]:
    low, high = readings.min(axis=0), readings.max(axis=0)
    return (low + high) / 2.0, float((high - low).max() / 2.0)


def _spread() -> Vector:
    """Directions on a spiral, at equal distances (Fibonacci sphere)."""
    numbers = np.arange(_DIRECTIONS) + 0.5
    z, turn = 1.0 - 2.0 * numbers / _DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * numbers
    across = np.sqrt(1.0 - z * z)
    return np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


def _symmetric(six: Vector) -> Vector:
    matrix = np.empty((3, 3))
    matrix[_ROWS, _COLUMNS] = six
    matrix[_COLUMNS, _ROWS] = six
    return matrix


def _algebraic(points: Vector) -> Vector | None:
    """The six numbers of the matrix and the offset; None for another quadric than an ellipsoid."""
    twice = np.where(np.equal(_ROWS, _COLUMNS), 1.0, 2.0)
    design = np.hstack([points[:, _ROWS] * points[:, _COLUMNS] * twice, points])
    found = np.linalg.lstsq(design, np.ones(len(points)), rcond=None)[0].astype(np.float64)
    quadratic, linear = _symmetric(found[:6]), found[6:]
    if np.linalg.eigvalsh(quadratic)[0] <= 0.0:
        return None
    offset = -np.linalg.solve(quadratic, linear) / 2.0
    values, vectors = np.linalg.eigh(quadratic / (1.0 + offset @ quadratic @ offset))
    root = vectors * np.sqrt(values) @ vectors.T
    return np.concatenate([root[_ROWS, _COLUMNS], offset])


def _distances(points: Vector, parameters: Vector) -> tuple[Vector, Vector]:
    """Of the points from the unit sphere, and their derivatives."""
    matrix = _symmetric(parameters[:6])
    centred = points - parameters[6:]
    image = centred @ matrix
    length = np.linalg.norm(image, axis=1)
    direction = image / length[:, None]
    by_matrix = direction[:, _ROWS] * centred[:, _COLUMNS]
    mirrored = direction[:, _COLUMNS] * centred[:, _ROWS]
    off_diagonal = np.not_equal(_ROWS, _COLUMNS)
    return length - 1.0, np.hstack([by_matrix + mirrored * off_diagonal, -direction @ matrix])
