# SPDX-License-Identifier: Apache-2.0
"""Writes body.csv: axial and normal coefficients of the rocket over the angle between its axis and its motion.

A cylinder of 2.4 m by 0.6 m with a flat tail, a blunt nose and four legs, after L. H. Jorgensen, Prediction of Static
Aerodynamic Characteristics for Slender Bodies to Very High Angles of Attack, NASA TR R-474 (1977), section 3. With the
angle a up to 90 degrees from the end that leads:

    normal = (k2 - k1) sin(2 a) cos(a / 2) + eta cdc (side area / area) sin^2 a
    axial  = axial(0) cos^2 a

The first term is of potential flow (k2 - k1: M. Munk, NACA TR-184 (1924), fineness 4), the second is the drag of the flow
across, eta its loss at the ends. Axial coefficients: S. Hoerner, Fluid-Dynamic Drag (1965), chapter 3.
"""

from __future__ import annotations

import math
from pathlib import Path

LENGTH, DIAMETER = 2.4, 0.6  # m
AREA = math.pi / 4.0 * DIAMETER**2  # m^2
SIDE = LENGTH * DIAMETER
K2_K1 = 0.78
ETA, CDC = 0.6, 1.2  # of a cylinder of fineness 4, below the critical Reynolds number
LEGS = 4 * 0.02 * 1.1 / AREA  # four struts of 0.02 m^2 each
TAIL_FIRST, NOSE_FIRST = 0.85 + LEGS, 0.30 + LEGS


def coefficients(angle: float) -> tuple[float, float]:
    """Axial (positive against motion along +z) and normal, for an angle (rad) that is 0 tail first, pi nose first."""
    a = min(angle, math.pi - angle)
    normal = K2_K1 * math.sin(2.0 * a) * math.cos(a / 2.0) + ETA * CDC * SIDE / AREA * math.sin(a) ** 2
    leading = TAIL_FIRST if angle <= math.pi / 2.0 else -NOSE_FIRST
    return leading * math.cos(a) ** 2, normal


def main() -> None:
    rows = ["angle,axial,normal"]
    for degrees in range(0, 181, 5):
        angle = math.radians(degrees)
        axial, normal = coefficients(angle)
        rows.append(f"{angle:.6f},{axial:.5f},{normal:.5f}")
    (Path(__file__).parent / "body.csv").write_text("\n".join(rows) + "\n")
    print(f"area {AREA:.5f} m^2, tail first {TAIL_FIRST:.3f}, nose first {NOSE_FIRST:.3f}")


if __name__ == "__main__":
    main()
