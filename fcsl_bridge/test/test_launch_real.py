# SPDX-License-Identifier: Apache-2.0
"""The launch files under the real launch, where it is installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from fcsl_compiler.base.ament import package_share

launch = pytest.importorskip("launch")
pytest.importorskip("launch_ros")

SIL = (
    Path(__file__).parents[1] / "launch" / "sil.launch.py",
    {"machine": "lander/lander_control", "sim": "package://lander/sim/lander.sim.json"},
)
LANDER = (package_share("lander") / "launch" / "lander.launch.py", {})


@pytest.mark.parametrize(("path", "given"), [SIL, LANDER])
def test_a_flight(path: Path, given: dict[str, str]) -> None:
    from launch.actions import IncludeLaunchDescription
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    arguments = {**given, "duration": "1.0", "timeout_s": "60.0"}
    service = launch.LaunchService()
    source = PythonLaunchDescriptionSource(str(path))
    service.include_launch_description(
        launch.LaunchDescription([IncludeLaunchDescription(source, launch_arguments=arguments.items())])
    )
    assert service.run() == 0
