# SPDX-License-Identifier: Apache-2.0
"""The launch files: their arguments are the nodes' parameters. test_launch_real.py runs them where launch is installed."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import launch_standins
import pytest
from launch_standins import Node, Shutdown, visit

from fcsl_bridge import controller_node, rerun_node, sim_node
from fcsl_compiler.base.ament import package_share

SIL = Path(__file__).parents[1] / "launch" / "sil.launch.py"
LANDER = package_share("lander") / "launch" / "lander.launch.py"
GIVEN = {"machine": "lander/lander_control", "sim": "package://lander/sim/lander.sim.json"}
MODULES = {"controller_node": controller_node, "sim_node": sim_node, "rerun_node": rerun_node}


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, module in launch_standins.modules().items():
        monkeypatch.setitem(sys.modules, name, module)


def by_name(nodes: list[Node]) -> dict[str, Node]:
    return {f"{node.namespace or ''}/{node.executable}": node for node in nodes}


def check(node: Node) -> None:
    """Every parameter is one of the node's, of its type, in a form that preserves the type."""
    kinds = {option.name: option.kind for option in MODULES[node.executable].OPTIONS}
    for name, value in node.parameters.items():
        if isinstance(value, list):
            assert kinds[name] is list and all(isinstance(item, str) for item in value)
        else:
            assert kinds[name] is value.value_type and value.value != ""
            assert value.value in ("true", "false") if value.value_type is bool else value.value_type(value.value) != ""


def values(node: Node) -> dict[str, Any]:
    return {name: getattr(value, "value", value) for name, value in node.parameters.items()}


def test_the_defaults() -> None:
    nodes, context = visit(SIL, **GIVEN)
    assert list(by_name(nodes)) == ["/controller_node", "/sim_node"]
    for node in nodes:
        check(node)
        assert node.package == "fcsl_bridge"
    controller, sim = nodes
    assert values(controller)["machine"] == GIVEN["machine"] and "record" not in controller.parameters
    assert values(sim)["sim"] == GIVEN["sim"] and not {"seed", "duration", "vehicles"} & set(sim.parameters)


@pytest.mark.parametrize("missing", ["machine", "sim"])
def test_required_arguments(missing: str) -> None:
    with pytest.raises(RuntimeError, match=f'Required launch argument "{missing}" was not provided'):
        visit(SIL, **{name: value for name, value in GIVEN.items() if name != missing})


def test_every_argument_reaches_its_node() -> None:
    arguments = {
        "record": "flight",
        "decimate": "10",
        "seed": "3",
        "duration": "2.5",
        "speed": "1.0",
        "paused": "true",
        "timeout_s": "7",
        "start_timeout_s": "8",
        "wait_for_subscribers": "1",
        "allow_set_state": "true",
        "checkpoints": "saved",
        "namespace": "/fleet/",
    }
    nodes, _ = visit(SIL, **GIVEN, **arguments)
    controller, sim = by_name(nodes)["fleet/controller_node"], by_name(nodes)["fleet/sim_node"]
    for node in nodes:
        check(node)
    shown = values(controller) | values(sim)
    del arguments["namespace"]
    assert shown == GIVEN | arguments


def test_the_viewer_is_optional() -> None:
    nodes, _ = visit(SIL, **GIVEN, rerun="true", namespace="fleet")
    viewer = by_name(nodes)["fleet/rerun_node"]
    check(viewer)
    assert values(viewer) == {"machine": GIVEN["machine"]}
    with pytest.raises(RuntimeError, match='"rerun" provided value "yes" is not valid'):
        visit(SIL, **GIVEN, rerun="yes")


def test_several_vehicles() -> None:
    nodes, _ = visit(SIL, **GIVEN, vehicles="one, two", namespace="fleet", record="bag", rerun="true")
    assert list(by_name(nodes)) == [
        "fleet/one/controller_node",
        "fleet/one/rerun_node",
        "fleet/two/controller_node",
        "fleet/two/rerun_node",
        "fleet/sim_node",
    ]
    for node in nodes:
        check(node)
    found = by_name(nodes)
    assert values(found["fleet/sim_node"])["vehicles"] == ["one", "two"]
    assert [values(found[f"fleet/{v}/controller_node"])["record"] for v in ("one", "two")] == ["bag_one", "bag_two"]


def ends(node: Node, returncode: int) -> bool:
    """Whether the launch ends when this node ends with this status."""
    return any(isinstance(action, Shutdown) for action in node.on_exit(SimpleNamespace(returncode=returncode), None))


def test_what_ends_the_launch() -> None:
    """The launch ends when all controllers have ended or one node failed; not when the simulator is done, while bags
    are closed.
    """
    (controller, sim), _ = visit(SIL, **GIVEN)
    assert not ends(sim, 0) and ends(sim, 1) and ends(controller, 0)
    nodes, _ = visit(SIL, **GIVEN, vehicles="one,two")
    one, two, sim = nodes
    assert not ends(one, 0) and ends(two, 0)
    one, *_ = visit(SIL, **GIVEN, vehicles="one,two")[0]
    assert ends(one, 1)


def test_the_lander_includes_the_general_file() -> None:
    nodes, _ = visit(LANDER)
    assert values(nodes[0])["machine"] == "lander/lander_control"
    assert values(nodes[1])["sim"] == "package://lander/sim/lander.sim.json"
    other = "package://lander/sim/dropout.sim.json"
    nodes, _ = visit(LANDER, sim=other, seed="3", record="flight", rerun="true")
    assert list(by_name(nodes)) == ["/controller_node", "/rerun_node", "/sim_node"]
    assert values(nodes[2]).items() >= {"sim": other, "seed": "3"}.items() and values(nodes[0])["record"] == "flight"


def test_the_network_stays_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.delenv(name, raising=False)
    _, context = visit(SIL, **GIVEN)
    assert Path(context.environment["FASTRTPS_DEFAULT_PROFILES_FILE"]).name == "fastdds_loopback.xml"
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    assert visit(SIL, **GIVEN)[1].environment == {}
