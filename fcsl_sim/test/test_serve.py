# SPDX-License-Identifier: Apache-2.0
"""A simulation behind the variable server: the machine's fields and the models', commands between ticks."""

from __future__ import annotations

import base64
import contextlib
import json
import socket
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fcsl_sim import SimError, Simulation

FCSL_SIM = Path(__file__).resolve().parents[1] / "bin/fcsl-sim"
LANDER = Path(__file__).resolve().parents[2] / "examples/lander/sim/lander.sim.json"


class Client:
    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(10)
        self._socket.connect(str(path))
        self._file = self._socket.makefile("rb")

    def __call__(self, cmd: str, **members: Any) -> dict[str, Any]:
        self._socket.sendall(json.dumps({"cmd": cmd, **members}).encode() + b"\n")
        reply: dict[str, Any] = json.loads(self._file.readline())
        return reply

    def get(self, *paths: str) -> list[Any]:
        values = self("get", paths=list(paths))["values"]
        return [values[path] for path in paths]

    def close(self) -> None:
        self._file.close()
        self._socket.close()


@contextlib.contextmanager
def served(sim: Simulation, path: Path, serving: bool = False) -> Iterator[Client]:
    """Runs the simulation, paused at first, in a thread of its own until the block ends; `serving`: it serves already."""
    over = threading.Event()

    def fly() -> None:
        while not over.is_set() and sim.status == "running":
            sim.run(100)

    assert serving or sim.serve(str(path), None, paused=True) == str(path)
    thread = threading.Thread(target=fly)
    thread.start()
    client = Client(path)
    try:
        yield client
    finally:
        client.close()
        over.set()
        thread.join()
        sim.close()


def test_machine_and_models_are_served_alike(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    with served(open_sim(), tmp_path / "s") as client:
        blocks = client("describe")["blocks"]
        assert blocks[0] == "" and set(blocks[1:]) == {"ramp", "altimeter", "velocimeter"}
        assert client("tick", count=10) == {
            "ok": True,
            "tick": 10,
            **{k: client("state")[k] for k in ("state", "next_state")},
            "paused": True,
        }
        tick, x, seen, truth = client.get(
            "machine.tick", "ramp.outputs.x", "altimeter.outputs.value", "altimeter.inputs.truth"
        )
        assert tick == 10 and seen == truth
        field = client("describe", path="ramp.outputs.x")
        assert field["role"] == "output" and field["instance"] == "ramp"
        assert client("eval", expression=f"ramp.outputs.x == {x!r}")["value"] is True
        assert client("get", paths=["ramp.outputs"])["values"]["ramp.outputs"]["x"] == x


def test_models_are_set_and_what_is_connected_is_refused(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """A bias of one sensor is seen by the machine from the next tick on."""
    with served(open_sim(), tmp_path / "s") as client:
        client("tick", count=5)
        assert client("set", values={"altimeter.parameters.bias": 100.0})["overwritten_by"] == {}
        client("tick")
        assert client.get("altimeter.outputs.value")[0] > 99.0
        refused = client("set", values={"altimeter.inputs.truth": 1.0})["error"]
        assert refused["code"] == "refused" and refused["overwritten_by"] == "ramp.outputs.x"
        refused = client("set", values={"altimeter.parameters.bias": 0.0, "ramp.inputs.rate": 1.0})["error"]
        assert refused["overwritten_by"].endswith("throttle")
        assert client.get("altimeter.parameters.bias") == [100.0]  # all or nothing
        reply = client("set", values={"ramp.outputs.x": 7.0})
        assert reply["overwritten_by"] == {"ramp.outputs.x": "instance ramp"}


def test_the_machine_can_be_saved_and_flown_on_elsewhere(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """The checkpoint is of the hosted machine, as a file of any host; back it does not go, and the reply says why."""
    sim = open_sim()
    sim.serve(str(tmp_path / "s"), None, True, tmp_path)
    with served(sim, tmp_path / "s", serving=True) as client:
        client("tick", count=10)
        reply = client("save")
        data = base64.b64decode(reply["data"])
        assert reply["ok"] and data.startswith(b"FCSLCKPT") and len(data) == reply["bytes"]
        assert client("save", file="kept")["file"] == "kept" and (tmp_path / "kept").read_bytes() == data
        for request in ({"data": reply["data"]}, {"file": "kept"}):
            refused = client("restore", **request)["error"]
            assert refused["code"] == "refused" and "the machine alone" in refused["message"]
        assert "not of" in client("restore", data=base64.b64encode(_of_another(data)).decode())["error"]["message"]


def _of_another(checkpoint: bytes) -> bytes:
    """The same of a machine with another name."""
    changed = checkpoint[:248] + bytes([checkpoint[248] ^ 1]) + checkpoint[249:-4]
    return changed + struct.pack("<I", zlib.crc32(changed))


def test_stats_are_those_of_flights(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    with served(open_sim(), tmp_path / "s") as client:
        assert client("stats")["step_time_ns"]["count"] == 0
        client("tick", count=25)
        stats = client("stats")
        assert stats["ticks"] == stats["step_time_ns"]["count"] == 25 and stats["step_time_ns"]["p50"] > 0
        assert (
            stats["lateness_ns"]["count"] == stats["late"] == stats["frames_refused"] == stats["records_dropped"] == 0
        )


def test_every_tick_of_a_running_simulation_until_its_end(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """Served or not, the same bits; and after the end a client is told so."""
    alone = open_sim()
    while alone.status == "running":
        alone.run(1000)
    with served(open_sim(), tmp_path / "s") as client:
        assert client("tick", count=40)["tick"] == 40
        total = alone.ticks
        error = client("tick", count=total)["error"]
        assert error["code"] == "ended" and client("state")["tick"] == total
        assert client.get("ramp.outputs.x") == [alone.get("ramp.outputs.x")]
    alone.close()


def test_a_name_means_one_thing(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    def rename(config: dict[str, Any]) -> None:
        config["instances"]["machine"] = config["instances"].pop("velocimeter")
        config["rates"]["machine"] = config["rates"].pop("velocimeter")
        config["connections"] = json.loads(json.dumps(config["connections"]).replace("velocimeter", "machine"))

    with open_sim(rename) as sim, pytest.raises(SimError, match="rename it"):
        sim.serve(str(tmp_path / "s"), None, paused=True)


def test_from_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "s"
    command = [sys.executable, str(FCSL_SIM), "run", str(LANDER), "--socket", str(path), "--paused", "--duration", "2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == f"variables on {path}\n"
        client = Client(path)
        before = client("state")
        assert before["tick"] == 0 and before["paused"] is True
        paths = client("list")["paths"]
        assert any(p.startswith("machine.") for p in paths) and len(client("describe")["blocks"]) > 2
        assert client("tick", count=100)["tick"] == 100
        client("resume")
        out, _ = process.communicate(timeout=60)
        client.close()
    assert process.returncode == 0 and "end:" in out and not path.exists()
    refused = subprocess.run([*command[:4], "--paused"], capture_output=True, text=True, check=False, timeout=60)
    assert refused.returncode == 2 and "--socket" in refused.stderr
