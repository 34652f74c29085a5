# SPDX-License-Identifier: Apache-2.0
"""The rules of the workspace: packages, pins, paths, commands."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import pytest
from catkin_pkg.package import parse_package

ROOT = Path(__file__).parents[1]
PACKAGES = sorted(p.parent for g in ("*", "fcsl_runtime/*", "examples/*") for p in ROOT.glob(f"{g}/package.xml"))

#: Patterns of paths that exist only where the ROS wheels are installed, or only on one computer.
WHEEL_ONLY = re.compile(r"\.venv\b|site-packages|/opt/python|ros_wheels")
#: These files set up or explain the environment; fcslc finds its own package in colcon's install layout.
MAY_NAME_WHEELS = re.compile(
    r"^(scripts/|docs/|Makefile$|\.gitignore$|\.ci/|README\.md$|CONTRIBUTING\.md$|test/test_workspace\.py$"
    r"|fcsl_compiler/bin/fcslc?$)"
)
#: Keys that rosdep resolves to Debian packages on Ubuntu 24.04 with Jazzy, without pip. Before you add one, look it up with
#: `rosdep resolve --os=ubuntu:noble --rosdistro jazzy KEY`.
ROSDEP_KEYS = {
    *("cargo", "python3-hypothesis", "python3-matplotlib", "python3-numpy", "python3-pytest", "python3-scipy"),
    *(
        "python3-yaml",
        "ament_cmake",
        "ament_cmake_pytest",
        "ament_cmake_python",
        "builtin_interfaces",
        "diagnostic_msgs",
    ),
    *(
        "geometry_msgs",
        "launch",
        "launch_ros",
        "launch_testing_ament_cmake",
        "lifecycle_msgs",
        "nav_msgs",
        "rcl_interfaces",
        "rclpy",
        "ros2cli",
        "ros2launch",
    ),
    *(
        "rosgraph_msgs",
        "rosidl_default_generators",
        "rosidl_default_runtime",
        "sensor_msgs",
        "std_msgs",
        "std_srvs",
        "tf2_msgs",
    ),
}
PIN = re.compile(r"^\s*[A-Za-z0-9_.\[\]-]+\s*(==|~=|>=|<=|<|>)\s*\d", re.MULTILINE)


def tracked() -> list[str]:
    """Files of the repository: committed and untracked ones."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    return [name for name in listing if (ROOT / name).is_file()]


def text_of(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8", errors="replace")


def lines_with(pattern: re.Pattern[str], names: list[str]) -> list[str]:
    return [
        f"{name}:{number}: {line.strip()}"
        for name in names
        for number, line in enumerate(text_of(name).splitlines(), start=1)
        if pattern.search(line)
    ]


def test_no_wheel_only_path_outside_scripts() -> None:
    assert lines_with(WHEEL_ONLY, [name for name in tracked() if not MAY_NAME_WHEELS.match(name)]) == []


def test_no_path_of_one_machine() -> None:
    own = "test/test_workspace.py"
    pattern = re.compile(r"(^|[\s\"'=(:])/(work|root|home)/")
    assert lines_with(pattern, [name for name in tracked() if name != own]) == []


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda p: p.name)
def test_package_manifest(folder: Path) -> None:
    package = ElementTree.parse(folder / "package.xml").getroot()
    assert package.get("format") == "3"
    assert package.findtext("name") == folder.name
    assert package.findtext("license") == "Apache-2.0"
    assert package.findtext("description")
    warnings: list[str] = []
    parse_package(folder / "package.xml", warnings=warnings).validate(warnings)
    assert warnings == []
    build_type = package.findtext("export/build_type")
    assert build_type in ("ament_cmake", "ament_python")
    assert (folder / ("CMakeLists.txt" if build_type == "ament_cmake" else "setup.py")).is_file()


def test_one_version() -> None:
    assert len({ElementTree.parse(p / "package.xml").getroot().findtext("version") for p in PACKAGES}) == 1


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda p: p.name)
def test_rosdep_resolves_every_key(folder: Path) -> None:
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    keys = {element.text for element in manifest.iter() if element.tag.endswith("depend")}
    assert keys <= ROSDEP_KEYS | {package.name for package in PACKAGES}


def test_packages_depend_only_on_what_stands_above_them() -> None:
    order = ["fcsl_compiler", "fcsl_hal", "fcsl_runtime", "simclient", "fcsl_sim", "fcsl_bridge"]
    for folder in PACKAGES:
        manifest = ElementTree.parse(folder / "package.xml").getroot()
        needed = {e.text for e in manifest.iter() if e.tag in ("depend", "build_depend", "exec_depend")}
        if folder.name in order:
            allowed = {*order[: order.index(folder.name)], "fcsl_msgs" if folder.name == "fcsl_bridge" else ""}
            assert {n for n in needed if n and n.startswith(("fcsl_", "simclient"))} <= allowed, folder.name
        if folder.name == "fcsl_msgs":
            assert not any(n and n.startswith("fcsl_") for n in needed)


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda p: p.name)
def test_what_tests_import_is_declared(folder: Path) -> None:
    """Those imports that have a rosdep key; the others (mpmath, mcap, rerun-sdk) are in pyproject.toml only."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in folder.glob("test/*.py"))
    imported = set(re.findall(r"^\s*(?:import|from) (numpy|scipy|hypothesis|matplotlib|yaml)\b", text, re.MULTILINE))
    manifest = ElementTree.parse(folder / "package.xml").getroot()
    declared = {e.text for e in manifest.iter() if e.tag in ("depend", "exec_depend", "test_depend")}
    assert {f"python3-{name}" for name in imported} <= declared


def named_packages() -> set[str]:
    """Those of all groups of pyproject.toml, as written there."""
    groups = tomllib.loads(text_of("pyproject.toml"))["dependency-groups"]
    return {name for group in groups.values() for name in group if isinstance(name, str)}


def test_python_versions_are_pinned_in_one_place() -> None:
    names = [n for n in tracked() if re.search(r"requirements.*\.txt$|setup\.(py|cfg)$", n)]
    assert lines_with(PIN, names) == []
    assert [name for name in named_packages() if not re.fullmatch(r"[A-Za-z0-9-]+", name)] == []
    assert (
        lines_with(
            re.compile(r"pip install.*(==|[<>]\d)"),
            [n for n in tracked() if n.startswith(("scripts/", "Makefile", ".ci/"))],
        )
        == []
    )


def test_every_direct_requirement_is_pinned_exactly() -> None:
    lines = [line for line in text_of("constraints.txt").splitlines() if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[a-z0-9.-]+==[0-9][^\s=]*", line) for line in lines)
    pinned = {line.split("==")[0] for line in lines}
    assert len(pinned) == len(lines), "a package is pinned twice"
    assert {name.lower() for name in named_packages()} | {"uv"} <= pinned


def test_pytest_starts_beside_the_plugins_of_jazzy(tmp_path: Path) -> None:
    """launch_testing's hook takes `path`. pytest 9 does not have it, and refuses to start where the plugin is installed."""
    hook = "def pytest_pycollect_makemodule(path, parent):\n    return None\n"
    (tmp_path / "jazzy_hook.py").write_text(hook)
    (tmp_path / "test_empty.py").write_text("def test_empty():\n    pass\n")
    command = [sys.executable, "-m", "pytest", "-p", "jazzy_hook", "-p", "no:cacheprovider", "test_empty.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_rust_crates_are_locked() -> None:
    manifests = [name for name in tracked() if name.endswith("Cargo.toml")]
    assert manifests
    for name in manifests:
        assert 'rust-version = "' in text_of(name)
        if re.search(r"^\[dependencies", text_of(name), re.MULTILINE):
            assert f"{name[:-5]}.lock" in tracked(), f"{name} has no committed Cargo.lock"


def test_header_names_are_unique() -> None:
    """`#include "x.h"` includes the first x.h on the path, and the fuzzers' path has most folders."""
    headers: dict[str, list[str]] = {}
    for name in tracked():
        if name.endswith(".h"):
            headers.setdefault(Path(name).name, []).append(name)
    assert headers
    assert {name: files for name, files in headers.items() if len(files) > 1} == {}


def test_c_sources_open_with_what_they_own() -> None:
    sources = [n for n in tracked() if re.match(r"fcsl_.*\.c$", n) and "/test/" not in n]
    assert len(sources) > 80
    opening = "/* SPDX-License-Identifier: Apache-2.0\n *\n * "
    assert [name for name in sources if not text_of(name).startswith(opening)] == []


def test_colcon_meta_names_real_packages() -> None:
    assert set(json.loads(text_of("colcon.meta"))["names"]) <= {p.name for p in PACKAGES}


def test_make_help_lists_every_target() -> None:
    phony = re.search(r"^\.PHONY: (.*)$", text_of("Makefile"), re.MULTILINE)
    assert phony
    printed = subprocess.run(["make", "-s", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {line.split()[1] for line in printed.splitlines()} == set(phony.group(1).split())


def links(name: str) -> list[tuple[str, str]]:
    """Files that a Markdown page links to, and the headings in them; "" for the page itself, or for no heading."""
    prose = re.sub(r"```.*?```|`[^`\n]*`", "", text_of(name), flags=re.DOTALL)
    return re.findall(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)", prose)


def anchors(page: Path) -> set[str]:
    """Anchors of the page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_links_between_pages_lead_somewhere() -> None:
    wrong = []
    for name in (n for n in tracked() if n.endswith(".md")):
        for target, heading in links(name):
            page = (ROOT / name).parent / target if target else ROOT / name
            if not page.exists() or (heading and heading not in anchors(page)):
                wrong.append(f"{name}: {target}#{heading}")
    assert wrong == []


def test_prose_in_pages_is_at_most_120_columns_wide() -> None:
    """Except code, tables, and CHANGELOG.md, which is mainly searched."""
    wide = []
    for name in (n for n in tracked() if n.endswith(".md") and n != "CHANGELOG.md"):
        code = False
        for number, line in enumerate(text_of(name).splitlines(), start=1):
            code ^= line.lstrip().startswith("```")
            if len(line) > 120 and not code and not line.startswith("|"):
                wide.append(f"{name}:{number}")
    assert wide == []


def test_the_readme_names_every_page() -> None:
    linked = {target for target, _ in links("README.md")}
    assert {name for name in tracked() if re.fullmatch(r"docs/(?!decisions/).+\.md", name)} <= linked


def test_files_that_the_architecture_names_exist() -> None:
    prose = re.sub(r"```.*?```", "", text_of("docs/architecture.md"), flags=re.DOTALL)
    named = set(re.findall(r"`([\w/.*-]+\.(?:py|c|h|rs|json|txt|sh|md|msg))`", prose))
    files = [PurePosixPath(name) for name in tracked()]
    assert len(named) > 100
    assert {name for name in named if not any(file.match(name) for file in files)} == set()


def test_env_is_safe_under_strict_shells() -> None:
    script = "set -euo pipefail; . scripts/env.sh; case $- in *e*u*) ;; *) exit 3;; esac; command -v fcslc fcsl-sim; set -o | grep pipefail"
    result = subprocess.run(["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "on" in result.stdout.splitlines()[-1]


def test_only_what_is_installed_rebuilds_the_environment(tmp_path: Path) -> None:
    """A comment or a setting of a tool changes nothing of what `make setup` compares; a package or a pin does."""

    def requirements(file: str = "", old: str = "", new: str = "") -> str:
        for name in ("pyproject.toml", "constraints.txt"):
            text = text_of(name)
            assert name != file or old in text
            (tmp_path / name).write_text(text.replace(old, new, 1) if name == file else text)
        script = f". {ROOT}/scripts/common.sh && requirements {sys.executable}"
        done = subprocess.run(["bash", "-ec", script], cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout

    today = requirements()
    assert requirements("pyproject.toml", "# building\n", "# what builds\n") == today
    assert requirements("pyproject.toml", "line-length = 120", "line-length = 100") == today
    assert requirements("constraints.txt", "# Every", "# All and every") == today
    assert requirements("pyproject.toml", '    "ninja",\n', "") != today
    assert requirements("constraints.txt", "anyio==", "anyio==1.") != today
