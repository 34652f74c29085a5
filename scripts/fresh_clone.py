# SPDX-License-Identifier: Apache-2.0
"""This workspace as a user gets it: the tracked files in a folder of their own, and an environment that knows nothing of here."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from jobs import ROOT

#: What scripts/env.sh and other environments of colcon set.
_OF_WORKSPACES = (
    *("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_DEFAULTS_FILE", "COLCON_PREFIX_PATH", "LD_LIBRARY_PATH"),
    *("PYTHONDONTWRITEBYTECODE", "PYTHONPATH", "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"),
)


def copy_tracked(folder: Path) -> None:
    """The tracked files as they are here, uncommitted changes included."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)


def outside() -> dict[str, str]:
    """The environment of this process without this workspace."""
    path = [p for p in os.environ["PATH"].split(os.pathsep) if ROOT not in (Path(p), *Path(p).parents)]
    kept = {name: value for name, value in os.environ.items() if name not in _OF_WORKSPACES}
    return kept | {"PATH": os.pathsep.join(path)}
