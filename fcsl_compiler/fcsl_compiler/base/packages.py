# SPDX-License-Identifier: Apache-2.0
"""Finds installed packages without importing ROS: by the ament index, and by entry points of Python distributions."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

#: An entry point of this group is a package that a Python distribution brings: its name, and the importable package
#: whose folder is its prefix.
ENTRY_POINTS = "fcsl.packages"
_INDEX = "share/ament_index/resource_index/packages"


class PackageNotFound(LookupError):
    """Neither AMENT_PREFIX_PATH nor a Python distribution has the package. str() gives the remedy."""


class Package(NamedTuple):
    """An installed package: its prefix, and the folder of its own files."""

    name: str
    prefix: Path
    share: Path


def package_prefix(name: str) -> Path:
    """Install prefix of package `name`. Raises PackageNotFound."""
    return _package(name).prefix


def package_share(name: str) -> Path:
    """The folder of the package's files: <prefix>/share/<name>; a Python distribution may have them in its prefix
    itself. Raises PackageNotFound."""
    return _package(name).share


def installed_packages() -> Iterator[Package]:
    """All packages; one that is found first hides others of its name. Raises PackageNotFound for an incomplete one."""
    seen: set[str] = set()
    for prefix in _prefixes():
        index = Path(prefix, _INDEX)
        for name in sorted(p.name for p in index.iterdir()) if index.is_dir() else []:
            if name not in seen:
                seen.add(name)
                yield _built(name, prefix)
    for name, module in sorted(_registered(tuple(sys.path)).items()):
        if name not in seen:
            yield _distributed(name, module)


def _package(name: str) -> Package:
    if name.isidentifier():  # else it may be a path, for which no file is looked at
        for prefix in _prefixes():
            if os.path.isfile(f"{prefix}/{_INDEX}/{name}"):
                return _built(name, prefix)
        if module := _registered(tuple(sys.path)).get(name):
            return _distributed(name, module)
    raise PackageNotFound(f"package `{name}` is not installed in this environment; source install/setup.bash")


def _prefixes() -> list[str]:
    return [entry for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]


def _built(name: str, prefix: str) -> Package:
    """A package that colcon has built."""
    return Package(name, Path(prefix), Path(prefix, "share", name))


def _distributed(name: str, module: str) -> Package:
    """A package whose prefix is the folder of an importable package."""
    from importlib.util import find_spec

    try:
        spec = find_spec(module)
    except ImportError:
        spec = None
    if spec is None or not spec.submodule_search_locations:
        why = f"its entry point of group {ENTRY_POINTS} names `{module}`, which is no importable package"
        raise PackageNotFound(f"package `{name}` is installed incompletely: {why}; install it again")
    prefix = Path(spec.submodule_search_locations[0])
    share = prefix / "share" / name
    return Package(name, prefix, share if share.is_dir() else prefix)


@cache
def _registered(path: tuple[str, ...]) -> dict[str, str]:
    """Package to importable package, of the distributions on `path`, which is sys.path; an earlier one hides a later
    one."""
    from importlib.metadata import entry_points  # here, because it takes 20 ms, and with ROS nobody asks

    return {point.name: point.module for point in reversed(tuple(entry_points(group=ENTRY_POINTS)))}
