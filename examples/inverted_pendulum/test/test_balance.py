# SPDX-License-Identifier: Apache-2.0
"""Balance against its design: steps of the target, pushes, taps on the pole, and the states that it catches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import CALM, HZ, TRUTH, Array, changes, parameters
from design import loop, pushed, regulator

from simclient import SimTwin


def filtered(size: float, time_s: Array) -> Array:
    """The response of five lags to a step, in closed form."""
    x = parameters("reference")["pole"] * time_s
    total: Array = size * (1.0 - np.exp(-x) * sum(x**n / math.factorial(n) for n in range(5)))
    return total


@pytest.mark.parametrize("size", [0.2, -0.25])
def test_a_step_of_the_target_is_followed_as_designed(calm: SimTwin, size: float) -> None:
    now = calm.get("machine.tick") / HZ
    calm.set("desk.parameters.targets", [size, 0.0, 0.0, 0.0])
    calm.set("desk.parameters.times", [now, -1.0, -1.0, -1.0])
    with calm.trace(*TRUTH, "reference.outputs.goal", "operator.outputs.target", "motor.outputs.force") as trace:
        calm.tick(4 * HZ)
    begin = int(np.argmax(trace["operator.outputs.target"] != 0.0))
    assert begin < 5  # the desk speaks 50 times a second
    time_s = np.arange(4 * HZ - begin) / HZ
    position, angle = (trace[path][begin:] for path in TRUTH[:2])
    # The flat output y = s + (J / m l) a is the filtered target; the rest follows.
    plant = parameters("reference")["plant"]
    moment = plant["pole_mass"] * plant["pole_length"]
    arm = (plant["pole_inertia"] + moment * plant["pole_length"]) / moment
    goal = trace["reference.outputs.goal"][begin:]
    np.testing.assert_allclose(goal[:, 0] + arm * goal[:, 1], filtered(size, time_s), atol=1e-9 * abs(size))
    np.testing.assert_allclose(position + arm * angle, filtered(size, time_s), atol=0.01 * abs(size))
    share = position / size
    rise = (np.argmax(share > 0.9) - np.argmax(share > 0.1)) / HZ
    assert 0.9 < rise < 1.1
    assert share.max() < 1.01
    assert -0.12 < share.min() < -0.03  # first the other way, so that the pole leans
    assert abs(share[round(2.5 * HZ)] - 1.0) < 0.02
    assert np.abs(angle).max() < 0.35 * abs(size)
    assert np.abs(np.diff(trace["motor.outputs.force"])).max() < 0.5 * abs(size)  # N: no jump


def test_a_push_is_answered_as_the_linear_loop_does(calm: SimTwin) -> None:
    """5 N for 0.1 s."""
    push = np.zeros(4 * HZ)
    push[: HZ // 10] = 5.0
    with calm.trace(*TRUTH, "motor.outputs.force") as trace:
        calm.set("push.parameters.bias", 5.0)
        calm.tick(HZ // 10)
        calm.set("push.parameters.bias", 0.0)
        calm.tick(len(push) - HZ // 10)
    expected = pushed(loop(regulator()[0]), push)
    moved = np.column_stack([trace[path] for path in TRUTH[:2]])
    np.testing.assert_allclose(moved, expected, atol=0.01 * np.abs(expected).max())
    assert 0.03 < np.abs(moved[:, 0]).max() < 0.06 and 0.04 < np.abs(moved[:, 1]).max() < 0.08
    assert np.abs(moved[2 * HZ :]).max() < 0.005


@pytest.mark.parametrize("force", [1.5, -3.0])
def test_a_steady_push_moves_the_cart_by_force_over_gain(calm: SimTwin, force: float) -> None:
    """There is no integral: the cart leans against the push. The filter takes 3 % of it for a speed."""
    calm.set("push.parameters.bias", force)
    calm.tick(5 * HZ)
    assert calm.state() == "BALANCE"
    leaning = calm.get("pendulum.outputs.position")
    assert leaning == pytest.approx(force / parameters("balance")["k"][0], rel=0.03)
    expected = pushed(loop(regulator()[0]), np.full(5 * HZ + 1, force))
    assert leaning == pytest.approx(expected[-1, 0], rel=0.002)
    assert calm.get("motor.outputs.force") == pytest.approx(-force, rel=0.01)


def test_a_wrong_zero_of_the_angle_moves_the_cart(calm: SimTwin) -> None:
    """By a count: 3.4 mm a mrad. The pole is upright and seems to lean; the cart's error has to make up for that."""
    calm.set("pole_encoder.parameters.bias", 0.0015)
    calm.tick(5 * HZ)
    expected = pushed(loop(regulator()[0]), np.zeros(5 * HZ + 1), zero=0.0015)
    assert calm.get("pendulum.outputs.position") == pytest.approx(expected[-1, 0], rel=0.005)
    assert calm.get("pendulum.outputs.position") == pytest.approx(-3.4 * 0.0015, rel=0.02)


@pytest.mark.parametrize("rate", [0.5, -0.5, 1.2, -1.2])
def test_a_tap_on_the_pole_is_borne(balancing: SimTwin, rate: float) -> None:
    """Which changes its rate at once."""
    balancing.set("pendulum.state.angle_rate", rate)
    with balancing.trace("machine.state", *TRUTH) as trace:
        balancing.tick(3 * HZ)
    assert not changes(trace["machine.state"])
    assert np.abs(trace[TRUTH[1]]).max() < 0.18 * abs(rate)
    assert np.abs(trace[TRUTH[1]][2 * HZ :]).max() < 0.02


@pytest.mark.parametrize("rate", [3.0, -3.0, 5.0, -5.0])
def test_a_blow_that_balance_cannot_bear_ends_in_another_swing_up(balancing: SimTwin, rate: float) -> None:
    """It sees at once that it will not, and does not drive the cart into the end of the rail."""
    balancing.set("pendulum.state.angle_rate", rate)
    with balancing.trace("machine.state", "motor.outputs.force", "pendulum.outputs.position") as trace:
        balancing.tick(10 * HZ)
    (lost, state), (_, again) = changes(trace["machine.state"])
    assert (state, again) == ("SWING_UP", "BALANCE") and lost < 10
    assert np.abs(np.diff(trace["motor.outputs.force"][lost - 1 :])).max() <= 2.0 + 1e-9  # the slew of swing_up
    assert np.abs(trace["pendulum.outputs.position"]).max() < 0.42


def on_the_edge(count: int) -> Array:
    """States of the edge of the ellipsoid (lead, tilt, speed, rate), at most 0.35 rad."""
    cost = np.array(parameters("swing_up")["cost"])
    ways = np.random.default_rng(1).normal(size=(4 * count, 4))
    states = np.linalg.solve(np.linalg.cholesky(cost).T, (ways / np.linalg.norm(ways, axis=1, keepdims=True)).T).T
    chosen = states[np.abs(states[:, 1]) < parameters("swing_up")["capture_tilt"]][:count]
    assert len(chosen) == count
    return np.asarray(chosen)


def test_balance_catches_every_state_of_its_ellipsoid() -> None:
    """In the plant itself, with its limit of force, and a motor that is 5 N off where it takes over. On a longer rail."""
    with SimTwin.from_config(CALM, sets=["desk.parameters.run_s=0.0"]) as twin:
        twin.set("monitor.parameters.end_limit", 2.0)
        twin.set("drive.parameters.rail_half_length", 3.0)
        twin.tick(10)
        start = twin.save()
        for lead, tilt, speed, rate in on_the_edge(60):
            twin.restore(start)
            names = ("position", "angle", "speed", "angle_rate")
            values = [float(value) for value in (0.0, tilt, speed, rate)]
            twin.set_many({f"pendulum.state.{name}": value for name, value in zip(names, values, strict=True)})
            twin.set("estimator.state.x", values)
            for encoder, value in (("cart", 0.0), ("pole", float(tilt))):
                twin.set(f"{encoder}_check.state.last", value)
            twin.set_state("BALANCE")
            force = float(-np.array(parameters("balance")["k"]) @ [lead, tilt, speed, rate])
            twin.set("motor.outputs.force", force - math.copysign(5.0, force))
            with twin.trace("machine.state", *TRUTH) as trace:
                twin.tick(3 * HZ)
            assert set(trace["machine.state"]) == {"BALANCE"}, (lead, tilt, speed, rate)
            assert abs(trace[TRUTH[1]][-1]) < 0.01 and abs(trace[TRUTH[0]][-1]) < 0.02
