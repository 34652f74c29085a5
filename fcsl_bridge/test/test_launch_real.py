# SPDX-License-Identifier: Apache-2.0
"""Flights with the launch files, under the real `launch` and `launch_ros`. Skipped where they are not installed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from bridge_harness import Domain

from fcsl_compiler.base.packages import package_share
from simclient.bag import Bag

pytest.importorskip("launch_ros", reason="launch_ros is not installed; CONTRIBUTING.md says how to have it")

HERE = Path(__file__).parent
SIL = HERE.parent / "launch" / "sil.launch.py"
GIVEN = ["machine:=lander/lander_control", "sim:=package://lander/sim/lander.sim.json"]
LANDER = package_share("lander") / "launch" / "lander.launch.py"
LAUNCH_TEST = HERE.parents[1] / "examples" / "lander" / "test" / "flight.launch.py"


@pytest.mark.parametrize(
    ("path", "given", "bags"),
    [
        (SIL, GIVEN, ["bag"]),
        (SIL, [*GIVEN, "vehicles:=one,two", "namespace:=fleet"], ["bag_one", "bag_two"]),
        (LANDER, [], ["bag"]),
    ],
)
def test_a_flight(domain: Domain, path: Path, given: list[str], bags: list[str]) -> None:
    arguments = [*given, f"record:={domain.folder / 'bag'}", "duration:=1.0", "timeout_s:=60.0"]
    process = domain.run([sys.executable, HERE / "run_launch_file.py", path, *arguments])
    assert process.finish() == 0, process.out + process.err
    for bag in bags:
        assert any(Bag(domain.folder / bag).messages())


def test_the_launch_test_of_the_lander(domain: Domain) -> None:
    pytest.importorskip("launch_testing", reason="launch_testing is not installed; CONTRIBUTING.md says how to have it")
    process = domain.run([sys.executable, "-m", "launch_testing.launch_test", LAUNCH_TEST])
    assert process.finish() == 0, process.out + process.err
    assert "Ran 1 test" in process.err and "Ran 2 tests" in process.err, process.err
