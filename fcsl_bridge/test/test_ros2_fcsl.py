# SPDX-License-Identifier: Apache-2.0
"""`ros2 fcsl`: its verbs on running controllers; under the real ros2cli where that is installed."""

from __future__ import annotations

import signal
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest
import rig
import run_verb
from bridge_harness import LIMIT_S, Domain
from controller_client import ACTIVATE, DEACTIVATE, ControllerClient

from simclient.run import open_run

HERE = Path(__file__).parent
ALONE = [sys.executable, str(HERE / "run_verb.py")]
ROS2 = [sys.executable, "-c", "import sys; from ros2cli.cli import main; sys.exit(main())", "fcsl"]
#: How to have ros2cli: CONTRIBUTING.md.
NEEDS_ROS2CLI = pytest.mark.skipif(find_spec("ros2cli") is None, reason="ros2cli is not installed")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"))


class Fleet:
    """Machine `rig` in the namespaces one, where its state may be forced, and two. `says` runs a verb in this process."""

    def __init__(self, domain: Domain, library: Path, patch: pytest.MonkeyPatch, capture: pytest.CaptureFixture[str]):
        self._capture = capture
        patch.setenv("ROS_DOMAIN_ID", str(domain.number))
        self.empty = self.says("list", "-t", "0.1"), self.says("state", "rig", "-t", "0.1")
        self.one, self.two = (
            domain.start("controller_node", "-r", f"__ns:=/{space}", machine=library, mode="realtime", **parameters)
            for space, parameters in (("one", {"allow_set_state": True, "record": domain.folder / "bag"}), ("two", {}))
        )

    def says(self, *given: str) -> str:
        """What it prints, or the error."""
        status = run_verb.main(list(given))
        return status if isinstance(status, str) else self._capture.readouterr().out

    def at_last_says(self, answer: str, *given: str) -> None:
        """Runs a verb until that is its answer: a busy machine may find nodes later than the verb waits for them."""
        deadline = time.monotonic() + LIMIT_S
        while (said := self.says(*given)) != answer and time.monotonic() < deadline:
            pass
        assert said == answer


@pytest.fixture
def fleet(domain: Domain, library: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Fleet:
    return Fleet(domain, library, monkeypatch, capsys)


def test_verbs(domain: Domain, fleet: Fleet, library: Path) -> None:
    nothing, no_machine = fleet.empty
    assert nothing == "" and "error: no machine `rig` runs; no controller_node runs in ROS_DOMAIN_ID" in no_machine

    for machine in ("/one/rig", "/two/rig"):
        fleet.at_last_says("FLY\n", "state", machine)
    fleet.at_last_says("", "set-state", "/one/rig", "SLOW")
    fleet.at_last_says("SLOW\n", "state", "/one/rig")
    fleet.at_last_says("/one/rig  SLOW  /one/rig\n/two/rig  FLY   /two/rig\n", "list")

    client = ControllerClient(domain.listener(), "/two/rig")
    assert client.change(DEACTIVATE)
    fleet.at_last_says("/one/rig  SLOW            /one/rig\n/two/rig  FLY (inactive)  /two/rig\n", "list")
    assert client.change(ACTIVATE)
    fleet.at_last_says("/one/rig  SLOW  /one/rig\n/two/rig  FLY   /two/rig\n", "list")

    refused = {
        ("set-state", "/one/rig", "SLO"): "/one/rig: no state `SLO`; did you mean `SLOW`?",
        ("set-state", "/two/rig", "SLOW"): "/two/rig: not allowed: start the node with -p allow_set_state:=true",
        ("state", "rig"): "several machines are `rig`; name one of /one/rig, /two/rig",
        ("state", "/one/rug", "-t", "1"): "no machine `/one/rug` runs; did you mean `/one/rig`?",
        ("state", "x", "-t", "1"): "no machine `x` runs; there are /one/rig, /two/rig",
    }
    for given, reason in refused.items():
        fleet.at_last_says(f"ros2 fcsl: error: {reason}", *given)
    check_info(fleet, library)


def check_info(fleet: Fleet, library: Path) -> None:
    run = open_run(library, None)
    machine = run.machine
    run.close()
    said = fleet.says("info", "/one/rig")
    rows = dict(line.split(maxsplit=1) for line in said.splitlines() if line.startswith("  "))
    assert rows["library"] == str(library) and rows["tick_hz"] == "100" and rows["states"] == "IDLE, SLOW, FLY"
    assert (rows["source_hash"], rows["layout_hash"]) == (machine.source_hash, machine.layout_hash)
    assert rows["build_hash"] == machine.build_hash
    sensor, actuator = (rows[name].split(maxsplit=4) for name in ("imu.rate", "motor.torque"))
    assert sensor == ["sensor", "1", "f64[3]", "rad/s", "/one/imu/data (sensor_msgs/Imu, angular_velocity)"]
    assert actuator == ["actuator", "2", "f64", "N", "/one/motor/torque (std_msgs/Float64, data)"]
    assert rows["/one/rig/state"] == "fcsl_msgs/msg/MachineState"


@pytest.mark.parametrize("command", [ALONE, pytest.param(ROS2, marks=NEEDS_ROS2CLI)], ids=["alone", "ros2"])
def test_follow_and_replay(domain: Domain, fleet: Fleet, library: Path, command: list[str]) -> None:
    following = domain.run([*command, "state", "/one/rig", "--follow", "-t", "60"])
    following.wait_for("  FLY\n")
    assert domain.run([*command, "set-state", "/one/rig", "SLOW"]).finish() == 0
    following.wait_for("  SLOW\n")
    refused = domain.run([*command, "set-state", "/two/rig", "SLOW"])
    assert refused.finish() == 1 and refused.err.startswith("ros2 fcsl: error: /two/rig: not allowed: "), refused.err
    fleet.one.signal(signal.SIGSTOP)
    following.wait_for("/one/rig: no sign of life\n")
    fleet.one.signal(signal.SIGCONT)
    fleet.one.signal(signal.SIGINT)
    assert fleet.one.finish() == 0
    replayed = domain.run([*command, "replay", "--library", library, domain.folder / "bag"])
    assert replayed.finish() == 0 and "identical" in replayed.out, replayed.out + replayed.err


@NEEDS_ROS2CLI
def test_the_command_is_known_to_ros2(domain: Domain) -> None:
    asked = domain.run([*ROS2, "-h"])
    assert asked.finish() == 0
    assert {line.split()[0] for line in asked.out.splitlines() if line.startswith("  ")} >= {
        *("list", "info", "state", "set-state", "replay")
    }, asked.out
