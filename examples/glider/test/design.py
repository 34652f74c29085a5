# SPDX-License-Identifier: Apache-2.0
"""The linear design: loops, crossovers and margins, from the linearised plant and the parameters of the machine."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from flight_mechanics import EXAMPLE, GRAVITY, SIM, Array
from numpy.typing import NDArray

Response = NDArray[np.complex128]
MACHINE = json.loads((EXAMPLE / "fc" / "glider.json").read_text())
TICK_HZ: int = MACHINE["tick_hz"]
OMEGA: Array = np.geomspace(0.002, 200.0, 8000)  # rad/s
DELAY = 0.5 / TICK_HZ  # s: a command holds for a tick
LONGITUDINAL, LATERAL = [0, 2, 4, 7], [1, 3, 5, 6, 8]  # u w pitch q; v roll yaw p r
S = 1j * OMEGA


def parameters(instance: str) -> dict[str, Any]:
    """The parameters of an instance of the machine."""
    values: dict[str, Any] = MACHINE["instances"][instance]["parameters"]
    return values


@dataclass(frozen=True)
class Margins:
    crossover: float  # rad/s, the last one
    phase: float  # rad, the least of all crossings
    gain: float


def margins(loop: Response) -> Margins:
    magnitude, phase = np.abs(loop), np.unwrap(np.angle(loop))
    crossing = np.flatnonzero((magnitude[:-1] >= 1.0) != (magnitude[1:] >= 1.0))
    distance = np.abs((phase[crossing] + np.pi + np.pi) % (2.0 * np.pi) - np.pi)
    past = np.flatnonzero((np.sin(phase[:-1]) < 0.0) & (np.sin(phase[1:]) >= 0.0) & (OMEGA[:-1] > OMEGA[crossing[-1]]))
    gain = 1.0 / magnitude[past[0]] if len(past) else np.inf
    return Margins(float(OMEGA[crossing[-1]]), float(distance.min()), float(gain))


def closed(loop: Response) -> Response:
    return loop / (1.0 + loop)


def bandwidth(response: Response) -> float:
    """Where the closed loop has fallen to -3 dB, rad/s."""
    return float(OMEGA[np.flatnonzero(np.abs(response) < np.sqrt(0.5))[0]])


def actuator() -> Response:
    """A servo and half a tick of delay."""
    servo = SIM["instances"]["elevator_servo"]["parameters"]
    n, d = servo["natural_frequency"], servo["damping"]
    return np.asarray(n**2 / (S**2 + 2.0 * d * n * S + n**2) * np.exp(-S * DELAY), dtype=np.complex128)


def responses(a: Array, b: Array) -> Response:
    """States by the inputs' column b, for each frequency: shape (frequencies, states)."""
    eye = np.eye(len(a))
    columns = np.broadcast_to(b[:, None], (len(S), len(a), 1))
    return np.asarray(np.linalg.solve(S[:, None, None] * eye - a, columns)[:, :, 0], dtype=np.complex128)


def loops(a: Array, b: Array, speed: float) -> dict[str, Response]:
    """The open loops of pitch and speed, roll and course, each with the loops inside closed; at the design speed."""
    reference, control = parameters("reference"), parameters("control")
    along = responses(a[np.ix_(LONGITUDINAL, LONGITUDINAL)], b[LONGITUDINAL, 0])
    attitude = control["k_pitch"] + control["ki_pitch"] / S
    pitch = -(attitude * along[:, 2] + control["k_q"] * along[:, 3]) * actuator()
    from_command = -attitude * actuator() / (1.0 + pitch)  # elevator by commanded pitch
    slowing = -along[:, 0] * from_command * speed / GRAVITY  # - kinetic energy as a height, by commanded pitch
    energy = reference["k"] / speed * (1.0 + reference["ki"] / S) * slowing

    lateral = a[np.ix_(LATERAL, LATERAL)].copy()
    aileron, rudder = b[LATERAL, 1], b[LATERAL, 2]
    lateral[:, 4] += rudder * control["k_r"]
    lateral[:, 1] -= rudder * control["k_r"] * GRAVITY / speed
    lateral[:, 3] -= rudder * control["k_rp"]
    across = responses(lateral, aileron - rudder * control["k_ra"])
    attitude = control["k_roll"] + control["ki_roll"] / S
    roll = (attitude * across[:, 1] + control["k_p"] * across[:, 3]) * actuator()
    from_command = attitude * actuator() / (1.0 + roll)
    turned = (across[:, 2] + across[:, 0] / speed) * from_command
    course = reference["k_course"] * speed / GRAVITY * turned
    return {"pitch": pitch, "speed": energy, "roll": roll, "course": course}


def step_response(response: Response, time_s: Array) -> Array:
    """Of a stable loop with a gain of 1 at rest: 2/pi times the integral of Re(T) sin(w t) / w."""
    first = 2.0 / np.pi * OMEGA[0] * time_s  # below the first frequency
    waves = [np.trapezoid(response.real * np.sin(OMEGA * t) / OMEGA, OMEGA) for t in time_s]
    return np.asarray(first + 2.0 / np.pi * np.array(waves))
