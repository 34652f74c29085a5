# SPDX-License-Identifier: Apache-2.0
"""The linear design: gains, poles, margins, and the loop gain of the compiled machine, measured."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import HZ, MACHINE, SIM, parameters
from design import FORCE_LIMIT, LAG, held, loop, margins, opened, plant, poles, regulator, stationary_filter

from fcsl_sim import load
from fcsl_sim.linear.linearise import linearise
from fcsl_sim.linear.plant import Plant
from simclient import SimTwin


def test_the_plant_of_the_design_is_the_one_that_flies(tmp_path: Path) -> None:
    """By the central differences of `fcsl linearise`, upright."""
    values = json.loads(SIM.read_text())["instances"]["pendulum"]["parameters"] | {"position": 0.0, "angle": 0.0}
    simulation = {
        "tick_hz": HZ,
        "seed": 1,
        "duration": 1.0,
        "integrator": {"method": "rk4", "hz": 1000},
        "models": {"pendulum": {"source": "package://fcsl_sim/models/inverted_pendulum.c"}},
        "instances": {"pendulum": {"model": "pendulum", "parameters": values, "inputs": {"force": 0.0}}},
    }
    (tmp_path / "plant.sim.json").write_text(json.dumps(simulation))
    with Plant(load(tmp_path / "plant.sim.json")) as flies:
        found = linearise(flies, ["pendulum.inputs.force"], [])
    order = [f"pendulum.state.{name}" for name in ("position", "angle", "speed", "angle_rate")]
    assert [state.path for state in found.states] == order
    a, b = plant()
    np.testing.assert_allclose(found.a, a, atol=1e-8)
    np.testing.assert_allclose(found.b, b[:, :1], atol=1e-8)
    own = parameters("estimator")["plant"]
    assert own == {name: values[name] for name in own}
    assert own == parameters("swing_up")["plant"] == parameters("reference")["plant"]


def test_the_gains_are_those_of_the_regulator() -> None:
    k, p = regulator()
    scale = k @ np.linalg.solve(p, k) / FORCE_LIMIT**2
    np.testing.assert_allclose(parameters("balance")["k"], k, rtol=1e-5)
    for instance in ("swing_up", "balance", "motor"):
        assert parameters(instance)["force_limit"] == FORCE_LIMIT
    for instance in ("swing_up", "reference", "balance"):
        np.testing.assert_allclose(parameters(instance)["cost"], p * scale, rtol=1e-5)


@pytest.fixture
def compiled_gain(fcsl: Any) -> np.ndarray:
    """k of the compiled balance, by small differences around the reference."""
    twin = fcsl(MACHINE, instances=["balance"])
    small, columns = 1e-4, []
    for number in range(4):
        forces = []
        for sign in (1.0, -1.0):
            goal = [0.1, 0.01, 0.2, -0.1]
            goal[number] += sign * small
            twin.set_many({f"balance.inputs.{name}": 0.0 for name in ("applied", "reference_force")})
            twin.set("balance.inputs.reference", goal)
            names = ("position", "tilt", "speed", "rate")
            twin.set_many(dict(zip((f"balance.inputs.{name}" for name in names), [0.1, 0.01, 0.2, -0.1], strict=True)))
            twin.tick()
            forces.append(twin.get_value("balance.outputs.force"))
        columns.append((forces[0] - forces[1]) / (2.0 * small))
    return np.array(columns)


def test_the_eigenvalues_of_the_closed_loop(compiled_gain: np.ndarray) -> None:
    """Those in README.md: of the regulator alone, and with filter and motor."""
    a, b = plant()
    f, g = held(a, b[:, :1])
    regulated = np.log(np.linalg.eigvals(f - g @ compiled_gain[None, :]).astype(complex)) * HZ
    stated = np.array([-7.75 + 5.31j, -7.75 - 5.31j, -2.41 + 1.66j, -2.41 - 1.66j])
    np.testing.assert_allclose(np.sort_complex(regulated), np.sort_complex(stated), atol=0.01)
    whole = np.log(poles(loop(compiled_gain))) * HZ
    assert len(whole) == 9 and whole.real.max() < -2.3
    for pole in stated:  # separation, but for the lag of the motor
        assert np.abs(whole - pole).min() < 0.25
    for pole in (-43.7 + 44.0j, -151.4 + 145.3j):
        assert np.abs(whole - pole).min() < 0.5


def test_the_loop_has_the_stated_margins(compiled_gain: np.ndarray) -> None:
    found = margins(loop(compiled_gain))
    assert found.crossover == pytest.approx(16.5, rel=0.01)
    assert np.degrees(found.phase) == pytest.approx(55.9, abs=0.5)
    assert found.least_gain == pytest.approx(0.32, abs=0.01)
    assert found.most_gain == pytest.approx(10.1, rel=0.02)
    assert found.sensitivity < 1.2


@pytest.mark.parametrize("scale, stable", [(0.30, False), (0.34, True), (9.0, True), (11.0, False)])
def test_the_gain_margins_are_where_the_loop_becomes_unstable(scale: float, stable: bool) -> None:
    """By eigenvalues, the other way to find them. The motor gives a multiple of the command; the filter does not know."""
    of = loop(regulator()[0])
    seen, rest = np.eye(2, 5), np.eye(4) - of.gain @ np.eye(2, 4)
    whole = np.zeros((9, 9))
    command = np.hstack([-of.k @ of.gain @ seen, -of.k @ rest])
    whole[:5, :5] = of.f
    whole[:5] += scale * np.outer(of.command, command)
    whole[5:, :5], whole[5:, 5:] = of.model @ of.gain @ seen, of.model @ rest
    whole[5:] += np.outer(of.drive, command)
    assert (np.abs(np.linalg.eigvals(whole)).max() < 1.0) == stable


@pytest.mark.parametrize("ticks", [400, 160, 80, 40, 20])
def test_the_measured_loop_gain_is_the_computed_one(calm: SimTwin, ticks: int) -> None:
    """A push of 0.2 N with a period of so many ticks, and the command that answers it, r = -X / (1 + q X).

    X is the gain from push to command without feedback, q that from command to push: the motor. L = q X.
    """
    settle, periods = 800 // ticks * ticks, max(2, 400 // ticks)
    push = 0.2 * np.sin(2.0 * np.pi * np.arange(settle + periods * ticks) / ticks)
    force = np.zeros(len(push))
    for i, value in enumerate(push):
        calm.set("push.parameters.bias", float(value))
        calm.tick()
        force[i] = calm.get("motor.outputs.force")
    omega = 2.0 * np.pi * HZ / ticks
    wave = np.exp(-1j * omega / HZ * np.arange(periods * ticks))
    answer = (force[settle:] @ wave) / (push[settle:] @ wave)
    (computed,), (from_push,) = opened(loop(regulator()[0]), np.array([omega]))
    motor = computed / from_push
    assert abs(motor) == pytest.approx(1.0 / np.hypot(1.0, omega * LAG), rel=0.01)
    measured = -motor * answer / (1.0 + motor * answer)
    assert abs(measured / computed - 1.0) < 0.005


def test_the_filter_becomes_the_stationary_one(calm: SimTwin) -> None:
    _, covariance = stationary_filter()
    np.testing.assert_allclose(calm.get("estimator.state.P"), covariance, rtol=1e-3)
