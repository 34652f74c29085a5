# SPDX-License-Identifier: Apache-2.0
"""The aerodynamic data: methods against closed forms, and the files against the methods."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from flight_mechanics import EXAMPLE, INERTIA, MASS, TABLE, WING

sys.path.insert(0, str(EXAMPLE / "sim"))
import aerodynamics as methods  # noqa: E402


def test_the_lifting_line_of_an_elliptic_wing_is_the_closed_form() -> None:
    """CL = 2 pi AR / (AR + 2) alpha, CDi = CL^2 / (pi AR), Cl_p = -pi/4 AR / (AR + 4)."""
    line, aspect = methods.LiftingLine(elliptic=True), methods.ASPECT
    unit = line.coefficients(np.full_like(line.y, 1.0))
    assert unit["CL"] == pytest.approx(2.0 * np.pi * aspect / (aspect + 2.0), rel=1e-6)
    assert unit["CD"] == pytest.approx(unit["CL"] ** 2 / (np.pi * aspect), rel=1e-6)
    rolling = line.coefficients(line.y / (0.5 * methods.SPAN))
    assert rolling["Cl"] == pytest.approx(-np.pi / 4.0 * aspect / (aspect + 4.0), rel=1e-6)


def test_the_section_is_that_of_thin_aerofoil_theory() -> None:
    """NACA 2410: Abbott, von Doenhoff, Theory of Wing Sections (1959), table II: -2.08 degrees, -0.053."""
    zero_lift, moment = methods.thin_aerofoil()
    assert np.degrees(zero_lift) == pytest.approx(-2.08, abs=0.01)
    assert moment == pytest.approx(-0.053, abs=0.0005)
    assert methods.flap(1.0) == pytest.approx(1.0) and methods.flap(0.25) == pytest.approx(0.609, abs=0.001)


def test_the_tapered_wing_is_a_little_worse_than_the_elliptic_one() -> None:
    assert 0.95 < methods.wing().efficiency < 1.0


def test_the_files_hold_what_the_methods_give() -> None:
    for name, column in methods.table().items():
        assert [methods.rounded(v) for v in column] == pytest.approx(list(TABLE[name])), name
    for name, value in methods.derivatives().items():
        assert WING[name] == pytest.approx(methods.rounded(value)), name
    assert WING["moment_reference_body"] == [methods.WING_AHEAD, 0.0, 0.0]
    assert MASS == methods.MASS == methods.WING_MASS + methods.POD_MASS + methods.TAIL_MASS
    assert np.array(INERTIA) == pytest.approx(np.array(methods.inertia()), rel=1e-4)


def test_the_masses_balance_at_the_centre_of_mass() -> None:
    """And the pod, of 0.6 m, reaches from behind the leading edge of the wing to 0.46 m ahead of the balance."""
    wing, pod, tail = methods.WING_PLACE, methods.POD_PLACE, methods.TAIL_PLACE
    total = methods.WING_MASS * wing + methods.POD_MASS * pod + methods.TAIL_MASS * tail
    assert total == pytest.approx(0.0, abs=1e-12)
    assert pod + 0.5 * methods.POD[0] == pytest.approx(0.456, abs=0.005)


def test_it_is_statically_stable_with_the_stated_margin() -> None:
    """11 % of the chord: the moment about the centre of mass by lift, at best glide."""
    craft = methods.wing()
    tail = methods.TAIL_AREA / methods.AREA * craft.tail_slope * (1.0 - craft.downwash)
    neutral = tail * methods.TAIL_ARM / (craft.slope + tail)  # behind the aerodynamic centre of the wing
    assert (neutral - methods.WING_AHEAD) / methods.CHORD == pytest.approx(0.113, abs=0.005)
