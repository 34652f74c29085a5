# SPDX-License-Identifier: Apache-2.0
"""fcsl view as a program: what it serves and to whom, a viewer that does not read, and a real flight."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from native import PROGRAM
from rrd import read_rrd, values
from telemetry_packets import Channel, Sender

from simclient.errors import ViewError
from simclient.live import viewer
from simclient.live.live_view import LiveView
from simclient.live.viewer import NO_VIEWER, WEB, Viewer
from simclient.telemetry.receiver import Telemetry
from simclient.view.rrd import to_rerun

LIMIT_S = 60.0


def free_pair() -> int:
    """A port that is free, as is the one after it."""
    for _ in range(100):
        with socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            try:
                second.bind(("127.0.0.1", first.getsockname()[1] + 1))
            except OSError:
                continue
            return int(first.getsockname()[1])
    raise AssertionError("no two free ports in a row")


def until(holds: object, what: str) -> None:
    """Returns when `holds()` does."""
    deadline = time.monotonic() + LIMIT_S
    while not holds():  # type: ignore[operator]
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


def answers(port: int) -> bool:
    with socket.socket() as sock:
        return sock.connect_ex(("127.0.0.1", port)) == 0


def listeners(port: int) -> set[str]:
    """The local addresses, in the kernel's hexadecimal, at which somebody listens on this port."""
    lines = [
        line.split() for table in ("tcp", "tcp6") for line in Path("/proc/net", table).read_text().splitlines()[1:]
    ]
    return {local.split(":")[0] for _, local, _, state, *_ in lines if local.endswith(f":{port:04X}") and state == "0A"}


@contextmanager
def viewing(*options: str | Path) -> Iterator[tuple[subprocess.Popen[str], list[str]]]:
    """The program and its first lines, up to the one that says where it listens; it is ended behind the block."""
    command = ["fcsl", "view", *map(str, options)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process, [process.stdout.readline()]
        finally:
            process.kill()


def port_of(line: str) -> int:
    assert line.startswith("waiting for telemetry on 127.0.0.1:"), line
    return int(line.rpartition(":")[2])


def test_page_and_data_are_for_this_computer_alone_and_end_with_the_program() -> None:
    port = free_pair()
    with viewing("udp:127.0.0.1:0", "--web", port) as (process, _):
        until(lambda: answers(port) and answers(port + 1), "neither page nor data")
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=LIMIT_S) as page:
            assert page.status == 200 and b"<title>Rerun Viewer</title>" in page.read()
        assert listeners(port) == listeners(port + 1) == {"0100007F"}
        process.send_signal(signal.SIGKILL)
        until(lambda: not listeners(port) | listeners(port + 1), "the server outlives the program")


def test_a_page_whose_port_is_taken_is_a_message() -> None:
    port = free_pair()
    for taken in (port, port + 1):
        with socket.create_server(("127.0.0.1", taken)), viewing("udp:127.0.0.1:0", "--web", port) as (process, _):
            out, err = process.communicate(timeout=LIMIT_S)
        assert process.returncode == 2 and f"Address already in use ({taken})" in err and "open" not in out, out + err


def test_a_server_that_does_not_answer_is_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "rerun"
    program.write_text("#!/bin/sh\nexec sleep 60\n")
    program.chmod(0o755)
    started: list[subprocess.Popen[bytes]] = []

    def start(*command: object) -> subprocess.Popen[bytes]:
        started.append(begin(*command))
        return started[0]

    begin = viewer._start
    monkeypatch.setattr(viewer, "_start", start)
    monkeypatch.setattr(viewer, "_PROGRAM", program)
    monkeypatch.setattr(viewer, "_START_S", 0.0)
    with pytest.raises(ViewError, match="does not serve its page"):
        Viewer(WEB, web_port=free_pair())
    assert started[0].returncode == -signal.SIGKILL


def test_who_listens_everywhere_is_found() -> None:
    with socket.socket() as sock:
        sock.bind(("0.0.0.0", 0))
        sock.listen()
        assert listeners(sock.getsockname()[1]) == {"00000000"}


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["udp:127.0.0.1:99999"], "write udp:HOST:PORT"),
        (["udp:127.0.0.1:0", "--web", "65535"], "--web takes a port above 0 and below 65535"),
        (["udp:127.0.0.1:0", "--web", "0"], "--web takes a port above 0"),
        (["udp:127.0.0.1:0", "--connect", "here"], "`here` is not a viewer's address; expected one like rerun+http://"),
        (["udp:127.0.0.1:0", "--connect", "web"], "`web` is not a viewer"),
        (["udp:127.0.0.1:0", "--connect", "rerun+http://127.0.0.1:x/proxy"], "is not a viewer"),
        (
            ["udp:127.0.0.1:0", "--connect", "rerun+http://127.0.0.1:1/proxy"],
            "1/proxy: Connection refused; start it first",
        ),
        (["udp:127.0.0.1:0", "--save", "/no/where/x.rrd"], "no such directory: /no/where"),
        (["udp:300.0.0.1:0"], "cannot listen on 300.0.0.1:0"),
    ],
)
def test_wrong_usage_is_one_message(options: list[str], reason: str) -> None:
    with viewing(*options) as (process, _):
        out, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 2 and reason in err and "Traceback" not in err, err


def test_a_window_without_a_display_is_a_message() -> None:
    with pytest.MonkeyPatch.context() as patch:
        for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
            patch.delenv(name, raising=False)
        with viewing("udp:127.0.0.1:0") as (process, _):
            _, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 1 and "without a display, have a page" in err, err


def test_a_real_flight_is_shown_as_its_bag_is(probe: Path, tmp_path: Path) -> None:
    with viewing("udp:127.0.0.1:0", "--save", tmp_path / "live.rrd") as (process, lines):
        fly = [PROGRAM, str(probe), "--ticks", "100", "--record", str(tmp_path / "bag")]
        flight = subprocess.run(
            [*fly, "--telemetry", f"udp:127.0.0.1:{port_of(lines[0])}"], capture_output=True, text=True, timeout=LIMIT_S
        )
        assert flight.returncode == 0, flight.stderr
        assert "100 packets, 0 overwritten" in flight.stdout + flight.stderr
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0 and "100 ticks in 1 recording(s), 0 missing" in out, out + err
    to_rerun(tmp_path / "bag", tmp_path / "bag.rrd")
    shown, recorded = read_rrd(tmp_path / "live.rrd"), read_rrd(tmp_path / "bag.rrd")
    assert any("/inputs/" in entity for entity in recorded)
    for entity in recorded.keys() - {"/probe/state/step"}:
        assert str(shown[entity]) == str(recorded[entity]), entity


def test_a_viewer_that_does_not_read_costs_no_packet(tmp_path: Path) -> None:
    """It is stopped as a debugger stops a program; a file beside it gets everything."""
    sender = Sender(channels=tuple(Channel(f"nav.outputs.f{k}", 6, (50,)) for k in range(20)))
    port = free_pair()
    # Rows for 200 ticks: what comes while the viewer stands still is more.
    with Telemetry(0, window_ticks=200) as telemetry, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        frozen, file = Viewer(WEB, "", port), Viewer(NO_VIEWER, str(tmp_path / "x.rrd"))
        assert frozen._process is not None
        views = LiveView(telemetry, frozen), LiveView(telemetry, file)
        sent = 0

        def send(count: int) -> None:
            nonlocal sent
            for datagram in sender.configuration(sent) if sent == 0 else []:
                sock.sendto(datagram, ("127.0.0.1", telemetry.port))
            for sequence in range(sent, sent + count):
                for datagram in sender.data(sequence):
                    sock.sendto(datagram, ("127.0.0.1", telemetry.port))
            sent += count
            until(lambda: telemetry.counts.packets == sent, "packets were lost on the way")
            for view in views:
                view.show(rest=True)

        try:
            until(lambda: answers(port + 1), "the viewer does not begin")
            send(20)
            until(lambda: views[0].taken(0.2), "the viewer does not take what it is sent")
            os.kill(frozen._process.pid, signal.SIGSTOP)
            begin_s = time.monotonic()
            while not views[0].behind:
                send(20)
                assert time.monotonic() - begin_s < LIMIT_S, "a viewer that stands still takes everything"
            shown = views[0].ticks
            for _ in range(30):
                send(20)
            assert views[0].ticks == shown and views[1].ticks == sent
            os.kill(frozen._process.pid, signal.SIGCONT)
            until(lambda: views[0].taken(0.2), "the viewer does not go on")
            send(20)
            assert views[0].ticks + views[0].missing == sent and views[0].missing > 300
            assert views[1].missing == 0 and (telemetry.counts.lost, telemetry.counts.malformed) == (0, 0)
            for view in views:
                view.end()
        finally:
            frozen.close()
    assert len(values(read_rrd(tmp_path / "x.rrd"), "/probe/nav/f7", "Scalars:scalars")) == sent
