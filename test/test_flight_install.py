# SPDX-License-Identifier: Apache-2.0
"""A flight computer needs little: `colcon build --packages-up-to fcsl_runtime` needs no Python package but the
compiler.
"""

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

from fcsl_compiler.base.packages import package_prefix

ROOT = Path(__file__).resolve().parents[1]
MANIFESTS = {
    ElementTree.parse(path).getroot().findtext("name"): path
    for folder in ("*", "fcsl_runtime/*")
    for path in ROOT.glob(f"{folder}/package.xml")
}


def needed(name: str) -> set[str]:
    """All build and run dependencies of a package, recursively."""
    tags = ("depend", "build_depend", "build_export_depend", "exec_depend", "buildtool_depend")
    own = {str(e.text) for e in ElementTree.parse(MANIFESTS[name]).getroot().iter() if e.tag in tags}
    return own.union(*(needed(other) for other in own if other in MANIFESTS))


def test_the_flight_packages_name_no_python_package() -> None:
    found = needed("fcsl_runtime")
    assert {"fcsl_compiler", "fcsl_hal"} <= found
    assert {name for name in found if name.startswith("python3")} == set()
    assert not {"simclient", "fcsl_sim", "fcsl_bridge", "fcsl_msgs"} & found


def test_a_machine_is_compiled_and_flies_without_any_python_package(tmp_path: Path) -> None:
    """Python runs with its standard library alone: -I -S, and fcslc finds its own package beside itself."""
    fcslc = package_prefix("fcsl_compiler") / "bin/fcslc"
    config = ROOT / "examples/minimal/minimal.json"
    prefixes = os.pathsep.join(str(package_prefix(p)) for p in ("fcsl_compiler", "fcsl_hal", "fcsl_runtime"))
    environment = {"PATH": os.environ["PATH"], "AMENT_PREFIX_PATH": prefixes, "HOME": str(tmp_path)}
    build = [sys.executable, "-I", "-S", str(fcslc), "build", str(config), "-o", str(tmp_path)]
    built = subprocess.run(build, capture_output=True, text=True, env=environment, check=False)
    assert built.returncode == 0, built.stderr
    fc = package_prefix("fcsl_runtime") / "bin/fcsl-fc"
    fly = [str(fc), str(tmp_path / "libminimal.so"), "--rate", "max", "--ticks", "10"]
    flown = subprocess.run(fly, capture_output=True, text=True, env=environment, check=False)
    assert flown.returncode == 0 and "10 ticks" in flown.stdout, flown.stderr
