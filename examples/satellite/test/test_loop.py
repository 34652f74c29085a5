# SPDX-License-Identifier: Apache-2.0
"""The attitude loop against its design: the poles of the compiled gains, a step of torque, a turn of the command."""

import json
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLE, HZ, SIM, angles, flown
from scipy.linalg import expm
from scipy.signal import TransferFunction, lsim

MACHINE = EXAMPLE / "fc" / "satellite.json"
INERTIA = np.array(json.loads(SIM.read_text())["instances"]["body"]["inputs"]["inertia"])
NATURAL, DAMPING, INTEGRAL = 0.3, 0.7, 0.05  # rad/s, of the design in README.md
DESIGN = np.array([-INTEGRAL] + [NATURAL * complex(-DAMPING, sign * np.sqrt(1.0 - DAMPING**2)) for sign in (1.0, -1.0)])


@pytest.fixture
def jacobian(fcsl: Any) -> np.ndarray:
    """How the torque of the compiled machine depends on attitude, rate and integral (3 by 9), by small differences."""
    twin = fcsl(MACHINE, instances=["point"])
    twin.tick()  # the first one begins with an empty integral
    small, columns = 1e-5, []
    for number in range(9):
        torque = []
        for sign in (1.0, -1.0):
            lean, rate, total = np.zeros((3, 3))
            (lean, rate, total)[number // 3][number % 3] = sign * small
            twin.set_many(
                {
                    "point.inputs.reference": [1.0, 0.0, 0.0, 0.0],
                    "point.inputs.attitude": [np.cos(small / 2), *np.sin(lean / 2)] if number < 3 else [1.0, 0, 0, 0],
                    "point.inputs.rate": rate.tolist(),
                    "point.state.sum": total.tolist(),
                    "point.inputs.limited": True,  # the integral stands
                }
            )
            twin.tick()
            torque.append(np.array(twin.get_value("point.outputs.torque")))
        columns.append((torque[0] - torque[1]) / (2.0 * small))
    return np.array(columns).T


def close(poles: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    """Whether every pole is near an expected one, three at each."""
    near = np.abs(poles[:, None] - expected[None, :]) < tolerance * np.abs(expected)[None, :]
    return bool(near.any(axis=1).all() and (near.sum(axis=0) == 3).all())


def test_the_poles_of_the_linearised_loop_are_those_of_the_design(jacobian: np.ndarray) -> None:
    """States: attitude, rate, integral. In continuous time, and with the torque held for a tick."""
    plant = np.zeros((9, 9))
    plant[0:3, 3:6] = np.eye(3)
    plant[6:9, 0:3] = -np.eye(3)  # the integral is that of the error, minus the attitude
    drive = np.zeros((9, 3))
    drive[3:6] = np.linalg.inv(INERTIA)
    assert close(np.linalg.eigvals(plant + drive @ jacobian), DESIGN, 1e-3)

    whole = expm(np.block([[plant, drive], [np.zeros((3, 12))]]) / HZ)
    sampled = whole[:9, :9] + whole[:9, 9:] @ jacobian
    assert close(np.log(np.linalg.eigvals(sampled).astype(complex)) * HZ, DESIGN, 0.05)


@pytest.mark.parametrize("axis", range(3))
def test_a_step_of_torque_is_rejected_as_designed(fcsl_sim: Any, exact: list[str], axis: int) -> None:
    """e = -s / ((s + integral)(s^2 + 2 damping natural s + natural^2)) times the torque over the inertia."""
    twin = fcsl_sim(SIM, sets=[*exact, "wheels.inputs.torque_5_body=[0.0, 0.0, 0.0]"])
    twin.set("guidance.parameters.nadir", False)
    twin.tick(6000)
    assert twin.get_value("guidance.outputs.settled")
    twin.tick(1200)
    push = [0.0, 0.0, 0.0]
    push[axis] = 1e-4
    twin.set("wheels.inputs.torque_5_body", push)
    with twin.trace("body.outputs.attitude_body_to_inertial", "guidance.outputs.command") as trace:
        twin.tick(1600)
    moved = angles(trace["guidance.outputs.command"], trace["body.outputs.attitude_body_to_inertial"])
    time_s = np.arange(1600) / HZ
    loop = TransferFunction([1.0, 0.0], np.poly(DESIGN).real)
    unit = lsim(loop, np.ones(1600), time_s)[1]
    expected = unit[:, None] * (np.linalg.inv(INERTIA) @ push)[None, :]
    peak = np.abs(expected[:, axis]).max()
    np.testing.assert_allclose(moved, expected, atol=0.05 * peak)
    assert np.abs(moved[-1]).max() < 0.06 * peak  # the integral takes it away


def test_a_turn_of_30_degrees_arrives_without_overshoot(fcsl_sim: Any, exact: list[str]) -> None:
    twin = fcsl_sim(SIM, sets=exact)
    twin.set("guidance.parameters.nadir", False)
    twin.tick(6000)
    assert twin.get_value("guidance.outputs.settled")
    twin.tick(600)
    turn = np.radians(30.0)
    twin.set("guidance.parameters.inertial_attitude", [float(np.cos(turn / 2)), 0.0, float(np.sin(turn / 2)), 0.0])
    with twin.trace("body.outputs.attitude_body_to_inertial", "body.outputs.rate_body") as trace:
        twin.tick(3000)
    turned = angles(np.array([1.0, 0.0, 0.0, 0.0]), trace["body.outputs.attitude_body_to_inertial"])[:, 1]
    time_s = np.arange(3000) / HZ
    # By the profile: at max_rate to the last max_rate / approach, then exp(-approach t); 10 s for the beginning.
    arrives = (turn - 0.25) / 0.02 + np.log(0.25 / (0.02 * turn)) / 0.08
    assert arrives < time_s[np.argmax(turned > 0.98 * turn)] < arrives + 10.0
    assert turned.max() < turn * 1.002
    assert np.abs(trace["body.outputs.rate_body"]).max() < 0.021


def test_following_costs_no_accuracy(exact: list[str]) -> None:
    """While the reference turns, the attitude stays on it: rate and acceleration are fed forward."""
    trace = flown(
        5000,
        "body.outputs.attitude_body_to_inertial",
        "guidance.outputs.reference",
        "machine.state",
        sets=exact,
    )
    error = angles(trace["guidance.outputs.reference"], trace["body.outputs.attitude_body_to_inertial"])
    follows = np.flatnonzero(trace["machine.state"] == "POINT")[400:]
    assert np.degrees(np.abs(error[follows])).max() < 0.15
