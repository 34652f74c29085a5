# SPDX-License-Identifier: Apache-2.0
"""The control against its design: margins, step responses, disturbances, and changes of state without a bump."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import SILENT, TICK_HZ
from design import Margins, Response, bandwidth, closed, loops, margins, parameters, step_response
from flight_mechanics import Array, best_glide, trim
from plant import HEIGHT, Plant, steady
from test_glide import density_at

from simclient import SimTwin

COMMANDS = [f"surfaces.outputs.{name}" for name in ("elevator", "aileron", "rudder")]


@pytest.fixture(scope="module")
def designed(plant: Plant) -> dict[str, Response]:
    density = density_at(HEIGHT)
    glide = trim(best_glide().speed * math.sqrt(1.225 / density), density)
    return loops(*plant.linear(*steady(glide)), glide.speed)


def test_the_loops_have_the_stated_crossovers_and_margins(designed: dict[str, Response]) -> None:
    stated = {"pitch": 5.3, "speed": 0.62, "roll": 4.0, "course": 0.56}  # rad/s
    found: dict[str, Margins] = {name: margins(loop) for name, loop in designed.items()}
    for name, crossover in stated.items():
        assert found[name].crossover == pytest.approx(crossover, rel=0.03), name
        assert found[name].phase > math.radians(60.0) and found[name].gain > 6.0, name
    assert found["pitch"].crossover > 5.0 * found["speed"].crossover
    assert found["roll"].crossover > 5.0 * found["course"].crossover
    assert bandwidth(closed(designed["course"])) > 0.5


def step(twin: SimTwin, path: str, ticks: int, *paths: str) -> dict[str, Array]:
    with twin.trace(path, *paths) as trace:
        twin.tick(ticks)
    return {name: trace[name] for name in (path, *paths)}


def test_a_step_of_the_course_is_followed_as_designed(gliding: SimTwin, designed: dict[str, Response]) -> None:
    """Within 6 % of the linear design, without overshoot, and coordinated."""
    begin = gliding.get("navigation.outputs.course")
    gliding.set("glide.state.straight", begin + 0.05)  # so small that the rate of the bank is not limited for long
    values = step(gliding, "navigation.outputs.course", 15 * TICK_HZ, "air.outputs.sideslip", "angles.outputs.roll")
    share = (values["navigation.outputs.course"] - begin) / 0.05
    wanted = step_response(closed(designed["course"]), np.arange(len(share)) / TICK_HZ)
    assert np.abs(share - wanted).max() < 0.06
    assert share.max() < 1.01 and share[-1] == pytest.approx(1.0, abs=0.03)
    assert np.abs(values["air.outputs.sideslip"]).max() < math.radians(2.5)
    assert values["angles.outputs.roll"].max() == pytest.approx(0.026, abs=0.01)


def test_a_step_of_the_speed_is_followed_as_designed(gliding: SimTwin, designed: dict[str, Response]) -> None:
    """The command climbs by 1 m/s^2 for 1.5 s. The speed is within 6 % of what the linear design makes of that."""
    begin = gliding.get("navigation.outputs.airspeed")
    gliding.set("glide.parameters.speed", begin + 1.5)
    values = step(gliding, "navigation.outputs.airspeed", 25 * TICK_HZ, "angles.outputs.pitch")
    share = (values["navigation.outputs.airspeed"] - begin) / 1.5
    response = step_response(closed(designed["speed"]), np.arange(len(share)) / TICK_HZ)
    ramp = np.full(int(1.5 * TICK_HZ), 1.0 / (1.5 * TICK_HZ))
    wanted = np.convolve(response, ramp)[: len(share)]
    assert np.abs(share - wanted).max() < 0.06
    assert share.max() < 1.06 and share[-1] == pytest.approx(1.0, abs=0.05)


def test_the_phugoid_is_damped_by_the_speed_loop(gliding: SimTwin) -> None:
    """A kick of 1.5 m/s in speed dies out within 8 s, without an oscillation."""
    velocity = np.array(gliding.get("body.state.velocity_inertial"))
    begin = gliding.get("navigation.outputs.airspeed")
    kicked = list(velocity * (1.0 + 1.5 / np.linalg.norm(velocity)))
    gliding.set("body.state.velocity_inertial", kicked)
    gliding.set("navigation.outputs.velocity", kicked)
    values = step(gliding, "navigation.outputs.airspeed", 12 * TICK_HZ)
    error = values["navigation.outputs.airspeed"] - begin
    assert error[2] == pytest.approx(1.5, abs=0.3)
    assert np.abs(error[8 * TICK_HZ :]).max() < 0.15
    assert error.min() > -0.4


def test_an_updraught_lifts_it_and_leaves_its_speed(gliding: SimTwin) -> None:
    """1 m/s from one moment to the next: the sink is less by that, the speed is off by less than 1 m/s, and returns."""
    sink, speed = gliding.get("earth.outputs.velocity_ned")[2], gliding.get("air.outputs.airspeed")
    gliding.set("wind.parameters.wind_down", [-1.0] * 16)
    values = step(gliding, "air.outputs.airspeed", 15 * TICK_HZ, "earth.outputs.velocity_ned")
    error = values["air.outputs.airspeed"] - speed
    assert np.abs(error).max() < 1.0 and np.abs(error[-2 * TICK_HZ :]).max() < 0.15
    assert values["earth.outputs.velocity_ned"][-1, 2] == pytest.approx(sink - 1.0, abs=0.05)


def test_a_wind_from_the_side_does_not_change_the_course(gliding: SimTwin) -> None:
    """3 m/s within one tick: the wind is estimated within 0.5 m/s after 30 s, and the course is back within 1 degree."""
    begin = gliding.get("glide.state.straight")
    gliding.set("wind.parameters.wind_east", [3.0] * 16)
    gliding.tick(30 * TICK_HZ)
    assert gliding.get("navigation.outputs.wind")[1] == pytest.approx(3.0, abs=0.5)
    north, east, _ = gliding.get("earth.outputs.velocity_ned")
    assert math.atan2(east, north) == pytest.approx(begin, abs=math.radians(1.0))


def largest_change(twin: SimTwin, state: str, timeout_s: float, ticks: int = 25) -> dict[str, float]:
    """The largest change of each command of a surface from tick to tick, around the change into a state (rad)."""
    with twin.trace(*COMMANDS, "reference.outputs.pitch", "reference.outputs.bank") as trace:
        twin.tick(2)
        twin.run_until(f"machine.state == '{state}'", timeout_ticks=int(timeout_s * TICK_HZ))
        twin.tick(ticks)
    last = -(ticks + 3)
    names = [*COMMANDS, "reference.outputs.pitch", "reference.outputs.bank"]
    return {name: float(np.abs(np.diff(trace[name][last:])).max()) for name in names}


def check_no_bump(change: dict[str, float]) -> None:
    """Commands of pitch and bank move by less than 0.7 rad/s, surfaces by less than 1.2 degrees a tick."""
    assert change["reference.outputs.pitch"] < 0.7 / TICK_HZ and change["reference.outputs.bank"] < 0.71 / TICK_HZ
    for name in COMMANDS:
        assert change[name] < math.radians(1.2), name


def test_the_loss_of_the_airspeed_does_not_bump_the_surfaces(gliding: SimTwin) -> None:
    gliding.set("glide.state.straight", gliding.get("glide.state.straight") + 1.0)
    gliding.tick(TICK_HZ)
    assert gliding.get("angles.outputs.roll") > 0.2
    gliding.set("pitot_tube.parameters.fault", SILENT)
    check_no_bump(largest_change(gliding, "SAFE", 1.0))
    gliding.set("pitot_tube.parameters.fault", 0)
    check_no_bump(largest_change(gliding, "GLIDE", 5.0))


def test_the_way_from_glide_to_waypoints_to_circle_does_not_bump_the_surfaces(gliding: SimTwin) -> None:
    gliding.set("glide.parameters.straight_s", 0.0)
    check_no_bump(largest_change(gliding, "WAYPOINT", 1.0))
    gliding.tick(5 * TICK_HZ)
    gliding.set("waypoint.outputs.done", True)
    check_no_bump(largest_change(gliding, "LOITER", 1.0))


def test_the_release_of_the_winch_does_not_bump_the_surfaces() -> None:
    from conftest import CALM

    with SimTwin.from_config(CALM) as twin:
        twin.run_until("machine.state == 'LAUNCH'", timeout_ticks=1000)
        change = largest_change(twin, "GLIDE", 30.0)
        check_no_bump(change)
        with twin.trace("air.outputs.airspeed") as trace:
            twin.tick(5 * TICK_HZ)
        assert trace["air.outputs.airspeed"].min() > 10.0  # it pushes over in time


def test_the_circle_has_its_radius(gliding: SimTwin) -> None:
    """In still air: 60 m within 2 m, bank within 1 degree of atan(V^2 / (g r)), sideslip below 1.2 degrees."""
    gliding.set_many({"glide.parameters.straight_s": 0.0, "reference.outputs.waypoints_done": True})
    gliding.run_until("machine.state == 'LOITER'", timeout_ticks=2 * TICK_HZ)
    here = gliding.get("navigation.outputs.position")
    gliding.set("loiter.parameters.centre", [here[0], here[1] + 60.0])
    gliding.tick(20 * TICK_HZ)
    names = ["loiter.outputs.distance", "angles.outputs.roll", "air.outputs.airspeed", "air.outputs.sideslip"]
    with gliding.trace(*names) as trace:
        gliding.tick(20 * TICK_HZ)
    assert abs(np.degrees(trace["air.outputs.sideslip"].mean())) < 1.2
    assert np.abs(trace["loiter.outputs.distance"] - parameters("loiter")["radius"]).max() < 2.0
    bank = math.atan(float(trace["air.outputs.airspeed"].mean()) ** 2 / (9.80665 * 60.0))
    assert trace["angles.outputs.roll"].mean() == pytest.approx(bank, abs=math.radians(1.0))
