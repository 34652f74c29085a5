# SPDX-License-Identifier: Apache-2.0
"""The control against its design: steps, disturbances, and changes of state without a bump."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import SILENT, TICK_HZ, Array, parameters
from design import closed, loops, step_response

from simclient import SimTwin


def test_a_step_of_the_pad_is_followed_as_designed(sinking: SimTwin) -> None:
    """0.5 m to the north: within 7 % of the linear design, with an overshoot of less than 6 %."""
    begin = sinking.get("earth.outputs.position_ned")[0]
    pad = sinking.get("terminal.parameters.pad")
    sinking.set("terminal.parameters.pad", [begin + 0.5, pad[1]])
    with sinking.trace("earth.outputs.position_ned") as trace:
        sinking.tick(8 * TICK_HZ)
    share = (trace["earth.outputs.position_ned"][:, 0] - begin) / 0.5
    wanted = step_response(closed(loops()["position"]), np.arange(len(share)) / TICK_HZ)
    assert np.abs(share - wanted).max() < 0.07
    assert share.max() < 1.06 and share[-1] == pytest.approx(1.0, abs=0.05)


def test_a_kick_dies_out_as_designed(climbing: SimTwin) -> None:
    """0.1 rad/s about pitch, with the velocity loop open: the rate is that of the linear sensitivity, within 4 %."""
    climbing.set_many({"ascent.parameters.kv": 0.0, "ascent.parameters.kp": 0.0})
    climbing.tick(20)
    climbing.set("body.state.rate_body", [0.0, 0.1, 0.0])
    with climbing.trace("body.outputs.rate_body") as trace:
        climbing.tick(3 * TICK_HZ // 2)
    share = trace["body.outputs.rate_body"][:, 1] / 0.1
    wanted = 1.0 - step_response(closed(loops()["attitude"]), np.arange(1, len(share) + 1) / TICK_HZ)
    assert np.abs(share - wanted).max() < 0.04
    assert share.min() < -0.15  # so that the angle comes back


def test_a_shifted_centre_of_mass_is_trimmed_out(climbing: SimTwin) -> None:
    """2 cm from one moment to the next: an error of the attitude of at most 2 degrees, less than 0.3 after 5 s.
    What remains is a nozzle at offset / arm, and a body that leans by it, so that the thrust is vertical."""
    climbing.set("gimbal.parameters.dry_offset_body", [0.02, 0.0, 0.0])
    names = ["attitude.outputs.error", "earth.outputs.attitude_body_to_ned", "servo_y.outputs.angle"]
    with climbing.trace(*names) as trace:
        climbing.tick(6 * TICK_HZ)
    error = np.degrees(trace["attitude.outputs.error"][:, 1])
    assert 0.3 < np.abs(error).max() < 2.0 and np.abs(error[500:]).max() < 0.3
    offset = climbing.get("gimbal.outputs.centre_of_mass_body")
    trim = math.atan(offset[0] / (parameters("actuators")["pivot"] - offset[2]))
    assert abs(trace["servo_y.outputs.angle"][-1]) == pytest.approx(trim, rel=0.1)
    lean = 2.0 * trace["earth.outputs.attitude_body_to_ned"][-1, 2]
    assert abs(lean) == pytest.approx(trim, abs=0.004)


def test_a_wind_from_the_side_pushes_it_little(sinking: SimTwin) -> None:
    """6 m/s from one moment to the next: less than 1.1 m away, and back within 0.7 m after 10 s."""
    begin = np.array(sinking.get("earth.outputs.position_ned"))
    sinking.set("wind.parameters.wind_east", [6.0] * 16)
    with sinking.trace("earth.outputs.position_ned") as trace:
        sinking.tick(10 * TICK_HZ)
    moved = trace["earth.outputs.position_ned"][:, 1] - begin[1]
    assert 0.05 < np.abs(moved).max() < 1.1 and abs(moved[-1]) < 0.7


def test_thrust_that_is_off_is_found(climbing: SimTwin) -> None:
    """6 % less from one moment to the next: the factor finds it within 3 s, and the climb is back."""
    climb = climbing.get("earth.outputs.velocity_ned")[2]
    factor = climbing.get("propulsion.outputs.factor")
    climbing.set("engine.parameters.max_thrust", 1900.0 * 0.94)
    climbing.tick(4 * TICK_HZ)
    assert climbing.get("propulsion.outputs.factor") - factor == pytest.approx(-0.06, abs=0.015)
    assert climbing.get("earth.outputs.velocity_ned")[2] == pytest.approx(climb, abs=0.3)


def test_roll_stays_within_its_switch(climbing: SimTwin) -> None:
    """A kick of 0.3 rad/s is stopped, and the heading comes back within 3 degrees."""
    climbing.set("body.state.rate_body", [0.0, 0.0, 0.3])
    with climbing.trace("earth.outputs.attitude_body_to_ned") as trace:
        climbing.tick(6 * TICK_HZ)
    heading = np.degrees(2.0 * trace["earth.outputs.attitude_body_to_ned"][:, 3])
    assert 1.0 < heading.max() < 15.0 and abs(heading[-1]) < 3.0


COMMANDS = ["actuators.outputs.throttle", "actuators.outputs.nozzle_x", "actuators.outputs.nozzle_y"]


def changes(twin: SimTwin, state: str, timeout_s: float) -> dict[str, Array]:
    """The change of each command from tick to tick, in the 0.2 s from a change into the state on."""
    names = [*COMMANDS, "steering.outputs.attitude_command"]
    with twin.trace(*names) as trace:
        twin.tick(2)
        twin.run_until(f"machine.state == '{state}'", timeout_ticks=int(timeout_s * TICK_HZ))
        twin.tick(20)
    return {name: np.abs(np.diff(trace[name][-23:], axis=0)) for name in names}


def check_no_bump(change: dict[str, Array]) -> None:
    """A tick changes the throttle by less than 1 %, a nozzle by less than 1 degree, the commanded attitude by 0.5."""
    assert change["actuators.outputs.throttle"].max() < 0.01
    for name in COMMANDS[1:]:
        assert change[name].max() < math.radians(1.0), name
    assert 2.0 * change["steering.outputs.attitude_command"].max() < math.radians(0.5)


def test_the_changes_of_state_of_a_flight_have_no_bump(ascending: SimTwin) -> None:
    check_no_bump(changes(ascending, "DESCENT", 20.0))
    check_no_bump(changes(ascending, "TERMINAL", 20.0))


def test_the_change_to_safe_has_no_bump(descending: SimTwin) -> None:
    descending.set("receiver.parameters.fault", SILENT)
    check_no_bump(changes(descending, "SAFE", 2.0))


def test_the_sink_rate_follows_the_height(ascending: SimTwin) -> None:
    ascending.run_until("machine.state == 'TERMINAL'", timeout_ticks=3000)
    ascending.tick(2 * TICK_HZ)
    with ascending.trace("terminal.outputs.sink", "earth.outputs.velocity_ned", "earth.outputs.height") as trace:
        ascending.run_until("machine.state == 'TOUCHDOWN'", timeout_ticks=2000)
    flying = trace["earth.outputs.height"] > 1.3
    error = trace["earth.outputs.velocity_ned"][flying, 2] - trace["terminal.outputs.sink"][flying]
    assert np.abs(error).max() < 0.35
    assert trace["terminal.outputs.sink"][-1] == parameters("terminal")["touch_speed"]
