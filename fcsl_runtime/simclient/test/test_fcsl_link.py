# SPDX-License-Identifier: Apache-2.0
"""fcsl link beside a real flight over UDP, and beside programs without a link."""

from __future__ import annotations

import json
import socket
import subprocess
from pathlib import Path

from native import FIXTURE, WIRE_SIM, flying


def fcsl_link(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    line = ["fcsl", "link", *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, timeout=60, check=False)


def test_a_flight_over_udp(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        wire = f"udp:127.0.0.1:{found.getsockname()[1]}"
    variables = tmp_path / "fc.sock"
    with (
        subprocess.Popen([WIRE_SIM, FIXTURE, wire, "50", "hang"], stdout=subprocess.PIPE, text=True) as sim,
        flying("--hal", f"wire:{wire}", "--timeout", "60", "--socket", variables),
    ):
        assert sim.stdout is not None and sim.stdout.readline() == "50 ticks\n"
        shown = fcsl_link("--socket", variables, "--period", "0.1", "--count", "2")
        told = fcsl_link("--socket", variables, "--period", "0.1", "--count", "1", "--json")
        sim.kill()
    assert (shown.returncode, shown.stderr) == (0, "")
    assert shown.stdout.startswith("connected; frames taken ") and "wrong crc 0 (0.0/s)" in shown.stdout
    assert [line.split()[0] for line in shown.stdout.splitlines() if line[:1].isdigit()] == ["0", "0"]
    total = json.loads(told.stdout)["total"]
    # A hello, 50 sensor messages, 50 times; a hello and 50 commands back.
    assert (total["port0.received"], total["port0.sent"], total["connected"]) == (101, 51, 1)


def test_a_program_without_a_link(tmp_path: Path) -> None:
    with flying("--socket", tmp_path / "s") as fc:
        fc.client(tmp_path / "s")
        done = fcsl_link("--socket", tmp_path / "s", "--count", "1")
    assert done.returncode == 1 and done.stderr.startswith("fcsl link: this program has no link: ")


def test_no_program(tmp_path: Path) -> None:
    done = fcsl_link("--socket", tmp_path / "nothing", "--count", "1")
    assert done.returncode == 2 and done.stderr.startswith("fcsl link: ") and done.stderr.count("\n") == 1
