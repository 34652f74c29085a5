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
from fcsl_sim.campaign.flight import Flights
from fcsl_sim.campaign.study import read_study
from fcsl_sim.cli import main
from fcsl_sim.sim_run import SimRun
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


# ---- parameters of controllers ---------------------------------------------------------------------------------------

CONTROLLER = """
class Law:
    inputs = {"x": "f64 m"}
    outputs = {"u": "f64 m/s", "rows": "f32"}
    parameters = {
        "gain": "f64 1/s in 0.5..4.0",
        "targets": "f64[2] m",
        "table": "f32[2][2]",
        "count": "i32 in 1..9",
        "fixed": "f64",
        "on": "bool",
    }

    def start(self):
        self.rows = self.table[0][1] + self.table[1][0]

    def execute(self):
        self.u = self.fixed
        if self.on:
            self.u = self.gain * (self.targets[0] + self.targets[1] - self.x) * f64(self.count)


class Sense:
    outputs = {"x": "f64 m"}

    def execute(self):
        pass
"""
PARAMETERS = {
    "gain": 1.0, "targets": [0.25, 0.5], "table": [[0.1, 0.2], [0.3, 0.4]], "count": 2, "fixed": 0.0, "on": True
}  # fmt: skip
MACHINE: dict[str, Any] = {
    "tick_hz": 50,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}, "Sense": {"source": "law.py"}},
    "instances": {
        "law": {"algorithm": "Law", "parameters": PARAMETERS, "frozen": ["fixed"]},
        "sense": {"algorithm": "Sense"},
    },
    "connections": [{"from": "sense.x", "to": "law.x"}],
    "states": {"RUN": {"schedule": {"sense": 50, "law": 50}}},
    "channels": [
        {"name": "x", "id": 1, "field": "sense.outputs.x", "direction": "sensor"},
        {"name": "u", "id": 2, "field": "law.outputs.u", "direction": "actuator"},
    ],
}
LOOP: dict[str, Any] = {
    "controllers": {"lead": {"machine": "lead.json"}, "second": {"machine": "second.json"}},
    "seed": 1,
    "duration": 1.0,
    "integrator": {"method": "rk4", "hz": 100},
    "models": {"chain": {"source": "chain.c"}},
    "instances": {name: {"model": "chain", "parameters": {"gain": 0.0, "rate": 1.0, "x": 0.0}} for name in "ab"},
    "connections": [
        {"from": "a.free", "to": "lead.x"}, {"from": "lead.u", "to": "a.u"},
        {"from": "b.free", "to": "second.x"}, {"from": "second.u", "to": "b.u"},
    ],
}  # fmt: skip
#: A value for each kind of path, and what the JSON of its machine has then.
CONTROLLER_SETS: dict[str, Any] = {
    "law.parameters.gain": 1.7,
    "law.parameters.targets[1]": 0.1,
    "law.parameters.table[1][0]": 0.7,
    "second.law.parameters.count": 3,
    "second.law.parameters.on": False,
    "second.law.parameters.targets[0]": 5,
}


def write_loop(folder: Path, lead: dict[str, Any] | None = None, second: dict[str, Any] | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "law.py").write_text(CONTROLLER)
    (folder / "chain.c").write_text((Path(__file__).parent / "models/chain.c").read_text())
    for name, values in (("lead", lead), ("second", second)):
        law = MACHINE["instances"]["law"] | {"parameters": PARAMETERS | (values or {})}
        text = json.dumps(MACHINE | {"instances": MACHINE["instances"] | {"law": law}})
        (folder / f"{name}.json").write_text(text)
    (folder / "loop.sim.json").write_text(json.dumps(LOOP))
    return folder / "loop.sim.json"


def states(config: SimConfig) -> tuple[bytes, list[Any]]:
    """The structs of both machines at the end, without the hashes that a checkpoint has."""
    with SimTwin(SimRun(config)) as twin:
        twin.tick(config.ticks)
        return twin._sim_run.save(), [twin.get("law.outputs.rows"), twin.get("b.outputs.free")]


@pytest.fixture
def edited(tmp_path: Path) -> tuple[bytes, list[Any]]:
    """The flight of the machines with the values of CONTROLLER_SETS in their JSON."""
    lead = {"gain": 1.7, "targets": [0.25, 0.1], "table": [[0.1, 0.2], [0.7, 0.4]]}
    second = {"count": 3, "on": False, "targets": [5, 0.5]}
    return states(load(write_loop(tmp_path / "edited", lead, second)))


def test_set_of_a_controller_is_the_edited_machine(tmp_path: Path, edited: tuple[bytes, list[Any]]) -> None:
    """Bit for bit, what `start` reads included; with a parameter file the rest of its values stays."""
    path = write_loop(tmp_path / "plain")
    sets = [f"{path}={json.dumps(value)}" for path, value in CONTROLLER_SETS.items()]
    assert states(load(path, sets=sets)) == edited != states(load(path))
    file = {"lead": {"ros__parameters": {"law.gain": 1.7}}, "second": {"ros__parameters": {"law.targets": [5.0, 0.5]}}}
    (tmp_path / "params.yaml").write_text(json.dumps(file))
    assert states(load(path, sets=sets[1:-1], parameters=tmp_path / "params.yaml")) == edited
    assert states(load(path, sets=["law.parameters.targets=[9, 9]", "law.parameters.targets[0]=0.25", *sets])) == edited


def test_a_study_disperses_controllers(tmp_path: Path, edited: tuple[bytes, list[Any]]) -> None:
    path = write_loop(tmp_path / "plain")
    spreads = {path: {"choice": [value]} for path, value in CONTROLLER_SETS.items()}
    spreads["a.parameters.x"] = {"choice": [0.0]}
    study = {
        "simulation": path.name,
        "seed": 1,
        "design": "sweep",
        "parameters": spreads,
        "metrics": {"x": "max(a.outputs.free)"},
    }
    (path.parent / "x.study.json").write_text(json.dumps(study))
    flights = Flights.of(path.parent / "x.study.json")
    assert states(flights.config(0)) == edited
    outcome = flights.fly(0)
    assert outcome.verdict == "passed" and outcome.hash == flown(load(path, seed=outcome.seed, sets=[
        f"{path}={json.dumps(value)}" for path, value in CONTROLLER_SETS.items()
    ]))  # fmt: skip
    flights.close()


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("law.parameters.gain=9", "E204", "`law.parameters.gain` is 9.0, outside 0.5..4.0"),
        ("second.law.parameters.count=0", "E204", "`second.law.parameters.count` is 0, outside 1..9"),
        ("law.parameters.count=1.5", "E207", "parameter `count` is i32, not a number with a point"),
        ("law.parameters.fixed=1", "E214", "`law.parameters.fixed` is frozen"),
        ("law.parameters.targets[2]=1", "E217", "`law.parameters.targets` is f64[2]"),
        ("second.law.parameters.gian=1", "E210", "there is no parameter or input `second.law.parameters.gian`"),
        ("law.outputs.u=1", "E210", "there is no parameter or input `law.outputs.u`"),
    ],
)
def test_what_a_controller_refuses(tmp_path: Path, text: str, code: str, message: str) -> None:
    with pytest.raises(DiagnosticError) as error:
        load(write_loop(tmp_path / "plain"), sets=[text])
    assert [(d.code, d.message) for d in error.value.diagnostics] == [(code, message)]
    assert error.value.diagnostics[0].span.source.name.startswith("--set")


@pytest.mark.parametrize(
    ("path", "spread", "message"),
    [
        ("law.parameters.gain", {"uniform": [0.4, 1.0]}, "E204]: `law.parameters.gain` is 0.4, outside 0.5..4.0"),
        ("law.parameters.gain", {"normal": [1.0, 0.1]}, "E214]: `law.parameters.gain` needs `within`"),
        ("second.law.parameters.fixed", {"choice": [1.0]}, "E214]: `second.law.parameters.fixed` is frozen"),
        ("law.parameters.table[0]", {"choice": [1.0]}, "E217]: `law.parameters.table` is f32[2][2]"),
        ("second.law.parameters.gani", {"choice": [1.0]}, "did you mean `second.law.parameters.gain`"),
    ],
)
def test_what_a_study_cannot_disperse(tmp_path: Path, path: str, spread: Any, message: str) -> None:
    folder = write_loop(tmp_path / "plain").parent
    study = {"simulation": "loop.sim.json", "seed": 1, "design": "random", "cases": 1, "parameters": {path: spread}}
    (folder / "x.study.json").write_text(json.dumps(study))
    with pytest.raises(DiagnosticError) as error:
        read_study(folder / "x.study.json")
    assert message in str(error.value) and "x.study.json:1:" in str(error.value)


def test_two_controllers_of_one_machine_cannot_differ(tmp_path: Path) -> None:
    path = write_loop(tmp_path / "plain")
    both = {"lead": {"machine": "lead.json"}, "second": {"machine": "lead.json"}}
    path.write_text(json.dumps(LOOP | {"controllers": both}))
    with pytest.raises(DiagnosticError, match="another controller flies the machine of `second.law.parameters.gain`"):
        load(path, sets=["second.law.parameters.gain=1"])


def test_a_flight_that_cannot_take_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["run", str(write_loop(tmp_path / "plain")), "--set", "law.parameters.gain=2"]
    for more in (["--external", "wire:unix:x"], ["--restore", "x"], ["--pil", "qemu:mps2-an500"]):
        assert main([*line, *more]) == 2
        assert "`--set` of a controller's parameter" in capsys.readouterr().err
