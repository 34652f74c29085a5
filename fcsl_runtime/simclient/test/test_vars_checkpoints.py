# SPDX-License-Identifier: Apache-2.0
"""Checkpoints over the socket: the bytes of a file (docs/guide/recording.md), to the client and back or in a folder of the server's."""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from native import FIXTURE, Client, flying
from vars_machine import HOLD, build

_HEAD = struct.Struct("<8sIIQQQIIII")
_AT_SOURCE = 56


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> str:
    return build(tmp_path_factory.mktemp("shapes"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("checkpoints")


@pytest.fixture(scope="module")
def client(library: str, folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A client of a paused flight program, shared."""
    path = tmp_path_factory.mktemp("socket") / "fc.sock"
    with flying("--socket", path, "--paused", "--checkpoints", folder, library=library) as fc:
        opened = fc.client(path)
        yield opened
        opened.close()
        assert fc.stop()[0] == 0


def saved(client: Client) -> bytes:
    reply = client.ok("save")
    data = base64.b64decode(reply["data"], validate=True)
    while len(data) < reply["bytes"]:
        data += base64.b64decode(client.ok("saved", at=len(data))["data"], validate=True)
    assert len(data) == reply["bytes"]
    return data


def text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def with_crc(data: bytes) -> bytes:
    return data[:-4] + struct.pack("<I", zlib.crc32(data[:-4]))


def test_what_is_saved_is_a_file_that_continues(client: Client, library: str, tmp_path: Path) -> None:
    """The same bits as without the stop; and the flight program begins with the bytes as its file."""
    client.set("hold.state.p[0]", [1.5, -0.0, 2.0, 3.0, 4.0])
    client.ok("tick", count=7)
    data = saved(client)
    magic, version, _, size, tick, hz, *_ = _HEAD.unpack_from(data)
    assert (magic, version, size, tick, hz) == (b"FCSLCKPT", 2, len(data), client.get("machine.tick"), 1000)
    assert data == with_crc(data)
    before = client.get("hold")
    client.ok("tick", count=20)
    after = saved(client)
    assert client.ok("restore", data=text(data))["tick"] == tick and client.get("hold") == before
    assert saved(client) == data
    client.ok("tick", count=20)
    assert saved(client) == after
    (tmp_path / "c").write_bytes(data)
    path = tmp_path / "s"
    with flying("--restore", tmp_path / "c", "--socket", path, "--paused", library=library) as fc:
        other = fc.client(path)
        other.ok("tick", count=20)
        assert saved(other) == after
        other.close()


def test_named_files(client: Client, folder: Path) -> None:
    reply = client.ok("save", file="before_burn.fcsl")
    data = (folder / "before_burn.fcsl").read_bytes()
    assert data == saved(client) and reply["bytes"] == len(data) and "data" not in reply
    tick = reply["tick"]
    client.ok("tick", count=3)
    assert client.ok("restore", file="before_burn.fcsl")["tick"] == tick and saved(client) == data
    client.ok("tick", count=3)
    client.ok("save", file="before_burn.fcsl")
    assert (folder / "before_burn.fcsl").read_bytes() == saved(client) != data
    assert os.listdir(folder) == ["before_burn.fcsl"]


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".",
        "..",
        "../up",
        "a/b",
        "/tmp/x",
        ".hidden",
        "-x",
        "x.tmp",
        "a b",
        "a\\b",
        "a\nb",
        "é",
        "x" * 128,
        "x" * 5000,
    ],
)
def test_nothing_leaves_the_folder(client: Client, folder: Path, name: str) -> None:
    before = sorted(folder.parent.rglob("*"))
    for command in ("save", "restore"):
        assert client.error(command, file=name)["code"] in ("bad_value", "bad_request")
    assert sorted(folder.parent.rglob("*")) == before


def test_what_is_no_file_of_the_folder_is_refused(client: Client, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").write_bytes(saved(client))
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    os.mkfifo(folder / "fifo")
    (folder / "folder").mkdir()
    for name in ("link", "fifo", "folder", "absent"):
        error = client.error("restore", file=name)
        assert error["code"] == "refused" and name in error["message"]
    # Where it would be written stands something that is no file.
    (folder / "y.tmp").mkdir()
    error = client.error("save", file="y")
    assert error["code"] == "failed" and "cannot write" in error["message"] and not (folder / "y").exists()
    # A link is replaced, not followed, and a FIFO not waited for: neither there nor where it is written first.
    os.symlink(tmp_path / "stolen", folder / "z.tmp")
    os.mkfifo(folder / "w.tmp")
    for name in ("z", "w"):
        client.ok("save", file=name)
        assert (folder / name).read_bytes() == saved(client) and not (folder / name).is_symlink()
    assert not (tmp_path / "stolen").exists()
    client.ok("save", file="link")
    assert not (folder / "link").is_symlink() and client.ok("restore", file="link")
    for entry in folder.iterdir():
        shutil.rmtree(entry) if entry.is_dir() else entry.unlink()


def test_without_a_folder_no_file_is_named(tmp_path: Path) -> None:
    with flying("--socket", tmp_path / "s", "--paused") as fc:
        client = fc.client(tmp_path / "s")
        for command in ("save", "restore"):
            error = client.error(command, file="x")
            assert error["code"] == "refused" and "--checkpoints" in error["message"]
        client.close()
    for wrong in (tmp_path / "absent", Path(FIXTURE)):
        with flying("--socket", tmp_path / "t", "--checkpoints", wrong) as fc:
            status, _, said = fc.wait()
            assert status == 1 and str(wrong) in said and not (tmp_path / "t").exists()
    with flying("--checkpoints", tmp_path) as fc:
        status, _, said = fc.wait()
        assert status == 2 and "--socket" in said


def test_who_leaves_after_a_save_has_it(client: Client, folder: Path, library: str, tmp_path: Path) -> None:
    """The reply is for nobody; the file is written all the same."""
    with flying("--socket", tmp_path / "s", "--paused", "--checkpoints", tmp_path, library=library) as fc:
        fc.client(tmp_path / "s").close()
        for number in range(20):
            hasty = socket.socket(socket.AF_UNIX)
            hasty.connect(str(tmp_path / "s"))
            hasty.sendall(json.dumps({"cmd": "save", "file": f"f{number}"}).encode() + b"\n")
            hasty.close()
        last = fc.client(tmp_path / "s")
        last.ok("save", file="last")
        found = {path.name for path in tmp_path.glob("f*")}
        # One whose connection was seen to end before its request was served has asked for nothing.
        assert all((tmp_path / name).read_bytes() == (tmp_path / "last").read_bytes() for name in found)
        last.close()


# ---- what is refused


def test_the_reasons_of_files(client: Client, library: str, tmp_path: Path) -> None:
    """Another machine, other sources; the latter is taken when that is meant."""
    here = saved(client)
    with flying("--socket", tmp_path / "s", "--paused") as fc:
        stranger = fc.client(tmp_path / "s")
        of_another = saved(stranger)
        assert "of machine 'shapes'" in stranger.error("restore", data=text(here))["message"]
        stranger.close()
    error = client.error("restore", data=text(of_another))
    assert error["code"] == "refused" and "not of 'shapes'" in error["message"]
    source = with_crc(here[:_AT_SOURCE] + b"0" * 64 + here[_AT_SOURCE + 64 :])
    assert "other sources" in client.error("restore", data=text(source))["message"]
    assert client.ok("restore", data=text(source), ignore_source_hash=True) and saved(client) == here
    layout = with_crc(here[: _AT_SOURCE + 64] + b"0" * 64 + here[_AT_SOURCE + 128 :])
    assert "another layout" in client.error("restore", data=text(layout), ignore_source_hash=True)["message"]
    for data, reason in ((b"", "does not begin"), (here[:-9], "cut short"), (here + b"x", "damaged")):
        assert reason in client.error("restore", data=text(data))["message"]
    assert saved(client) == here


@settings(max_examples=80)
@given(data=st.data())
def test_a_byte_that_changed_changes_nothing(client: Client, data: st.DataObject) -> None:
    here = saved(client)
    at = data.draw(st.integers(0, len(here) - 1))
    bad = here[:at] + bytes([here[at] ^ data.draw(st.integers(1, 255))]) + here[at + 1 :]
    assert client.error("restore", data=text(bad))["code"] == "refused"
    assert saved(client) == here


def test_requests_that_do_not_fit(client: Client) -> None:
    kept = client.ok("save")["data"]
    for members in (
        {"data": "?"},
        {"data": "AAA"},
        {"data": "A==="},
        {"data": 7},
        {"file": "x", "data": ""},
        {"data": "", "ignore_source_hash": 1},
        {"layout_hash": "x"},
    ):
        assert client.error("restore", **members)["code"] in ("bad_request", "bad_value"), members
    for members in ({"bytes": 4, "data": text(b"12345")}, {"bytes": 0, "data": ""}, {"bytes": 1 << 40, "data": ""}, {}):
        assert client.error("load", **members)["code"] in ("bad_request", "bad_value", "refused"), members
    assert client.ok("saved")["data"] == kept  # what is refused takes nothing away


# ---- hardware, and machines of any size


def test_simulated_hardware_is_in_it(client: Client) -> None:
    here = saved(client)
    entries = struct.pack("<IIQIIQIIQ", 0, 17, 1, 1, 3, 2500, 2, 0x40000024, 2**32 - 1)
    data = here[:-4] + entries + b"crc!"
    data = data[:16] + struct.pack("<Q", len(data)) + data[24:44] + struct.pack("<I", 3) + data[48:]
    data = with_crc(data)
    client.ok("restore", data=text(data))
    client.ok("tick")
    assert saved(client)[-4 - len(entries) : -4] == entries
    client.ok("restore", data=text(here))
    assert saved(client) == here


_LARGE = HOLD.replace('"big": "u64"', '"a": "f64[65536]", "b": "f64[65536]", "big": "u64"')


def test_a_large_machine_goes_in_portions(tmp_path: Path) -> None:
    """1 MB: more than a reply or a request holds. Whoever comes between is told apart."""
    assert HOLD != _LARGE
    library = build(tmp_path, _LARGE)
    path = tmp_path / "s"
    with flying("--socket", path, "--paused", library=library) as fc:
        one, two = fc.client(path), fc.client(path)
        for client in (one, two):
            assert client.error("saved", at=1)["code"] == "refused"
        one.set("hold.state.b[65526:]", [float(i) for i in range(10)])
        one.ok("tick")
        data = saved(one)
        assert len(data) > 1_000_000 and data == with_crc(data)
        assert one.error("saved", at=len(data))["code"] == "bad_request"
        assert two.error("saved", at=1)["code"] == "refused"
        one.ok("tick", count=5)
        assert one.ok("restore")["tick"] == 1  # what it has saved is there
        one.ok("tick", count=5)
        load(one, data, 48_000)
        assert one.ok("restore")["tick"] == 1 and saved(one) == data
        first = text(data[:3000])
        one.ok("load", bytes=len(data), data=first)
        assert "3000 of " in one.error("restore")["message"]
        assert one.error("load", at=48_000, data=first)["code"] == "bad_request"
        two.ok("save")
        assert one.error("load", at=3000, data=first)["code"] == "refused"
        # Who is refused takes nothing away; who comes between is heard of: nobody reads a mixture.
        assert one.error("load", bytes=3000, data=first[:-4] + "!!!!")["code"] == "bad_value"
        assert one.error("restore", data="====")["code"] == "bad_value"
        two.ok("saved", at=3000)
        one.ok("load", bytes=6000, data=first)
        for command in ("saved", "restore"):
            assert "another client has saved or loaded since" in two.error(command)["message"]
        assert "is of another machine, or of another layout" in one.error("load", bytes=10**9, data=first)["message"]
        one.close()
        two.close()


def load(client: Client, data: bytes, portion: int) -> None:
    client.ok("load", bytes=len(data), data=text(data[:portion]))
    for at in range(portion, len(data), portion):
        assert client.ok("load", at=at, data=text(data[at : at + portion]))["loaded"] == min(len(data), at + portion)
