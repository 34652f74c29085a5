# SPDX-License-Identifier: Apache-2.0
"""Definitions of custom messages for sqlite3 bags that have none."""

from __future__ import annotations

import sqlite3
import struct
import subprocess
from pathlib import Path

import pytest
from foreign_bags import number, write

from simclient import BagError
from simclient.bag.formats import open_bag

START = 100 * 10**9


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """One message of custom_msgs/msg/Drive, whose bag says nothing of its fields."""
    path = write(tmp_path / "bag", {"/drive": [(START, number(1.0))]}, "sqlite3")
    data = struct.pack("<4siId", b"\0\1\0\0", 7, 3, 2.5)
    with sqlite3.connect(next(path.glob("*.db3"))) as database:
        database.execute("UPDATE topics SET type = 'custom_msgs/msg/Drive'")
        database.execute("DELETE FROM message_definitions")
        database.execute("UPDATE messages SET data = ?", (data,))
    database.close()
    return path


def package(folder: Path, drive: str = "builtin_interfaces/Time stamp\nSpeed speed\n") -> Path:
    (folder / "custom_msgs/msg").mkdir(parents=True)
    (folder / "custom_msgs/msg/Drive.msg").write_text(drive)
    (folder / "custom_msgs/msg/Speed.msg").write_text("float64 value  # m/s\n")
    return folder


def check(bag: Path, *folders: Path) -> list[str]:
    opened = open_bag(bag, folders)
    ((topic, _, data),) = opened.messages()
    message = opened.decode(topic, data)
    assert (message.stamp.sec, message.stamp.nanosec, message.speed.value) == (7, 3, 2.5)
    return opened.notes


def test_from_a_folder(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="missing schema"):
        check(bag)
    folder = package(tmp_path / "src")
    file = folder / "custom_msgs/msg/Drive.msg"
    note = f"the bag does not define its types; those of {file} are taken for custom_msgs/msg/Drive"
    assert check(bag, folder) == [note]
    assert check(bag, folder / "custom_msgs") == [note]
    command = ["fcsl", "bag", "export", str(bag), "-o", str(tmp_path / "a.csv")]
    done = subprocess.run([*command, "--msg-path", str(folder)], capture_output=True, text=True)
    assert done.returncode == 0 and "speed.value" in (tmp_path / "a.csv").read_text(), done.stderr


def test_from_an_installed_package(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(tmp_path / "install/share")
    index = tmp_path / "install/share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    (index / "custom_msgs").touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"), prepend=":")
    assert len(check(bag)) == 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("Nowhere x\n", "uses custom_msgs/msg/Nowhere, whose definition is neither"),
        ("float64\n", "not a valid definition of custom_msgs/msg/Drive"),
    ],
)
def test_wrong_definitions(bag: Path, text: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(BagError, match=reason):
        check(bag, package(tmp_path / "src", text))
    with pytest.raises(BagError, match="no such directory; --msg-path names"):
        check(bag, tmp_path / "none")
