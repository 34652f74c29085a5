# SPDX-License-Identifier: Apache-2.0
"""The launch file: its arguments are the nodes' parameters. With a real `launch` installed it is also interpreted."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from fcsl_bridge import controller_node, sim_node

FILE = Path(__file__).parents[1] / "launch" / "sil.launch.py"


class Recorded:
    """Stands for any launch action: remembers what it was made with."""

    def __init__(self, *arguments: Any, **named: Any):
        self.arguments, self.named = arguments, named


def load_launch_file() -> ModuleType:
    spec = importlib.util.spec_from_file_location("sil_launch", FILE)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def stubbed(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    names = {
        "launch": ["LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "OpaqueFunction", "SetEnvironmentVariable", "Shutdown"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
        "launch_ros.parameter_descriptions": ["ParameterValue"],
    }
    for name, members in names.items():
        module = ModuleType(name)
        for member in members:
            setattr(module, member, type(member, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    return load_launch_file()


def test_arguments_are_the_nodes_parameters(stubbed: ModuleType) -> None:
    entities = stubbed.generate_launch_description().arguments[0]
    declared = {
        e.arguments[0]: e.named["default_value"] for e in entities if type(e).__name__ == "DeclareLaunchArgument"
    }
    given = {name: "given" if default is None else default for name, default in declared.items()}
    controller, sim = stubbed._nodes(SimpleNamespace(launch_configurations=given))
    for node, module in ((controller, controller_node), (sim, sim_node)):
        (parameters,) = node.named["parameters"]
        kinds = {option.name: option.kind for option in module.OPTIONS}
        assert parameters and {n: v.named["value_type"] for n, v in parameters.items()}.items() <= kinds.items()
        assert node.named["namespace"] is None
    assert {"machine", "sim"} == {name for name, default in declared.items() if default is None}


def test_a_failed_simulator_ends_the_launch(stubbed: ModuleType) -> None:
    given = {name: "1" for name, *_ in (*stubbed.CONTROLLER, *stubbed.SIMULATOR, *stubbed.BOTH)} | {"namespace": "a"}
    controller, sim = stubbed._nodes(SimpleNamespace(launch_configurations=given))
    assert sim.named["on_exit"](SimpleNamespace(returncode=0), None) == []
    assert len(sim.named["on_exit"](SimpleNamespace(returncode=1), None)) == 1
    assert type(controller.named["on_exit"]).__name__ == "Shutdown"


def test_with_the_real_launch() -> None:
    launch = pytest.importorskip("launch")
    pytest.importorskip("launch_ros")
    from launch.actions import IncludeLaunchDescription
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    from fcsl_compiler.ament import package_share

    sim = package_share("lander") / "sim" / "lander.sim.json"
    arguments = {"machine": "lander/lander_control", "sim": str(sim), "duration": "1.0", "timeout_s": "60.0"}
    service = launch.LaunchService()
    source = PythonLaunchDescriptionSource(str(FILE))
    service.include_launch_description(
        launch.LaunchDescription([IncludeLaunchDescription(source, launch_arguments=arguments.items())])
    )
    assert service.run() == 0
