# SPDX-License-Identifier: Apache-2.0
"""The plant alone, at a given throttle, against analytic solutions of rocket motion."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.driver.cache import build_machine
from fcsl_sim import SimError, Simulation, load

LANDER = Path(__file__).resolve().parents[1]
G0 = 9.80665
PARAMETERS = {
    "dry_mass": 400.0,
    "fuel_mass": 100.0,
    "min_thrust": 50.0,
    "max_thrust": 2000.0,
    "isp": 220.0,
    "gravity": 1.62,
    "pos_z": 0.0,
    "vel_z": 0.0,
}
Fly = Callable[..., Simulation]


@pytest.fixture
def fly(tmp_path: Path) -> Fly:
    """Opens the plant with other parameters and a throttle over time, [(at_s, value), …]."""
    built = build_machine(LANDER / "fc/lander_control.json")
    shutil.copy(LANDER / "sim/lander_plant.c", tmp_path)

    def open_plant(throttle: list[tuple[float, float]], method: str = "rk4", **parameters: float) -> Simulation:
        config: dict[str, Any] = {
            "controller": {"machine": "not used"},
            "seed": 1,
            "duration": 600.0,
            "integrator": {"method": method, "hz": 1000},
            "models": {"plant": {"source": "lander_plant.c"}},
            "instances": {"lander": {"model": "plant", "parameters": PARAMETERS | parameters}},
            "connections": [],
            "events": [{"at_s": at, "set": "lander.inputs.throttle", "value": value} for at, value in throttle],
        }
        path = tmp_path / "plant.sim.json"
        path.write_text(json.dumps(config))
        checked = load(path, machine=(built.library, built.name))
        return Simulation(checked.plan, checked.tables)

    return open_plant


def output(sim: Simulation, name: str) -> Any:
    return sim.get(f"lander.outputs.{name}")


def run_to(sim: Simulation, time_s: float) -> None:
    """Runs up to and including the tick at time_s."""
    ticks = round(time_s * 100) + 1
    while sim.tick < ticks:
        sim.run(ticks - sim.tick)


def test_free_fall(fly: Fly) -> None:
    with fly([], pos_z=100.0, vel_z=5.0) as sim:
        for time_s in (1.0, 5.0, 10.0):
            run_to(sim, time_s)
            assert output(sim, "vel_z") == pytest.approx(5.0 - 1.62 * time_s, abs=1e-10)
            assert output(sim, "pos_z") == pytest.approx(100.0 + 5.0 * time_s - 0.81 * time_s**2, abs=1e-10)
            energy = output(sim, "vel_z") ** 2 / 2 + 1.62 * output(sim, "pos_z")
            assert energy == pytest.approx(12.5 + 162.0, rel=1e-12)
        assert output(sim, "mass") == 500.0 and not output(sim, "landed")


def test_touchdown(fly: Fly) -> None:
    """The speed is that at the ground, v^2 = 2 g h. Then the vehicle is at rest."""
    with fly([], pos_z=100.0) as sim:
        lowest = 100.0
        while not output(sim, "landed"):
            sim.run(1)
            lowest = min(lowest, output(sim, "pos_z"))
        assert lowest == 0.0
        assert sim.tick / 100 == pytest.approx(math.sqrt(2 * 100.0 / 1.62), abs=0.02)
        assert output(sim, "touchdown_speed") == pytest.approx(math.sqrt(2 * 1.62 * 100.0), abs=1e-8)
        sim.run(500)
        assert (output(sim, "pos_z"), output(sim, "vel_z"), output(sim, "landed")) == (0.0, 0.0, True)


def test_full_thrust_obeys_the_rocket_equation(fly: Fly) -> None:
    """m(t) = m0 - thrust t / (isp g0),  v(t) = isp g0 ln(m0 / m) - g t."""
    with fly([(0.0, 1.0)]) as sim:
        for time_s in (1.0, 20.0, 100.0):
            run_to(sim, time_s)
            mass = 500.0 - 2000.0 * time_s / (220.0 * G0)
            assert output(sim, "mass") == pytest.approx(mass, rel=1e-11)
            assert output(sim, "thrust") == 2000.0
            assert output(sim, "vel_z") == pytest.approx(220.0 * G0 * math.log(500.0 / mass) - 1.62 * time_s, rel=1e-10)


def test_burn_out_gives_the_whole_velocity_of_tsiolkovsky(fly: Fly) -> None:
    with fly([(0.0, 1.0)], gravity=0.0) as sim:
        run_to(sim, 150.0)
        assert (output(sim, "mass"), output(sim, "thrust")) == (400.0, 0.0)
        assert output(sim, "vel_z") == pytest.approx(220.0 * G0 * math.log(500.0 / 400.0), rel=1e-10)


def test_on_the_pad_until_thrust_exceeds_weight(fly: Fly) -> None:
    """Weight 810 N: 780 N consumes fuel without lift-off until the mass is low enough."""
    with fly([(0.0, 0.39)]) as sim:
        lift_off_s = (500.0 - 780.0 / 1.62) * 220.0 * G0 / 780.0
        run_to(sim, math.floor(lift_off_s))
        assert (output(sim, "pos_z"), output(sim, "vel_z"), output(sim, "landed")) == (0.0, 0.0, False)
        assert output(sim, "mass") < 500.0
        run_to(sim, math.ceil(lift_off_s) + 1)
        assert output(sim, "pos_z") > 0.0


def test_a_hop(fly: Fly) -> None:
    with fly([(1.0, 1.0), (4.0, 0.0)]) as sim:
        run_to(sim, 1.0)
        assert output(sim, "pos_z") == 0.0 and not output(sim, "landed")
        run_to(sim, 4.0)
        height = output(sim, "pos_z") + output(sim, "vel_z") ** 2 / (2 * 1.62)
        run_to(sim, 30.0)
        assert output(sim, "landed")
        assert output(sim, "touchdown_speed") == pytest.approx(math.sqrt(2 * 1.62 * height), abs=1e-7)


@pytest.mark.parametrize(
    ("throttle", "thrust"), [(2.0, 2000.0), (0.5, 1000.0), (0.025, 50.0), (0.024, 0.0), (-1.0, 0.0)]
)
def test_thrust_limits(fly: Fly, throttle: float, thrust: float) -> None:
    with fly([(0.0, throttle)], pos_z=50.0) as sim:
        run_to(sim, 0.0)
        assert output(sim, "thrust") == pytest.approx(thrust)


def test_euler_is_close_too(fly: Fly) -> None:
    with fly([(0.0, 1.0)], method="euler") as sim:
        run_to(sim, 20.0)
        mass = 500.0 - 2000.0 * 20.0 / (220.0 * G0)
        assert output(sim, "vel_z") == pytest.approx(220.0 * G0 * math.log(500.0 / mass) - 32.4, abs=1e-3)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"dry_mass": 0.0}, "parameters.dry_mass must be positive"),
        ({"fuel_mass": -1.0}, "parameters.fuel_mass must not be negative"),
        ({"min_thrust": 3000.0}, "parameters.min_thrust and max_thrust must be 0 <= min_thrust <= max_thrust"),
        ({"isp": 0.0}, "parameters.isp must be positive"),
        ({"gravity": -1.0}, "parameters.gravity must not be negative"),
        ({"pos_z": -1.0}, "parameters.pos_z must not be below the ground"),
    ],
)
def test_parameters_are_checked(fly: Fly, parameters: dict[str, float], message: str) -> None:
    with pytest.raises(SimError, match=f"^instance `lander`: {message}$"):
        fly([], **parameters)
