# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of the variable server: which ticks are sampled, in both formats, and what a slow reader loses."""

from __future__ import annotations

import json
import math
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from native import Client, Fc, flying
from vars_machine import build


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> str:
    return build(tmp_path_factory.mktemp("shapes"))


@pytest.fixture
def flight(library: str, tmp_path: Path) -> Iterator[tuple[Fc, Path]]:
    path = tmp_path / "fc.sock"
    with flying("--socket", path, "--paused", library=library) as fc:
        yield fc, path


class Stream:
    """Reads replies, JSON samples and binary frames off one connection, as docs/reference/variables.md has them."""

    def __init__(self, client: Client) -> None:
        self._file = client.file  # it may have read on behind the last reply

    def next(self) -> dict[str, Any]:
        first = self._file.read(1)
        if first != b"\xff":
            message: dict[str, Any] = json.loads(first + self._file.readline())
            return message
        version, number, size, tick, time_ns, lost = struct.unpack("<BHIQQQ", self._file.read(31))
        assert version == 1
        return {
            "subscription": number,
            "tick": tick,
            "time_ns": time_ns,
            "lost": lost,
            "payload": self._file.read(size),
        }

    def samples(self, count: int) -> list[dict[str, Any]]:
        return [self.next() for _ in range(count)]


def subscribe(client: Client, paths: list[str], **members: Any) -> int:
    return int(client.ok("subscribe", paths=paths, **members)["subscription"])


@pytest.mark.parametrize("every", [1, 3, 64, 1000])
def test_every_nth_tick_and_no_other(flight: tuple[Fc, Path], every: int) -> None:
    """Also far beyond what the history holds: a `tick` waits for those who look on."""
    fc, path = flight
    watcher, driver = fc.client(path), fc.client(path)
    driver.ok("tick", count=5)
    number = subscribe(watcher, ["machine.tick", "hold.state.count"], every=every)
    driver.send(b'{"cmd":"tick","count":2500}\n')
    expected = [t for t in range(6, 2506) if t % every == 0]
    samples = Stream(watcher).samples(len(expected))
    assert driver.read()["tick"] == 2505
    assert [s["tick"] for s in samples] == expected and {s["subscription"] for s in samples} == {number}
    assert all(s["values"] == {"machine.tick": s["tick"], "hold.state.count": s["tick"]} for s in samples)
    assert {s["lost"] for s in samples} == {0} and driver.ok("stats")["samples_lost"] == 0


def test_a_tick_by_the_subscriber_itself(flight: tuple[Fc, Path]) -> None:
    """Its samples come before the reply to its `tick`."""
    fc, path = flight
    client = fc.client(path)
    subscribe(client, ["hold.state.count"])
    client.send(b'{"cmd":"tick","count":200,"id":9}\n')
    messages = Stream(client).samples(201)
    assert [m["tick"] for m in messages] == [*range(1, 201), 200] and messages[-1]["id"] == 9


def test_a_set_makes_no_sample(flight: tuple[Fc, Path]) -> None:
    fc, path = flight
    watcher, driver = fc.client(path), fc.client(path)
    subscribe(watcher, ["hold.inputs.free"])
    for value in (1.0, 2.0):
        driver.set("hold.inputs.free", value)
        driver.ok("tick")
    assert [(s["tick"], s["values"]["hold.inputs.free"]) for s in Stream(watcher).samples(2)] == [(1, 1.0), (2, 2.0)]


def test_binary_frames(flight: tuple[Fc, Path]) -> None:
    """Scalars little-endian, row by row, without gaps; two subscriptions and replies share the connection."""
    fc, path = flight
    client = fc.client(path)
    values: dict[str, Any] = {
        "hold.state.p[1:3,::2]": [[1.5, -2.0, 3.0], [4.0, 5.0, 6.0]],
        "hold.state.cube[0,0,:2]": [-7, 2**31 - 1],
        "hold.state.line[-1]": 0.25,
        "hold.state.flag": True,
        "hold.state.big": 2**64 - 1,
        "hold.inputs.free": "nan",
    }
    client.ok("set", values=values, allow_non_finite=True)
    first = subscribe(client, [*values, "machine.state", "hold.outputs.health"], format="binary", every=2)
    second = subscribe(client, ["hold.state.line[-1]"])
    client.send(b'{"cmd":"tick","count":2}\n')
    stream = Stream(client)
    one, two, frame = sorted(stream.samples(3), key=lambda s: (s["subscription"] == first, s["tick"]))
    assert stream.next()["ok"] is True
    assert (one["tick"], two["tick"], two["subscription"]) == (1, 2, second) and "payload" not in two
    assert frame["tick"] == 2 and frame["subscription"] == first and frame["time_ns"] == two["time_ns"]
    numbers = struct.unpack("<6d2if?Qdii", frame["payload"])
    assert numbers[:11] == (1.5, -2.0, 3.0, 4.0, 5.0, 6.0, -7, 2**31 - 1, 0.25, True, 2**64 - 1)
    assert math.isnan(numbers[11]) and numbers[12:] == (0, 0)
    assert frame["payload"][-16:-8] == struct.pack("<Q", 0x7FF8 << 48)  # the one NaN


def test_unsubscribe(flight: tuple[Fc, Path]) -> None:
    fc, path = flight
    client = fc.client(path)
    numbers = [subscribe(client, ["machine.tick"]) for _ in range(4)]
    assert numbers == [1, 2, 3, 4]
    assert client.error("subscribe", paths=["machine.tick"])["code"] == "too_many_subscriptions"
    for number in numbers:
        assert client.ok("unsubscribe", subscription=number)["lost"] == 0
    assert client.error("unsubscribe", subscription=1)["code"] == "bad_request"
    assert client.ok("tick", count=3)["tick"] == 3  # and no sample before it
    for bad in (
        {"paths": []},
        {"paths": ["machine.tik"]},
        {"paths": ["hold"]},
        {"paths": ["machine.tick"], "every": 0},
    ):
        client.error("subscribe", **bad)
    assert client.error("subscribe", paths=["machine.tick"], format="xml")["hint"] == "json"
    large = client.error("subscribe", paths=["hold.state.p"] * 64)
    assert large["code"] == "too_large" and large["hint"] == "binary"
    assert "1 to 64" in client.error("subscribe", paths=["machine.tick"] * 65)["message"]
    assert subscribe(client, ["machine.tick"]) == 1


def test_a_sample_of_as_many_scalars_as_paths_may_be(flight: tuple[Fc, Path]) -> None:
    fc, path = flight
    client = fc.client(path)
    paths = [f"hold.state.p[{i},{j}]" for i in range(4) for j in range(5)] * 3 + ["machine.state"] * 4
    for form in ("json", "binary"):
        client.ok("unsubscribe", subscription=subscribe(client, paths, format=form))
    subscribe(client, paths)
    client.set("hold.state.p", [[-1.2345678901234567e-300] * 5] * 4)
    client.send(b'{"cmd":"tick"}\n')
    assert len(Stream(client).next()["values"]) == 21  # the same path twice is one member for a reader


def test_a_restore_goes_back_in_time(flight: tuple[Fc, Path]) -> None:
    fc, path = flight
    watcher, driver = fc.client(path), fc.client(path)
    driver.ok("tick", count=5)
    saved = driver.ok("save")
    subscribe(watcher, ["hold.state.count"], every=10)
    driver.ok("tick", count=40)
    driver.ok("restore", data=saved["data"])
    driver.ok("tick", count=10)
    samples = Stream(watcher).samples(5)
    assert [(s["tick"], s["lost"]) for s in samples] == [(10, 0), (20, 0), (30, 0), (40, 0), (10, 0)]


def test_ticks_that_a_restore_jumps_over_are_not_lost(flight: tuple[Fc, Path]) -> None:
    """They never were."""
    fc, path = flight
    watcher, driver = fc.client(path), fc.client(path)
    early = driver.ok("save")["data"]
    driver.ok("tick", count=1000)
    late = driver.ok("save")["data"]
    driver.ok("restore", data=early)
    number = subscribe(watcher, ["machine.tick"])
    driver.ok("tick", count=2)
    driver.ok("restore", data=late)
    driver.ok("tick", count=2)
    samples = Stream(watcher).samples(5)
    assert [(s["tick"], s["lost"]) for s in samples] == [(1, 0), (2, 0), (1000, 0), (1001, 0), (1002, 0)]
    assert watcher.ok("unsubscribe", subscription=number)["lost"] == 0 == driver.ok("stats")["samples_lost"]


def test_a_subscriber_that_does_not_read_loses_samples_and_then_its_connection(library: str, tmp_path: Path) -> None:
    """Ticks and other clients go on; what was lost is counted, and told with what still comes."""
    path = tmp_path / "fc.sock"
    with flying("--socket", path, library=library) as fc:
        slow, driver = fc.client(path), fc.client(path)
        subscribe(slow, ["hold.state.p", "hold.state.cube", "hold.state.p", "hold.state.cube"])
        deadline = time.monotonic() + 30
        while driver.ok("stats")["samples_lost"] == 0:
            assert time.monotonic() < deadline
        stream = Stream(slow)
        lost, tick = 0, 0
        while lost == 0:  # what comes next after the gap says how many were lost, and its tick agrees
            sample = stream.next()
            lost, missed, tick = sample["lost"], sample["tick"] - tick - 1, sample["tick"]
        assert lost == missed
        while driver.ok("stats")["clients_dropped"] == 0:
            assert time.monotonic() < deadline
        before = driver.ok("state")["tick"]
        while driver.ok("state")["tick"] < before + 10:
            assert time.monotonic() < deadline
