# SPDX-License-Identifier: Apache-2.0
"""The mixer alone: what four rotors make of its thrusts, its order of priority, and when the motors are off."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import Array, parameters

from simclient import AlgTwin

ARM, VOLTAGE, WEIGHT = 0.16, 11.4, 1.2 * 9.81
# Where the rotors are (x, y), and the sign of the torque that they put on the body about down.
ROTORS = [(ARM, ARM, 1.0), (-ARM, -ARM, 1.0), (ARM, -ARM, -1.0), (-ARM, ARM, -1.0)]


def wrench(thrusts: Array) -> Array:
    """Thrust, roll, pitch and yaw torque of four rotors at these places: the sum of r x (0, 0, -T), and reactions."""
    factor = parameters("mixer")["torque_factor"] / parameters("mixer")["thrust_factor"]
    total = np.zeros(4)
    for (x, y, side), thrust in zip(ROTORS, thrusts, strict=True):
        moment = np.cross([x, y, 0.0], [0.0, 0.0, -thrust])
        total += [thrust, moment[0], moment[1], side * factor * thrust]
    return total


@pytest.fixture
def mixed(fcsl: Callable[..., AlgTwin]) -> Callable[..., dict[str, Any]]:
    """mixed(thrust, torque, **inputs): the outputs of the mixer."""
    twin = fcsl("../fc/quadrotor.json", instances=["mixer"])

    def mix(thrust: float, torque: list[float], **inputs: Any) -> dict[str, Any]:
        given = {
            "position_health": "nominal", "rate_health": "nominal", "descent_health": "stale", "landed": False,
            "voltage": VOLTAGE, "voltage_valid": True, "imu_valid": True, "thrust": thrust, "torque": torque,
        } | inputs  # fmt: skip
        twin.set_many({f"mixer.inputs.{name}": value for name, value in given.items()})
        twin.tick()
        names = ["thrusts", "given", "limited", "running"] + [f"throttle_{k}" for k in range(1, 5)]
        values = twin.get_many(f"mixer.outputs.{name}" for name in names)
        return {path.rsplit(".", 1)[1]: value for path, value in values.items()}

    return mix


@pytest.mark.parametrize(
    "torque", [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, -0.3, 0.0], [0.0, 0.0, 0.05], [0.2, 0.1, -0.03]]
)
def test_the_rotors_make_what_is_asked_for(mixed: Callable[..., dict[str, Any]], torque: list[float]) -> None:
    out = mixed(WEIGHT, torque)
    assert wrench(out["thrusts"]) == pytest.approx([WEIGHT, *torque], abs=1e-9)
    assert out["given"] == pytest.approx(torque) and not out["limited"]


def test_the_throttle_turns_the_rotor_as_fast_as_the_thrust_needs(mixed: Callable[..., dict[str, Any]]) -> None:
    """The steady motor: throttle V = w / kv + R (kq w^2 kv + i0)."""
    motor = parameters("mixer")
    out = mixed(WEIGHT, [0.2, 0.1, 0.0])
    for k, thrust in enumerate(out["thrusts"], start=1):
        speed = np.sqrt(thrust / motor["thrust_factor"])
        current = motor["torque_factor"] * speed**2 * motor["kv"] + motor["no_load_current"]
        volts = speed / motor["kv"] + motor["resistance"] * current
        assert out[f"throttle_{k}"] == pytest.approx(volts / VOLTAGE)


def test_yaw_gives_way_before_roll_and_pitch(mixed: Callable[..., dict[str, Any]]) -> None:
    out = mixed(WEIGHT, [0.5, -0.4, 2.0])
    thrust, roll, pitch, yaw = wrench(out["thrusts"])
    assert [thrust, roll, pitch] == pytest.approx([WEIGHT, 0.5, -0.4])
    assert 0.0 <= yaw < 0.5 and out["limited"]
    assert out["given"] == pytest.approx([roll, pitch, yaw])


@pytest.mark.parametrize("asked", [0.5, 40.0])
def test_thrust_moves_to_make_room_for_roll(mixed: Callable[..., dict[str, Any]], asked: float) -> None:
    out = mixed(asked, [1.0, 0.0, 0.0])
    thrust, roll, _, _ = wrench(out["thrusts"])
    assert roll == pytest.approx(1.0)
    assert (thrust > asked) if asked < WEIGHT else (thrust < asked)


def test_roll_and_pitch_shrink_together_when_even_that_is_not_enough(mixed: Callable[..., dict[str, Any]]) -> None:
    out = mixed(WEIGHT, [9.0, 4.5, 0.0])
    _, roll, pitch, _ = wrench(out["thrusts"])
    assert 1.0 < roll < 9.0 and roll == pytest.approx(2.0 * pitch) and out["limited"]
    assert min(out["thrusts"]) == pytest.approx(parameters("mixer")["least"])
    assert max(out[f"throttle_{k}"] for k in range(1, 5)) == pytest.approx(1.0)


def test_random_requests_stay_within_the_motors(mixed: Callable[..., dict[str, Any]]) -> None:
    draw = np.random.default_rng(1)
    for _ in range(300):
        out = mixed(draw.uniform(-5.0, 60.0), list(draw.normal(0.0, [2.0, 2.0, 0.5])), voltage=draw.uniform(9.0, 12.6))
        assert min(out["thrusts"]) >= parameters("mixer")["least"] - 1e-12
        throttles = [out[f"throttle_{k}"] for k in range(1, 5)]
        assert min(throttles) > 0.0 and max(throttles) <= 1.0
        assert wrench(out["thrusts"])[1:] == pytest.approx(out["given"], abs=1e-9)


def test_a_dead_voltmeter_is_replaced_by_the_nominal_voltage(mixed: Callable[..., dict[str, Any]]) -> None:
    nominal = mixed(WEIGHT, [0.0, 0.0, 0.0], voltage=11.4)
    for wrong in ({"voltage": 0.0}, {"voltage": 3.0, "voltage_valid": False}, {"voltage": float("nan")}):
        assert mixed(WEIGHT, [0.0, 0.0, 0.0], **wrong)["throttle_1"] == pytest.approx(nominal["throttle_1"])


def test_motors_are_off_without_a_controller_and_for_good_without_imu(mixed: Callable[..., dict[str, Any]]) -> None:
    off = mixed(WEIGHT, [0.1, 0.0, 0.0], position_health="stale")
    assert not off["running"] and all(off[f"throttle_{k}"] == 0.0 for k in range(1, 5))
    assert mixed(WEIGHT, [0.1, 0.0, 0.0])["running"]
    assert mixed(WEIGHT, [0.0, 0.0, 0.0], landed=True)["running"]  # not in SAFE: no meaning
    assert not mixed(WEIGHT, [0.0, 0.0, 0.0], imu_valid=False)["running"]
    assert not mixed(WEIGHT, [0.0, 0.0, 0.0])["running"]
