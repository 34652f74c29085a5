# SPDX-License-Identifier: Apache-2.0
"""What `fcsl-fc --telemetry` sends, read by a reader that was written from docs/guide/monitoring.md alone."""

from __future__ import annotations

import fnmatch
import json
import math
import re
import shutil
import struct
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from native import FIXTURE, PROGRAM, Client, flying
from telemetry_page import Malformed, Port, Reading, dumps, example, read, read_configuration, read_datagram

from fcsl_compiler.driver.cache import build_machine
from simclient import AlgTwin
from simclient.run import open_run

#: So few that the history, which the run leaves behind at full speed, still has all of them.
TICKS = 60
FREE = ("--rate", "max", "--ticks", str(TICKS))


def fly(*options: str | Path, library: str = FIXTURE, suffix: str = "") -> tuple[Reading, str]:
    """A whole run: what it sent, and its output."""
    with Port() as port, flying("--telemetry", port.address + suffix, *options, library=library) as fc:
        code, out, err = fc.wait()
        assert code == 0 and err == "", err
        return read(port.datagrams()), out


def counts(output: str) -> dict[str, int]:
    """The line that tells of telemetry."""
    found = re.search(
        r"telemetry (\d+) packets, (\d+) overwritten, (\d+) configurations, (\d+) datagrams sent, (\d+) came back",
        output,
    )
    assert found, output
    return dict(
        zip(
            ("packets", "overwritten", "configurations", "datagrams", "failures"), map(int, found.groups()), strict=True
        )
    )


# ---- the bytes


@pytest.fixture(scope="module")
def ramp(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The machine of the page's example."""
    folder = tmp_path_factory.mktemp("ramp")
    (folder / "ramp.json").write_text(example("json"))
    (folder / "ramp.py").write_text(example("python"))
    return str(build_machine(folder / "ramp.json").library)


def without_session(datagram: bytes) -> str:
    """With zeros for CRC and session, which differ from run to run."""
    read_datagram(datagram)
    return (datagram[:8] + bytes(4) + datagram[12:24] + bytes(8) + datagram[32:]).hex(" ", 16)


def test_the_bytes_of_the_page_are_those_that_are_sent(ramp: str) -> None:
    options = ("--rate", "max", "--ticks", "4", "--telemetry-fields", "machine.state,ramp.outputs.height")
    with Port() as port, flying("--telemetry", f"{port.address}/3", *options, library=ramp) as fc:
        assert fc.wait()[0] == 0
        sent = port.datagrams()
    assert len(sent) == 4
    assert [without_session(sent[i]) for i in (0, 3)] == [without_session(d) for d in dumps()]
    reading = read(sent)
    assert [(p.sequence, p.tick, p.time_ns, p.overwritten) for p in reading.packets] == [
        (0, 0, 0, 0),
        (1, 3, 300_000_000, 0),
    ]
    assert [p.values for p in reading.packets] == [
        {"machine.state": "CLIMB", "ramp.outputs.height": height} for height in (0.5, 2.0)
    ]
    assert reading.announced == [0, 1] and len(reading.sessions) == 1


def test_control_the_reader_finds_damage() -> None:
    for datagram in dumps():
        for at in range(len(datagram)):
            with pytest.raises(Malformed):
                read_datagram(datagram[:at] + bytes([datagram[at] ^ 0x10]) + datagram[at + 1 :])
        with pytest.raises(Malformed):
            read_datagram(datagram[:-1])
    configuration, data = dumps()
    with pytest.raises(Malformed):
        read([data])
    for cut in range(40, len(configuration)):
        with pytest.raises(Malformed):
            read_configuration(configuration[40:cut])


# ---- what is sent


def test_the_fields_that_are_sent_by_default() -> None:
    reading, _ = fly("--ticks", "3")
    (configuration,) = set(reading.configurations)
    sensors = "outputs.gyro outputs.temperature outputs.armed outputs.count outputs.transition_request outputs.health"
    pilot = (
        "inputs.gyro inputs.temperature inputs.armed inputs.count inputs.period outputs.force outputs.matrix outputs.runs outputs.sign outputs.checksum outputs.saturated "
        "outputs.transition_request outputs.health"
    )
    counters = ["counters.faults", "counters.overruns", "counters.fault_place"]
    assert [c.path for c in configuration.channels] == [
        *("machine.tick", "machine.state", "machine.next_state"),
        *(f"sensors.{name}" for name in (*sensors.split(), *counters)),
        *(f"pilot.{name}" for name in (*pilot.split(), *counters)),
    ]
    by_path = {c.path: c for c in configuration.channels}
    assert by_path["pilot.outputs.matrix"].shape == (2, 2) and by_path["sensors.outputs.gyro"].unit == "rad/s"
    assert by_path["machine.state"].labels == ("IDLE", "ACTIVE")
    assert by_path["pilot.outputs.health"].labels == ("nominal", "degraded", "failed", "stale")
    assert by_path["pilot.outputs.transition_request"].labels == ("", "tr_GO", "tr_BACK")
    assert configuration.machine == "fixture" and configuration.tick_hz == 100 and configuration.every == 1
    assert configuration.views == '{"panels":[]}'
    assert abs(configuration.wall_ns - time.time_ns()) < 60 * 10**9


def plain(value: Any, narrow: bool) -> Any:
    """A value of the variable server's as a packet has it: flat, NaN and infinities as numbers; narrow: of 32 bits."""
    if isinstance(value, list):
        items = [plain(item, narrow) for item in value]
        return tuple(v for item in items for v in (item if isinstance(item, tuple) else (item,)))
    number = float(value) if value in ("nan", "inf", "-inf") else value
    return struct.unpack("<f", struct.pack("<f", number))[0] if narrow else number


def same(a: Any, b: Any) -> bool:
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b or (a != a and b != b)


def set_inputs(client: Client, k: int) -> None:
    gyro = [0.1 * k, "nan" if k % 7 == 0 else -k, 1e300]
    client.set("sensors.outputs.gyro", gyro, allow_non_finite=True)
    client.set("sensors.outputs.armed", k % 20 < 10)
    client.set("sensors.outputs.count", -1 if k % 11 == 0 else 2**62 + k)


def test_every_value_of_every_tick_is_what_the_variable_server_says(tmp_path: Path) -> None:
    with Port() as port:
        options = ("--telemetry", port.address, "--telemetry-fields", "*", "--socket", tmp_path / "s", "--paused")
        with flying(*options) as fc:
            client = fc.client(tmp_path / "s")
            paths = client.ok("list")["paths"]
            sent, seen = [], []
            for k in range(TICKS):
                set_inputs(client, k)
                client.ok("tick")
                sent += port.until(kind=2)
                seen.append(client.ok("get", paths=paths)["values"])
            stats = client.ok("stats")["telemetry"]
            code, out, _ = fc.stop()
        sent += port.datagrams()
    reading = read(sent)
    assert code == 0 and [p.tick for p in reading.packets] == list(range(TICKS))
    assert list(reading.packets[0].values) == paths
    narrow = {c.path for c in reading.configurations[0].channels if c.type == 5}
    for packet, values in zip(reading.packets, seen, strict=True):
        assert packet.time_ns == packet.tick * 10_000_000 and packet.overwritten == 0
        for path, value in values.items():
            assert same(packet.values[path], plain(value, path in narrow)), (packet.tick, path)
    # The comparison tells one tick from the next.
    assert not any(
        p.values["machine.tick"] == v["machine.tick"] for p, v in zip(reading.packets, seen[1:], strict=False)
    )
    assert any(math.isnan(p.values["sensors.outputs.gyro"][1]) for p in reading.packets)  # type: ignore[index]
    assert {p.values["machine.state"] for p in reading.packets} == {"IDLE", "ACTIVE"}
    assert reading.packets[-1].values["pilot.counters.faults"] != 0
    assert stats["packets"] == TICKS and counts(out) == {**stats, "datagrams": len(sent)}


PARTS = st.lists(
    st.sampled_from(["machine", "sensors", "pilot", "outputs", "counters", "gyro", "?", "*", "a*"]),
    min_size=1,
    max_size=4,
)


@settings(max_examples=25)
@given(st.lists(PARTS.map(".".join), min_size=1, max_size=3))
def test_globs_choose_as_those_of_the_shell_do(globs: list[str]) -> None:
    """Channels are those that Python's fnmatch finds, in the machine's order; a glob that matches nothing is refused."""
    paths = [f.path for f in open_run(Path(FIXTURE), None).machine.fields.values()]
    hits = [[p for p in paths if fnmatch.fnmatchcase(p, glob)] for glob in globs]
    with Port() as port:
        options = ("--telemetry", port.address, "--telemetry-fields", ",".join(globs), "--rate", "max", "--ticks", "1")
        with flying(*options) as fc:
            code, _, err = fc.wait()
        sent = port.datagrams()
    if all(hits):
        (configuration,) = set(read(sent).configurations)
        assert [c.path for c in configuration.channels] == [p for p in paths if any(p in hit for hit in hits)]
    else:
        assert code == 1 and f"no field matches '{globs[hits.index([])]}'" in err and sent == []


def test_nan_has_one_form(tmp_path: Path) -> None:
    with Port() as port:
        options = ("--telemetry", port.address, "--telemetry-fields", "sensors.outputs.gyro", "--paused")
        with flying(*options, "--socket", tmp_path / "s") as fc:
            client = fc.client(tmp_path / "s")
            client.set("sensors.outputs.gyro", ["nan", "-inf", 0.0], allow_non_finite=True)
            client.ok("tick")
            (data,) = (read_datagram(d).payload for d in port.until(kind=2) if read_datagram(d).kind == 2)
    assert data[24:32] == bytes.fromhex("000000000000f87f") and struct.unpack("<2d", data[32:]) == (-math.inf, 0.0)


# ---- when


def test_the_configuration_is_sent_at_spaced_numbers() -> None:
    reading, out = fly(*FREE)
    assert reading.announced == [0, 1, 2, 4, 8, 16, 32] and len(set(reading.configurations)) == 1
    assert [p.sequence for p in reading.packets] == list(range(TICKS))
    assert counts(out) == {"packets": 60, "overwritten": 0, "configurations": 7, "datagrams": 67, "failures": 0}
    assert reading.configurations[0].wall_ns == 0


def test_a_paused_machine_announces_itself(tmp_path: Path) -> None:
    with Port() as port, flying("--telemetry", port.address, "--socket", tmp_path / "s", "--paused") as fc:
        reading = read(port.until(kind=1))
        assert reading.announced == [0] and reading.configurations[0].machine == "fixture"
        assert fc.stop()[0] == 0 and port.datagrams() == []


@pytest.mark.parametrize("every", [1, 2, 7, 59, 1000])
def test_every_so_many_ticks(every: int) -> None:
    reading, _ = fly(*FREE, suffix=f"/{every}")
    assert [p.tick for p in reading.packets] == list(range(0, TICKS, every))
    assert {c.every for c in reading.configurations} == {every}


def test_a_run_from_a_checkpoint_goes_on_in_its_ticks(tmp_path: Path) -> None:
    with AlgTwin.from_library(FIXTURE) as twin:
        twin.tick(7)
        twin.save_file(tmp_path / "checkpoint")
    reading, _ = fly("--restore", tmp_path / "checkpoint", "--rate", "max", "--ticks", "3")
    assert [(p.sequence, p.tick) for p in reading.packets] == [(0, 6), (1, 7), (2, 8), (3, 9)]


def test_a_restart_is_a_new_session() -> None:
    first, second = (fly(*FREE)[0] for _ in range(2))
    assert len({*first.sessions, *second.sessions}) == 2 and 0 not in first.sessions + second.sessions
    assert first.packets == second.packets


# ---- large packets


LARGE = '''class Large:
    """Many channels, and long ones."""

    outputs = {"field": "f64[1500]", "targets": "Target[450]"}

    def execute(self):
        for i in range(1500):
            self.field[i] = f64(i) + 0.25
        for i in range(450):
            self.targets[i].distance += f64(i)
            self.targets[i].valid = not self.targets[i].valid
'''


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("large")
    (folder / "large.py").write_text(LARGE)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "structs": {"Target": {"distance": "f64 m", "valid": "bool", "identifier_of_target": "u32"}},
        "algorithms": {"Large": {"source": "large.py"}},
        "instances": {"seeker": {"algorithm": "Large"}},
        "connections": [],
        "states": {"RUN": {"schedule": {"seeker": 100}}},
        "transitions": [],
    }
    (folder / "large.json").write_text(json.dumps(config))
    return str(build_machine(folder / "large.json").library)


def test_packets_of_many_datagrams(large: str) -> None:
    reading, out = fly(*FREE, library=large)
    (configuration,) = set(reading.configurations)
    assert len(configuration.channels) > 1350 and configuration.data_bytes > 1500 * 8 + 450 * 13
    sizes = {d.kind: (d.total + 1359) // 1360 for d in reading.datagrams}
    assert sizes[1] > 32 and sizes[2] > 10 and all(len(d.payload) <= 1360 for d in reading.datagrams)
    assert len(reading.packets) == TICKS and counts(out)["datagrams"] == len(reading.datagrams)
    for k, packet in enumerate(reading.packets):
        assert packet.values["seeker.outputs.field"] == tuple(i + 0.25 for i in range(1500))
        assert packet.values["seeker.outputs.targets[449].distance"] == 449.0 * (k + 1)
        assert packet.values["seeker.outputs.targets[7].valid"] == (k % 2 == 0)


def test_a_large_configuration_lets_data_through(large: str) -> None:
    """No more than 32 datagrams of it go out at once."""
    reading, _ = fly("--ticks", "5", library=large)
    kinds = "".join(str(d.kind) for d in reading.datagrams)
    assert max(map(len, re.findall("1+", kinds))) >= 32


# ---- nobody, nowhere


def test_nobody_listens() -> None:
    port = Port()
    port.socket.close()
    with flying("--telemetry", port.address, *FREE) as fc:
        code, out, err = fc.wait()
    assert code == 0 and err == "" and counts(out)["packets"] == TICKS and counts(out)["failures"] > 0


def test_a_receiver_that_comes_late_gets_the_rest(tmp_path: Path) -> None:
    port = Port()
    number = port.socket.getsockname()
    port.socket.close()
    with flying("--telemetry", port.address, "--socket", tmp_path / "s", "--paused") as fc:
        client = fc.client(tmp_path / "s")
        client.ok("tick", count=10)
        with Port(number) as late:
            client.ok("tick", count=30)
            assert fc.stop()[0] == 0
            ticks = [p.tick for p in read(late.datagrams()).packets]
    assert ticks == list(range(ticks[0], 40)) and ticks[0] <= 20


def test_no_network_at_all() -> None:
    tool = shutil.which("unshare")
    line = [
        tool or "",
        "--user",
        "--map-root-user",
        "--net",
        PROGRAM,
        FIXTURE,
        "--telemetry",
        "udp:127.0.0.1:7600",
        *FREE,
    ]
    if tool is None or subprocess.run([*line[:4], "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("no network of one's own can be made here")
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    sent = counts(done.stdout)
    assert done.returncode == 0 and done.stderr == "" and sent["packets"] == TICKS
    assert sent["datagrams"] == 0 and sent["failures"] == 67


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--telemetry", "127.0.0.1:7600"), "write udp:HOST:PORT"),
        (("--telemetry", "udp:localhost:7600/0"), "write udp:HOST:PORT"),
        (("--telemetry", "udp:localhost:"), "write udp:HOST:PORT"),
        (("--telemetry", "udp:localhost:007600"), "write udp:HOST:PORT"),
        (("--telemetry", "udp:localhost:65536"), "write udp:HOST:PORT"),
        (("--telemetry", "udp::7600"), "write udp:HOST:PORT"),
        (("--telemetry", f"udp:{'1' * 64}:7600"), "write udp:HOST:PORT"),
        (("--telemetry", "udp:localhost:7600/4294967297"), "write udp:HOST:PORT"),  # not every tick, its low 32 bits
        (
            ("--telemetry", "udp:127.0.0.1:7600", "--telemetry-fields", "pilot"),
            "no field matches 'pilot'; a path is like",
        ),
        (("--telemetry", "udp:127.0.0.1:7600", "--telemetry-fields", ""), "chooses no field"),
    ],
)
def test_what_is_refused_before_the_first_tick(options: tuple[str, ...], text: str) -> None:
    with flying(*options, "--ticks", "3") as fc:
        code, out, err = fc.wait()
    assert code == 1 and text in err and err.count("\n") == 1 and "ticks" not in out
