# SPDX-License-Identifier: Apache-2.0
"""The satellite that all simulators fly: a rigid body with an axis of symmetry, free of torques, in an orbit around a point mass.
Where it is at any time is known in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence

Vector = list[float]

#: m^3/s^2: that of JSBSim 1.3.3 for the Earth, which is in feet there.
MU = 14.0764417572e15 * 0.3048**3
MASS = 100.0
#: kg m^2, in principal axes.
INERTIA = [20.0, 20.0, 30.0]
POSITION = [7.0e6, 0.0, 0.0]
VELOCITY = [0.0, 6.5e3, 4.0e3]
#: From the body to the inertial frame: w, x, y, z.
ATTITUDE = [1.0, 0.0, 0.0, 0.0]
#: rad/s, in the body.
RATES = [0.1, 0.0, 0.3]
START = [*POSITION, *VELOCITY, *ATTITUDE, *RATES]
STEP_S = 0.001


def errors(t: float, position: Sequence[float], attitude: Sequence[float]) -> tuple[float, float]:
    """How far away from the closed form after t seconds: in m, and in rad."""
    away = math.dist(position, orbit(t))
    w, x, y, z = attitude
    turned = multiply([w, -x, -y, -z], turn(t))
    return away, 2.0 * math.asin(min(1.0, math.hypot(*turned[1:]) / math.hypot(*turned)))


def orbit(t: float) -> Vector:
    """By Kepler's equation for the change of the eccentric anomaly, and Lagrange's coefficients."""
    r0 = math.hypot(*POSITION)
    a = 1.0 / (2.0 / r0 - math.hypot(*VELOCITY) ** 2 / MU)
    rate = math.sqrt(MU / a**3)
    radial = sum(p * v for p, v in zip(POSITION, VELOCITY, strict=True)) / math.sqrt(MU * a)
    change = rate * t
    for _ in range(20):
        off = change - (1 - r0 / a) * math.sin(change) + radial * (1 - math.cos(change)) - rate * t
        change -= off / (1 - (1 - r0 / a) * math.cos(change) + radial * math.sin(change))
    f = 1 - a / r0 * (1 - math.cos(change))
    g = t - (change - math.sin(change)) / rate
    return [f * p + g * v for p, v in zip(POSITION, VELOCITY, strict=True)]


def turn(t: float) -> Vector:
    """The quaternion: the angular momentum stands still, and the body turns around it and around its own axis."""
    across, along = INERTIA[0], INERTIA[2]
    momentum = rotate(ATTITUDE, [i * w for i, w in zip(INERTIA, RATES, strict=True)])
    around = about([h / across * t for h in momentum])
    return multiply(multiply(around, ATTITUDE), about([0.0, 0.0, RATES[2] * (1.0 - along / across) * t]))


def about(angle: Vector) -> Vector:
    """The quaternion of a rotation."""
    size = math.hypot(*angle)
    return [math.cos(size / 2), *(math.sin(size / 2) * part / size for part in angle)] if size else [1.0, 0.0, 0.0, 0.0]


def multiply(a: Sequence[float], b: Sequence[float]) -> Vector:
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    ]


def rotate(q: Sequence[float], v: Sequence[float]) -> Vector:
    return multiply(multiply(q, [0.0, *v]), [q[0], -q[1], -q[2], -q[3]])[1:]
