# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, in any format: those that metadata.yaml lists, or else those in its directory."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from ..errors import BagError

#: Suffixes of storage files: MCAP, sqlite3, ROS 1.
STORAGE = (".mcap", ".db3", ".bag")
#: Second suffixes of files that are compressed as a whole.
ZSTD = ".zstd"
#: That of a ROS 1 bag that was not closed.
_ACTIVE = ".active"
#: Most bytes of a metadata.yaml that are read. Recorders write some KB; parsing takes seconds per MB.
_MAX_METADATA_BYTES = 1 << 20
_DIGITS = re.compile(r"(\d+)")


class _Metadata(yaml.CSafeLoader):
    """libyaml's loader, ten times as fast as that in Python. Rejects `<<`, by which a few lines expand to gigabytes.

    Aliases alone are harmless as long as nothing prints them.
    """

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        pass


def metadata_of(path: Path) -> Mapping[str, Any]:
    """The content of metadata.yaml; empty if it is missing (a recording that was cut off) or invalid."""
    try:
        with (path / "metadata.yaml").open("rb") as file:
            text = file.read(_MAX_METADATA_BYTES + 1)
        if len(text) > _MAX_METADATA_BYTES:
            return {}
        found = yaml.load(text, _Metadata)["rosbag2_bagfile_information"]  # noqa: S506  a SafeLoader
    except Exception:  # noqa: BLE001  text made to do harm can make yaml raise anything, RecursionError for one
        return {}
    return found if isinstance(found, dict) else {}


def bag_files(path: Path) -> list[Path]:
    """The storage files of the bag at `path`, in order; `path` itself if it is a file. Raises BagError."""
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BagError(f"{path}: no such bag")
    files = _listed(path) or sorted((f for f in path.iterdir() if _is_storage(f.name)), key=_natural)
    if not files:
        raise BagError(f"{path}: not a bag (no {', '.join(STORAGE)} file in it)")
    for file in files:
        if not file.is_file():
            raise BagError(f"{file}: missing, though {path / 'metadata.yaml'} lists it")
    return files


def mcap_files(folder: Path) -> list[Path]:
    """The MCAP files in a directory, in order, whatever its metadata.yaml says. Raises BagError if there is none."""
    if not folder.is_dir():
        raise BagError(f"{folder}: no such bag")
    files = sorted((f for f in folder.iterdir() if f.suffix == ".mcap"), key=_natural)
    if not files:
        raise BagError(f"{folder}: no .mcap file in it; bags of other formats are mended by `ros2 bag reindex`")
    return files


def storage_suffix(file: Path) -> str:
    """`.mcap`, `.db3` or `.bag`, wherever it is in the name."""
    return Path(file.name.removesuffix(ZSTD).removesuffix(_ACTIVE)).suffix


def _listed(path: Path) -> list[Path]:
    names = metadata_of(path).get("relative_file_paths")
    if not isinstance(names, list):
        return []
    # Older recorders also wrote the directory.
    return [path / Path(name).name for name in names if isinstance(name, str) and _is_storage(name)]


def _is_storage(name: str) -> bool:
    return storage_suffix(Path(name)) in STORAGE


def _natural(file: Path) -> list[tuple[int, str]]:
    """Sort key that orders run_10 after run_9."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in _DIGITS.split(file.name)]
