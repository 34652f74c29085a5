# SPDX-License-Identifier: Apache-2.0
"""What the tests of the satellite share: rotations of whole flights, and simulations."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simclient import SimTwin

EXAMPLE = Path(__file__).resolve().parents[1]
SIM = EXAMPLE / "sim" / "satellite.sim.json"
HZ = 20


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """p q of quaternions w, x, y, z along the last axis."""
    p0, p1, p2, p3 = np.moveaxis(p, -1, 0)
    q0, q1, q2, q3 = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3,
            p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2,
            p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1,
            p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0,
        ],
        -1,
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The rotation vectors from p to q, rad, in axes of p."""
    r = product(conjugate(p), q)
    r = np.where(r[..., :1] < 0.0, -r, r)
    sine = np.linalg.norm(r[..., 1:], axis=-1, keepdims=True)
    size = 2.0 * np.arctan2(sine, r[..., :1])
    return r[..., 1:] * np.where(sine > 1e-12, size / np.maximum(sine, 1e-12), 2.0)


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """v of the frame that q turns from, in the frame that it turns to."""
    pure = np.concatenate([np.zeros((*v.shape[:-1], 1)), v], -1)
    return product(product(q, pure), conjugate(q))[..., 1:]


def changes(states: np.ndarray) -> list[tuple[float, str]]:
    """The time (s) and the name of each state that is entered after the first."""
    return [(i / HZ, str(states[i])) for i in range(1, len(states)) if states[i] != states[i - 1]]


@pytest.fixture(scope="session")
def exact() -> list[str]:
    """Settings of sensors that measure the truth."""
    return [
        "inertial_unit.parameters.gyroscope_noise_density=0.0",
        "inertial_unit.parameters.gyroscope_bias_walk=0.0",
        "inertial_unit.parameters.gyroscope_bias=[0.0, 0.0, 0.0]",
        "star_camera.parameters.sigma_body=[0.0, 0.0, 0.0]",
        "star_camera.parameters.dropout_probability=0.0",
    ]


def flown(ticks: int, *paths: str, sim: Path = SIM, **options: Any) -> Any:
    """The trace of a simulation."""
    with SimTwin.from_config(sim, **options) as twin, twin.trace(*paths) as trace:
        twin.tick(ticks)
    return trace
