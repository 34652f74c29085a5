# SPDX-License-Identifier: Apache-2.0
"""`--set`, `sets` of `load` and of `SimTwin`, and studies name the same values by the same paths."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, Simulation, load
from fcsl_sim.campaign.study import read_study
from fcsl_sim.cli import main
from fcsl_sim.sim_twin import SimTwin

#: Scalars, elements of a vector, of a matrix, of a table and of an input that nothing feeds; a bool and a whole number.
SIMULATION: dict[str, Any] = {
    "tick_hz": 50,
    "seed": 1,
    "duration": 1.0,
    "integrator": {"method": "rk4", "hz": 100},
    "models": {
        "rigid_body": {"source": "package://fcsl_sim/models/rigid_body.c"},
        "wind_profile": {"source": "package://fcsl_sim/models/wind_profile.c"},
        "noisy_sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"},
    },
    "instances": {
        "body": {
            "model": "rigid_body",
            "parameters": {
                "position_inertial": [0.0, 0.0, 0.0], "velocity_inertial": [0.0, 0.0, 0.0],
                "roll": 0.0, "pitch": 0.0, "yaw": 0.0, "rate_body": [0.1, 0.2, 0.3],
            },
            "inputs": {
                "mass": 2.0, "inertia": [[1.0, 0, 0], [0, 2.0, 0], [0, 0, 3.0]], "gravity_inertial": [0.0, 0.0, 9.81],
                "force_body": [0.0, 0.0, -19.62],
            },
        },
        "wind": {
            "model": "wind_profile",
            "parameters": {"height": [0.0, 50.0, 100.0], "wind_north": [1.0, 2.0], "wind_east": [0.0], "wind_down": [0.0]},
            "inputs": {"height": 60.0},
        },
        "gauge": {
            "model": "noisy_sensor", "parameters": {"bias": 0.0, "sigma": 0.5, "dropout": False}, "inputs": {"truth": 3.0}
        },
    },
    "rates": {"gauge": 50},
}  # fmt: skip
STUDY: dict[str, Any] = {
    "simulation": "flight.sim.json",
    "seed": 9,
    "design": "random",
    "cases": 6,
    "parameters": {
        "gauge.parameters.sigma": {"uniform": [0.1, 0.5]},
        "gauge.parameters.dropout": {"choice": [True, False]},
        "body.parameters.rate_body[2]": {"normal": [0.3, 0.1]},
        "body.inputs.inertia[0][0]": {"uniform": [0.5, 1.5]},
        "body.inputs.inertia[2][2]": {"uniform": [2.5, 3.5]},
        "body.inputs.force_body[1]": {"choice": [1, 2, 3]},
        "wind.parameters.wind_north[2]": {"uniform": [1.0, 9.0]},
        "wind.parameters.wind_east[0]": {"uniform": [1.0, 9.0]},
    },
    "metrics": {"north": "wind.outputs.wind_ned[0]", "rate": "body.outputs.rate_body[0]"},
}


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "flight.sim.json").write_text(json.dumps(SIMULATION, indent=1))
    path = tmp_path / "flight.study.json"
    path.write_text(json.dumps(STUDY))
    monkeypatch.chdir(tmp_path)
    return path


def hash_of(checkpoint: bytes) -> str:
    return hashlib.sha256(checkpoint).hexdigest()[:16]


def flown(config: SimConfig) -> str:
    """As a campaign does it."""
    with Simulation(config.plan, config.tables) as sim:
        while sim.status == "running":
            sim.run(config.ticks)
        return hash_of(sim.checkpoint())


def test_a_case_of_a_study_is_a_run_with_its_values(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever a study disperses: the plan, and the state at the end, bit for bit."""
    hashes = set()
    for case in range(STUDY["cases"]):
        main(["campaign", str(study), "--case", str(case), "--json"])
        outcome = json.loads(capsys.readouterr().out)
        sets = [f"{path}={json.dumps(value)}" for path, value in outcome["values"].items()]
        assert len(sets) == len(STUDY["parameters"])
        assert flown(load("flight.sim.json", seed=outcome["seed"], sets=sets)) == outcome["hash"]
        with SimTwin.from_config("flight.sim.json", seed=outcome["seed"], sets=sets) as twin:
            twin.tick(outcome["ticks"])
            assert hash_of(twin.save()) == outcome["hash"]
            assert twin.get("wind.outputs.wind_ned[0]") == outcome["metrics"]["north"]
        hashes.add(outcome["hash"])
    assert len(hashes) == STUDY["cases"]


def test_the_command_line_takes_elements(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sets = ["--set", "body.inputs.force_body[0]=8", "--set", "wind.parameters.wind_north[2]=7"]
    assert main(["run", "flight.sim.json", *sets, "--json"]) == 0
    truth = json.loads(capsys.readouterr().out)["truth"]
    assert truth["wind.outputs.wind_ned"] == pytest.approx([3.0, 0.0, 0.0])  # 60 m, between 2 m/s and 7 m/s
    assert truth["body.outputs.velocity_inertial"][0] > 2.0


def value(config: SimConfig, path: str, element: int) -> str:
    instance, _, rest = path.partition(".")
    (line,) = (line for line in config.plan.text.splitlines() if line.startswith(f"set {instance} {rest} {element} "))
    return line.rpartition(" ")[2]


@pytest.mark.parametrize("order", [1, -1])
def test_an_element_goes_over_the_whole(study: Path, order: int) -> None:
    """In whatever order they are said. What a table repeats is repeated before; a row of a matrix is an element, too."""
    sets = [
        "wind.parameters.wind_north=[4.0]", "wind.parameters.wind_north[1]=8.0", "body.inputs.inertia[1]=[0.0, 4.0, 0.0]"
    ]  # fmt: skip
    config = load("flight.sim.json", sets=sets[::order])
    north = [value(config, "wind.parameters.wind_north", i) for i in range(3)]
    assert north == ["4010000000000000", "4020000000000000", "4010000000000000"]
    inertia = [value(config, "body.inputs.inertia", i) for i in (0, 4, 8)]
    assert inertia == ["3ff0000000000000", "4010000000000000", "4008000000000000"]


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("body.parameters.rate_body[3]=1", "E217", "`body.parameters.rate_body` is f64[3]"),
        ("body.parameters.roll[0]=1", "E217", "`body.parameters.roll` is f64"),
        ("body.inputs.inertia[0][0][0]=1", "E217", "`body.inputs.inertia` is f64[3][3]"),
        ("body.inputs.inertia[0]=1", "E207", "input `inertia[0]` is f64[3], not an integer"),
        ("body.parameters.rate_body[1]=true", "E207", "parameter `rate_body[1]` is f64, not a bool"),
        ("body.parameters.rate[1]=1", "E210", "there is no parameter or input `body.parameters.rate`"),
        (
            "body.inputs.torque_body[1]=1",
            "E211",
            "`body.inputs.torque_body` has no value of which an element can be set",
        ),
    ],
)
def test_what_is_no_element(study: Path, text: str, code: str, message: str) -> None:
    with pytest.raises(DiagnosticError) as error:
        load("flight.sim.json", sets=[text])
    assert [(d.code, d.message) for d in error.value.diagnostics] == [(code, message)]
    assert error.value.diagnostics[0].span.source.name.startswith("--set")


def test_a_study_refuses_the_same(study: Path) -> None:
    """Elements of what has no value."""
    study.write_text(json.dumps(STUDY | {"parameters": {"body.inputs.torque_body[1]": {"uniform": [0, 1]}}}))
    with pytest.raises(DiagnosticError, match="E211"):
        read_study(study)
