# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, under the real `launch` and `launch_ros`: each node's parameters, namespace and
environment, and what ends the launch. Skipped where they are not installed; CONTRIBUTING.md says how to have them.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from bridge_harness import Domain, Process

from fcsl_bridge.nodes import controller_node, rerun_node, sim_node
from fcsl_compiler.base.packages import package_share

pytest.importorskip("launch_ros", reason="launch_ros is not installed; CONTRIBUTING.md says how to have it")

HERE = Path(__file__).parent
SIL = HERE.parent / "launch" / "sil.launch.py"
LANDER = package_share("lander") / "launch" / "lander.launch.py"
GIVEN = {"machine": "lander/lander_control", "sim": "package://lander/sim/lander.sim.json"}
MODULES = {"controller_node": controller_node, "sim_node": sim_node, "rerun_node": rerun_node}
#: A node that would end by itself after this many seconds was interrupted before, or the test failed.
LONG_S = 100.0

Start = Callable[..., dict[str, "Started"]]


class Started:
    """What one node was started with."""

    def __init__(self, found: dict[str, Any]):
        self.environment, self.interrupted = found["environment"], found["interrupted"]
        self.executable = found["name"].rpartition("/")[2]
        self.parameters: dict[str, Any] = {}
        for text in found["parameters"]:
            # launch_ros writes a list of strings as a Python tuple; rcl takes it as a list.
            for each in yaml.safe_load(text.replace("!!python/tuple", "")).values():
                self.parameters |= each["ros__parameters"]
        options = {option.name: option.kind for option in MODULES[self.executable].OPTIONS}
        for name, value in self.parameters.items():
            assert "." in name or type(value) is options[name], f"{found['name']}: {name} is {value!r}"


def launch(domain: Domain, path: Path, **arguments: str) -> Process:
    given = [f"{name.replace('__', '-')}:={value}" for name, value in arguments.items()]
    return domain.run([sys.executable, HERE / "run_launch_file.py", path, *given])


@pytest.fixture
def start(domain: Domain) -> Start:
    """Launches a file with recorders in place of the nodes; returns them by `<namespace>/<executable>`.

    `behaviour`: for some of them exit status and duration.
    """

    def starter(path: Path, behaviour: dict[str, tuple[int, float]] | None = None, **given: str) -> dict[str, Started]:
        (domain.folder / "behaviour.json").write_text(json.dumps(behaviour or {}))
        recorder = f"{sys.executable} -I -S {HERE / 'launch_recorder.py'} {domain.folder}"
        process = launch(domain, path, **given, launch__prefix=recorder)
        process.finish()
        assert "Caught exception" not in process.out, process.out
        files = [file for file in domain.folder.glob("*.json") if file.name != "behaviour.json"]
        found = [json.loads(file.read_text()) for file in files]
        for file in files:
            file.unlink()
        return {each["name"]: Started(each) for each in found}

    return starter


def test_the_defaults(start: Start) -> None:
    nodes = start(SIL, {"/controller_node": (0, 2.0)}, **GIVEN)
    assert sorted(nodes) == ["/controller_node", "/sim_node"]
    both = {"decimate": 1, "timeout_s": 5.0, "start_timeout_s": 60.0, "wait_for_subscribers": 0}
    controller, sim = nodes["/controller_node"], nodes["/sim_node"]
    assert controller.parameters == {"machine": GIVEN["machine"], "allow_set_state": False, **both}
    assert sim.parameters == {"sim": GIVEN["sim"], "speed": 0.0, "paused": False, **both}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sim": GIVEN["sim"]}, "missing required argument 'machine'"),
        ({"machine": GIVEN["machine"]}, "missing required argument 'sim'"),
        (GIVEN | {"rerun": "yes"}, 'Argument "rerun" provided value "yes" is not valid'),
        (GIVEN | {"seed": "1.5"}, "launch argument `seed` takes a whole number, got `1.5`"),
        (GIVEN | {"speed": "fast"}, "launch argument `speed` takes a number, got `fast`"),
        (GIVEN | {"paused": "yes"}, "launch argument `paused` takes `true` or `false`, got `yes`"),
    ],
)
def test_bad_arguments(domain: Domain, given: dict[str, str], message: str) -> None:
    process = launch(domain, SIL, **given)
    assert process.finish() == 1
    assert message in process.out


def test_every_argument_reaches_its_node(start: Start) -> None:
    """With its type: a bag named 007 is text, `speed:=1` a double."""
    own = {"record": "007", "allow_set_state": True, "checkpoints": "saved"}
    sims = {"seed": 3, "duration": 2.5, "speed": 1.0, "paused": True}
    both = {"decimate": 10, "timeout_s": 7.0, "start_timeout_s": 8.0, "wait_for_subscribers": 1}
    texts = {name: str(value).removesuffix(".0") for name, value in (own | sims | both).items()}
    texts |= {"allow_set_state": "true", "paused": "true", "namespace": "/fleet/"}
    nodes = start(SIL, {"fleet/controller_node": (0, 2.0)}, **GIVEN, **texts)
    assert nodes["fleet/controller_node"].parameters == {"machine": GIVEN["machine"], **own, **both}
    assert nodes["fleet/sim_node"].parameters == {"sim": GIVEN["sim"], **sims, **both}


def test_several_vehicles_with_viewers(start: Start) -> None:
    ends = {f"fleet/{vehicle}/controller_node": (0, 3.0) for vehicle in ("one", "two")}
    nodes = start(SIL, ends, **GIVEN, vehicles="one, two", namespace="fleet", record="bag", rerun="true")
    viewers = ["fleet/one/rerun_node", "fleet/two/rerun_node"]
    assert sorted(nodes) == sorted([*ends, *viewers, "fleet/sim_node"])
    assert nodes["fleet/sim_node"].parameters["vehicles"] == ["one", "two"]
    assert [nodes[name].parameters["record"] for name in ends] == ["bag_one", "bag_two"]
    assert all(nodes[name].parameters == {"machine": GIVEN["machine"]} for name in viewers)


def test_the_end_of_the_only_controller_ends_the_launch(start: Start) -> None:
    nodes = start(SIL, {"/controller_node": (0, 2.0), "/sim_node": (0, LONG_S)}, **GIVEN)
    assert nodes["/sim_node"].interrupted and not nodes["/controller_node"].interrupted


def test_the_end_of_the_simulator_leaves_the_controller_time_for_its_bag(start: Start) -> None:
    nodes = start(SIL, {"/controller_node": (0, 3.0)}, **GIVEN)
    assert not nodes["/controller_node"].interrupted


def test_a_failed_simulator_ends_the_launch(start: Start) -> None:
    nodes = start(SIL, {"/controller_node": (0, LONG_S), "/sim_node": (1, 2.0)}, **GIVEN)
    assert nodes["/controller_node"].interrupted


def test_the_launch_ends_with_the_last_of_several_controllers(start: Start) -> None:
    one, two = "one/controller_node", "two/controller_node"
    nodes = start(SIL, {one: (0, 2.0), two: (0, 6.0), "/sim_node": (0, LONG_S)}, **GIVEN, vehicles="one,two")
    assert [nodes[name].interrupted for name in (one, two, "/sim_node")] == [False, False, True]


def test_a_failed_controller_of_several_ends_the_launch(start: Start) -> None:
    one, two = "one/controller_node", "two/controller_node"
    nodes = start(SIL, {one: (1, 2.0), two: (0, LONG_S), "/sim_node": (0, LONG_S)}, **GIVEN, vehicles="one,two")
    assert [nodes[name].interrupted for name in (one, two, "/sim_node")] == [False, True, True]


def test_the_lander_includes_the_general_file(start: Start) -> None:
    other = "package://lander/sim/dropout.sim.json"
    nodes = start(LANDER, {"/controller_node": (0, 2.0)}, sim=other, seed="3", record="flight", rerun="true")
    assert sorted(nodes) == ["/controller_node", "/rerun_node", "/sim_node"]
    assert nodes["/sim_node"].parameters.items() >= {"sim": other, "seed": 3}.items()
    controller = nodes["/controller_node"].parameters
    assert controller.items() >= {"machine": "lander/lander_control", "record": "flight"}.items()


def test_the_launch_file_of_the_documentation(domain: Domain, start: Start) -> None:
    page = (HERE.parents[1] / "docs/guide/ros2.md").read_text(encoding="utf-8")
    (block,) = [b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "generate_launch_description" in b]
    path = domain.folder / "robot.launch.py"
    path.write_text(block)
    node = start(path)["/controller_node"]
    expected = {"machine": "my_robot/my_robot", "mode": "realtime", "controller.gain": 3.0}
    assert node.parameters == expected
    assert expected["mode"] in controller_node.MODES
    assert node.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SUBNET"


@pytest.mark.parametrize(
    ("given", "expected"),
    [({}, "fastdds_loopback.xml"), ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, None)],
)
def test_the_network_stays_on_this_machine(
    domain: Domain, start: Start, given: dict[str, str], expected: str | None
) -> None:
    """Unless the user chose otherwise."""
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        domain.environment.pop(name, None)
    domain.environment |= given
    for node in start(SIL, {"/controller_node": (0, 2.0)}, **GIVEN).values():
        profile = node.environment.get("FASTRTPS_DEFAULT_PROFILES_FILE")
        assert profile and Path(profile).name == expected if expected else profile is None
