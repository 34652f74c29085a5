# SPDX-License-Identifier: Apache-2.0
"""A simulation behind the variable server: the machine's fields and the models', commands between ticks."""

from __future__ import annotations

import base64
import contextlib
import itertools
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

from fcsl_compiler.api.build import build_machine
from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import Simulation, load
from fcsl_sim.sim_run import SimRun
from simclient import SimTwin

FCSL_SIM = Path(__file__).resolve().parents[1] / "bin/fcsl-sim"
LANDER = Path(__file__).resolve().parents[2] / "examples/lander/sim/lander.sim.json"


class Client:
    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(10)
        self._socket.connect(str(path))
        self._file = self._socket.makefile("rb")

    def send(self, cmd: str, **members: Any) -> None:
        self._socket.sendall(json.dumps({"cmd": cmd, **members}).encode() + b"\n")

    def reply(self) -> dict[str, Any]:
        reply: dict[str, Any] = json.loads(self._file.readline())
        return reply

    def __call__(self, cmd: str, **members: Any) -> dict[str, Any]:
        self.send(cmd, **members)
        return self.reply()

    def get(self, *paths: str) -> list[Any]:
        values = self("get", paths=list(paths))["values"]
        return [values[path] for path in paths]

    def close(self) -> None:
        self._file.close()
        self._socket.close()


@contextlib.contextmanager
def served(sim: Simulation, path: Path, serving: bool = False) -> Iterator[Client]:
    """Runs the simulation, paused at first, in a separate thread until the block ends; `serving`: it serves variables
    already.
    """
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


def test_models_are_set_and_who_overwrites_it_is_said(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """A bias of one sensor affects the machine from the next tick on."""
    with served(open_sim(), tmp_path / "s") as client:
        client("tick", count=5)
        assert client("set", values={"altimeter.parameters.bias": 100.0})["overwritten_by"] == {}
        client("tick")
        assert client.get("altimeter.outputs.value")[0] > 99.0
        reply = client("set", values={"altimeter.inputs.truth": -5.0, "ramp.inputs.rate": 9.0})
        assert reply["overwritten_by"] == {
            "altimeter.inputs.truth": "ramp.outputs.x",
            "ramp.inputs.rate": "pilot.outputs.throttle",
        }
        assert client.get("altimeter.inputs.truth", "ramp.inputs.rate") == [-5.0, 9.0]
        client("tick")
        truth, x, rate = client.get("altimeter.inputs.truth", "ramp.outputs.x", "ramp.inputs.rate")
        assert truth == x and rate == 1.0
        refused = client("set", values={"altimeter.parameters.bias": 0.0, "machine.tick": 1})["error"]
        assert refused["overwritten_by"] == "the machine"
        assert client.get("altimeter.parameters.bias") == [100.0]  # all or nothing
        reply = client("set", values={"ramp.outputs.x": 7.0})
        assert reply["overwritten_by"] == {"ramp.outputs.x": "instance ramp"}


def test_a_simulated_machine_takes_commands_of_a_hosted_one(
    open_sim: Callable[..., Simulation], tmp_path: Path
) -> None:
    """States and simulated hardware as in a flight program; sensor channels have their samples from the simulation."""
    with served(open_sim(), tmp_path / "s") as client:
        assert client("hardware", bank="adc", number=3, value=77)["value"] == 77
        assert client("hardware", bank="adc", number=3)["value"] == 77
        refused = client("inject", instance="pilot", what="overrun")["error"]
        assert "has no max_wcet_us" in refused["message"]
        for command, members in (("attach", {}), ("sample", {"value": 1.0})):
            refused = client(command, channel="altitude", **members)["error"]
            assert refused["code"] == "refused" and "simulation feeds the sensor channels" in refused["message"]


def test_the_machine_can_be_saved_and_flown_on_elsewhere(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """A checkpoint is of the hosted machine, for a file of any host.

    Only the last one saved here can be restored; else the reply has the reason.
    """
    sim = open_sim()
    sim.serve(str(tmp_path / "s"), None, True, tmp_path)
    with served(sim, tmp_path / "s", serving=True) as client:
        client("tick", count=9)
        older = client("save")["data"]
        client("tick")
        reply = client("save")
        data = base64.b64decode(reply["data"])
        assert reply["ok"] and data.startswith(b"FCSLCKPT") and len(data) == reply["bytes"]
        assert client("save", file="kept")["file"] == "kept" and (tmp_path / "kept").read_bytes() == data
        refused = client("restore", data=older)["error"]
        assert refused["code"] == "refused" and "the machine alone" in refused["message"]
        assert "saved last, behind tick 10" in refused["message"]
        for request in ({"data": reply["data"]}, {"file": "kept"}):
            client("tick")
            assert client("restore", **request)["tick"] == 10
        assert "not of" in client("restore", data=base64.b64encode(_of_another(data)).decode())["error"]["message"]


def test_nothing_saved_is_nothing_to_put_back(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    with served(open_sim(), tmp_path / "first") as client:
        data = client("save")["data"]
    with served(open_sim(), tmp_path / "second") as client:
        refused = client("restore", data=data)["error"]
        assert refused["code"] == "refused" and "itself saved last" in refused["message"]


def everything(client: Client) -> dict[str, Any]:
    """All values of the machine and the models."""
    paths = client("list")["paths"]
    parts = [client("get", paths=paths[n : n + 200])["values"] for n in range(0, len(paths), 200)]
    return {path: value for part in parts for path, value in part.items()}


#: Frames are under way, and some are lost.
LATE = [f"line.parameters.{text}" for text in ("halts=false", "delay_s=0.02", "baud=57600", "retransmit_ticks=60")]


@pytest.mark.parametrize("before, between, serial", [(0, 50, 0), (7, 1, 0), (33, 300, 0), (600, 0, 0), (33, 300, 1)])
def test_what_follows_a_restore_is_what_followed_the_save(
    before: int, between: int, serial: int, tmp_path: Path
) -> None:
    """The lander with its noise and sensors of several rates: every value of 60 ticks, bit for bit. Verdicts on requirements
    go on: a restore is no other run."""
    lander = load(LANDER.with_name("lander_serial.sim.json"), sets=LATE) if serial else load(LANDER)

    def flight(client: Client) -> list[dict[str, Any]]:
        rows = [everything(client) for _ in range(60) if client("tick")["ok"]]
        return [{path: value for path, value in row.items() if not path.startswith("requirements.")} for row in rows]

    with served(Simulation(lander.plan, lander.tables), tmp_path / "steady") as client:
        client("tick", count=before) if before else None
        steady = flight(client)
    with served(Simulation(lander.plan, lander.tables), tmp_path / "back") as client:
        client("tick", count=before) if before else None
        assert client("save")["ok"]
        client("tick", count=between) if between else None
        assert client("set", values={"lander.parameters.gravity": 9.81})["ok"]  # of the plant, and restored with it
        assert client("restore")["tick"] == before
        assert flight(client) == steady
        assert client("restore")["tick"] == before  # repeatedly
        assert flight(client) == steady


def test_scheduled_writes_come_again(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    def write(config: dict[str, Any]) -> None:
        config["events"] = [{"at_s": 0.05, "set": "altimeter.parameters.bias", "value": 50.0}]

    with served(open_sim(write), tmp_path / "s") as client:
        client("tick", count=3)
        assert client("save")["ok"]
        for _ in range(3):
            client("tick", count=7)
            assert client.get("altimeter.parameters.bias") == [50.0]
            assert client("restore")["tick"] == 3
            assert client.get("altimeter.parameters.bias") == [0.0]


def test_the_stop_condition_has_held_as_long_as_it_had(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    def change(config: dict[str, Any]) -> None:
        config["until"] = {"condition": "ramp.outputs.x > 0.2", "for_s": 0.1}

    with open_sim(change) as steady:
        while steady.status == "running":
            steady.run(1000)
        end = steady.tick
    with served(open_sim(change), tmp_path / "s") as client:
        client("tick", count=end - 6)
        assert client("save")["ok"]
        client("tick", count=3)
        assert client("restore")["tick"] == end - 6
        assert client("tick", count=1000)["error"]["code"] == "ended" and client("state")["tick"] == end


def _of_another(checkpoint: bytes) -> bytes:
    """The same checkpoint, of a machine with another name."""
    changed = checkpoint[:248] + bytes([checkpoint[248] ^ 1]) + checkpoint[249:-4]
    return changed + struct.pack("<I", zlib.crc32(changed))


def test_stats_are_those_of_flights(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """Only counts that apply: a simulation has no deadlines and no watchdog."""
    with served(open_sim(), tmp_path / "s") as client:
        assert client("stats")["tick_time_ns"]["count"] == 0
        assert client("save")["ok"]
        client("tick", count=25)
        assert client("restore")["tick"] == 0
        client("tick", count=4)
        stats = client("stats")
        assert stats["ticks"] == stats["tick_time_ns"]["count"] == 29 and stats["tick_time_ns"]["p50"] > 0
        assert stats["tick"] == 4 and stats["messages_refused"] == stats["records_dropped"] == 0
        assert not {"deadlines_missed", "ticks_skipped", "watchdog_trips", "lateness_ns"} & stats.keys()


def test_every_tick_of_a_running_simulation_until_its_end(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """Served or not, the same bits; and after the end a client gets an error."""
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


def test_a_long_tick_is_made_in_portions(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """The caller can handle a signal in between."""
    with open_sim(lambda config: config.update(duration=1000.0)) as sim:
        sim.serve(str(tmp_path / "s"), None, paused=True)
        replies: list[dict[str, Any]] = []
        client = Client(tmp_path / "s")
        asking = threading.Thread(target=lambda: replies.append(client("tick", count=50_000)))
        asking.start()
        returns = {0}
        while not replies:
            assert sim.run(1) == 0
            returns.add(sim.tick)
        asking.join()
        client.close()
    assert replies[0]["tick"] == max(returns) == 50_000
    assert max(after - before for before, after in itertools.pairwise(sorted(returns))) <= 2000


def test_a_long_tick_ends_with_its_client(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """It ends with the current portion: the server checks before each one that the client is connected."""
    with open_sim(lambda config: config.update(duration=20000.0)) as sim:
        sim.serve(str(tmp_path / "s"), None, paused=True)
        leaving, next_one = Client(tmp_path / "s"), Client(tmp_path / "s")
        leaving.send("tick", count=1_000_000)
        while sim.tick == 0:
            sim.run(1)
        leaving.close()
        left_at = sim.tick
        next_one.send("tick")
        while sim.run(1) == 0 and sim.tick % 1000 != 1:
            pass
        assert next_one.reply()["tick"] == sim.tick <= left_at + 4001
        next_one.close()


def test_a_long_tick_ends_with_a_pause(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    """Of another client; the client that requested the ticks gets the number of missing ones."""
    with open_sim(lambda config: config.update(duration=20000.0)) as sim:
        sim.serve(str(tmp_path / "s"), None, paused=True)
        asking, pausing = Client(tmp_path / "s"), Client(tmp_path / "s")
        asking.send("tick", count=1_000_000)
        while sim.tick == 0:
            sim.run(1)
        stopper = threading.Thread(target=lambda: replies.append(pausing("pause")))
        replies: list[dict[str, Any]] = []
        stopper.start()
        while not replies:
            sim.run(1)
        stopper.join()
        assert replies[0]["ok"] and replies[0]["tick"] == sim.tick < 1_000_000
        error = asking.reply()["error"]
        assert (
            error["code"] == "refused" and error["message"] == f"a `pause` ended it {1_000_000 - sim.tick} ticks early"
        )
        for client in (asking, pausing):
            client.close()


def test_a_name_means_one_thing(open_sim: Callable[..., Simulation]) -> None:
    def rename(config: dict[str, Any]) -> None:
        config["instances"]["machine"] = config["instances"].pop("velocimeter")
        config["rates"]["machine"] = config["rates"].pop("velocimeter")
        config["connections"] = json.loads(json.dumps(config["connections"]).replace("velocimeter", "machine"))

    with pytest.raises(DiagnosticError) as error:
        open_sim(rename)
    assert [d.message for d in error.value.diagnostics] == ["`machine` is reserved"]


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
    assert process.returncode == 1 and "end:" in out and not path.exists()
    refused = subprocess.run([*command[:4], "--paused"], capture_output=True, text=True, check=False, timeout=60)
    assert refused.returncode == 2 and "--socket" in refused.stderr


def test_times_of_the_machine_are_served(
    write_sim: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of one that was built with --times; SimTwin and the variable server have the same."""
    monkeypatch.setenv("FCSL_TIMES", "1")
    machine = build_machine(Path(__file__).parent / "machines/hopper.json")
    config = load(write_sim(), machine=(machine.library, machine.name))
    with SimTwin(SimRun(config)) as twin:
        twin.tick(7)
        times = twin.instance_times()
        assert {name: row.runs for name, row in times.items()} == {"pilot": 7, "machine": 7}
        assert 0 < times["pilot"].total_ns <= times["machine"].total_ns
    with served(Simulation(config.plan, config.tables), tmp_path / "sim") as client:
        client("tick", count=7)
        assert client.get("times.pilot.runs", "times.machine.runs") == [7, 7]
        assert client("stats")["times"]["pilot"]["total_ns"] == client.get("times.pilot.total_ns")[0]
