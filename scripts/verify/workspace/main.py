# SPDX-License-Identifier: Apache-2.0
"""FCSL in a user's own colcon workspace: plain `colcon build`, without this workspace's scripts and settings.

A copy of the tracked files lies under src/fcsl, beside a package that `fcsl new machine my_robot --package` wrote. The build
takes the packages that docs/guide/ros2.md names, writes nothing to standard error, which colcon would report as if something
were wrong, and takes no example; then the package's tests pass. Only the tools and ROS 2 come from this workspace.

A flight computer's packages, built without Zenoh in a second workspace, compile none of its crates; fcsl-fc flies there, and says
why it opens no session of the bus.

The control: a package that prints to standard error is noticed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from fresh_clone import copy_tracked, outside

from fcsl_compiler.base.packages import package_prefix

from ..shared.cases import ROOT, CheckFailed, write_facts

#: What may be built for fcsl_bridge and a user's package.
WANTED = {"fcsl_compiler", "fcsl_hal", "fcsl_runtime", "simclient", "fcsl_sim", "fcsl_msgs", "fcsl_bridge", "my_robot"}
_LIMIT_S = 3000.0


def in_shell(workspace: Path, line: str) -> str:
    """Runs a line of bash in the workspace, on the underlay alone. Raises CheckFailed unless it ends with 0."""
    script = f". {ROOT}/scripts/underlay.sh; unset COLCON_DEFAULTS_FILE; {line}"
    done = subprocess.run(
        ["bash", "-c", script], cwd=workspace, env=outside(), capture_output=True, text=True, timeout=_LIMIT_S
    )
    if done.returncode != 0:
        raise CheckFailed(f"`{line}`: exit status {done.returncode}\n{done.stdout[-4000:]}{done.stderr[-4000:]}")
    return done.stdout


def complaints(workspace: Path) -> list[str]:
    """What the packages of the last build wrote to standard error."""
    logs = sorted((workspace / "log/latest_build").glob("*/stderr.log"))
    return [f"{log.parent.name}: {log.read_text(errors='replace')}" for log in logs if log.stat().st_size]


def check_without_zenoh(workspace: Path, sources: Path) -> None:
    shutil.rmtree(workspace, ignore_errors=True)
    print("workspace: building without Zenoh", flush=True)
    options = "-DFCSL_ZENOH=OFF -DBUILD_TESTING=OFF --no-warn-unused-cli"
    workspace.mkdir()
    in_shell(workspace, f"colcon build --base-paths {sources} --packages-up-to fcsl_runtime --cmake-args {options}")
    if crates := list((workspace / "build/fcsl_hal/cargo").rglob("*zenoh*")):
        raise CheckFailed(f"without Zenoh, cargo made {crates[0]}")
    fly = f"install/fcsl_runtime/bin/fcsl-fc {package_prefix('lander')}/lib/lander/liblander_machines.so --machine lander_control"
    in_shell(workspace, f"{fly} --rate max --ticks 10")
    refused = in_shell(workspace, f"{fly} --hal zenoh:tcp:127.0.0.1:7447 2>&1 || true")
    if "built without the bus" not in refused:
        raise CheckFailed(f"without Zenoh, fcsl-fc says of an address of the bus: {refused}")


def check(workspace: Path) -> list[str]:
    shutil.rmtree(workspace, ignore_errors=True)
    copy_tracked(workspace / "src/fcsl")
    in_shell(workspace, f". {ROOT}/scripts/env.sh; cd src && fcsl new machine my_robot --package")
    print("workspace: building", flush=True)
    in_shell(workspace, "colcon build --packages-up-to fcsl_bridge my_robot")
    built = {path.name for path in (workspace / "install").iterdir() if path.is_dir()}
    if built != WANTED:
        raise CheckFailed(f"built {sorted(built - WANTED)} without need, not {sorted(WANTED - built)}")
    if said := complaints(workspace):
        raise CheckFailed("packages wrote to standard error:\n" + "\n".join(said))
    in_shell(workspace, ". install/local_setup.bash; python3 -m pytest -q src/my_robot/test")
    check_without_zenoh(workspace.with_name("verify_workspace_without_zenoh"), workspace / "src/fcsl")
    cmake = workspace / "src/my_robot/CMakeLists.txt"
    cmake.write_text(cmake.read_text() + 'message(WARNING "control")\n')
    in_shell(workspace, "colcon build --packages-select my_robot")
    if not complaints(workspace):
        raise CheckFailed("control: a package that warns was not noticed")
    return sorted(built)


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    try:
        built = check(ROOT / "build/verify_workspace")  # colcon ignores the folder build
    except CheckFailed as error:
        print(f"workspace: {error}", file=sys.stderr)
        return 1
    write_facts("workspace", {"packages": built})
    print(
        f"workspace: {len(built)} packages, nothing on standard error, the package's tests pass; the control is noticed"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
