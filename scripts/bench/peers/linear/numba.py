# SPDX-License-Identifier: Apache-2.0
"""The peers in Numba: loops over arrays of fixed size, which it compiles for this processor."""

from __future__ import annotations

import numpy as np
from numba import njit

from .model import DT, GAINS, INERTIA, Matrix

_INERTIA = np.array(INERTIA)
_ATTITUDE, _RATE, _INTEGRAL, _LIMIT, _ = GAINS.values()


@njit
def _multiply(a, b, c):  # type: ignore[no-untyped-def]
    """c = a b."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            c[i, j] = 0.0
        for p in range(a.shape[1]):
            for j in range(b.shape[1]):
                c[i, j] += a[i, p] * b[p, j]


@njit
def _kalman(f, h, q, r, inputs):  # type: ignore[no-untyped-def]
    n = f.shape[0]
    x, p = np.zeros((n, 1)), np.zeros((n, n))
    ft, ht = np.ascontiguousarray(f.T), np.ascontiguousarray(h.T)
    predicted, fp, kp = np.zeros((n, 1)), np.zeros((n, n)), np.zeros((n, n))
    hp, pht, s, k = np.zeros((3, n)), np.zeros((n, 3)), np.zeros((3, 3)), np.zeros((n, 3))
    seen, innovation, step = np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((n, 1))
    for z in inputs:
        _multiply(f, x, predicted)
        _multiply(f, p, fp)
        _multiply(fp, ft, p)
        p += q
        _multiply(h, p, hp)
        _multiply(p, ht, pht)
        _multiply(hp, ht, s)
        s += r
        _multiply(pht, np.linalg.inv(s), k)
        _multiply(h, predicted, seen)
        for i in range(3):
            innovation[i, 0] = z[i] - seen[i, 0]
        _multiply(k, innovation, step)
        for i in range(n):
            x[i, 0] = predicted[i, 0] + step[i, 0]
        _multiply(k, hp, kp)
        p -= kp
    return np.concatenate((x.ravel(), p.ravel()))


def kalman_numba(model: dict[str, Matrix], inputs: Matrix) -> Matrix:
    """The result is x, then P row by row."""
    result: Matrix = _kalman(model["f"], model["h"], model["q"], model["r"], inputs)
    return result


@njit
def _cross(a, b):  # type: ignore[no-untyped-def]
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit
def _inertia(v):  # type: ignore[no-untyped-def]
    return (
        _INERTIA[0, 0] * v[0] + _INERTIA[0, 1] * v[1] + _INERTIA[0, 2] * v[2],
        _INERTIA[1, 0] * v[0] + _INERTIA[1, 1] * v[1] + _INERTIA[1, 2] * v[2],
        _INERTIA[2, 0] * v[0] + _INERTIA[2, 1] * v[1] + _INERTIA[2, 2] * v[2],
    )


@njit
def _attitude(inputs):  # type: ignore[no-untyped-def]
    integral, torque = np.zeros(3), np.zeros(3)
    wanted = np.zeros(3)
    for u in inputs:
        q, rate, w, rate_wanted = u[:4], u[4:7], u[7:11], u[11:]
        turned = _cross(q[1:], w[1:])
        near = q[0] * w[0] + q[1] * w[1] + q[2] * w[2] + q[3] * w[3]
        side = 2.0 if near >= 0.0 else -2.0
        for i in range(3):
            vector = q[0] * w[i + 1] - w[0] * q[i + 1] - turned[i]
            error = rate_wanted[i] + side * _ATTITUDE * vector - rate[i]
            integral[i] = min(max(integral[i] + DT * error, -_LIMIT), _LIMIT)
            wanted[i] = _RATE * error + _INTEGRAL * integral[i]
        moment, turning = _inertia(wanted), _cross(rate, _inertia(rate))
        for i in range(3):
            torque[i] = moment[i] + turning[i]
    return np.concatenate((torque, integral))


def attitude_numba(inputs: Matrix) -> Matrix:
    """The result is the torque, then the integral."""
    result: Matrix = _attitude(inputs)
    return result
