# SPDX-License-Identifier: Apache-2.0
"""Attributes of sysfs and configfs."""

from __future__ import annotations

from pathlib import Path

CONFIGFS = Path("/sys/kernel/config")


def put(attribute: Path, value: object) -> None:
    """Writes it in one go; what the kernel refuses is an OSError."""
    with attribute.open("wb", buffering=0) as file:
        file.write(f"{value}\n".encode())


def get(attribute: Path) -> str:
    return attribute.read_text().strip()


def find(folder: Path, attribute: str, value: str) -> Path:
    """The folder below `folder` whose attribute has this value. Raises LookupError."""
    for device in sorted(folder.iterdir()):
        if (device / attribute).is_file() and get(device / attribute) == value:
            return device
    raise LookupError(f"{folder}: nothing has {attribute} {value}")
