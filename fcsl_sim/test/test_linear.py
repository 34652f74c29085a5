# SPDX-License-Identifier: Apache-2.0
"""`fcsl linearise` and `trim`, against closed forms."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimError, load
from fcsl_sim.cli import main
from fcsl_sim.linear.linearise import linearise
from fcsl_sim.linear.plant import Plant
from fcsl_sim.linear.trim import read_trim

LIBRARY = "package://fcsl_sim/models"
POLE = {"cart_mass": 1.3, "pole_mass": 0.2, "pole_length": 0.4, "pole_inertia": 0.011, "cart_friction": 0.3,
        "pivot_friction": 0.002, "gravity": 9.81, "position": 0.0, "angle": 0.0}  # fmt: skip
PENDULUM: dict[str, Any] = {
    "tick_hz": 100,
    "seed": 1,
    "duration": 5.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {"pole": {"source": f"{LIBRARY}/inverted_pendulum.c"}},
    "instances": {"pole": {"model": "pole", "parameters": POLE, "inputs": {"force": 0.0}}},
}
#: A sphere that falls through air of constant density.
FALL: dict[str, Any] = {
    "tick_hz": 100,
    "seed": 1,
    "duration": 5.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {
        "body": {"source": f"{LIBRARY}/rigid_body.c"},
        "air": {"source": f"{LIBRARY}/air_data.c"},
        "drag": {"source": f"{LIBRARY}/aerodynamic_drag.c"},
    },
    "instances": {
        "body": {
            "model": "body",
            "parameters": {
                "position_inertial": [0.0, 0.0, 0.0], "velocity_inertial": [0.0, 0.0, 1.0],
                "roll": 0.0, "pitch": 0.0, "yaw": 0.0, "rate_body": [0.0, 0.0, 0.0],
            },
            "inputs": {
                "mass": 2.0, "inertia": [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], "gravity_inertial": [0.0, 0.0, 9.81],
            },
        },
        "air": {"model": "air", "inputs": {"density": 1.2, "speed_of_sound": 340.0}},
        "drag": {"model": "drag", "parameters": {"area": 0.1, "drag_coefficient": 0.5}, "inputs": {"density": 1.2}},
    },
    "connections": [
        {"from": "body.velocity_inertial", "to": "air.velocity_ned"},
        {"from": "body.attitude_body_to_inertial", "to": "air.attitude_body_to_ned"},
        {"from": "air.velocity_air_body", "to": "drag.velocity_air_body"},
        {"from": "drag.force_body", "to": "body.force_body"},
    ],
}  # fmt: skip
TRIM: dict[str, Any] = {
    "simulation": "plant.sim.json",
    "unknowns": {"body.state.velocity_inertial[2]": {"start": 5.0, "within": [0.0, 100.0]}},
    "steady": ["body.state.velocity_inertial"],
}
TERMINAL = math.sqrt(2.0 * 2.0 * 9.81 / (1.2 * 0.1 * 0.5))
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    def write_files(simulation: dict[str, Any], trim: dict[str, Any] | None = None) -> Path:
        (tmp_path / "plant.sim.json").write_text(json.dumps(simulation))
        (tmp_path / "plant.trim.json").write_text(json.dumps(trim, indent=2))
        return tmp_path / ("plant.trim.json" if trim else "plant.sim.json")

    monkeypatch.chdir(tmp_path)
    return write_files


def pendulum_by_hand(angle: float) -> tuple[np.ndarray, np.ndarray]:
    """A and B of (position, angle, speed, angle rate), at rest upright (0) or hanging (pi)."""
    p, sign = POLE, math.cos(angle)
    inertia = np.array(
        [
            [p["cart_mass"] + p["pole_mass"], sign * p["pole_mass"] * p["pole_length"]],
            [sign * p["pole_mass"] * p["pole_length"], p["pole_inertia"] + p["pole_mass"] * p["pole_length"] ** 2],
        ]
    )
    stiffness = np.array([[0.0, 0.0], [0.0, sign * p["pole_mass"] * p["gravity"] * p["pole_length"]]])
    damping = -np.diag([p["cart_friction"], p["pivot_friction"]])
    lower = np.linalg.solve(inertia, np.hstack([stiffness, damping]))
    a = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), lower])
    b = np.concatenate([[0.0, 0.0], np.linalg.solve(inertia, [1.0, 0.0])])
    return a, b[:, None]


@pytest.mark.parametrize("angle", [0.0, math.pi])
def test_a_pendulum_is_that_by_hand(write: Write, angle: float) -> None:
    PENDULUM["instances"]["pole"]["parameters"] = POLE | {"angle": angle}
    with Plant(load(write(PENDULUM))) as plant:
        linear = linearise(plant, ["pole.inputs.force"], ["pole.outputs.angle", "pole.outputs.speed"])
    order = [["position", "angle", "speed", "angle_rate"].index(state.path.split(".")[-1]) for state in linear.states]
    a, b = pendulum_by_hand(angle)
    assert linear.a == pytest.approx(a[np.ix_(order, order)], abs=1e-9)
    assert linear.b == pytest.approx(b[order], abs=1e-10)
    names = [state.path for state in linear.states]
    expected = [[float(name == f"pole.state.{wanted}") for name in names] for wanted in ("angle", "speed")]
    assert linear.c == pytest.approx(np.array(expected), abs=1e-11)
    assert linear.d.tolist() == [[0.0], [0.0]]
    assert np.abs(linear.slopes).max() < 1e-14


def test_states_are_kept_by_patterns_and_the_point_is_left_as_it_was(write: Write) -> None:
    with Plant(load(write(FALL))) as plant:
        before = plant.get(plant.states)
        linear = linearise(plant, [], ["drag.outputs.force_body[2]"], ["body.state.velocity*"])
        assert plant.get(plant.states).tolist() == before.tolist()
    assert [state.path for state in linear.states] == [f"body.state.velocity_inertial[{i}]" for i in range(3)]
    # Force -k |v| v at v = (0, 0, 1): -2 k along it, -k across it.
    k = 0.5 * 1.2 * 0.1 * 0.5
    assert linear.a == pytest.approx(np.diag([-k, -k, -2 * k]) / 2.0, abs=1e-9)
    assert linear.c == pytest.approx(np.array([[0.0, 0.0, -2 * k]]), abs=1e-9)
    assert [variable.unit for variable in linear.outputs] == ["N"]


def test_it_flies_to_the_point(write: Write) -> None:
    """A fall through air is v = terminal tanh(g t / terminal)."""
    with Plant(load(write(FALL)), at_s=2) as plant:
        (speed,) = plant.get(plant.variables("body.state.velocity_inertial[2]", ("state",)))
    begun = math.atanh(1.0 / TERMINAL)
    assert speed == pytest.approx(TERMINAL * math.tanh(begun + 9.81 * 2.0 / TERMINAL), rel=1e-9)
    with pytest.raises(SimError, match="the simulation has ended at 5 s, before 9 s"):
        Plant(load(write(FALL)), at_s=9)


def test_a_trim_finds_the_terminal_velocity(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(FALL, TRIM)
    assert main(["trim", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["equilibrium"] is True
    assert found["values"] == {"body.state.velocity_inertial[2]": pytest.approx(TERMINAL, rel=1e-10)}
    assert main(["linearise", str(path), "--states", "body.state.velocity*", "-o", "linear.json"]) == 0
    linear = json.loads(Path("linear.json").read_text())
    assert linear["A"][2][2] == pytest.approx(-2.0 * 9.81 / TERMINAL, rel=1e-8)
    assert np.linalg.eigvals(linear["A"]).real.max() == pytest.approx(-9.81 / TERMINAL, rel=1e-8)
    assert "3 states, 0 inputs, 0 outputs" in capsys.readouterr().out


def test_a_trim_writes_a_simulation(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    """The density at which it falls at 20 m/s, as an input; and the drag coefficient, a parameter."""
    unknowns = {"drag.inputs.density": {"start": 1.0}, "body.state.velocity_inertial[2]": {"start": 20.0}}
    problem = TRIM | {"unknowns": unknowns, "outputs": {"air.outputs.airspeed": 20.0}}
    assert main(["trim", str(write(FALL, problem)), "-o", "trimmed.sim.json"]) == 0
    trimmed = json.loads(Path("trimmed.sim.json").read_text())
    density = 2.0 * 2.0 * 9.81 / (0.1 * 0.5 * 20.0**2)
    assert trimmed["extends"] == "plant.sim.json"
    assert trimmed["instances"] == {"drag": {"inputs": {"density": pytest.approx(density, rel=1e-9)}}}
    assert load("trimmed.sim.json").warnings == ()
    assert "an equilibrium" in capsys.readouterr().out
    assert main(["trim", "plant.trim.json", "-o", "trimmed.sim.json"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_no_equilibrium_is_said(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    slow = {"body.state.velocity_inertial[2]": {"start": 1.0, "within": [0.0, 2.0]}}
    path = write(FALL, TRIM | {"unknowns": slow})
    assert main(["trim", str(path)]) == 1
    assert "no equilibrium was found" in capsys.readouterr().out
    assert main(["linearise", str(path)]) == 2


def test_large_states_have_steps_that_fit(write: Write) -> None:
    """The density of air over the radius, at 6.4e6 m from the centre of the Earth: against differences of 1 m by hand."""
    body = json.loads(json.dumps(FALL["instances"]["body"]))
    body["parameters"]["position_inertial"] = [6378137.0 + 1000.0, 0.0, 0.0]
    body["inputs"]["force_body"] = [0.0, 0.0, 0.0]
    simulation = {
        **{key: FALL[key] for key in ("tick_hz", "seed", "duration", "integrator")},
        "models": {
            "body": FALL["models"]["body"],
            "earth": {"source": f"{LIBRARY}/earth_wgs84.c"},
            "air": {"source": f"{LIBRARY}/atmosphere_1976.c"},
        },
        "instances": {
            "body": body,
            "earth": {"model": "earth"},
            "air": {"model": "air", "parameters": {"temperature_offset": 0.0}},
        },
        "connections": [
            {"from": "body.position_inertial", "to": "earth.position_inertial"},
            {"from": "body.velocity_inertial", "to": "earth.velocity_inertial"},
            {"from": "earth.height", "to": "air.height"},
        ],
    }
    with Plant(load(write(simulation))) as plant:
        linear = linearise(plant, [], ["air.outputs.density"], ["body.state.position_inertial[0]"])
        (state,), (density,) = linear.states, plant.variables("air.outputs.density", ("output",))
        middle, values = plant.get([state])[0], []
        for value in (middle + 1.0, middle - 1.0):
            plant.set([state], [value])
            plant.slopes()
            values.append(plant.get([density])[0])
    assert linear.c[0][0] == pytest.approx((values[0] - values[1]) / 2.0, rel=1e-6)


def test_a_trim_writes_whole_arrays(write: Write) -> None:
    """The gravity in which it falls at 10 m/s."""
    unknowns = {"body.inputs.gravity_inertial[2]": {"start": 1.0}, "body.state.velocity_inertial[2]": {"start": 9.0}}
    problem = TRIM | {"unknowns": unknowns, "outputs": {"air.outputs.airspeed": 10.0}}
    assert main(["trim", str(write(FALL, problem)), "-o", "trimmed.sim.json"]) == 0
    gravity = 0.5 * 1.2 * 0.1 * 0.5 * 10.0**2 / 2.0
    expected = {"inputs": {"gravity_inertial": [0.0, 0.0, pytest.approx(gravity, rel=1e-9)]}}
    assert json.loads(Path("trimmed.sim.json").read_text())["instances"] == {"body": expected}


@pytest.mark.parametrize(
    ("unknown", "message"),
    [
        ("body.inputs.force_body[2]", "`body.inputs.force_body[2]` is fed by another model"),
        ("body.parameters.velocity_inertial[2]", "changes none of the conditions"),
    ],
)
def test_unknowns_that_cannot_act(write: Write, capsys: pytest.CaptureFixture[str], unknown: str, message: str) -> None:
    assert main(["trim", str(write(FALL, TRIM | {"unknowns": {unknown: {"start": 1.0}}}))]) == 2
    assert message in capsys.readouterr().err


def test_a_start_without_derivatives_is_said(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    problem = TRIM | {"unknowns": {"body.inputs.mass": {"start": 0.0}}}
    assert main(["trim", str(write(FALL, problem))]) == 2
    assert "the derivative of body.state.velocity_inertial[0] is" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--at", "0.005"], "0.005 s is not a whole number of ticks (1/100 s)"),
        (["--input", "drag.inputs.densty"], "there is no input `drag.inputs.densty` of a model; did you mean `drag.inputs.density`?"),
        (["--input", "body.inputs.force_body[0]"], "`body.inputs.force_body[0]` is fed by another model"),
        (["--measure", "air.outputs.velocity_air_body[3]"], "there is no such element of f64[3]"),
        (["--states", "wing.*"], "no continuous state matches wing.*"),
    ],
)  # fmt: skip
def test_wrong_options(write: Write, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str) -> None:
    assert main(["linearise", str(write(FALL)), *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"unknowns": {"a.b": {"start": 1.0, "within": [2.0, 3.0]}}}, "E204"),
        ({"unknowns": {"a.b": {"start": 2.0, "within": [2.0, 2.0]}}}, "E204"),
        ({"unknowns": {"a.b": {}}}, "E202"),
        ({"unknowns": 3}, "E208"),
        ({"steady": [3]}, "E208"),
        ({"outputs": {"a.b": "x"}}, "E208"),
        ({"simulation": None}, "E208"),
        ({"more": 1}, "E201"),
    ],
)
def test_wrong_trims(write: Write, change: dict[str, Any], code: str) -> None:
    with pytest.raises(DiagnosticError) as error:
        read_trim(write(FALL, TRIM | change))
    assert error.value.diagnostics[0].code == code


def test_a_trim_has_conditions_and_single_unknowns(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SimError, match="it has no condition"):
        read_trim(write(FALL, TRIM | {"steady": []}))
    path = write(FALL, TRIM | {"unknowns": {"body.state.velocity_inertial": {"start": 1.0}}})
    assert main(["trim", str(path)]) == 2
    assert "has 3 elements: name one" in capsys.readouterr().err
