# SPDX-License-Identifier: Apache-2.0
"""The simulated plant, set to a steady glide and linearised by differences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from flight_mechanics import EXAMPLE, Array, Glide
from scipy.linalg import expm, logm

from simclient import SimTwin

PLANT = EXAMPLE / "sim" / "plant.sim.json"
SURFACES = ("elevator", "aileron", "rudder")
HEIGHT = 100.0  # m


def quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    cr, cp, cy = (math.cos(0.5 * a) for a in (roll, pitch, yaw))
    sr, sp, sy = (math.sin(0.5 * a) for a in (roll, pitch, yaw))
    return [
        cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]  # fmt: skip


def euler(q: Array) -> Array:
    w, x, y, z = q
    return np.array(
        [
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(2.0 * (w * y - x * z)),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        ]
    )


class Plant:
    """States u, v, w (body), roll, pitch, yaw, p, q, r; inputs are the three surfaces, without their servos."""

    def __init__(self, twin: SimTwin) -> None:
        self.twin = twin
        twin.tick()  # the instant 0; from here on a tick integrates first
        self.saved = twin.save()

    def write(self, state: Array, surfaces: Array) -> None:
        roll, pitch, yaw = state[3:6]
        velocity = rotation(roll, pitch, yaw) @ state[:3]
        values: dict[str, Any] = {
            "body.state.position_inertial": [0.0, 0.0, -HEIGHT],
            "body.state.velocity_inertial": list(velocity),
            "body.state.attitude_body_to_inertial": quaternion(roll, pitch, yaw),
            "body.state.rate_body": list(state[6:]),
        }
        for name, angle in zip(SURFACES, surfaces, strict=True):
            values |= {f"{name}_servo.state.angle": angle, f"{name}_servo.state.rate": 0.0}
            values |= {f"{name}_servo.inputs.command": angle}
        self.twin.set_many({k: [float(x) for x in v] if isinstance(v, list) else float(v) for k, v in values.items()})

    def read(self) -> Array:
        angles = euler(np.array(self.twin.get("body.outputs.attitude_body_to_inertial")))
        velocity = rotation(*angles).T @ np.array(self.twin.get("body.outputs.velocity_inertial"))
        return np.concatenate([velocity, angles, self.twin.get("body.outputs.rate_body")])

    def step(self, state: Array, surfaces: Array, ticks: int = 1) -> Array:
        self.twin.restore(self.saved)
        self.write(state, surfaces)
        self.twin.tick(ticks)
        return self.read()

    def linear(self, state: Array, surfaces: Array, period: float = 0.01) -> tuple[Array, Array]:
        """A and B of x' = A x + B u, from central differences of a tick: the logarithm of its transition."""
        point = np.concatenate([state, surfaces])
        transition = np.zeros((12, 12))
        transition[9:, 9:] = np.eye(3)
        for i in range(12):
            small = np.zeros(12)
            small[i] = 1e-4
            up, down = point + small, point - small
            transition[:9, i] = (self.step(up[:9], up[9:]) - self.step(down[:9], down[9:])) / 2e-4
        generator = np.real(logm(transition)) / period
        assert np.allclose(expm(generator * period), transition, atol=1e-9)
        return generator[:9, :9], generator[:9, 9:]


def rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Body to NED."""
    cr, cp, cy = math.cos(roll), math.cos(pitch), math.cos(yaw)
    sr, sp, sy = math.sin(roll), math.sin(pitch), math.sin(yaw)
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def steady(glide: Glide) -> tuple[Array, Array]:
    """State and surfaces of a glide."""
    angle = glide.angle_of_attack
    state = np.zeros(9)
    state[0], state[2], state[4] = glide.speed * math.cos(angle), glide.speed * math.sin(angle), glide.pitch
    return state, np.array([glide.elevator, 0.0, 0.0])
