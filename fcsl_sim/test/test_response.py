# SPDX-License-Identifier: Apache-2.0
"""`fcsl response`, against transfer functions by hand."""

from __future__ import annotations

import cmath
import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimError, load
from fcsl_sim.cli import main
from fcsl_sim.linear.response import Point, Response, margins, spaced
from fcsl_sim.linear.response_picture import bode_figure
from fcsl_sim.linear.response_report import Measured
from simclient.view.picture import pyplot

TICK = 0.02
GAIN = 8.0
#: x' = u, sampled and held: u = gain (target - x). The gain may grow from tick to tick.
HOLD = """
class Hold:
    inputs = {"x": "f64 m"}
    outputs = {"u": "f64 m/s"}
    parameters = {"gain": "f64 1/s", "target": "f64 m", "growth": "f64"}
    state = {"ticks": "f64"}

    def execute(self):
        self.u = self.gain * (1.0 + self.growth * self.ticks) * (self.target - self.x)
        self.ticks += 1.0
"""
#: Ends the control at a tick.
CLOCK = """
class Clock:
    inputs = {}
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"end": "i64"}
    state = {"ticks": "i64"}

    def execute(self):
        self.ticks += 1
        if self.ticks == self.end:
            self.transition_request = "REST"
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
    "algorithms": {"Sense": {"source": "sense.py"}, "Hold": {"source": "hold.py"}, "Clock": {"source": "clock.py"}},
    "instances": {
        "sense": {"algorithm": "Sense", "parameters": {}},
        "hold": {"algorithm": "Hold", "parameters": {"gain": GAIN, "target": 1.0, "growth": 0.0}},
        "clock": {"algorithm": "Clock", "parameters": {"end": -1}},
    },
    "connections": [{"from": "sense.x", "to": "hold.x"}],
    "states": {"RUN": {"schedule": {"sense": 50, "hold": 50, "clock": 50}}, "REST": {"schedule": {"sense": 50}}},
    "transitions": [{"from": "RUN", "request": "REST", "to": "REST", "priority": 1}],
    "channels": [
        {"name": "x", "id": 1, "field": "sense.outputs.x", "direction": "sensor"},
        {"name": "u", "id": 2, "field": "hold.outputs.u", "direction": "actuator"},
    ],
}
SIMULATION: dict[str, Any] = {
    "controller": {"machine": "machine.json"},
    "seed": 1,
    "duration": 3.0,
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
    def write_files(
        delay_ticks: int = 0,
        sigma: float = 0.0,
        growth: float = 0.0,
        end: int = -1,
        until: dict[str, Any] | None = None,
    ) -> Path:
        machine = json.loads(json.dumps(MACHINE))
        machine["instances"]["hold"]["parameters"]["growth"] = growth
        machine["instances"]["clock"]["parameters"]["end"] = end
        simulation = json.loads(json.dumps(SIMULATION))
        simulation["controller"]["delay_ticks"] = delay_ticks
        simulation["instances"]["sensor"]["parameters"]["sigma"] = sigma
        simulation |= {"until": until} if until else {}
        (tmp_path / "sense.py").write_text(SENSE)
        (tmp_path / "hold.py").write_text(HOLD)
        (tmp_path / "ramp.c").write_text((Path(__file__).parent / "models/ramp.c").read_text())
        (tmp_path / "clock.py").write_text(CLOCK)
        (tmp_path / "machine.json").write_text(json.dumps(machine))
        (tmp_path / "hold.sim.json").write_text(json.dumps(simulation, indent=1))
        return tmp_path / "hold.sim.json"

    monkeypatch.chdir(tmp_path)
    return write_files


@pytest.fixture
def measure(write: Callable[..., Path]) -> Measure:
    def points(
        inputs: Sequence[str],
        outputs: Sequence[str],
        omegas: Sequence[float],
        amplitude: float = 1e-3,
        within: float = 1e-3,
        **changes: Any,
    ) -> list[Point]:
        with Response(load(write(**changes)), inputs, outputs, Fraction(1, 5), amplitude, within) as response:
            return list(response.points(omegas))

    return points


def loop_by_hand(omega: float, delay_ticks: int = 0) -> complex:
    """gain T z^-delay / (z - 1)"""
    z = cmath.exp(1j * omega * TICK)
    return GAIN * TICK * z**-delay_ticks / (z - 1.0)


@pytest.mark.parametrize("place", ["ramp.inputs.rate", "ramp.rate", "controller.x", "controller.u"])
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


def test_margins_are_not_sought_where_nothing_was_measured() -> None:
    points = [Point(w, -loop_by_hand(w) / (1.0 + loop_by_hand(w)), 1.0, (), 0.0, 0.0) for w in (4.0, 6.0, 8.0, 10.0)]
    assert margins(points).gain_crossover == pytest.approx(8.0, rel=0.02)
    points[2] = Point(8.0, 0j, 0j, (), 0.1, 0.0, "the flight ended")
    found = margins(points)
    assert (found.gain_crossover, found.phase_margin) == (None, None)
    assert found.peak_sensitivity == abs(points[3].sensitivity)
    points[3] = Point(10.0, 0j, 1.0, (), 0.0, 0.0)  # without a loop: its sensitivity of 1 is none
    assert margins(points).peak_sensitivity == abs(points[1].sensitivity) < 1.0
    for value in ("loop", "sensitivity"):
        with pytest.raises(SimError, match="nothing was measured at 8 rad/s: the flight ended"):
            getattr(points[2], value)
    with pytest.raises(SimError, match="no loop was measured"):
        margins(points[2:])


# ---- what cannot be measured ---------------------------------------------------------------------------------------


def test_a_change_of_state_ends_a_measurement(measure: Measure) -> None:
    """Windows of 40 rad/s agree before it, one of 2 rad/s is not over. After it the loop would be open."""
    slow, fast = measure(["ramp.inputs.rate"], [], [2.0, 40.0], end=300)
    assert slow.why == "the controller went from RUN to REST at 6 s (after 0 windows of 6.3 s)"
    assert not slow.is_settled and not slow.has_loop
    assert fast.is_settled and fast.loop == pytest.approx(loop_by_hand(40.0), rel=3e-4)


def test_the_stop_condition_ends_a_measurement(measure: Measure) -> None:
    held = {"condition": "ramp.outputs.x > 0.5", "for_s": 6.0}
    slow, fast = measure(["ramp.inputs.rate"], [], [2.0, 40.0], until=held)
    assert slow.why.startswith("the simulation has ended after") and "`until` held" in slow.why
    assert fast.loop == pytest.approx(loop_by_hand(40.0), rel=3e-4)
    with pytest.raises(SimError, match='`until` held: .*; extend the file with {"until": null}'):
        measure(["ramp.inputs.rate"], [], [2.0], until=held | {"for_s": 0.0})


def test_a_vehicle_that_changes_settles_within_what_it_may_change(measure: Measure) -> None:
    """The gain grows by 2 % of its first value in a second."""
    (point,) = measure(["ramp.inputs.rate"], [], [20.0], growth=4e-4)
    assert re.fullmatch(
        r"it does not settle: after 60 windows of 1.58 s, of which the last two differ by 0.00\d", point.why
    )
    (point,) = measure(["ramp.inputs.rate"], [], [20.0], growth=4e-4, within=0.05)
    assert 1e-3 < point.change < 0.05
    in_the_middle = 1.0 + 4e-4 * 50 * (0.2 + 2.5 * 1.58)  # of the third window
    assert point.loop == pytest.approx(in_the_middle * loop_by_hand(20.0), rel=2e-3)
    with pytest.raises(SimError, match="`--within` 1 is a part of an amplitude"):
        measure(["ramp.inputs.rate"], [], [20.0], within=1.0)


def test_the_command_says_what_was_not_measured(
    write: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    line = [
        "response",
        str(write(end=300)),
        "--input",
        "ramp.inputs.rate",
        "--measure",
        "ramp.outputs.x",
        "--at",
        "0.2",
    ]
    assert main([*line, "--from", "1", "--to", "60", "--points", "4", "-o", "hold.json", "--plot", "hold.png"]) == 0
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert (
        lines[1] == "        1  not measured: the controller went from RUN to REST at 6 s (after 0 windows of 12.6 s)"
    )
    assert lines[-1] == "not measured at 1, 3.915 rad/s: what is said above is of the other 2"
    assert "largest sensitivity" in printed and "inf" not in printed and "nan" not in printed
    assert (tmp_path / "hold.png").stat().st_size > 10_000
    written = json.loads((tmp_path / "hold.json").read_text())
    assert written["omega"] == pytest.approx([15.33, 60.0], rel=1e-3) and len(written["loop"]["real"]) == 2
    assert [point["omega"] for point in written["not_measured"]] == pytest.approx([1.0, 3.915], rel=1e-3)
    assert "RUN to REST" in written["not_measured"][0]["why"]
    assert main([*line, "--from", "1", "--to", "2", "--points", "2", "--plot", "none.png"]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "nothing was measured"
    assert not (tmp_path / "none.png").exists()


def test_without_a_loop_there_are_no_figures_of_it(
    write: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    outputs = ["--measure", "servo.outputs.angle", "--measure", "ramp.outputs.x"]
    line = ["response", str(write()), "--input", "servo.inputs.command", *outputs, "--to", "9", "--points", "2"]
    assert main([*line, "--plot", "servo.png"]) == 0
    _, first, _, last = capsys.readouterr().out.splitlines()
    cells = first.split()
    assert cells[:3] == ["1", "none", "none"] and cells[6] == "none" and "inf" not in first
    assert last == "no loop: the source does not depend on the sine"
    assert (tmp_path / "servo.png").stat().st_size > 10_000


def test_the_command(write: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    line = ["response", str(write()), "--input", "ramp.inputs.rate", "--measure", "ramp.outputs.x", "--points", "12"]
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


def test_what_the_command_line_changes(write: Callable[..., Path], capsys: pytest.CaptureFixture[str]) -> None:
    """Parameters, an event on the way, and the value of the very input to which the sine is added: at 0.95 rad the servo
    meets its stop."""
    line = ["response", str(write()), "--input", "servo.inputs.command", "--measure", "servo.outputs.angle", "--json"]
    line += ["--points", "1", "--from", "15", "--to", "16", "--amplitude", "0.2", "--at", "2"]

    def measured(*changes: str) -> tuple[complex, float]:
        assert main([*line, *changes]) == 0
        found = json.loads(capsys.readouterr().out)
        angle = found["responses"]["servo.outputs.angle"]
        return complex(angle["real"][0], angle["imag"][0]), found["rest"][0]

    def expected(frequency: float, damping: float) -> complex:
        s = 15j
        return frequency**2 / (s**2 + 2.0 * damping * frequency * s + frequency**2)

    fast = ("--set", "servo.parameters.natural_frequency=40", "--set", "servo.parameters.max_rate=50")
    assert measured(*fast)[0] == pytest.approx(expected(40.0, 0.7), rel=3e-4)
    damped = (*fast, "--event", "1.0 servo.parameters.damping=1.4", "--seed", "3")
    assert measured(*damped)[0] == pytest.approx(expected(40.0, 1.4), rel=3e-4)
    assert measured(*fast)[1] < 1e-3 < 0.02 < measured(*fast, "--set", "servo.inputs.command=0.95")[1]
    assert main([*line, "--set", "servo.parameters.mass=1"]) == 2
    assert "mass" in capsys.readouterr().err


# ---- the picture -----------------------------------------------------------------------------------------------------

#: Of k / (s (s + 1)²) with k = 0.5: the phase is -180° at 1 rad/s, where the gain is 1/4.
LAG = [
    Point(w, -(lag := 0.5 / (1j * w * (1j * w + 1) ** 2)), 1.0 + lag, (2.0 / (1j * w),), 0.0, 0.0)
    for w in spaced(0.1, 10.0, 41)
]


def bode(points: Sequence[Point], outputs: Sequence[tuple[str, str]] = ()) -> Any:
    response: Any = SimpleNamespace(
        injections=[SimpleNamespace(path="ramp.inputs.rate", weight=1.0)], outputs=list(outputs), within=1e-3
    )
    figure = bode_figure(Measured(response, points), "lag.sim.json")
    figure.canvas.draw()
    pyplot.close(figure)
    return figure


def dots(axis: Any) -> list[tuple[float, float]]:
    return [(line.get_xdata()[0], line.get_ydata()[0]) for line in axis.lines if line.get_marker() == "o"]


def test_a_picture_marks_crossings_and_margins() -> None:
    figure = bode(LAG, [("ramp.outputs.x", "m")])
    gain, sensitivity, outputs, phase, _, _ = figure.axes
    ((crossover, level),) = dots(gain)
    ((turn, angle),) = dots(phase)
    exact = brentq(lambda w: abs(0.5 / (1j * w * (1j * w + 1) ** 2)) - 1.0, 0.1, 1.0)
    assert (crossover, level) == (pytest.approx(exact, rel=1e-2), 0.0)
    assert (turn, angle) == (pytest.approx(1.0, rel=1e-2), pytest.approx(-180.0, abs=0.1))
    assert [text.get_text() for text in gain.texts] == ["12.0 dB"] and gain.get_title("left").startswith(
        "loop: gain margin 12.0 dB"
    )
    margin = math.degrees(margins(LAG).phase_margin or 0.0)
    assert margin == pytest.approx(90.0 - 2.0 * math.degrees(math.atan(exact)), abs=0.2)
    assert [text.get_text() for text in phase.texts] == [f"{margin:.1f}°"]
    assert phase.get_title("left").startswith(f"phase margin {margin:.1f}° at 0.4")
    # Each stands at two thirds of its margin, towards the line that it is measured from.
    assert [axis.texts[0].xy[1] for axis in (gain, phase)] == pytest.approx([-12.0 / 3, -180.0 + margin / 3], abs=0.1)
    # Sensitivity has axes of its own, as outputs have.
    assert sensitivity.get_title("left").startswith("largest sensitivity 1.83 (5.3 dB) at 0.631")
    legends = [[text.get_text() for text in axis.get_legend().get_texts()] for axis in (gain, sensitivity, outputs)]
    assert legends == [["loop"], ["sensitivity"], ["ramp.outputs.x (m)"]]
    assert figure.get_supxlabel() == ""


def test_a_picture_says_why_nothing_was_measured() -> None:
    points = list(LAG)
    points[3] = points[4] = replace(LAG[3], why="the flight is over")
    points[3], points[4] = (replace(p, omega=o.omega) for p, o in zip(points[3:5], LAG[3:5], strict=True))
    points[20] = replace(LAG[20], source=0j)
    figure = bode(points, [("ramp.outputs.x", "m")])
    gain, _, outputs, *_ = figure.axes
    shaded = [[(p.get_x(), p.get_x() + p.get_width()) for p in axis.patches] for axis in (gain, outputs)]
    assert len(shaded[0]) == 2 and shaded[1] == shaded[0][:1]
    (low, high), (no_loop, _) = shaded[0]
    assert LAG[2].omega < low < LAG[3].omega and LAG[4].omega < high < LAG[5].omega < no_loop < LAG[20].omega
    lines = [line for line in gain.lines if line.get_marker() == "."]
    assert [len(line.get_xdata()) for line in lines] == [3, 15, 20]
    assert figure.get_supxlabel().splitlines() == [
        f"{LAG[3].omega:.4g} rad/s not measured: the flight is over",
        f"{LAG[4].omega:.4g} rad/s not measured: the flight is over",
        f"{LAG[20].omega:.4g} rad/s not measured: no loop: the source does not depend on the sine",
    ]


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
        (["controller.xx"], [], "`machine` has no channel `xx`; did you mean `x`?"),
        (["controller.y9"], [], "`machine` has no channel `y9`; it has the sensor channel x, and the actuator channel u$"),
        (["controller.u", "ramp.rate"], [], "`ramp.rate` has a sine already, by its source"),
        (["ramp.rate", "controller.u"], [], "`controller.u` feeds an input that has a sine already"),
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
