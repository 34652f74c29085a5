# SPDX-License-Identifier: Apache-2.0
"""The control against its design: margins, step responses, disturbances, and changes of state without a bump."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from conftest import CALM, TICK_HZ, Array, angle_error, parameters
from design import bandwidth, cascade, closed, margins
from scipy.linalg import expm
from scipy.signal import cont2discrete

from fcsl_sim import Simulation, load
from fcsl_sim.linear.linearise import linearise
from fcsl_sim.linear.plant import Plant
from fcsl_sim.linear.response import Response
from simclient import SimTwin

GROUND_SPEED = 3.0  # m/s, of the mission
ROLL = np.array([-1.0, 1.0, 1.0, -1.0])  # throttles: the left rotors faster, the right ones slower
HOME = [0.0, 0.0, -5.12]


def test_the_loops_have_the_stated_crossovers_and_margins() -> None:
    stated = {"rate": 23.5, "attitude": 8.3, "velocity": 2.0, "position": 0.86}  # rad/s
    for axis in (0, 1):
        loops = cascade(axis)
        for name, crossover in stated.items():
            found = margins(loops[name])
            assert found.crossover == pytest.approx(crossover, rel=0.02), name
            assert found.phase > math.radians(60.0) and found.gain > 6.0, name
        for inner, outer in zip(stated, list(stated)[1:], strict=False):
            assert stated[inner] > 2.0 * stated[outer]
        assert bandwidth(closed(loops["position"])) == pytest.approx(1.5, rel=0.05)


def test_the_rate_loop_has_the_poles_that_it_was_placed_at() -> None:
    """Without integral and delay: 40 rad/s, damping 0.8."""
    rate = parameters("rate")
    for axis in (0, 1):
        poles = np.roots([rate["lag"], 1.0 + rate["c"][axis], rate["k"][axis]])
        assert np.abs(poles) == pytest.approx(40.0, rel=0.01)
        assert -poles[0].real / abs(poles[0]) == pytest.approx(0.8, rel=0.01)


def test_the_flown_response_is_that_of_the_sampled_linear_plant() -> None:
    """Roll by the motors, with controller and sensors in the loop, beside the linearised plant with commands that are held
    for a tick (SciPy). The design's sensitivities, all four in a row, have a peak of 1.47."""
    config = load(CALM)
    motors = {f"motor_{k}.inputs.throttle": weight for k, weight in zip(range(1, 5), ROLL, strict=True)}
    with Plant(config, Fraction(20)) as plant:
        linear = linearise(plant, list(motors), ["body.outputs.rate_body[0]"], ["body.state.rate_body*", "motor_*"])
    continuous = linear.a, linear.b @ ROLL[:, None], linear.c, linear.d @ ROLL[:, None]
    a, b, c, d, _ = cont2discrete(continuous, 1.0 / TICK_HZ)
    inputs = [f"{path}={weight}" for path, weight in motors.items()]
    with Response(config, inputs, ["body.outputs.rate_body[0]"], Fraction(20), 1e-3) as response:
        points = list(response.points([25.0, 45.0, 200.0, 500.0]))
    for point in points:
        z = cmath.exp(1j * point.omega / TICK_HZ)
        expected = c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d
        assert point.response(0) / point.sensitivity == pytest.approx(expected[0, 0], rel=2e-3)
    assert abs(points[1].sensitivity) == pytest.approx(1.55, rel=0.02)


def test_it_hovers_with_its_weight_where_it_was_sent(hovering: SimTwin) -> None:
    share = hovering.get("position.outputs.thrust_share")
    assert share == pytest.approx(1.0, abs=0.01)
    thrusts = [hovering.get(f"rotor_{k}.outputs.thrust") for k in range(1, 5)]
    assert thrusts == pytest.approx(hovering.get("mixer.outputs.thrusts"), rel=0.01)  # the inverse of the motors
    assert sum(thrusts) == pytest.approx(1.2 * 9.81, rel=0.01)
    assert hovering.get("earth.outputs.position_ned") == pytest.approx(HOME, abs=0.06)


def linear_roll(kick: float, ticks: int) -> Array:
    """The roll rate (rad/s) after a kick, in the linear design: angle, rate, torque, a command held for each tick."""
    rate, attitude = parameters("rate"), parameters("attitude")
    inertia, lag = rate["inertia"][0], rate["lag"]
    held = np.zeros((4, 4))
    held[0, 1], held[1, 2], held[2, 2], held[2, 3] = 1.0, 1.0 / inertia, -1.0 / lag, 1.0 / lag
    step = expm(held / TICK_HZ)
    state, modelled, integral, rates = np.array([0.0, kick, 0.0, 0.0]), 0.0, 0.0, []
    for _ in range(ticks):
        rates.append(state[1])
        modelled += (state[3] - modelled) * (1.0 - math.exp(-1.0 / TICK_HZ / lag))
        error = -attitude["gain"][0] * state[0] - state[1]
        integral += rate["ki"][0] * error / TICK_HZ
        state[3] = inertia * (rate["k"][0] * error + integral) - rate["c"][0] * modelled
        state = step @ state
    return np.array(rates)


def test_a_kick_in_roll_dies_out_as_designed(hovering: SimTwin) -> None:
    hovering.set("body.state.rate_body", [0.4, 0.0, 0.0])
    with hovering.trace("body.outputs.rate_body", "position.outputs.attitude_command") as trace:
        hovering.tick(150)
    flown, designed = trace["body.outputs.rate_body"][:, 0], linear_roll(0.4, 150)
    assert np.abs(flown - designed).max() < 0.15 * 0.4
    assert np.abs(flown[100:]).max() < 0.1 * 0.4  # settled after 0.4 s
    assert np.abs(trace["body.outputs.rate_body"][:, 1:]).max() < 0.02  # and it stays in roll


def test_a_yaw_error_decays_with_the_stated_rate(hovering: SimTwin) -> None:
    """2 rad/s: 63 % in 0.5 s, and no overshoot to speak of."""
    yaw = 0.3
    attitude = hovering.get("body.state.attitude_body_to_inertial")
    w, _, _, z = attitude
    turned = [w * math.cos(yaw / 2) - z * math.sin(yaw / 2), 0.0, 0.0, z * math.cos(yaw / 2) + w * math.sin(yaw / 2)]
    hovering.set("body.state.attitude_body_to_inertial", turned)
    hovering.set("navigation.outputs.attitude", turned)
    with hovering.trace("earth.outputs.attitude_body_to_ned") as trace:
        hovering.tick(3 * TICK_HZ)
    error = -angle_error(trace["earth.outputs.attitude_body_to_ned"], np.array([attitude]))[:, 2]
    assert error[0] == pytest.approx(yaw, rel=0.02)
    assert 0.3 < np.argmax(error < yaw / math.e) / TICK_HZ < 0.9
    assert error.min() > -0.25 * yaw and abs(error[-1]) < 0.1 * yaw


def test_a_step_of_the_target_is_followed_with_little_overshoot(hovering: SimTwin) -> None:
    start = np.array(hovering.get("earth.outputs.position_ned"))
    begin = np.array(hovering.get("hold.outputs.target"))
    hovering.set("hold.outputs.target", list(begin + [3.0, 0.0, 0.0]))
    with hovering.trace("earth.outputs.position_ned", "reference.outputs.position") as trace:
        hovering.tick(8 * TICK_HZ)
    moved = trace["earth.outputs.position_ned"] - start
    time_s = np.arange(len(moved)) / TICK_HZ
    pole = parameters("reference")["pole"]
    lead = pole * time_s
    filtered = 3.0 * (1.0 - np.exp(-lead) * (1.0 + lead + lead**2 / 2.0))  # the closed form of the reference
    reference = trace["reference.outputs.position"][:, 0] - begin[0]
    np.testing.assert_allclose(reference, np.interp(time_s + 1 / TICK_HZ, time_s, filtered), atol=0.02)
    assert np.abs(moved[:, 0] - reference).max() < 0.2
    rise = (np.argmax(moved[:, 0] > 2.7) - np.argmax(moved[:, 0] > 0.3)) / TICK_HZ
    assert 1.5 < rise < 2.5
    assert moved[:, 0].max() < 1.05 * 3.0
    assert np.abs(moved[:, 1:]).max() < 0.1


def test_a_steady_push_is_trimmed_out(hovering: SimTwin) -> None:
    """A wind of 4 m/s from one moment to the next: pushed by less than 0.6 m, back within 0.15 m after 9 s."""
    start = np.array(hovering.get("earth.outputs.position_ned"))
    hovering.set("wind.parameters.wind_north", [4.0] * 16)
    with hovering.trace("earth.outputs.position_ned", "earth.outputs.attitude_body_to_ned") as trace:
        hovering.tick(10 * TICK_HZ)
    moved = trace["earth.outputs.position_ned"] - start
    assert 0.1 < moved[:, 0].max() < 0.6
    assert np.abs(moved[-TICK_HZ:]).max() < 0.15
    pitch = 2.0 * trace["earth.outputs.attitude_body_to_ned"][-1, 2]
    assert 0.03 < pitch < 0.2  # nose up, against the wind


@pytest.mark.parametrize("mass", [1.14, 1.26])
def test_a_mass_5_percent_off_costs_little_height(hovering: SimTwin, mass: float) -> None:
    height = hovering.get("earth.outputs.position_ned")[2]
    hovering.set("mass.parameters.dry_mass", mass)
    with hovering.trace("earth.outputs.position_ned") as trace:
        hovering.tick(6 * TICK_HZ)
    moved = trace["earth.outputs.position_ned"][:, 2] - height
    assert 0.02 < np.abs(moved).max() < 0.2 and abs(moved[-1]) < 0.06


def test_the_motors_spool_up_slowly_before_it_leaves_the_ground(fly: Callable[..., Simulation]) -> None:
    with fly(1) as sim:
        while sim.state != "TAKE_OFF":
            sim.run(10 * TICK_HZ)
        throttles = []
        for _ in range(10):
            sim.run(25)
            throttles.append(sim.machine_value("mixer.outputs.throttle_1"))
            assert sim.get("ground.outputs.touching")
        assert throttles[0] < 0.2 and 0.4 < throttles[-1] < 0.5
        assert np.diff(throttles).max() < 0.08


@pytest.mark.parametrize("order, state", [(2, "MISSION"), (3, "LAND")])
def test_a_change_of_state_does_not_bump_the_motors(hovering: SimTwin, order: int, state: str) -> None:
    """Throttles move by less than 1 % of full from tick to tick, and the commanded tilt by less than 0.2 degrees."""
    name = {2: "mission_s", 3: "land_s"}[order]
    hovering.set(f"pilot.parameters.{name}", hovering.get("machine.tick") / TICK_HZ + 0.3)
    paths = [f"mixer.outputs.throttle_{k}" for k in range(1, 5)]
    with hovering.trace(*paths, "position.outputs.attitude_command") as trace:
        hovering.run_until(f"machine.state == '{state}'", timeout_ticks=TICK_HZ)
        hovering.tick(50)
    for path in paths:
        assert np.abs(np.diff(trace[path])).max() < 0.01
    commands = trace["position.outputs.attitude_command"]
    assert np.abs(angle_error(commands[:-1], commands[1:])).max() < math.radians(0.2)


@pytest.mark.parametrize("fault", ["receiver", "baro"])
def test_the_loss_of_a_sensor_in_full_flight_does_not_bump_the_motors(hovering: SimTwin, fault: str) -> None:
    """From 3 m/s into SAFE (GNSS) or LAND (barometer): throttles by less than 3 %, tilt by less than 1 degree a tick."""
    hovering.set("pilot.parameters.mission_s", hovering.get("machine.tick") / TICK_HZ)
    hovering.run_until("machine.state == 'MISSION'", timeout_ticks=TICK_HZ)
    hovering.tick(2 * TICK_HZ)
    assert np.linalg.norm(hovering.get("earth.outputs.velocity_ned")) > 0.6 * GROUND_SPEED
    hovering.set(f"{fault}.parameters.fault", 1)
    paths = [f"mixer.outputs.throttle_{k}" for k in range(1, 5)]
    with hovering.trace(*paths, "position.outputs.attitude_command") as trace:
        hovering.run_until("machine.state != 'MISSION'", timeout_ticks=TICK_HZ)
        hovering.tick(25)
    for path in paths:
        assert np.abs(np.diff(trace[path])).max() < 0.03
    commands = trace["position.outputs.attitude_command"]
    assert np.abs(angle_error(commands[:-1], commands[1:])).max() < math.radians(1.0)
