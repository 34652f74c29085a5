# SPDX-License-Identifier: Apache-2.0
"""What every peer computes: the filter's matrices, the controller's parameters, and the inputs of each."""

from __future__ import annotations

import math

import numpy as np

Matrix = np.ndarray

DT = 0.01
STEPS = 2000
INERTIA = [[0.02, 0.0, -0.001], [0.0, 0.025, 0.0], [-0.001, 0.0, 0.04]]
GAINS = {"attitude_gain": 8.0, "rate_gain": 20.0, "integral_gain": 4.0, "limit": 0.5, "dt": DT}


def kalman_model(n: int) -> dict[str, Matrix]:
    """Three axes of n/3 integrators each, whose last derivative is driven by noise; positions are measured. The states stand
    in the order of their derivatives: all positions, all velocities, …"""
    order = n // 3
    axis = np.array(
        [[DT ** (j - i) / math.factorial(j - i) if j >= i else 0.0 for j in range(order)] for i in range(order)]
    )
    drive = np.array([[DT ** (order - i) / math.factorial(order - i)] for i in range(order)])
    three = np.eye(3)
    return {
        "f": np.kron(axis, three),
        "h": np.kron(np.eye(1, order), three),
        "q": np.kron(drive @ drive.T * 4.0 + 1e-9 * np.eye(order), three),
        "r": np.diag([0.04, 0.04, 0.09]),
    }


def kalman_inputs() -> Matrix:
    """Noisy positions on a curve."""
    rng = np.random.default_rng(1)
    t = DT * np.arange(STEPS)
    curve = np.column_stack([np.sin(t), 2.0 * np.cos(0.5 * t), 0.1 * t])
    return np.ascontiguousarray(curve + rng.normal(scale=[0.2, 0.2, 0.3], size=curve.shape))


def attitude_inputs() -> Matrix:
    """Attitude, rate, wanted attitude, wanted rate; both attitudes drift, so that errors of both signs occur."""
    rng = np.random.default_rng(2)

    def attitudes() -> Matrix:
        walk = np.cumsum(rng.normal(size=(STEPS, 4)), axis=0)
        unit: Matrix = walk / np.linalg.norm(walk, axis=1)[:, None]
        return unit

    rates = [rng.normal(size=(STEPS, 3)) for _ in range(2)]
    return np.ascontiguousarray(np.column_stack([attitudes(), rates[0], attitudes(), rates[1]]))


def kalman_numpy(model: dict[str, Matrix], inputs: Matrix) -> Matrix:
    """The filter as it is written with NumPy; the result is x, then P row by row."""
    f, h, q, r = (model[name] for name in "fhqr")
    n = len(f)
    x, p = np.zeros(n), np.zeros((n, n))
    for z in inputs:
        x, p = f @ x, f @ p @ f.T + q
        hp = h @ p
        k = p @ h.T @ np.linalg.inv(hp @ h.T + r)
        x, p = x + k @ (z - h @ x), p - k @ hp
    return np.concatenate([x, p.ravel()])


def attitude_numpy(inputs: Matrix) -> Matrix:
    """The controller as it is written with NumPy; the result is the torque, then the integral."""
    inertia = np.array(INERTIA)
    attitude_gain, rate_gain, integral_gain, limit, _ = GAINS.values()
    integral = torque = np.zeros(3)
    for u in inputs:
        q, rate, q_wanted, rate_wanted = u[:4], u[4:7], u[7:11], u[11:]
        vector = q[0] * q_wanted[1:] - q_wanted[0] * q[1:] - np.cross(q[1:], q_wanted[1:])
        side = 2.0 if q @ q_wanted >= 0.0 else -2.0
        error = rate_wanted + side * attitude_gain * vector - rate
        integral = np.clip(integral + DT * error, -limit, limit)
        torque = inertia @ (rate_gain * error + integral_gain * integral) + np.cross(rate, inertia @ rate)
    return np.concatenate([torque, integral])
