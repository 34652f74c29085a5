# SPDX-License-Identifier: Apache-2.0
"""fcsl-sim as a user runs it: output, exit status, remaining files."""

from __future__ import annotations

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.codes.pages import explain
from fcsl_sim.codes import SIM_CODES
from simclient.bag import Bag

FCSL_SIM = Path(__file__).resolve().parents[1] / "bin/fcsl-sim"
Write = Callable[..., Path]

#: The smallest machine that fits RAMP's channels, to be compiled.
HOPPER = {
    "tick_hz": 100,
    "initial_state": "UP",
    "algorithms": {"Sensors": {"source": "sensors.py"}, "Pilot": {"source": "pilot.py"}},
    "instances": {"sensors": {"algorithm": "Sensors"}, "pilot": {"algorithm": "Pilot"}},
    "connections": [{"from": "sensors.pos_z", "to": "pilot.pos_z"}],
    "states": {
        "UP": {"schedule": {"sensors": 100, "pilot": 100}},
        "DOWN": {"schedule": {"sensors": 100, "pilot": 100}},
    },
    "transitions": [{"from": "UP", "request": "TURN", "to": "DOWN", "priority": 1}],
    "channels": [
        {"name": "altitude", "id": 1, "field": "sensors.outputs.pos_z", "direction": "sensor", "max_age_ticks": 5},
        {"name": "velocity", "id": 2, "field": "sensors.outputs.vel_z", "direction": "sensor", "max_age_ticks": 5},
        {"name": "throttle", "id": 16, "field": "pilot.outputs.throttle", "direction": "actuator"},
    ],
}
SENSORS = """
class Sensors:
    outputs = {
        "pos_z": "f64 m",  # altitude
        "vel_z": "f64 m/s",  # velocity
    }

    def execute(self):
        pass
"""
PILOT = '''
class Pilot:
    """Full throttle; turns above half a metre."""

    inputs = {"pos_z": "f64 m"}  # altitude
    outputs = {
        "throttle": "f64",  # 0 to 1
        "transition_request": "TransitionRequest",
    }

    def execute(self):
        self.throttle = 1.0
        self.transition_request = "TURN" if self.pos_z > 0.505 else ""
'''


@pytest.fixture
def sim_json(write_sim: Write) -> Path:
    """RAMP with a machine that is compiled."""
    path = write_sim()
    (path.parent / "hopper.json").write_text(json.dumps(HOPPER))
    (path.parent / "sensors.py").write_text(SENSORS)
    (path.parent / "pilot.py").write_text(PILOT)
    return path


def fcsl_sim(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(FCSL_SIM), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)


def test_run_tells_what_happened(sim_json: Path, tmp_path: Path) -> None:
    done = fcsl_sim("run", sim_json, "--record", tmp_path / "bag")
    assert (done.returncode, done.stderr) == (0, "")
    change, end, last, *truth, speed, bag = done.stdout.splitlines()
    assert change == "     0.520 s  UP -> DOWN"
    assert end == "     1.000 s  end: the duration is over"
    assert last == "     0.990 s  values of the last tick:"
    assert truth == [
        "  ramp.outputs.x = 0.99 m",
        "  ramp.outputs.seen_rate = 1",
        "  ramp.outputs.time_ns = 990000000 ns",
    ]
    assert speed.startswith("seed 1: 100 ticks in ") and speed.endswith(" times real time")
    assert bag == f"bag: {tmp_path / 'bag'}"
    assert (tmp_path / "bag/metadata.yaml").is_file()


def test_run_as_json(sim_json: Path) -> None:
    done = fcsl_sim("run", sim_json, "--json", "--seed", "5", "--set", "altimeter.parameters.bias=0.25")
    assert (done.returncode, done.stderr) == (0, "")
    summary = json.loads(done.stdout)
    assert summary["transitions"] == [{"tick": 27, "time_s": 0.27, "from_state": "UP", "to_state": "DOWN"}]
    assert (summary["seed"], summary["ticks"], summary["end"], summary["state"]) == (5, 100, "duration", "DOWN")
    assert summary["until_held"] is None
    assert summary["truth"]["altimeter.outputs.value"] == pytest.approx(1.24)
    assert (summary["time_s"], summary["truth_time_s"]) == (1.0, 0.99)
    assert summary["truth"]["ramp.outputs.time_ns"] == 990_000_000
    assert summary["bag"] is None and summary["real_time_factor"] > 0


def test_a_run_names_transitions_that_lost_requests(sim_json: Path) -> None:
    """When the time leads to HELD, TURN has asked for DOWN; likewise of a second controller."""
    machine = json.loads(json.dumps(HOPPER))
    machine["states"]["HELD"] = machine["states"]["UP"]
    machine["transitions"][0]["after_s"] = 0.8
    machine["transitions"].append({"from": "UP", "to": "HELD", "priority": 2, "after_s": 0.8})
    (sim_json.parent / "hopper.json").write_text(json.dumps(machine))
    done = fcsl_sim("run", sim_json)
    assert (done.returncode, done.stderr) == (0, "")
    change, *_, lost = done.stdout.splitlines()
    assert (change, lost) == ("     0.800 s  UP -> HELD", "lost requests: UP -> DOWN: TURN 1")
    summary = json.loads(fcsl_sim("run", sim_json, "--json").stdout)
    assert summary["lost_requests"] == {"UP -> DOWN: TURN": 1}
    text = sim_json.read_text().replace("controller.", "one.")
    config = json.loads(text) | {"controllers": {name: {"machine": "hopper.json"} for name in ("one", "two")}}
    del config["controller"]
    config["connections"] += [
        {"from": "altimeter.value", "to": "two.altitude"},
        {"from": "velocimeter.value", "to": "two.velocity"},
    ]
    sim_json.write_text(json.dumps(config))
    done = fcsl_sim("run", sim_json)
    told = ["controller two: 100 ticks, HELD", "controller two: lost requests: UP -> DOWN: TURN 1"]
    assert done.stdout.splitlines()[-3:] == [lost, *told], done.stderr
    summary = json.loads(fcsl_sim("run", sim_json, "--json").stdout)
    assert summary["companions"]["two"]["lost_requests"] == summary["lost_requests"] == {"UP -> DOWN: TURN": 1}


def test_a_run_in_which_until_never_holds_says_so(sim_json: Path, tmp_path: Path) -> None:
    """By its status, its last line and its summary; the bag is whole."""
    config = json.loads(sim_json.read_text())
    outcomes = {0.2: (0, "until", True), 5.0: (1, "duration", False)}
    for above, (status, end, held) in outcomes.items():
        config["until"] = {"condition": f"ramp.outputs.x > {above}", "for_s": 0.1}
        sim_json.write_text(json.dumps(config))
        done = fcsl_sim("run", sim_json, "--record", tmp_path / f"bag{above}")
        assert (done.returncode, done.stderr) == (status, "")
        says = done.stdout.splitlines()[-1] == "until never held: ramp.outputs.x > 5.0 for 0.1 s"
        assert says is not held and (held or f"bag: {tmp_path / f'bag{above}'}" in done.stdout)
        done = fcsl_sim("run", sim_json, "--json")
        summary = json.loads(done.stdout)
        assert (done.returncode, summary["end"], summary["until_held"]) == (status, end, held)
    assert not Bag(tmp_path / "bag5.0").truncated


def test_check(sim_json: Path) -> None:
    done = fcsl_sim("check", sim_json)
    expected = f"{sim_json}: ok: `hopper` and ramp, altimeter, velocimeter for at most 1 s\n"
    assert (done.returncode, done.stdout, done.stderr) == (0, expected, "")


def test_errors_of_simulation_and_machine_come_together(sim_json: Path) -> None:
    sim_json.write_text(sim_json.read_text().replace('"seed"', '"sead"'))
    (sim_json.parent / "pilot.py").write_text(PILOT.replace("self.pos_z", "self.pos_y"))
    done = fcsl_sim("check", sim_json)
    assert done.returncode == 1 and done.stdout == ""
    assert "pilot.py:13:" in done.stderr and "error[E201]: unknown key `sead`" in done.stderr
    assert "Traceback" not in done.stderr and done.stderr.endswith("fcsl-sim: 2 errors\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--external", "dds:x"],
            "fcsl-sim: error: --external dds:x: write wire:SPEC, as in wire:unix:PATH or wire:udp:127.0.0.1:7600",
        ),
        (["--external", "zenoh:x"], "fcsl-sim: error: zenoh:x: write zenoh:tcp:HOST:PORT in numbers"),
        (["--record", "."], "fcsl-sim: error: .: exists already; a bag is written into a new directory"),
        (["--record", "no/such/bag"], "fcsl-sim: error: "),
        (
            ["--record", "b", "--external", "wire:unix:s"],
            "fcsl-sim: error: with an external controller the controller records",
        ),
        (["--seed", "-1"], "argument --seed: invalid seed (0 to 2^64 - 1) value: '-1'"),
        (["--duration", "nan"], "argument --duration: invalid number of seconds value: 'nan'"),
        (["--duration", "0"], "argument --duration: 0 s is not above zero"),
        (["--duration", "1e300"], "argument --duration: 1e300 s is more than 1e+09 s"),
        (["--duration", "1e99999999"], "argument --duration: 1e99999999 s is more than 1e+09 s"),
        (["--duration", "1e-99999999"], "argument --duration: 1e-99999999 s is not above zero"),
        (["--duration", "1/0"], "argument --duration: invalid number of seconds value: '1/0'"),
        (["--external", "wire:unix:s", "--timeout", "0.1", "--telemetry", "udp:nowhere"], "cannot go to 'udp:nowhere'"),
        (["--timeout", "1"], "fcsl-sim: error: `--timeout` needs `--external`"),
        (["--namespace", "a"], "fcsl-sim: error: `--namespace` needs `--record`"),
        (
            ["--speed", "-1"],
            "argument --speed: invalid speed (a number above zero, or 0 for as fast as possible) value: '-1'",
        ),
        (["--speed", "nan"], "argument --speed: invalid speed ("),
        (["--speed", "inf"], "argument --speed: invalid speed ("),
        (["--speed", "fast"], "argument --speed: invalid speed ("),
        (["--set", "x"], "--set:1:1: error[E215]"),
    ],
)
def test_bad_arguments(arguments: list[str], message: str, sim_json: Path) -> None:
    before = sorted(sim_json.parent.rglob("*"))
    done = fcsl_sim("run", sim_json, *arguments, cwd=sim_json.parent)
    assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr
    assert sorted(sim_json.parent.rglob("*")) == before


def test_a_machine_is_no_simulation(sim_json: Path) -> None:
    machine = sim_json.parent / json.loads(sim_json.read_text())["controller"]["machine"]
    for command in ("run", "check"):
        result = fcsl_sim(command, str(machine))
        assert result.returncode == 2 and result.stderr == (
            f"fcsl-sim: error: {machine}: this is a machine, not a simulation; name a simulation whose `controller` is "
            f'{{"machine": "{machine.name}"}}, such as {machine.stem}.sim.json; `fcsl check {machine}` checks it alone\n'
        )


def test_a_study_is_no_simulation(sim_json: Path) -> None:
    study = sim_json.with_name("wide.study.json")
    members = {"simulation": sim_json.name, "seed": 1, "cases": 3, "design": "random"}
    study.write_text(json.dumps({**members, "metrics": {"length": "machine.tick"}}))
    done = fcsl_sim("run", study)
    assert done.returncode == 2 and done.stderr.endswith(
        f"this is a study, not a simulation; `fcsl campaign {study}` flies it\n"
    )
    done = fcsl_sim("campaign", sim_json)
    assert done.returncode == 2 and f"this is a simulation, not a study; `fcsl sim {sim_json}` flies it" in done.stderr
    done = fcsl_sim("check", sim_json, study)
    assert done.returncode == 0, done.stderr
    assert f"{study}: ok: 3 cases, metrics length\n" in done.stdout
    assert done.stdout.count(": ok: ") == 2


def fcsl_check(*words: str | Path) -> tuple[int, str, str]:
    line = ["fcsl", "check", *map(str, words)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    return done.returncode, done.stdout, done.stderr


def test_a_check_of_machines_simulations_and_studies(sim_json: Path) -> None:
    """Each file goes to its package, with the options that this knows; one exit status, and one document."""
    machine = sim_json.parent / json.loads(sim_json.read_text())["controller"]["machine"]
    study, sick, other = (sim_json.with_name(name) for name in ("wide.study.json", "sick.sim.json", "other.json"))
    members = {"simulation": sim_json.name, "seed": 1, "cases": 3, "design": "random"}
    study.write_text(json.dumps({**members, "metrics": {"length": "machine.tick"}}))
    sick.write_text(sim_json.read_text().replace('"seed"', '"sead"'))
    other.write_text(machine.read_text().replace('"tick_hz"', '"tick_herz"'))

    status, out, err = fcsl_check(sim_json, machine, "--set", "altimeter.parameters.sigma=0.8", study)
    assert (status, err) == (0, "")
    assert [line.partition(": ok")[0] for line in out.splitlines()] == [str(f) for f in (machine, sim_json, study)]

    status, out, err = fcsl_check("--json", machine, "--duration=0.5", sim_json, study)
    found = json.loads(out)
    assert (status, found["ok"], found["diagnostics"]) == (0, True, [])
    assert [row["config"] for row in found["machines"]] == [str(machine)]
    assert [(row["file"], row["ok"]) for row in found["simulations"]] == [(str(sim_json), True), (str(study), True)]
    assert found["simulations"][0]["duration_s"] == 0.5 and found["simulations"][1]["cases"] == 3

    for files, expected in (
        ((machine, sick, sim_json), [[], [False, True]]),
        ((other, sim_json), [["E201"], [True]]),
        ((other, sick, study), [["E201"], [False, True]]),
    ):
        status, out, err = fcsl_check("--json", *files)
        found = json.loads(out)
        assert (status, found["ok"]) == (1, False)
        codes = sorted(diagnostic["code"] for diagnostic in found["diagnostics"])
        assert [codes, [row["ok"] for row in found["simulations"]]] == expected, files
    assert fcsl_check(machine, sim_json.with_name("absent.sim.json"))[0] == 2
    assert fcsl_check(sim_json.with_name("absent.json"), sim_json)[0] == 2
    status, out, err = fcsl_check("--sarif", machine, sim_json)
    assert status == 2 and "--sarif" in err and out == ""
    status, _, err = fcsl_check("--nonsense", machine, sim_json)
    assert status == 2 and "--nonsense" in err


def test_explain_says_what_the_check_does_with_a_circle() -> None:
    page = " ".join(explain("E803", SIM_CODES).split())
    assert "algebraic loop" in page and "break the circle" not in page


def test_no_such_file() -> None:
    done = fcsl_sim("run", "missing.sim.json")
    assert (done.returncode, done.stderr) == (2, "fcsl-sim: error: missing.sim.json: no such file\n")


def test_no_simulator_installed(sim_json: Path) -> None:
    python_path = os.pathsep.join(path for path in sys.path if path)
    done = fcsl_sim("run", sim_json, env=os.environ | {"AMENT_PREFIX_PATH": "", "PYTHONPATH": python_path})
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "not installed in this environment; source install/setup.bash" in done.stderr


def test_a_socket_in_use(sim_json: Path) -> None:
    path = sim_json.parent / "s"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen(1)
        done = fcsl_sim("run", sim_json, "--external", f"wire:unix:{path}")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert done.stderr.startswith("fcsl-sim: error: ") and str(path) in done.stderr


def test_an_interrupt_while_waiting_for_a_controller(sim_json: Path) -> None:
    path = sim_json.parent / "s"
    command = [sys.executable, str(FCSL_SIM), "run", str(sim_json), "--external", f"wire:unix:{path}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout and process.stdout.readline().startswith("waiting for a controller: fcsl-fc ")
        deadline = time.monotonic() + 60
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130 and "Traceback" not in stderr
    assert not path.exists()


def test_a_controller_that_never_comes(sim_json: Path) -> None:
    """It is waited for in slices; the message has the whole time."""
    path = sim_json.parent / "s"
    done = fcsl_sim("run", sim_json, "--external", f"wire:unix:{path}", "--timeout", "0.5")
    assert done.returncode == 2 and done.stderr == f"fcsl-sim: error: no controller on unix:{path} within 0.5 s\n"
    assert not path.exists()


@pytest.mark.parametrize(("limit_kib", "kept"), [(400, True), (16, False)])
def test_a_full_disk_costs_no_tick_that_was_written(sim_json: Path, tmp_path: Path, limit_kib: int, kept: bool) -> None:
    """A bag without a tick is removed, so that it does not block the next run."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # the write then fails with EFBIG, much like a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_kib << 10, limit_kib << 10))

    assert fcsl_sim("check", sim_json).returncode == 0  # the machine is compiled without the limit
    bag = tmp_path / "bag"
    options = ("--duration", "1000", "--record", bag, "--namespace", "/ns/")
    uncached = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}  # no compiled import is cut short for later processes
    done = fcsl_sim("run", sim_json, *options, env=uncached, preexec_fn=limit)
    failed = f"fcsl-sim: error: recording failed: cannot write to bag '{bag}': File too large"
    told = f"; {bag} has the ticks recorded until then" if kept else ""
    assert (done.returncode, done.stderr) == (2, f"{failed}{told}\n")
    assert bag.exists() == kept
    assert not kept or min(Bag(bag).topics[topic].count for topic in ("/ns/hopper/state", "/ns/sim/ramp")) > 100


@pytest.mark.parametrize("wrong", [["--socket", "no/such/s"], ["--telemetry", "udp:nowhere"]])
def test_what_cannot_be_opened_leaves_no_bag(wrong: list[str], sim_json: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    refused = fcsl_sim("run", sim_json, "--record", bag, *wrong, cwd=tmp_path)
    assert refused.returncode == 2 and wrong[1] in refused.stderr and not bag.exists()
    assert fcsl_sim("run", sim_json, "--record", bag).returncode == 0


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("package://nowhere/x.sim.json", "package `nowhere` is not installed"),
        ("package://x", "write package://<ros package>/<path below its share folder>"),
        ("package://fcsl_sim/../x.sim.json", "it would leave its folder"),
        ("package://fcsl_sim/none.sim.json", "no such file"),
    ],
)
def test_a_simulation_of_a_package(path: str, message: str) -> None:
    refused = fcsl_sim("check", path)
    assert refused.returncode == 2 and f"fcsl-sim: error: {path}: " in refused.stderr and message in refused.stderr


def test_a_reader_that_leaves_does_not_end_the_flight(sim_json: Path, tmp_path: Path) -> None:
    """As in `fcsl sim … | head -1`: the rest of the lines is dropped, the bag is whole."""
    bag, read = tmp_path / "bag", os.pipe()
    os.close(read[0])
    command = [str(FCSL_SIM), "run", str(sim_json), "--record", str(bag)]
    done = subprocess.run(command, stdout=read[1], stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(read[1])
    assert (done.returncode, done.stderr) == (0, "")
    assert not Bag(bag).truncated


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_closes_its_bag(sim_json: Path, tmp_path: Path, number: int) -> None:
    bag = tmp_path / "bag"
    command = [sys.executable, str(FCSL_SIM), "run", str(sim_json), "--duration", "100000", "--record", str(bag)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout and "UP -> DOWN" in process.stdout.readline()
        process.send_signal(number)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert stderr == f"fcsl-sim: interrupted; {bag} has the ticks flown until then\n"
    recorded = Bag(bag)
    assert not recorded.truncated and recorded.topics["/hopper/pilot"].count >= 52
