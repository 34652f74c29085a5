# SPDX-License-Identifier: Apache-2.0
"""Swing-up and the run as a whole: 20 seeds with dispersed masses, energy, the estimate, and the change to balance."""

from __future__ import annotations

import importlib
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLE, HZ, TRUTH, Array, changes, flown, parameters

SEEDS = range(20)
IN_TIME = 8.0  # s, from hanging to balance
RAIL = 0.42  # m: beyond, the monitor ends it
JUMP = 0.5  # N from one tick to the next, until balance has the force that it wants
ESTIMATES = [f"estimator.outputs.{name}" for name in ("position", "angle", "speed", "rate")]
PATHS = (
    "machine.state",
    *TRUTH,
    *ESTIMATES,
    "estimator.outputs.sigma",
    "motor.outputs.force",
    "swing_up.outputs",
    "operator.outputs.target",
)


def dispersed(seed: int) -> list[str]:
    """Masses and inertia by up to 10 %, friction by 30 %; where it begins."""
    rng = np.random.default_rng(seed)
    values = {
        "cart_mass": 0.6 * rng.uniform(0.9, 1.1),
        "pole_mass": 0.2 * rng.uniform(0.9, 1.1),
        "pole_inertia": 0.006 * rng.uniform(0.9, 1.1),
        "cart_friction": 2.0 * rng.uniform(0.7, 1.3),
        "position": rng.uniform(-0.1, 0.1),
        "angle": np.pi + rng.uniform(-0.1, 0.1),
    }
    return [f"pendulum.parameters.{name}={float(value)!r}" for name, value in values.items()]


@pytest.fixture(scope="module")
def flights() -> list[Any]:
    """The traces of all seeds: 20 s, with the steps of the target."""
    return [flown(20 * HZ, *PATHS, seed=seed, sets=dispersed(seed)) for seed in SEEDS]


def test_every_seed_swings_up_in_time_and_balances(flights: list[Any]) -> None:
    for seed, trace in zip(SEEDS, flights, strict=True):
        entered = changes(trace["machine.state"])
        assert [state for _, state in entered] == ["SWING_UP", "BALANCE"], f"seed {seed}"
        (begin, _), (caught, _) = entered
        assert begin == 201 and (caught - begin) / HZ < IN_TIME, f"seed {seed}"
        assert np.abs(trace[TRUTH[0]]).max() < RAIL - 0.02, f"seed {seed}"
        assert np.abs(np.cos(trace[TRUTH[1]][caught + 2 * HZ :]) - 1.0).max() < 0.01, f"seed {seed}"


def test_every_seed_stands_on_its_target(flights: list[Any]) -> None:
    for seed, trace in zip(SEEDS, flights, strict=True):
        error = trace[TRUTH[0]] - trace["operator.outputs.target"]
        assert trace["operator.outputs.target"][-1] == -0.1
        assert np.sqrt((error[-2 * HZ :] ** 2).mean()) < 0.005, f"seed {seed}"


def test_swing_up_pumps_energy_without_taking_it_back(flights: list[Any]) -> None:
    """Of the plant itself, upright zero: from -1.18 J, never down by more than 5 %, into the band of capture."""
    for seed, trace in zip(SEEDS, flights, strict=True):
        (begin, _), (caught, _) = changes(trace["machine.state"])
        mass, inertia = (float(dispersed(seed)[i].split("=")[1]) for i in (1, 2))
        angle, rate = trace[TRUTH[1]][begin:caught], trace[TRUTH[3]][begin:caught]
        whole = inertia + mass * 0.3**2
        energy = 0.5 * whole * rate**2 + mass * 9.81 * 0.3 * (np.cos(angle) - 1.0)
        assert energy[0] == pytest.approx(-2.0 * mass * 9.81 * 0.3, rel=0.01)
        assert (np.maximum.accumulate(energy) - energy).max() < 0.06 * -energy[0], f"seed {seed}"
        assert abs(energy[-1]) < 0.06, f"seed {seed}"


def test_the_command_does_not_jump_when_balance_takes_over(flights: list[Any]) -> None:
    for seed, trace in zip(SEEDS, flights, strict=True):
        caught = changes(trace["machine.state"])[1][0]
        jumps = np.abs(np.diff(trace["motor.outputs.force"][caught - 1 : caught + HZ // 5]))
        assert jumps[0] <= JUMP + 1e-9, f"seed {seed}"
        assert jumps.max() < 1.5 * JUMP, f"seed {seed}"  # then the ripple shows


def test_without_the_take_over_the_command_would_jump(flights: list[Any]) -> None:
    """What balance wants in its first tick, beside what the motor has: so that the test above can fail."""
    k, cost = np.array(parameters("balance")["k"]), np.array(parameters("reference")["cost"])
    jumps = []
    for trace in flights:
        caught = changes(trace["machine.state"])[1][0]
        state = np.array([trace[path][caught] for path in ESTIMATES])
        state[1] = np.arctan2(np.sin(state[1]), np.cos(state[1]))
        state[0] = -cost[0, 1:] @ state[1:] / cost[0, 0]  # the lead that the reference begins with
        jumps.append(abs(-k @ state - trace["motor.outputs.force"][caught - 1]))
    assert np.median(jumps) > 2.0 * JUMP


def test_the_estimate_is_within_its_3_sigma(flights: list[Any]) -> None:
    """Of each seed more than 99 % of the time, swing-up with wrong masses included."""
    for seed, trace in zip(SEEDS, flights, strict=True):
        for number, (truth, estimate) in enumerate(zip(TRUTH, ESTIMATES, strict=True)):
            error = (trace[estimate] - trace[truth])[HZ // 2 :]
            sigma = trace["estimator.outputs.sigma"][HZ // 2 :, number]
            assert (np.abs(error) < 3.0 * sigma).mean() > 0.99, f"seed {seed}, {estimate}"


def test_the_rates_are_better_than_differences_of_counts(flights: list[Any]) -> None:
    for trace in flights:
        speed, rate = ((trace[ESTIMATES[i]] - trace[TRUTH[i]])[HZ // 2 :] for i in (2, 3))
        assert np.sqrt((speed**2).mean()) < 0.01  # a difference of counts: 0.0001 m sqrt(1 / 6) 200 Hz = 0.008 m/s
        assert np.sqrt((rate**2).mean()) < 0.03  # 0.125 rad/s


def slope(x: Array, force: float, plant: dict[str, float]) -> Array:
    """x' of states in columns, by Lagrange's equations with the inverse of the matrix of masses written out."""
    moment = plant["pole_mass"] * plant["pole_length"]
    whole, inertia = plant["cart_mass"] + plant["pole_mass"], plant["pole_inertia"] + moment * plant["pole_length"]
    off = moment * np.cos(x[1])
    cart = force - plant["cart_friction"] * x[2] + moment * x[3] ** 2 * np.sin(x[1])
    pole = moment * 9.81 * np.sin(x[1]) - plant["pivot_friction"] * x[3]
    share = whole * inertia - off**2
    return np.array([x[2], x[3], (inertia * cart - off * pole) / share, (whole * pole - off * cart) / share])


def moved(x: Array, force: float, plant: dict[str, float]) -> Array:
    """After a tick: the classical method of Runge and Kutta, two steps."""
    h = 0.5 / HZ
    for _ in range(2):
        a = slope(x, force, plant)
        b = slope(x + 0.5 * h * a, force, plant)
        c = slope(x + 0.5 * h * b, force, plant)
        d = slope(x + h * c, force, plant)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return x


def other_filter(samples: Array, usable: Array, force: Array, r: Array, q: Array) -> tuple[Array, Array]:
    """Estimates and their deviations by other means: Runge-Kutta, transition by differences, one update of both."""
    plant = parameters("estimator")["plant"]
    x, p = np.array([*samples[0], 0.0, 0.0]), np.diag([*r, 1.0, 25.0])
    estimates, sigmas = [x], [np.sqrt(np.diag(p))]
    small = 1e-5 * np.hstack([np.zeros((4, 1)), np.eye(4), -np.eye(4)])
    for sample, good, push in zip(samples[1:], usable[1:], force[:-1], strict=True):
        ends = moved(x[:, None] + small, push, plant)
        phi = (ends[:, 1:5] - ends[:, 5:]) / 2e-5
        middle = 0.5 * (x + ends[:, 0])
        unit = np.array([slope(middle, push + 1.0, plant) - slope(middle, push, plant), np.zeros(4)])[0, 2:]
        off = plant["pole_mass"] * plant["pole_length"] * np.cos(middle[1])
        turn = np.array([unit[1], -unit[1] * (plant["cart_mass"] + plant["pole_mass"]) / off])
        step = np.vstack([np.eye(2) / (2.0 * HZ), np.eye(2)]) @ np.column_stack([unit, turn]) / HZ
        x, p = ends[:, 0], phi @ p @ phi.T + step @ np.diag(q) @ step.T
        h = np.eye(2, 4)[good]
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(r[good]))
        x, p = x + gain @ (sample[good] - h @ x), (np.eye(4) - gain @ h) @ p
        estimates.append(x)
        sigmas.append(np.sqrt(np.diag(p)))
    return np.array(estimates), np.array(sigmas)


def test_the_filter_is_the_textbook_s() -> None:
    """Beside a filter of this test, on the samples of a swing-up, in which the pole reaches 9 rad/s."""
    names = ("cart.outputs.position", "pole.outputs.angle", "cart_check.outputs.usable", "pole_check.outputs.usable")
    trace = flown(5 * HZ, *names, "motor.outputs.force", *ESTIMATES, "estimator.outputs.sigma", seed=4)
    estimator = parameters("estimator")
    spread = [(estimator[f"{name}_quantum"], estimator[f"{name}_sigma"]) for name in ("cart", "pole")]
    estimates, sigmas = other_filter(
        np.column_stack([trace[name] for name in names[:2]]),
        np.column_stack([trace[name] for name in names[2:]]).astype(bool),
        trace["motor.outputs.force"],
        np.array([quantum**2 / 12.0 + sigma**2 for quantum, sigma in spread]),
        np.array([estimator["force_sigma"], estimator["torque_sigma"]]) ** 2,
    )
    found = np.column_stack([trace[path] for path in ESTIMATES])
    assert np.abs(found[:, 3]).max() > 8.0
    off = np.abs(found - estimates)[20:] / sigmas[20:]
    assert (off.max(axis=0) < 0.1).all(), off.max(axis=0)  # what the midpoint rule costs
    np.testing.assert_allclose(trace["estimator.outputs.sigma"][20:], sigmas[20:], rtol=1e-3)


def test_the_jacobian_of_the_filter_is_that_of_its_equations() -> None:
    """plant.py in CPython, beside complex steps through the equations of this test, which are exact to rounding."""
    sys.path.insert(0, str(EXAMPLE / "fc" / "algorithms"))
    try:
        module = importlib.import_module("plant")
    finally:
        sys.path.pop(0)
    values = parameters("estimator")["plant"]
    for x, force in zip(
        np.random.default_rng(2).normal(0.0, [0.3, 2.0, 1.0, 5.0], (20, 4)), (8.0, -5.0) * 10, strict=True
    ):
        steps = np.eye(4) * 1e-30j
        expected = slope(x[:, None] + steps, force, values).imag / 1e-30
        found = module.jacobian(SimpleNamespace(**values), x.tolist(), force)
        np.testing.assert_allclose(
            [[found[i, j] for j in range(4)] for i in range(4)], expected, rtol=1e-10, atol=1e-10
        )
        rates = module.slopes(SimpleNamespace(**values), x.tolist(), force)
        np.testing.assert_allclose(list(rates), slope(x, force, values), rtol=1e-12)
