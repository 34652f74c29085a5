# SPDX-License-Identifier: Apache-2.0
"""How long a newcomer waits: `make demo` in a fresh clone with empty caches; and a builder of a ROS 2 package, after an edit.

python3 scripts/bench set_up
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fresh_clone import copy_tracked, outside

from ..harness.size import sized

#: What says where caches are; the fresh home has none. rustup's toolchains stay: they are a system package's concern.
CACHES = ("CARGO_HOME", "FCSL_CACHE_DIR", "PIP_CACHE_DIR", "UV_CACHE_DIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME")
INSTANCES = tuple(f"stage_{number}" for number in range(sized(9, 2)))
_ALGORITHM = '''class Stage:
    """One of nine instances."""

    inputs = {"velocity": "f64[3] m/s"}
    outputs = {"speed": "f64[3] m/s", "count": "u32"OUTPUT}
    parameters = {"gain": "f64"}

    def execute(self):
        self.speed = self.velocity * self.gain
        self.count = self.count + 1
'''
_CMAKE = """cmake_minimum_required(VERSION 3.22)
project(rover C)
find_package(ament_cmake REQUIRED)
find_package(fcsl_compiler REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)
fcsl_add_machine(rover_machines rover.json)
fcsl_generate_interfaces()
ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""
_MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>rover</name>
  <version>0.1.0</version>
  <description>Nine instances, each with a message.</description>
  <maintainer email="maintainers@fcsl.invalid">FCSL maintainers</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>fcsl_compiler</depend>
  <depend>std_msgs</depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""


def set_up_times(folder: Path) -> dict[str, float]:
    """Seconds. Of the first demo, which a smallest run leaves out, also those of all processors."""
    return sized(first_demo, lambda _: {})(folder) | edit_times(folder / "workspace")


def first_demo(folder: Path) -> dict[str, float]:
    """`make demo` in a copy of the tracked files, with a home of its own."""
    clone, home = folder / "clone", folder / "home"
    home.mkdir()
    copy_tracked(clone)
    environment = {name: value for name, value in outside().items() if name not in CACHES} | {
        "HOME": str(home),
        "RUSTUP_HOME": os.environ.get("RUSTUP_HOME", str(Path.home() / ".rustup")),
    }
    seconds, processors = timed(["make", "demo"], clone, environment)
    return {"demo_s": seconds, "demo_processor_s": processors}


def edit_times(workspace: Path) -> dict[str, float]:
    """`colcon build` of a package with nine messages: all of it, after an output more, after another parameter."""
    package = workspace / "src" / "rover"
    package.mkdir(parents=True)
    (package / "CMakeLists.txt").write_text(_CMAKE)
    (package / "package.xml").write_text(_MANIFEST)
    for name in INSTANCES:
        (package / f"{name}.py").write_text(_ALGORITHM.replace("OUTPUT", ""))
    write_machine(package, 1.0)
    environment = {n: v for n, v in os.environ.items() if n != "COLCON_DEFAULTS_FILE"}
    times = {"rover_first_s": timed(["colcon", "build"], workspace, environment)[0]}
    (package / f"{INSTANCES[-1]}.py").write_text(_ALGORITHM.replace("OUTPUT", ', "armed": "bool"'))
    times["rover_output_s"] = timed(["colcon", "build"], workspace, environment)[0]
    write_machine(package, 2.0)
    times["rover_parameter_s"] = timed(["colcon", "build"], workspace, environment)[0]
    return times


def write_machine(package: Path, gain: float) -> None:
    machine = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {f"Stage{n}": {"source": f"{n}.py", "class": "Stage"} for n in INSTANCES},
        "instances": {n: {"algorithm": f"Stage{n}", "parameters": {"gain": gain}} for n in INSTANCES},
        "connections": [
            {"from": f"{before}.speed", "to": f"{name}.velocity"}
            for before, name in zip(INSTANCES, INSTANCES[1:], strict=False)
        ],
        "states": {"RUN": {"schedule": dict.fromkeys(INSTANCES, 100)}},
    }
    (package / "rover.json").write_text(json.dumps(machine, indent=2))


def timed(line: list[str], folder: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Seconds of a command, and those of the processors in it. Raises RuntimeError with what it printed if it fails."""
    begun, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        line, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise RuntimeError(f"`{' '.join(line)}` failed:\n{done.stdout[-4000:]}")
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.monotonic() - begun, used


def set_up_rows(times: dict[str, float]) -> list[tuple[str, str]]:
    rows = []
    if "demo_s" in times:
        rows = [
            ("make demo in a fresh clone, empty caches", f"{times['demo_s']:.0f} s (goal 240)"),
            ("    of all processors", f"{times['demo_processor_s']:.0f} s (goal 420)"),
        ]
    return [
        *rows,
        ("colcon build of a package with nine messages", f"{times['rover_first_s']:.1f} s"),
        ("    after one output more", f"{times['rover_output_s']:.1f} s (goal 20)"),
        ("    after another parameter", f"{times['rover_parameter_s']:.1f} s (goal 5)"),
    ]


def main() -> int:
    with tempfile.TemporaryDirectory(prefix="fcsl-") as folder:
        for title, figure in set_up_rows(set_up_times(Path(folder))):
            print(f"{title:60} {figure}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
