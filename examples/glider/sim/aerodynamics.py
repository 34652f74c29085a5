# SPDX-License-Identifier: Apache-2.0
"""The aerodynamic data of the glider from its geometry: `python3 aerodynamics.py` writes wing.csv and prints the rest.

| data | method |
|---|---|
| wing: lift slope, induced drag, roll and yaw by rates, dihedral, ailerons | lifting line (Glauert 1926), any twist |
| section: zero-lift angle, moment, flap effectiveness | thin-aerofoil theory, camber line NACA 24xx |
| tail surfaces: lift slope | Helmbold 1942 |
| downwash at the tail | 2 CL / (pi AR), far behind an elliptic wing |
| drag without lift | turbulent flat plate (Prandtl, Schlichting) with form factors of Hoerner 1965 |
| drag by lift beside the induced one | 0.38 CD0 CL^2 (Nita, Scholz 2012) |
| stall | blending into a flat plate (Beard, McLain 2012, section 4.2) |

Signs: elevator and left aileron positive with the trailing edge down, rudder with it to the left. So a positive aileron
rolls to the right, a positive rudder yaws to the left, a positive elevator pitches down.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DENSITY, VISCOSITY = 1.225, 1.789e-5  # kg/m^3, Pa s: sea level, US Standard Atmosphere 1976
DESIGN_SPEED = 11.3  # m/s, about best glide: for Reynolds numbers, and for the derivatives that depend on CL
MASS, GRAVITY = 3.5, 9.80665

SPAN, ROOT, TIP = 2.5, 0.30, 0.20  # m
AREA = SPAN * (ROOT + TIP) / 2.0
ASPECT = SPAN**2 / AREA
CHORD = 2.0 / 3.0 * (ROOT + TIP - ROOT * TIP / (ROOT + TIP))  # mean aerodynamic
THICKNESS = 0.10
DIHEDRAL = np.radians(7.0)
AILERON_FROM, AILERON_TO, AILERON_CHORD = 0.55, 0.95, 0.25  # of the half span, of the chord
WING_AHEAD = 0.025  # m: the aerodynamic centre of the wing is ahead of the centre of mass

TAIL_AREA, TAIL_ASPECT, TAIL_ARM = 0.075, 5.0, 0.85  # m^2, -, m from the aerodynamic centre of the wing
TAIL_INCIDENCE = np.radians(-2.4)  # elevator near 0 at best glide
ELEVATOR_CHORD = 0.35
FIN_AREA, FIN_ASPECT, FIN_ARM, FIN_HEIGHT = 0.045, 1.6, 0.85, 0.10
FIN_END_PLATE = 1.55  # the tailplane at its foot, as an aspect ratio: Raymer, section 16.4
RUDDER_CHORD = 0.40
POD, BOOM = (0.60, 0.12), (0.80, 0.025)  # length, diameter, m
PROTUBERANCES = 1.05  # Raymer, Aircraft Design, section 12.5

STALL, STALL_SHARPNESS = np.radians(14.0), 50.0  # chosen: a section of this kind at a Reynolds number of 2e5

# Masses, kg, and their places ahead of the centre of mass, m.
WING_MASS, POD_MASS, TAIL_MASS = 1.3, 1.9, 0.3
WING_PLACE = WING_AHEAD - 0.25 * CHORD  # of its mass, at half chord
TAIL_PLACE = -(TAIL_ARM - WING_AHEAD)
POD_PLACE = -(WING_MASS * WING_PLACE + TAIL_MASS * TAIL_PLACE) / POD_MASS  # it balances the others


def thin_aerofoil(camber: float = 0.02, place: float = 0.4) -> tuple[float, float]:
    """Zero-lift angle (rad) and moment coefficient about the quarter chord of a four-digit camber line."""
    theta = (np.arange(20_000) + 0.5) * np.pi / 20_000
    x = 0.5 * (1.0 - np.cos(theta))
    slope = np.where(x < place, 2.0 * camber / place**2, 2.0 * camber / (1.0 - place) ** 2) * (place - x)
    a1, a2 = 2.0 * (slope * np.cos(theta)).mean(), 2.0 * (slope * np.cos(2.0 * theta)).mean()
    return float(slope.mean() - 0.5 * a1), float(-np.pi / 4.0 * (a1 - a2))


def flap(chord: float) -> float:
    """Effectiveness of a plain flap, d alpha / d deflection, by thin-aerofoil theory."""
    hinge = np.arccos(2.0 * chord - 1.0)
    return float(1.0 - (hinge - np.sin(hinge)) / np.pi)


def helmbold(aspect: float) -> float:
    """Lift slope of an unswept wing, 1/rad."""
    return float(2.0 * np.pi * aspect / (2.0 + np.sqrt(4.0 + aspect**2)))


class LiftingLine:
    """Prandtl's lifting line as Glauert solved it: circulation = 2 b V sum A_n sin(n theta), y = -b/2 cos(theta).

    Unit speed and density. Section slope 2 pi. Angles are those of the sections from zero lift.
    """

    def __init__(self, terms: int = 80, elliptic: bool = False) -> None:
        """The wing of the glider, or an elliptic one of the same span and area."""
        self.theta = (np.arange(terms) + 0.5) * np.pi / terms
        self.y = -0.5 * SPAN * np.cos(self.theta)
        self.chord = ROOT + (TIP - ROOT) * np.abs(self.y) / (0.5 * SPAN)
        if elliptic:
            self.chord = 4.0 * AREA / (np.pi * SPAN) * np.sin(self.theta)
        self.area = AREA
        self.n = np.arange(1, terms + 1)
        self.sines = np.sin(np.outer(self.theta, self.n))
        mu = np.pi * self.chord / (2.0 * SPAN)
        self.matrix = self.sines * (mu[:, None] * self.n + np.sin(self.theta)[:, None])
        self.right = mu * np.sin(self.theta)
        self.width = 0.5 * SPAN * np.sin(self.theta) * np.pi / terms

    def solve(self, angle: Array) -> tuple[Array, Array]:
        """Lift per length over dynamic pressure, and induced angle, at the stations."""
        a = np.linalg.solve(self.matrix, self.right * angle)
        lift = 4.0 * SPAN * self.sines @ a
        induced = (self.sines * self.n) @ a / np.sin(self.theta)
        return lift, induced

    def coefficients(self, angle: Array, kinematic: Array | float = 0.0) -> dict[str, float]:
        """CL, CDi, Cl (right wing down), Cn (nose right). `kinematic`: part of the angle that comes from motion."""
        lift, induced = self.solve(angle)
        drag = lift * (induced - kinematic)
        size = self.area * SPAN
        return {
            "CL": float((lift * self.width).sum() / self.area),
            "CD": float((drag * self.width).sum() / self.area),
            "Cl": float(-(lift * self.y * self.width).sum() / size),
            "Cn": float((drag * self.y * self.width).sum() / size),
        }


def friction(speed: float, length: float) -> float:
    """Skin friction of a turbulent flat plate (Prandtl, Schlichting)."""
    return float(0.455 / np.log10(DENSITY * speed * length / VISCOSITY) ** 2.58)


def zero_lift_drag(speed: float) -> float:
    """CD0 of wing, tails, pod and boom."""
    surface = 2.0 * (1.0 + 2.0 * THICKNESS + 60.0 * THICKNESS**4)
    parts = [surface * friction(speed, CHORD) * AREA]
    for area, aspect in ((TAIL_AREA, TAIL_ASPECT), (FIN_AREA, FIN_ASPECT)):
        parts.append(surface * friction(speed, np.sqrt(area / aspect)) * area)
    slender = POD[1] / POD[0]
    body = 1.0 + 1.5 * slender**1.5 + 7.0 * slender**3
    parts.append(body * friction(speed, POD[0]) * 0.75 * np.pi * POD[0] * POD[1])
    parts.append(friction(speed, POD[0] + BOOM[0]) * np.pi * BOOM[0] * BOOM[1])
    return float(PROTUBERANCES * sum(parts) / AREA)


@dataclass(frozen=True)
class Wing:
    slope: float  # 1/rad
    zero_lift: float  # rad
    moment: float
    efficiency: float  # of the span: induced drag CL^2 / (pi AR efficiency)
    zero_lift_drag: float
    polar: float  # CD = zero_lift_drag + polar CL^2
    downwash: float  # d epsilon / d alpha
    tail_slope: float
    fin_slope: float


def wing() -> Wing:
    line = LiftingLine()
    unit = line.coefficients(np.full_like(line.y, 1.0))
    zero_lift, moment = thin_aerofoil()
    efficiency = unit["CL"] ** 2 / (np.pi * ASPECT * unit["CD"])
    least = zero_lift_drag(DESIGN_SPEED)
    polar = 1.0 / (np.pi * ASPECT * efficiency) + 0.38 * least
    return Wing(
        unit["CL"], zero_lift, moment, efficiency, least, polar, 2.0 * unit["CL"] / (np.pi * ASPECT),
        helmbold(TAIL_ASPECT), helmbold(FIN_END_PLATE * FIN_ASPECT),
    )  # fmt: skip


def share_attached(angle: Array) -> Array:
    """Beard and McLain's 1 - sigma, written without overflow."""
    above = 1.0 / (1.0 + np.exp(np.clip(STALL_SHARPNESS * (angle - STALL), -500.0, 500.0)))
    below = 1.0 / (1.0 + np.exp(np.clip(-STALL_SHARPNESS * (angle + STALL), -500.0, 500.0)))
    return above * below


def table() -> dict[str, Array]:
    """The columns of wing.csv."""
    craft = wing()
    fine = np.arange(-16.0, 18.5, 1.0)
    coarse = [-180, -150, -120, -90, -70, -50, -40, -30, -25, -20, 20, 22, 25, 30, 40, 50, 70, 90, 120, 150, 180]
    angle = np.radians(np.sort(np.concatenate([fine, coarse])))
    share = share_attached(angle)
    plate_lift, plate_drag = 2.0 * np.sin(angle) * np.abs(np.sin(angle)) * np.cos(angle), 2.0 * np.sin(angle) ** 2
    plate_drag = plate_drag * np.abs(np.sin(angle))
    wing_lift = craft.slope * (angle - craft.zero_lift)
    lift = share * wing_lift + (1.0 - share) * plate_lift
    drag = craft.zero_lift_drag + share * craft.polar * wing_lift**2 + (1.0 - share) * plate_drag
    downwash = share * craft.downwash * (angle - craft.zero_lift)
    tail_angle = angle - downwash + TAIL_INCIDENCE
    tail_share = share_attached(tail_angle)
    tail_plate = 2.0 * np.sin(tail_angle) * np.abs(np.sin(tail_angle)) * np.cos(tail_angle)
    tail = TAIL_AREA / AREA * (tail_share * craft.tail_slope * tail_angle + (1.0 - tail_share) * tail_plate)
    plate_moment = -0.25 * 2.0 * np.sin(angle) * np.abs(np.sin(angle))  # acts at half chord
    moment = share * craft.moment + (1.0 - share) * plate_moment - TAIL_ARM / CHORD * tail
    return {"angle_of_attack": angle, "lift": lift + tail, "drag": drag, "pitching_moment": moment}


def derivatives() -> dict[str, float]:
    """The parameters of aerodynamic_tables that are no tables."""
    craft, line = wing(), LiftingLine()
    half = 0.5 * SPAN
    wanted = 2.0 * MASS * GRAVITY / (DENSITY * DESIGN_SPEED**2 * AREA)
    base = np.full_like(line.y, wanted / craft.slope)
    ailerons = (np.abs(line.y) > AILERON_FROM * half) & (np.abs(line.y) < AILERON_TO * half)
    small = 1e-3

    def by(shape: Array, moves: bool = False) -> tuple[float, float]:
        """dCl and dCn by an antisymmetric angle of this shape; `moves`: it comes from motion, and tilts the lift."""
        plus = line.coefficients(base + small * shape, small * shape if moves else 0.0)
        minus = line.coefficients(base - small * shape, -small * shape if moves else 0.0)
        return (plus["Cl"] - minus["Cl"]) / (2.0 * small), (plus["Cn"] - minus["Cn"]) / (2.0 * small)

    roll_roll, yaw_roll = by(line.y / half, moves=True)  # p b / (2 V) = 1
    roll_slip, _ = by(np.sign(line.y) * DIHEDRAL)
    roll_aileron, yaw_aileron = by(-np.sign(line.y) * flap(AILERON_CHORD) * ailerons)
    lift, induced = line.solve(base)
    faster = -2.0 * line.y / half  # change of dynamic pressure by r b / (2 V) = 1, strips
    size = AREA * SPAN
    roll_yaw = float(-(lift * faster * line.y * line.width).sum() / size)
    profile = 2.0 * friction(DESIGN_SPEED, CHORD) * (1.0 + 2.0 * THICKNESS + 60.0 * THICKNESS**4)
    yaw_yaw = float(((profile * line.chord + lift * induced) * faster * line.y * line.width).sum() / size)

    tail_arm, fin_arm = TAIL_ARM - WING_AHEAD, FIN_ARM - WING_AHEAD  # from the centre of mass
    fin = craft.fin_slope * FIN_AREA / AREA
    rudder = fin * flap(RUDDER_CHORD)
    tail = craft.tail_slope * TAIL_AREA / AREA
    elevator = tail * flap(ELEVATOR_CHORD)
    return {
        "lift_from_pitch_rate": 2.0 * tail * tail_arm / CHORD,
        "lift_from_elevator": elevator,
        "side_force_from_sideslip": -fin,
        "side_force_from_rudder": rudder,
        "roll_from_sideslip": roll_slip - fin * FIN_HEIGHT / SPAN,
        "roll_from_roll_rate": roll_roll,
        "roll_from_yaw_rate": roll_yaw + 2.0 * fin * fin_arm * FIN_HEIGHT / SPAN**2,
        "roll_from_aileron": roll_aileron,
        "roll_from_rudder": rudder * FIN_HEIGHT / SPAN,
        "pitch_from_pitch_rate": -2.0 * tail * tail_arm * TAIL_ARM / CHORD**2,
        "pitch_from_elevator": -elevator * TAIL_ARM / CHORD,
        "yaw_from_sideslip": fin * FIN_ARM / SPAN,
        "yaw_from_roll_rate": yaw_roll,
        "yaw_from_yaw_rate": yaw_yaw - 2.0 * fin * fin_arm * FIN_ARM / SPAN**2,
        "yaw_from_aileron": yaw_aileron,
        "yaw_from_rudder": -rudder * FIN_ARM / SPAN,
        "area": AREA,
        "span": SPAN,
        "chord": CHORD,
    }


def inertia() -> Array:
    """About the centre of mass: the wing as a tapered plate, the pod as a rod, the tail as a point. kg m^2."""
    ratio = TIP / ROOT
    across = WING_MASS * SPAN**2 / 24.0 * (1.0 + 3.0 * ratio) / (1.0 + ratio)
    along = (
        POD_MASS * (POD_PLACE**2 + POD[0] ** 2 / 12.0)
        + TAIL_MASS * TAIL_PLACE**2
        + WING_MASS * (CHORD**2 / 12.0 + WING_PLACE**2)
    )
    pod = POD_MASS * POD[1] ** 2 / 8.0
    cross = -TAIL_MASS * TAIL_PLACE * -FIN_HEIGHT  # -sum m x z, z down
    return np.array([[across + pod, 0.0, cross], [0.0, along, 0.0], [cross, 0.0, across + along]])


def rounded(value: float) -> float:
    return float(f"{value:.5g}")


def main(path: Path) -> None:
    columns = table()
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([rounded(v) for v in row] for row in zip(*columns.values(), strict=True))
    craft = wing()
    for name, value in vars(craft).items():
        print(f"{name} = {value:.5g}", file=sys.stderr)
    for name, value in derivatives().items():
        print(f'"{name}": {rounded(value)},')
    print(f'"inertia": {[[rounded(v) for v in row] for row in inertia()]}')


if __name__ == "__main__":
    main(Path(__file__).parent / "wing.csv")
