# SPDX-License-Identifier: Apache-2.0
"""The linear design of the cascade: loops, bandwidths and margins, from the parameters of the machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from conftest import TICK_HZ, Array, parameters
from numpy.typing import NDArray

Response = NDArray[np.complex128]
OMEGA: Array = np.geomspace(0.05, 1000.0, 40_000)  # rad/s
DELAY = 0.5 / TICK_HZ  # s: a command holds for a tick; the IMU is read at the tick


@dataclass(frozen=True)
class Margins:
    crossover: float  # rad/s
    phase: float  # rad
    gain: float


def margins(loop: Response) -> Margins:
    """Of an open loop whose magnitude passes 1 once."""
    magnitude, phase = np.abs(loop), np.unwrap(np.angle(loop))
    crossing = np.flatnonzero((magnitude[:-1] >= 1.0) & (magnitude[1:] < 1.0))
    assert len(crossing) == 1
    turns = np.flatnonzero((phase[:-1] > -np.pi) & (phase[1:] <= -np.pi))
    gain = 1.0 / magnitude[turns[0]] if len(turns) else np.inf
    return Margins(float(OMEGA[crossing[0]]), float(np.pi + phase[crossing[0]]), float(gain))


def closed(loop: Response) -> Response:
    return loop / (1.0 + loop)


def bandwidth(response: Response) -> float:
    """Where the closed loop has fallen to -3 dB, rad/s."""
    return float(OMEGA[np.flatnonzero(np.abs(response) < np.sqrt(0.5))[0]])


def cascade(axis: int) -> dict[str, Response]:
    """The open loops of roll (0) or pitch (1), from the innermost on: rate, attitude, velocity, position."""
    rate, attitude, position = parameters("rate"), parameters("attitude"), parameters("position")
    s = 1j * OMEGA
    controller = rate["k"][axis] + rate["ki"][axis] / s
    loops = {"rate": controller / s / (rate["lag"] * s + 1.0 + rate["c"][axis]) * np.exp(-s * DELAY)}
    loops["attitude"] = attitude["gain"][axis] / s * closed(loops["rate"])
    along = 1 - axis  # pitch moves it north, roll east
    loops["velocity"] = (position["kv"][along] + position["ki"][along] / s) / s * closed(loops["attitude"])
    loops["position"] = position["kp"][along] / s * closed(loops["velocity"])
    return loops
