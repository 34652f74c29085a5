# SPDX-License-Identifier: Apache-2.0
"""The glide, written down again: the trim by SciPy, from the aerodynamic data alone, and the classical modes."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve, minimize_scalar

Array = NDArray[np.float64]
EXAMPLE = Path(__file__).resolve().parents[1]
SIM = json.loads((EXAMPLE / "sim" / "glider.sim.json").read_text())
WING: dict[str, Any] = SIM["instances"]["wing"]["parameters"]
MASS: float = SIM["instances"]["body"]["inputs"]["mass"]
INERTIA = np.array(SIM["instances"]["body"]["inputs"]["inertia"])
GRAVITY: float = SIM["instances"]["earth"]["parameters"]["gravity"]
DENSITY = 1.225  # kg/m^3, at sea level


def columns() -> dict[str, Array]:
    with (EXAMPLE / "sim" / "wing.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


TABLE = columns()


def coefficients(angle: float, elevator: float) -> tuple[float, float, float]:
    """CL, CD and the pitching moment about the centre of mass, without rates."""
    lift, drag, moment = (
        float(np.interp(angle, TABLE["angle_of_attack"], TABLE[name])) for name in ("lift", "drag", "pitching_moment")
    )
    lift += WING["lift_from_elevator"] * elevator
    moment += WING["pitch_from_elevator"] * elevator
    normal = lift * np.cos(angle) + drag * np.sin(angle)
    return lift, drag, float(moment + WING["moment_reference_body"][0] / WING["chord"] * normal)


@dataclass(frozen=True)
class Glide:
    """A steady, straight glide in still air."""

    speed: float  # m/s, along the path
    angle_of_attack: float  # rad
    elevator: float  # rad
    path: float  # rad below the horizon

    @property
    def sink(self) -> float:
        return float(self.speed * np.sin(self.path))

    @property
    def ratio(self) -> float:
        return float(1.0 / np.tan(self.path))

    @property
    def pitch(self) -> float:
        return self.angle_of_attack - self.path


def trim(speed: float, density: float = DENSITY) -> Glide:
    """Lift = W cos, drag = W sin, no pitching moment: three equations for angle of attack, elevator, path."""
    pressure = 0.5 * density * speed**2 * WING["area"] / (MASS * GRAVITY)

    def unbalanced(unknown: Array) -> list[float]:
        angle, elevator, path = unknown
        lift, drag, moment = coefficients(angle, elevator)
        return [pressure * lift - np.cos(path), pressure * drag - np.sin(path), moment]

    return Glide(speed, *(float(v) for v in fsolve(unbalanced, [0.07, 0.0, 0.06], xtol=1e-12)))


def best_glide() -> Glide:
    found = minimize_scalar(lambda v: trim(v).path, bounds=(9.5, 15.0), method="bounded", options={"xatol": 1e-3})
    return trim(float(found.x))


def least_sink() -> Glide:
    found = minimize_scalar(lambda v: trim(v).sink, bounds=(8.8, 14.0), method="bounded", options={"xatol": 1e-3})
    return trim(float(found.x))
