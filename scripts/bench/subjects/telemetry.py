# SPDX-License-Identifier: Apache-2.0
"""Telemetry over UDP: what it costs the step thread (its instructions, counted one by one as for the variable server), how many
packets the sender makes in a second, and how many simclient.Telemetry takes.

python3 scripts/bench telemetry
"""

from __future__ import annotations

import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.cache import build_machine
from simclient import Telemetry
from simclient.library import runtime_library

from ..harness.native import compile_program
from ..harness.size import sized
from .vars.main import SLOW, VEHICLE, instructions

#: Of the flight whose packets are received: at 1 kHz, so about so many milliseconds.
PACKETS = sized(5000, 500)
ROUNDS, RUNS = sized((20, 5), (1, 1))
#: What the sender sends of the vehicle.
SENT = {"state of the machine": "machine.*", "all fields": "*"}


def telemetry_figures(folder: Path) -> dict[str, Any]:
    """`instructions`: per scenario as pairs of number and how often; `sender`, `receiver`: medians of RUNS runs."""
    return {
        "instructions": _costs(folder),
        "sender": {n: _sender(folder, f) for n, f in SENT.items()},
        "receiver": _receiver(),
    }


def _bound() -> tuple[socket.socket, str]:
    """A socket on loopback, and its address as the option takes it."""
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16 << 20)
    receiver.bind(("127.0.0.1", 0))
    return receiver, f"udp:127.0.0.1:{receiver.getsockname()[1]}"


def _costs(folder: Path) -> dict[str, list[tuple[int, int]]]:
    program = compile_program(["subjects/vars/steps.c"], folder / "vars_steps")
    slow = build_machine(SLOW).library
    receiver, address = _bound()
    with receiver:
        scenarios: dict[str, tuple[str, ...]] = {
            "without telemetry": (),
            "telemetry of all fields": ("--telemetry", address, "--telemetry-fields", "*"),
        }
        return {
            name: sorted(Counter(instructions(folder, slow, program, [], *options)).items())
            for name, options in scenarios.items()
        }


def _sender(folder: Path, fields: str) -> dict[str, float]:
    """Packets that wait in the history (telemetry.c), to a port that nobody reads."""
    includes = [package_prefix(p) / "include" for p in ("fcsl_runtime", "fcsl_hal")]
    program = compile_program(["subjects/telemetry.c", runtime_library()], folder / "telemetry", includes)
    environment = {**os.environ, "LD_LIBRARY_PATH": str(runtime_library().parent)}
    receiver, address = _bound()
    with receiver:
        line = [str(program), str(build_machine(VEHICLE).library), address, fields, str(ROUNDS)]
        done = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True, env=environment)
    found = json.loads(done.stdout)
    if found["overwritten"] > 0:
        raise RuntimeError("the history did not hold what was published")
    rates = sorted(found["packets"] * 1e9 / ns for ns in found["ns"])
    each = found["datagrams"] / found["packets"]
    return {"packets_per_s": statistics.median(rates), "least": rates[0], "most": rates[-1], "datagrams_each": each}


def _flight() -> list[bytes]:
    """The datagrams of a flight at 1 kHz."""
    receiver, address = _bound()
    with receiver:
        line = ["fcsl-fc", str(build_machine(VEHICLE).library), "--ticks", str(PACKETS), "--telemetry", address]
        receiver.settimeout(2.0)
        with subprocess.Popen(line, stdout=subprocess.DEVNULL):
            datagrams = []
            try:
                while True:
                    datagrams.append(receiver.recv(65536))
            except TimeoutError:
                return datagrams


def _receiver() -> dict[str, float]:
    datagrams = _flight()
    rates = []
    for _ in range(RUNS):
        telemetry = Telemetry(window_ticks=PACKETS)
        begun = time.perf_counter()
        for datagram in datagrams:
            telemetry.feed(datagram)
        rates.append(PACKETS / (time.perf_counter() - begun))
        if len(telemetry.window()) < 0.9 * PACKETS:
            raise RuntimeError(f"only {len(telemetry.window())} of {PACKETS} packets were received")
        telemetry.close()
    return {"packets_per_s": statistics.median(rates), "least": min(rates), "most": max(rates)}


def telemetry_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, counts in facts["instructions"].items():
        times = [n for n, count in counts for _ in range(count)]
        median = times[len(times) // 2]
        rows.append((f"instructions of a tick, {name}", f"{times[0]} / {median} / {times[-1]} least / median / most"))
    for name, sent in facts["sender"].items():
        what = f"telemetry sent, {name} ({sent['datagrams_each']:.1f} datagrams each)"
        rows.append((what, f"{sent['packets_per_s']:.0f} packets/s ({sent['least']:.0f} to {sent['most']:.0f})"))
    receiver = facts["receiver"]
    rows.append(
        (
            "telemetry taken by simclient.Telemetry",
            f"{receiver['packets_per_s']:.0f} packets/s ({receiver['least']:.0f} to {receiver['most']:.0f})",
        )
    )
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        figures = telemetry_figures(Path(name))
    for what, figure in telemetry_rows(figures):
        print(f"{what:<48}{figure:>40}")
    print(json.dumps(figures["instructions"]))
    sys.exit(0)
