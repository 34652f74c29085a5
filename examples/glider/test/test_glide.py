# SPDX-License-Identifier: Apache-2.0
"""The plant against flight mechanics: the steady glide, phugoid and short period, and the lateral modes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from conftest import TICK_HZ
from design import LONGITUDINAL
from flight_mechanics import (
    GRAVITY,
    INERTIA,
    MASS,
    WING,
    Array,
    Glide,
    best_glide,
    coefficients,
    least_sink,
    trim,
)
from plant import HEIGHT, PLANT, Plant, steady

from simclient import SimTwin


def density_at(height: float) -> float:
    """US Standard Atmosphere 1976, below 11 km."""
    return 1.225 * (1.0 - 2.25577e-5 * height) ** 4.25588


@pytest.fixture(scope="session")
def glide() -> Glide:
    """Best glide at the height of the plant."""
    density = density_at(HEIGHT)
    return trim(best_glide().speed * math.sqrt(1.225 / density), density)


@pytest.fixture(scope="session")
def linear(plant: Plant, glide: Glide) -> tuple[Array, Array]:
    return plant.linear(*steady(glide))


def oscillation(eigenvalues: Any) -> list[tuple[float, float]]:
    """Frequency (rad/s) and damping of the oscillations, the slowest first."""
    return sorted((abs(v), -v.real / abs(v)) for v in eigenvalues if v.imag > 1e-6)


def test_the_best_glide_is_that_of_the_parabolic_polar() -> None:
    """E = 1 / (2 sqrt(k CD0)) of the wing; the lift of the tail changes it by less than 2 %."""
    best = best_glide()
    assert best.ratio == pytest.approx(1.0 / (2.0 * math.sqrt(0.041191 * 0.021307)), rel=0.02)
    assert least_sink().speed < best.speed and least_sink().sink < best.sink
    assert best.ratio == pytest.approx(17.0, abs=0.05) and best.speed == pytest.approx(11.1, abs=0.1)


@pytest.mark.parametrize("speed", [10.0, 11.1, 13.0])
def test_the_plant_stays_in_the_trim_of_scipy(plant: Plant, speed: float) -> None:
    """For 40 s with a fixed elevator: speed within 0.3 %, glide ratio within 0.5 %."""
    wanted = trim(speed, density_at(HEIGHT))
    end = plant.step(*steady(wanted), ticks=4000)
    north, _, down = plant.twin.get("earth.outputs.velocity_ned")
    assert math.hypot(north, down) == pytest.approx(speed, rel=0.003)
    assert north / down == pytest.approx(wanted.ratio, rel=0.005)
    assert math.atan2(end[2], end[0]) == pytest.approx(wanted.angle_of_attack, abs=math.radians(0.05))
    assert end[4] == pytest.approx(wanted.pitch, abs=math.radians(0.1))


def test_the_flown_glide_has_the_ratio_of_the_trim(gliding: SimTwin) -> None:
    """The machine holds its speed; the ratio over 20 s is within 2 % of the trim at that speed."""
    with gliding.trace("earth.outputs.position_ned", "air.outputs.airspeed", "elevator_servo.outputs.angle") as trace:
        gliding.tick(20 * TICK_HZ)
    way = trace["earth.outputs.position_ned"][-1] - trace["earth.outputs.position_ned"][0]
    speed = trace["air.outputs.airspeed"].mean()
    wanted = trim(float(speed), density_at(gliding.get("earth.outputs.height")))
    assert math.hypot(way[0], way[1]) / way[2] == pytest.approx(wanted.ratio, rel=0.02)
    assert speed * math.sqrt(density_at(gliding.get("earth.outputs.height")) / 1.225) == pytest.approx(11.5, abs=0.05)
    assert trace["elevator_servo.outputs.angle"].mean() == pytest.approx(wanted.elevator, abs=math.radians(0.15))


def derivatives(glide: Glide) -> tuple[float, float, float]:
    """Lift slope over m V (1/s), pitching moment by angle of attack (1/s^2) and by pitch rate (1/s)."""
    small, pressure = 1e-3, 0.5 * density_at(HEIGHT) * glide.speed**2 * WING["area"]
    up = coefficients(glide.angle_of_attack + small, glide.elevator)
    down = coefficients(glide.angle_of_attack - small, glide.elevator)
    lift = (up[0] - down[0]) / (2.0 * small) + up[1]
    stiffness = pressure * WING["chord"] / INERTIA[1, 1] * (up[2] - down[2]) / (2.0 * small)
    by_rate = (
        WING["pitch_from_pitch_rate"] + WING["moment_reference_body"][0] / WING["chord"] * WING["lift_from_pitch_rate"]
    )
    damping = pressure * WING["chord"] / INERTIA[1, 1] * by_rate * WING["chord"] / (2.0 * glide.speed)
    return pressure * lift / (MASS * glide.speed), stiffness, damping


def test_the_short_period_is_that_of_two_degrees_of_freedom(linear: tuple[Array, Array], glide: Glide) -> None:
    """n^2 = L_a M_q' - M_a,  2 d n = L_a + M_q' (Stevens, Lewis, Johnson, section 4.2), within 3 %."""
    frequency, damping = oscillation(np.linalg.eigvals(linear[0][np.ix_(LONGITUDINAL, LONGITUDINAL)]))[1]
    lift, stiffness, rate = derivatives(glide)
    assert frequency == pytest.approx(math.sqrt(-lift * rate - stiffness), rel=0.03)
    assert 2.0 * damping * frequency == pytest.approx(lift - rate, rel=0.03)


def test_the_phugoid_is_lanchesters_times_the_root_of_static_over_manoeuvre_margin(
    linear: tuple[Array, Array], glide: Glide
) -> None:
    """n = sqrt(2) g / V sqrt(M_a / (M_a + L_a M_q)): within 3 %. Lanchester alone, for constant angle of attack, is 50 %
    too fast, because the pitch damping of so slow a glider is as strong as its stiffness.
    """
    frequency, damping = oscillation(np.linalg.eigvals(linear[0][np.ix_(LONGITUDINAL, LONGITUDINAL)]))[0]
    lift, stiffness, rate = derivatives(glide)
    lanchester = math.sqrt(2.0) * GRAVITY / glide.speed
    assert lanchester / frequency == pytest.approx(1.51, abs=0.03)
    assert frequency == pytest.approx(lanchester * math.sqrt(stiffness / (stiffness + lift * rate)), rel=0.03)
    assert damping == pytest.approx(1.0 / (math.sqrt(2.0) * glide.ratio), rel=0.2)


def test_without_pitch_damping_the_phugoid_is_lanchesters(glide: Glide) -> None:
    """And a tail that holds the angle of attack: three times the margin. Frequency within 3 %."""
    with SimTwin.from_config(PLANT) as twin:
        twin.set_many(
            {
                "wing.parameters.pitch_from_pitch_rate": 0.0,
                "wing.parameters.lift_from_pitch_rate": 0.0,
                "wing.parameters.moment_reference_body": [-0.03, 0.0, 0.0],
            }
        )
        plant = Plant(twin)
        state, surfaces = steady(glide)
        lift, drag, _ = coefficients(glide.angle_of_attack, glide.elevator)
        normal = lift * math.cos(glide.angle_of_attack) + drag * math.sin(glide.angle_of_attack)
        moved = (WING["moment_reference_body"][0] + 0.03) / WING["chord"] * normal
        surfaces[0] += moved / WING["pitch_from_elevator"]  # the elevator makes up for the centre of mass
        a, _ = plant.linear(state, surfaces)
    frequency, _ = oscillation(np.linalg.eigvals(a[np.ix_(LONGITUDINAL, LONGITUDINAL)]))[0]
    assert frequency == pytest.approx(math.sqrt(2.0) * GRAVITY / glide.speed, rel=0.03)


def test_the_lateral_modes(linear: tuple[Array, Array], glide: Glide) -> None:
    """Roll subsidence by its approximation L_p within 5 %, a damped Dutch roll, a spiral that diverges slowly."""
    values = np.linalg.eigvals(linear[0][np.ix_([1, 3, 6, 8], [1, 3, 6, 8])])
    pressure = 0.5 * density_at(HEIGHT) * glide.speed**2 * WING["area"] * WING["span"]
    rolling = pressure / INERTIA[0, 0] * WING["roll_from_roll_rate"] * WING["span"] / (2.0 * glide.speed)
    real = sorted(v.real for v in values if abs(v.imag) < 1e-6)
    assert real[0] == pytest.approx(rolling, rel=0.05)
    assert 0.0 < real[1] < 0.2
    frequency, damping = oscillation(values)[0]
    assert 3.0 < frequency < 4.0 and damping > 0.15
