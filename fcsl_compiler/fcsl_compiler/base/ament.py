# SPDX-License-Identifier: Apache-2.0
"""Finds installed packages by the ament index, without importing ROS."""

from __future__ import annotations

import os
from pathlib import Path


class PackageNotFound(LookupError):
    """No prefix in AMENT_PREFIX_PATH contains the package. str() gives the remedy."""


def package_prefix(name: str) -> Path:
    """Install prefix of ROS package `name`. Raises PackageNotFound."""
    for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if entry and os.path.isfile(f"{entry}/share/ament_index/resource_index/packages/{name}"):
            return Path(entry)
    raise PackageNotFound(f"package `{name}` is not installed in this environment; source install/setup.bash")


def package_share(name: str) -> Path:
    """<prefix>/share/<name>. Raises PackageNotFound."""
    return package_prefix(name) / "share" / name
