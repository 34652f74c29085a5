# SPDX-License-Identifier: Apache-2.0
"""`make test CHANGED=…`: which packages' tests a change touches."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
from changed_packages import manifests, touched  # noqa: E402

ALL = sorted(manifests(ROOT))
EXAMPLES = [
    "ahrs", "arming", "check_cases", "glider", "inverted_pendulum", "lander", "minimal", "models", "quadrotor",
    "rocket_landing", "rover", "satellite", "thermal_guard",
]  # fmt: skip


@pytest.mark.parametrize(
    ("files", "packages"),
    [
        ([], []),
        (
            [
                "README.md",
                "docs/hardware/flight_computer.md",
                "scripts/demo.py",
                "test/test_layers.py",
                "fcsl_sim/README.md",
            ],
            [],
        ),
        (["fcsl_compiler/test/test_tick.py"], ["fcsl_compiler"]),
        (["fcsl_bridge/fcsl_bridge/topics/qos.py"], ["fcsl_bridge"]),
        (["fcsl_runtime/simclient/test/test_fc.py"], ["simclient"]),
        (
            ["fcsl_runtime/simclient/simclient/run.py"],
            sorted(["simclient", "fcsl_blocks", "fcsl_sim", "fcsl_bridge", *EXAMPLES]),
        ),
        (["examples/lander/sim/lander.sim.json"], ["fcsl_bridge", "lander"]),
        (["fcsl_msgs/msg/Checkpoint.msg", "fcsl_hal/test/test_codec.c"], ["fcsl_bridge", "fcsl_hal", "fcsl_msgs"]),
        (["constraints.txt"], ALL),
        (["scripts/build.sh"], ALL),
        (["scripts/jobs.py"], ALL),
    ],
)
def test_what_a_change_touches(files: list[str], packages: list[str]) -> None:
    assert touched(ROOT, files) == packages


def test_the_compiler_touches_everything_but_the_messages() -> None:
    assert set(ALL) - set(touched(ROOT, ["fcsl_compiler/fcsl_compiler/emit/tick.py"])) <= {"fcsl_msgs"}
