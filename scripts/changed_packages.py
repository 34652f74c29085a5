# SPDX-License-Identifier: Apache-2.0
"""`python3 scripts/changed_packages.py BASE`: the colcon packages whose tests a change touches, one a line.

A change is what differs from the commit that BASE and HEAD have in common, uncommitted and new files included. A file of a
package's tests touches that package; any other file of a package touches those that depend on it, too. A file that decides
what is installed or how everything is built touches all of them. Other files (pages, scripts, workspace tests) touch no
package: the workspace's tests always run.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
#: Of the workspace: they decide what every package is built and tested with.
EVERYTHING = {"constraints.txt", "colcon.meta", "conftest.py", "pyproject.toml"}
EVERYTHING_BELOW = (
    "scripts/setup",
    "scripts/build",
    "scripts/common",
    "scripts/ros",
    "scripts/test",
    "scripts/jobs",
    "scripts/colcon",
)
#: Examples that tests fly although their package does not depend on them: whoever builds the bridge gets no examples.
_TESTED_WITH = {"fcsl_bridge": {"ahrs", "lander"}}
_DEPENDS = ("depend", "build_depend", "build_export_depend", "exec_depend", "test_depend")


def manifests(root: Path) -> dict[str, PurePosixPath]:
    """Folder of each package, relative to `root`, by the package's name."""
    found = {}
    for pattern in ("*/package.xml", "fcsl_runtime/*/package.xml", "examples/*/package.xml"):
        for path in root.glob(pattern):
            name = ElementTree.parse(path).getroot().findtext("name")
            found[str(name)] = PurePosixPath(path.parent.relative_to(root))
    return found


def dependents(root: Path, packages: Mapping[str, PurePosixPath]) -> dict[str, set[str]]:
    """Of each package those that need it, however many stand between."""
    needs = {
        name: {
            str(e.text) for e in ElementTree.parse(root / folder / "package.xml").getroot().iter() if e.tag in _DEPENDS
        }
        | _TESTED_WITH.get(name, set())
        for name, folder in packages.items()
    }
    found: dict[str, set[str]] = {name: {name} for name in packages}
    while True:
        more = {name: others | {other for other in packages if needs[other] & others} for name, others in found.items()}
        if more == found:
            return found
        found = more


def touched(root: Path, files: Iterable[str]) -> list[str]:
    """The packages whose tests these files touch, sorted."""
    packages = manifests(root)
    above = dependents(root, packages)
    found: set[str] = set()
    for file in files:
        if file in EVERYTHING or file.startswith(EVERYTHING_BELOW):
            return sorted(packages)
        owner = next((n for n, folder in packages.items() if folder in PurePosixPath(file).parents), None)
        if owner is None or file.endswith(".md"):
            continue
        inside = PurePosixPath(file).relative_to(packages[owner])
        found |= {owner} if inside.parts[0] == "test" else above[owner]
    return sorted(found)


def changed_files(base: str) -> list[str]:
    def git(*arguments: str) -> list[str]:
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"fcsl: error: CHANGED={base}: {done.stderr.strip()}")
        return done.stdout.splitlines()

    [common] = git("merge-base", base, "HEAD")
    return [*git("diff", "--name-only", "--no-renames", common), *git("ls-files", "--others", "--exclude-standard")]


if __name__ == "__main__":
    print("\n".join(touched(ROOT, changed_files(sys.argv[1]))))
