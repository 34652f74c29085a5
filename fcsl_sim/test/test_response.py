# SPDX-License-Identifier: Apache-2.0
"""`fcsl-sim response`, against transfer functions by hand."""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimError, load
from fcsl_sim.cli import main
from fcsl_sim.linear.response import Point, Response, margins, spaced

TICK = 0.02
GAIN = 8.0
#: x' = u, sampled and held: u = gain (target - x).
HOLD = """
class Hold:
    inputs = {"x": "f64 m"}
    outputs = {"u": "f64 m/s"}
    parameters = {"gain": "f64 1/s", "target": "f64 m"}
    state = {}

    def execute(self):
        self.u = self.gain * (self.target - self.x)
"""
SENSE = """
class Sense:
    inputs = {}
    outputs = {"x": "f64 m"}
    parameters = {}
    state = {}

    def execute(self):
        pass
"""
MACHINE: dict[str, Any] = {
    "tick_hz": 50,
    "initial_state": "RUN",
    "algorithms": {"Sense": {"source": "sense.py"}, "Hold": {"source": "hold.py"}},
    "instances": {
        "sense": {"algorithm": "Sense", "parameters": {}},
        "hold": {"algorithm": "Hold", "parameters": {"gain": GAIN, "target": 1.0}},
    },
    "connections": [{"from": "sense.x", "to": "hold.x"}],
    "states": {"RUN": {"schedule": {"sense": 50, "hold": 50}}},
    "channels": [
        {"name": "x", "id": 1, "field": "sense.outputs.x", "direction": "sensor"},
        {"name": "u", "id": 2, "field": "hold.outputs.u", "direction": "actuator"},
    ],
}
SIMULATION: dict[str, Any] = {
    "controller": {"machine": "machine.json"},
    "seed": 1,
    "duration": 3.0,
    "until": {"field": "ramp.outputs.x", "above": 0.5},
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {
        "ramp": {"source": "ramp.c"},
        "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"},
        "servo": {"source": "package://fcsl_sim/models/servo.c"},
        "body": {"source": "package://fcsl_sim/models/rigid_body.c"},
    },
    "instances": {
        "ramp": {"model": "ramp"},
        "sensor": {"model": "sensor", "parameters": {"bias": 0.0, "sigma": 0.0, "dropout": False}},
        "servo": {
            "model": "servo",
            "parameters": {
                "natural_frequency": 20.0, "damping": 0.7, "max_rate": 5.0, "min_angle": -1.0, "max_angle": 1.0,
                "backlash": 0.0, "angle": 0.1,
            },
            "inputs": {"command": 0.1},
        },
        "body": {
            "model": "body",
            "parameters": {
                "position_inertial": [0.0, 0.0, 0.0], "velocity_inertial": [0.0, 0.0, 0.0],
                "roll": 0.0, "pitch": 0.0, "yaw": 0.0, "rate_body": [0.0, 0.0, 0.0],
            },
            "inputs": {
                "mass": 2.0, "inertia": [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], "gravity_inertial": [0.0, 0.0, 9.81],
                "force_body": [0.0, 0.0, -19.62],
            },
        },
    },
    "connections": [
        {"from": "ramp.x", "to": "sensor.truth"},
        {"from": "sensor.value", "to": "controller.x"},
        {"from": "controller.u", "to": "ramp.rate"},
    ],
    "rates": {"sensor": 50},
}  # fmt: skip
Measure = Callable[..., list[Point]]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    def write_files(delay_ticks: int = 0, sigma: float = 0.0) -> Path:
        simulation = json.loads(json.dumps(SIMULATION))
        simulation["controller"]["delay_ticks"] = delay_ticks
        simulation["instances"]["sensor"]["parameters"]["sigma"] = sigma
        (tmp_path / "sense.py").write_text(SENSE)
        (tmp_path / "hold.py").write_text(HOLD)
        (tmp_path / "ramp.c").write_text((Path(__file__).parent / "models/ramp.c").read_text())
        (tmp_path / "machine.json").write_text(json.dumps(MACHINE))
        (tmp_path / "hold.sim.json").write_text(json.dumps(simulation, indent=1))
        return tmp_path / "hold.sim.json"

    monkeypatch.chdir(tmp_path)
    return write_files


@pytest.fixture
def measure(write: Callable[..., Path]) -> Measure:
    def points(
        inputs: Sequence[str], outputs: Sequence[str], omegas: Sequence[float], amplitude: float = 1e-3, **changes: Any
    ) -> list[Point]:
        with Response(load(write(**changes)), inputs, outputs, Fraction(1, 5), amplitude) as response:
            return list(response.points(omegas))

    return points


def loop_by_hand(omega: float, delay_ticks: int = 0) -> complex:
    """gain T z^-delay / (z - 1)"""
    z = cmath.exp(1j * omega * TICK)
    return GAIN * TICK * z**-delay_ticks / (z - 1.0)


@pytest.mark.parametrize("place", ["ramp.inputs.rate", "ramp.rate", "controller.x"])
@pytest.mark.parametrize("delay_ticks", [0, 3])
def test_the_loop_is_that_of_the_sampled_controller(measure: Measure, place: str, delay_ticks: int) -> None:
    """It is the same wherever it is cut, and up to the frequency at which samples alternate."""
    for point in measure([place], [], [0.5, 5.0, 20.0, 100.0, 150.0], delay_ticks=delay_ticks):
        expected = loop_by_hand(point.omega, delay_ticks)
        assert point.is_settled
        assert point.loop == pytest.approx(expected, rel=3e-4), point.omega
        assert point.sensitivity == pytest.approx(1.0 / (1.0 + expected), rel=3e-4)


def test_outputs_are_relative_to_the_sine(measure: Measure) -> None:
    for point in measure(["ramp.inputs.rate"], ["ramp.outputs.x", "hold.outputs.u"], [2.0, 40.0]):
        loop = loop_by_hand(point.omega)
        assert point.response(0) == pytest.approx(loop / GAIN / (1.0 + loop), rel=3e-4)
        assert point.response(1) == pytest.approx(-loop / (1.0 + loop), rel=3e-4)
    for point in measure(["controller.x"], ["ramp.outputs.x", "hold.outputs.u"], [2.0, 40.0]):
        loop = loop_by_hand(point.omega)
        assert point.response(0) == pytest.approx(-loop / (1.0 + loop), rel=3e-4)
        assert point.response(1) == pytest.approx(-GAIN / (1.0 + loop), rel=3e-4)


def test_noise_cancels(measure: Measure) -> None:
    """Of a hundred times the sine's amplitude."""
    for point in measure(["ramp.inputs.rate"], [], [1.0, 10.0, 60.0], sigma=0.1):
        assert point.loop == pytest.approx(loop_by_hand(point.omega), rel=3e-4)
        assert point.rest < 1e-3


def test_an_input_that_nothing_feeds(measure: Measure) -> None:
    """A servo: its sine is continuous, about the value in the file; there is no loop."""
    for point in measure(["servo.inputs.command"], ["servo.outputs.angle"], [1.0, 20.0, 100.0]):
        s = 1j * point.omega
        expected = 20.0**2 / (s**2 + 2.0 * 0.7 * 20.0 * s + 20.0**2)
        assert point.source == 0.0
        assert point.response(0) == pytest.approx(expected, rel=3e-4)


def test_a_response_that_is_not_linear_has_a_rest(measure: Measure) -> None:
    (small,) = measure(["servo.inputs.command"], ["servo.outputs.angle"], [15.0], amplitude=0.2)
    (limited,) = measure(["servo.inputs.command"], ["servo.outputs.angle"], [15.0], amplitude=0.8)
    assert small.rest < 1e-3
    assert limited.rest > 0.05


def test_an_element_of_a_vector(measure: Measure) -> None:
    paths = [f"body.outputs.velocity_inertial[{i}]" for i in range(3)]
    (point,) = measure(["body.inputs.force_body[1]"], paths, [4.0])
    moved = [point.response(i) for i in range(3)]
    assert moved == pytest.approx([0.0, 1.0 / (2.0 * 4j), 0.0], rel=3e-4, abs=1e-12)


def test_several_inputs_have_shares(measure: Measure) -> None:
    """A force of three times the sine and a torque of four times."""
    inputs = ["body.inputs.force_body[0]=3", "body.inputs.torque_body[2]=4"]
    (point,) = measure(inputs, ["body.outputs.velocity_inertial[0]", "body.outputs.rate_body[2]"], [4.0])
    expected = np.array([3.0 / (2.0 * 4j), 4.0 / 4j])
    assert [point.response(0), point.response(1)] == pytest.approx(expected, rel=3e-4)
    (point,) = measure(["ramp.rate=-2"], ["ramp.outputs.x"], [5.0])
    loop = loop_by_hand(5.0)
    assert point.loop == pytest.approx(loop, rel=3e-4)
    assert point.response(0) == pytest.approx(-2.0 * loop / GAIN / (1.0 + loop), rel=3e-4)
    with pytest.raises(SimError, match="named twice"):
        measure(["ramp.rate", "ramp.inputs.rate"], [], [1.0])


def test_margins() -> None:
    """Of gain T / (z - 1) with a delay of 3 ticks, whose margins SciPy's root finder gives."""
    points = [
        Point(w, -loop_by_hand(w, 3) / (1.0 + loop_by_hand(w, 3)), 1.0, (), 0.0, 0.0) for w in spaced(0.5, 150.0, 60)
    ]
    found = margins(points)
    crossover = brentq(lambda w: abs(loop_by_hand(w, 3)) - 1.0, 1.0, 20.0)
    turned = brentq(lambda w: (loop_by_hand(w, 3) * 1j).real, 10.0, 30.0)
    assert found.gain_crossover == pytest.approx(crossover, rel=1e-3)
    assert found.phase_margin == pytest.approx(math.pi + cmath.phase(loop_by_hand(crossover, 3)), rel=1e-2)
    assert found.phase_crossover == pytest.approx(turned, rel=3e-3)
    assert found.gain_margin == pytest.approx(1.0 / abs(loop_by_hand(turned, 3)), rel=3e-3)
    assert found.peak_sensitivity == pytest.approx(max(abs(p.sensitivity) for p in points))
    assert margins(points[:5]).phase_margin is None


def test_the_command(write: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = ["response", str(write()), "--input", "ramp.inputs.rate", "--output", "ramp.outputs.x", "--points", "12"]
    assert main([*line, "-o", "hold.json", "--plot", "hold.png"]) == 0
    printed = capsys.readouterr().out
    assert "phase margin 85.3° at 8.009 rad/s, delay margin 186 ms" in printed
    assert (tmp_path / "hold.png").stat().st_size > 10_000
    written = json.loads((tmp_path / "hold.json").read_text())
    loop = np.array(written["loop"]["real"]) + 1j * np.array(written["loop"]["imag"])
    assert loop == pytest.approx(np.array([loop_by_hand(w) for w in written["omega"]]), rel=3e-4)
    assert written["responses"]["ramp.outputs.x"]["unit"] == "m"
    assert main([*line, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == written


@pytest.mark.parametrize(
    ("inputs", "outputs", "message"),
    [
        ([], [], "an `--input` is needed"),
        (["rump.inputs.rate"], [], "there is no instance or controller `rump`; did you mean `ramp`?"),
        (["ramp.inputs.rat"], [], "`ramp` has no input `rat`; did you mean `rate`?"),
        (["ramp"], [], "`ramp`: `instance.inputs.name`, or `controller.channel`, wanted"),
        (["ramp.inputs.rate=no"], [], "no is no number"),
        (["ramp.inputs.rate=0"], [], "a weight is neither zero nor huge"),
        (["body.inputs.force_body"], [], "name one element of it, `body.inputs.force_body\\[0\\]`"),
        (["body.inputs.force_body[3]"], [], "name one element"),
        (["body.inputs.inertia[0]"], [], "is f64\\[3\\]\\[3\\]: a sine is added to f64 or an element of f64\\[3\\] alone"),
        (["controller.y"], [], "`machine` has no sensor channel `y`"),
        (["ramp.inputs.rate"], ["ramp.outputs.y"], "ramp.outputs.y"),
        (["ramp.inputs.rate"], ["body.outputs.velocity_inertial"], "name one element of it"),
        (["ramp.inputs.rate"], ["ramp.outputs.time_ns"], "is i64, no floating number"),
    ],
)  # fmt: skip
def test_errors(write: Callable[..., Path], inputs: list[str], outputs: list[str], message: str) -> None:
    with pytest.raises(SimError, match=message):
        Response(load(write()), inputs, outputs, None, 1e-3)


def test_frequencies_and_times_have_bounds(write: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    file = str(write())
    line = ["response", file, "--input", "ramp.rate"]
    assert main([*line, "--to", "500"]) == 2
    assert "`--to` 500 rad/s is not below 157.08 rad/s, half of the ticks' frequency" in capsys.readouterr().err
    assert main([*line, "--from", "5", "--to", "4"]) == 2
    assert "`--from` 5 rad/s is not below `--to` 4 rad/s" in capsys.readouterr().err
    assert main([*line, "--at", "0.01"]) == 2
    assert "0.01 s is not a whole number of ticks (1/50 s)" in capsys.readouterr().err
    assert main([*line, "--plot", "hold.txt"]) == 2
    assert "the name of a picture ends in .png" in capsys.readouterr().err
    with pytest.raises((SimError, DiagnosticError)):
        load("absent.sim.json")
