# SPDX-License-Identifier: Apache-2.0
"""Folders of sysfs and their attributes. FCSL_SYSFS and FCSL_DEV replace /sys and /dev, as they do for the drivers."""

from __future__ import annotations

import os
import re
from pathlib import Path

_TEXT_BYTES = 4096


def sysfs_root() -> Path:
    return Path(os.environ.get("FCSL_SYSFS") or "/sys")


def dev_root() -> Path:
    return Path(os.environ.get("FCSL_DEV") or "/dev")


def folders(place: str, prefix: str = "") -> list[Path]:
    """The folders at a place of sysfs whose names begin so, numbers in their order. Empty without the place."""
    try:
        found = [path for path in (sysfs_root() / place).iterdir() if path.name.startswith(prefix)]
    except OSError:
        return []
    return sorted(
        found, key=lambda path: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]
    )


def attribute(folder: Path, name: str) -> str:
    """The text of an attribute, without what would control a terminal; "" without one, or where it cannot be read."""
    try:
        with open(folder / name, "rb", opener=lambda path, flags: os.open(path, flags | os.O_NONBLOCK)) as file:
            text = file.read(_TEXT_BYTES).decode(errors="replace").strip().strip("\0")
    except OSError:
        return ""
    return "".join(char if char.isprintable() else "\ufffd" for char in text)


def names_in(folder: Path) -> set[str]:
    try:
        return {path.name for path in folder.iterdir()}
    except OSError:
        return set()


def link_name(link: Path) -> str:
    """The name of what a link leads to; "" without a link."""
    try:
        return link.readlink().name
    except OSError:
        return ""
