# SPDX-License-Identifier: Apache-2.0
"""Services of a machine in a ROS 2 graph, without rclpy: queries of zenoh-plugin-ros2dds and of nodes of rmw_zenoh.

Here Zenoh sessions of Python stand for them.
"""

from __future__ import annotations

import json
import queue
import re
import shutil
import signal
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh
from ament_index_python.packages import get_package_share_directory
from rclpy.serialization import deserialize_message, serialize_message
from std_srvs.srv import SetBool, Trigger
from test_ros_graph import DOMAIN, ECHO, LONG_S, bridge, node_of_rmw_zenoh, started, until

from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint

REQUEST = struct.pack("<qqB16s", 41, 5, 16, bytes(range(16)))


def service_hash(name: str) -> str:
    known = json.loads((Path(get_package_share_directory("std_srvs")) / f"srv/{name}.json").read_text())
    return str(known["type_hashes"][0]["hash_string"])


class Graph:
    """A session that calls services of a flight computer: `ask` gives all answers to a request, with their attachments."""

    def __init__(self, session: zenoh.Session, is_rmw: bool):
        self.session, self.is_rmw = session, is_rmw

    def key(self, name: str, kind: Any) -> str:
        of_type = kind.__name__
        return (
            f"{DOMAIN}/r1/{name}/std_srvs::srv::dds_::{of_type}_/{service_hash(of_type)}"
            if self.is_rmw
            else f"r1/{name}"
        )

    def send(self, name: str, kind: Any, payload: bytes) -> queue.Queue[tuple[Any, bytes] | None]:
        """The answers, and None behind them."""
        came: queue.Queue[tuple[Any, bytes] | None] = queue.Queue()

        def take(reply: zenoh.Reply) -> None:
            assert reply.ok and str(reply.ok.key_expr) == self.key(name, kind)
            answer = deserialize_message(bytes(reply.ok.payload), kind.Response)
            came.put((answer, bytes(reply.ok.attachment or b"")))

        handler = zenoh.handlers.Callback(take, lambda: came.put(None))
        self.session.get(
            self.key(name, kind),
            handler,
            payload=payload,
            attachment=REQUEST,
            timeout=LONG_S,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        return came

    def call(self, name: str, kind: Any, **fields: Any) -> tuple[bool, str, bytes]:
        came = self.send(name, kind, bytes(serialize_message(kind.Request(**fields))))
        answered = came.get(timeout=LONG_S)
        assert answered is not None and came.get(timeout=LONG_S) is None, "one answer to each call"
        return answered[0].success, answered[0].message, answered[1]


def machine(folder: Path) -> Path:
    """That of `make interop`, with an actuator that `hold` arms, and more patience than a busy computer needs."""
    config = json.loads(ECHO.read_text())
    shutil.copytree(ECHO.parent / "algorithms", folder / "algorithms")
    config["arm"] = "echo.held"
    for channel in config["channels"]:
        if channel["name"] == "cmd":
            channel["safe"] = -1.0
        if channel["name"] == "mark":
            channel["ros"]["within_s"] = 5.0
    (folder / "echo.json").write_text(json.dumps(config))
    return folder / "echo.json"


@contextmanager
def flying(folder: Path, is_rmw: bool) -> Iterator[tuple[Graph, subprocess.Popen[str]]]:
    endpoint = free_endpoint()
    subprocess.run(["fcslc", "build", machine(folder), "-o", folder], check=True, capture_output=True)
    place = f"rmw_zenoh:{zenoh_locator(endpoint)}" if is_rmw else endpoint
    line = ["fcsl-fc", folder / "libecho.so", "--hal", f"ros:{place}", "--namespace", "r1", "--record", folder / "bag"]
    line += ["--summary", folder / "summary.json"]
    if is_rmw:
        with node_of_rmw_zenoh(endpoint) as session, started(*line) as fc:
            yield Graph(session, is_rmw), fc
    else:
        with started(*line) as fc, bridge(endpoint) as session:
            yield Graph(session, is_rmw), fc


@pytest.mark.parametrize("is_rmw", [False, True], ids=["ros2dds", "rmw_zenoh"])
def test_calls_are_answered_by_what_the_machine_did(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_rmw: bool
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    with flying(tmp_path, is_rmw) as (graph, fc):
        seen: list[str] = []

        def announced() -> bool:
            tokens = graph.session.liveliness().get("@ros2_lv/**" if is_rmw else "@/*/@ros2_lv/**")
            seen[:] = [str(reply.ok.key_expr) for reply in tokens if reply.ok]
            return sum("/SS/" in token for token in seen) == 2

        until(announced)
        if is_rmw:
            wanted = (
                rf"@ros2_lv/{DOMAIN}/\w+/0/\d+/SS/%/%r1/echo/%r1%(hold|mark)/std_srvs::srv::dds_::(SetBool|Trigger)_/"
            )
            wanted += r"(RIHS01_[0-9a-f]{64})/:2:,10:,:,:,,"
        else:
            wanted = r"@/\w+/@ros2_lv/SS/r1§(hold|mark)/std_srvs§srv§(SetBool|Trigger)"
        found = [match for token in seen if (match := re.fullmatch(wanted, token))]
        assert sorted(match[1] for match in found) == ["hold", "mark"]
        assert not is_rmw or all(match[3] == service_hash(match[2]) for match in found)

        done, why, _ = graph.call("mark", Trigger)
        assert not done and why.startswith("timed out: not echo.outputs.marked in RUN at tick "), why
        done, why, attachment = graph.call("hold", SetBool, data=True)
        assert done and why.startswith("accepted in RUN at tick "), why
        number, stamp_ns, size, gid = struct.unpack("<qqB16s", attachment)
        assert (number, size, gid) == (41, 16, bytes(range(16))) and stamp_ns > 5
        assert graph.call("mark", Trigger)[0]
        assert graph.call("hold", SetBool, data=False)[0]

        waiting = graph.send("mark", Trigger, bytes(serialize_message(Trigger.Request())))
        assert graph.call("mark", Trigger)[1] == "busy: another call waits for its answer"
        first = waiting.get(timeout=LONG_S)
        assert first is not None and first[0].message.startswith("timed out")

        # What is no request is answered or ends without an answer, and the next call is served.
        malformed = graph.send("hold", SetBool, b"\0\1\0\0\7").get(timeout=LONG_S)
        assert malformed is not None and malformed[0].message == "the request is no CDR of its type"
        assert graph.send("hold", SetBool, bytes(65)).get(timeout=LONG_S) is None
        assert graph.send("hold", SetBool, b"").get(timeout=LONG_S) is None
        assert graph.call("hold", SetBool, data=True)[0]

        assert graph.call("hold", SetBool, data=False)[0]
        waiting = graph.send("mark", Trigger, bytes(serialize_message(Trigger.Request())))
        assert graph.call("mark", Trigger)[1].startswith("busy")
        fc.send_signal(signal.SIGTERM)
        last = waiting.get(timeout=LONG_S)
        assert last is None or last[0].message == "the machine stopped before it answered"  # None: no tick has seen it
        _, complaint = fc.communicate(timeout=LONG_S)
    assert fc.returncode == 0, complaint
    counted = json.loads((tmp_path / "summary.json").read_text())["hal"]
    assert counted["wrong_size"] == 2
    assert counted["calls"] in (7, 8) and counted["calls_accepted"] == 5 and counted["calls_malformed"] == 1
    replayed = subprocess.run(
        ["fcsl", "replay", "--library", tmp_path / "libecho.so", tmp_path / "bag"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert replayed.returncode == 0 and "identical" in replayed.stdout, replayed.stdout + replayed.stderr
