# SPDX-License-Identifier: Apache-2.0
"""The linear design: gains of the attitude, loops, crossovers and margins, from the parameters of machine and plant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from conftest import GRAVITY, PLANT, TICK_HZ, Array, parameters
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are

Response = NDArray[np.complex128]
OMEGA: Array = np.geomspace(0.02, 200.0, 20_000)  # rad/s
S = 1j * OMEGA
DELAY = 0.5 / TICK_HZ  # s: a command holds for a tick; the IMU is read at the tick
WEIGHTS = np.diag([25.0, 100.0, 16.0])  # of the integral, the angle, the rate; that of the angular acceleration is 1


@dataclass(frozen=True)
class Margins:
    crossover: float  # rad/s, the last one
    phase: float  # degrees
    gain: float  # upwards
    sensitivity: float  # the largest


def margins(loop: Response) -> Margins:
    magnitude, phase = np.abs(loop), np.unwrap(np.angle(loop))
    last = np.flatnonzero((magnitude[:-1] >= 1.0) & (magnitude[1:] < 1.0))[-1]
    turns = np.flatnonzero((np.sin(phase[:-1]) < 0.0) & (np.sin(phase[1:]) >= 0.0) & (OMEGA[:-1] > OMEGA[last]))
    distance = np.degrees((phase[last] + 2.0 * np.pi) % (2.0 * np.pi) - np.pi)
    sensitivity = np.abs(1.0 / (1.0 + loop)).max()
    return Margins(float(OMEGA[last]), float(distance), float(1.0 / magnitude[turns[0]]), float(sensitivity))


def closed(loop: Response) -> Response:
    return loop / (1.0 + loop)


def regulator() -> Array:
    """The linear-quadratic gains of integral, angle and rate, of the double integrator."""
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    b = np.array([[0.0], [0.0], [1.0]])
    return np.asarray((b.T @ solve_continuous_are(a, b, WEIGHTS, np.eye(1)))[0])


def servo() -> Response:
    values = PLANT["servo_x"]["parameters"]
    n, d = values["natural_frequency"], values["damping"]
    return np.asarray(n**2 / (S**2 + 2.0 * d * n * S + n**2) * np.exp(-S * DELAY))


def smooth() -> Response:
    """The filter of `Steering`, within its limits."""
    n = parameters("steering")["bandwidth"]
    return np.asarray(n**2 / (S + n) ** 2 * np.exp(-S * DELAY))


def sideways() -> Response:
    """The acceleration of the centre of mass by the angle, over gravity, at half of the propellant.

    The nozzle that turns the body pushes it the other way: a = g angle - I / (m l) angle'', with a zero on the right.
    """
    values = parameters("actuators")
    left = 0.5 * values["full"]
    mass = parameters("propulsion")["dry_mass"] + left
    arm = values["pivot"] - values["tank"] * left / mass
    inertia = values["dry_inertia"] + 0.5 * values["full_inertia"]
    return np.asarray(1.0 - S**2 * inertia / (mass * arm * GRAVITY))


def loops() -> dict[str, Response]:
    """Open loops, each with those inside closed. The plant of the attitude is the double integrator that `Actuators`
    makes, with the servo; `vertical` has the lag of the engine instead."""
    attitude, terminal = parameters("attitude"), parameters("terminal")
    inner = (attitude["k"] + attitude["k_rate"] * S + attitude["k_integral"] / S) / S**2 * servo()
    kv, ki = terminal["kv"], terminal["ki"]
    velocity = (kv[0] + ki[0] / S) / S * smooth() * sideways() * closed(inner)
    lag = 1.0 / (PLANT["engine"]["parameters"]["time_constant"] * S + 1.0)
    return {
        "attitude": inner,
        "velocity": velocity,
        "position": terminal["kp"] / S * closed(velocity),
        "vertical": (kv[2] + ki[2] / S) / S * smooth() * lag,
    }


def step_response(response: Response, time_s: Array) -> Array:
    """Of a stable loop with a gain of 1 at rest: 2/pi times the integral of Re(T) sin(w t) / w."""
    first = 2.0 / np.pi * OMEGA[0] * time_s  # below the first frequency
    waves = [np.trapezoid(response.real * np.sin(OMEGA * t) / OMEGA, OMEGA) for t in time_s]
    return np.asarray(first + 2.0 / np.pi * np.array(waves))
