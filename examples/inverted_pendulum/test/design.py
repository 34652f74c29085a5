# SPDX-License-Identifier: Apache-2.0
"""The linear design: plant near upright, regulator, stationary filter, the loop that they make, and its margins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from conftest import HZ, Array, parameters
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

G = 9.81  # m/s^2
LAG = 0.002  # s, of the motor
ERROR = np.array([0.1, 0.1])  # m, rad: of the state that is worth
EFFORT = 2.0  # N
FORCE_LIMIT = 10.0  # N
SEEN = np.eye(2, 4)  # position and angle
Response = NDArray[np.complex128]


def plant() -> tuple[Array, Array]:
    """A and B of position, angle, speed, rate, for a force (N) and a torque on the pole (N m), in continuous time."""
    p = parameters("estimator")["plant"]
    moment = p["pole_mass"] * p["pole_length"]
    inertia = p["pole_inertia"] + moment * p["pole_length"]
    mass = np.array([[p["cart_mass"] + p["pole_mass"], moment], [moment, inertia]])
    stiff = np.array([[0.0, 0.0], [0.0, moment * G]])
    damp = np.diag([-p["cart_friction"], -p["pivot_friction"]])
    a, b = np.zeros((4, 4)), np.zeros((4, 2))
    a[:2, 2:] = np.eye(2)
    a[2:] = np.linalg.solve(mass, np.hstack([stiff, damp]))
    b[2:] = np.linalg.inv(mass)
    return a, b


def held(a: Array, b: Array) -> tuple[Array, Array]:
    """The same from tick to tick, for an input that holds for a tick."""
    states, inputs = b.shape
    whole = np.zeros((states + inputs, states + inputs))
    whole[:states, :states], whole[:states, states:] = a, b
    step = expm(whole / HZ)
    return step[:states, :states], step[:states, states:]


def regulator() -> tuple[Array, Array]:
    """k of F = -k x, and P of the cost x^T P x, by Bryson's rule."""
    a, b = plant()
    f, g = held(a, b[:, :1])
    p = solve_discrete_are(f, g, np.diag([*(ERROR**-2), 0.0, 0.0]), np.array([[EFFORT**-2]]))
    k = np.linalg.solve(EFFORT**-2 + g.T @ p @ g, g.T @ p @ f)
    return k[0], p


def stationary_filter() -> tuple[Array, Array]:
    """The gain of the Kalman filter, and the covariance after the samples."""
    estimator = parameters("estimator")
    f, _ = held(*plant())
    impulse = np.vstack([np.eye(2) / (2.0 * HZ), np.eye(2)]) @ plant()[1][2:] / HZ
    q = impulse @ np.diag([estimator["force_sigma"], estimator["torque_sigma"]]) ** 2 @ impulse.T
    r = np.diag(
        [estimator[f"{name}_quantum"] ** 2 / 12.0 + estimator[f"{name}_sigma"] ** 2 for name in ("cart", "pole")]
    )
    before = solve_discrete_are(f.T, SEEN.T, q, r)
    gain = before @ SEEN.T @ np.linalg.inv(SEEN @ before @ SEEN.T + r)
    return gain, (np.eye(4) - gain @ SEEN) @ before


@dataclass(frozen=True)
class Loop:
    """Plant with the lag of the motor (5 states; inputs: command, push), and the controller from samples to command."""

    f: Array
    command: Array
    push: Array
    model: Array  # of the filter: state, force
    drive: Array
    k: Array
    gain: Array


def loop(k: Array) -> Loop:
    a, b = plant()
    whole = np.zeros((5, 5))
    whole[:4, :4], whole[:4, 4], whole[4, 4] = a, b[:, 0], -1.0 / LAG
    inputs = np.zeros((5, 2))
    inputs[4, 0], inputs[:4, 1] = 1.0 / LAG, b[:, 0]
    f, g = held(whole, inputs)
    model, drive = held(a, b[:, :1])
    return Loop(f, g[:, 0], g[:, 1], model, drive[:, 0], k, stationary_filter()[0])


def poles(of: Loop) -> NDArray[np.complex128]:
    """The eigenvalues of plant, motor, filter and regulator, from tick to tick (9)."""
    seen = np.eye(2, 5)
    rest = np.eye(4) - of.gain @ SEEN
    # States: plant and motor, and the estimate before the samples.
    whole = np.zeros((9, 9))
    force = np.hstack([-of.k @ of.gain @ seen, -of.k @ rest])
    whole[:5, :5] = of.f
    whole[:5] += np.outer(of.command, force)
    whole[5:, :5], whole[5:, 5:] = of.model @ of.gain @ seen, of.model @ rest
    whole[5:] += np.outer(of.drive, force)
    return np.linalg.eigvals(whole).astype(np.complex128)


def opened(of: Loop, omega: Array) -> tuple[Response, Response]:
    """The loop gain, broken at the command; and the same from a push, which has no motor, to the command."""
    gains = np.zeros((2, len(omega)), dtype=np.complex128)
    keep = (np.eye(4) - of.gain @ SEEN) @ (of.model - np.outer(of.drive, of.k))
    for i, z in enumerate(np.exp(1j * omega / HZ)):
        samples = np.linalg.solve(z * np.eye(5) - of.f, np.column_stack([of.command, of.push]))[:2]
        gains[:, i] = of.k @ np.linalg.solve(z * np.eye(4) - keep, z * of.gain @ samples)
    return gains[0], gains[1]


@dataclass(frozen=True)
class Margins:
    crossover: float  # rad/s
    phase: float  # rad
    least_gain: float  # the loop is stable for gains from here
    most_gain: float  # to here
    sensitivity: float  # the largest |1 / (1 + L)|


def margins(of: Loop) -> Margins:
    omega = np.geomspace(0.3, np.pi * HZ * 0.999, 4000)
    gain, _ = opened(of, omega)
    (crossing,) = np.flatnonzero((np.abs(gain[:-1]) >= 1.0) & (np.abs(gain[1:]) < 1.0))
    turns = np.flatnonzero((gain.imag[:-1] * gain.imag[1:] < 0.0) & (gain.real[:-1] < 0.0))
    factors = -1.0 / gain.real[turns]
    return Margins(
        float(omega[crossing]),
        float(abs(np.angle(-gain[crossing]))),
        float(factors[factors < 1.0].max()),
        float(factors[factors > 1.0].min()),
        float(np.abs(1.0 / (1.0 + gain)).max()),
    )


def pushed(of: Loop, push: Array, zero: float = 0.0) -> Array:
    """Position and angle at every tick, from rest, for a push (N) of every tick and a wrong zero of the angle (rad)."""
    state, estimate, seen = np.zeros(5), np.zeros(4), []
    for force in push:
        seen.append(state[:2])
        estimate = estimate + of.gain @ (state[:2] + [0.0, zero] - estimate[:2])
        command = -of.k @ estimate
        state = of.f @ state + of.command * command + of.push * force
        estimate = of.model @ estimate + of.drive * command
    return np.array(seen)
