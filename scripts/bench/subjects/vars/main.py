# SPDX-License-Identifier: Apache-2.0
"""The variable server: how long a client waits for `get`, and what clients cost the step thread.

The step thread's instructions are counted one by one (ptrace, steps.c; a virtual machine need not have counters), from one call
of fcsl_run_step to the next: a tick, its publication, the command that may be served behind it, and the way into the sleep and
out of it. Alone, under 64 clients that flood the server with what only looks, and under 64 that flood it with `set`.

python3 scripts/bench vars
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.cache import build_machine

from ...harness.native import compile_program
from ...harness.size import sized
from ...harness.trips import connect, echo, in_turns, trip

ROOT = Path(__file__).resolve().parents[4]
SLOW = ROOT / "scripts/bench/machines/slow/slow.json"
VEHICLE = ROOT / "scripts/bench/machines/vehicle/vehicle.json"
TICKS, CLIENTS = sized(60, 5), 64
GET = b'{"cmd":"get","paths":["machine.tick"]}\n'
#: Of a run whose steps are timed.
SECONDS = sized(5.0, 0.5)
Requests = list[dict[str, Any]]

LOOKING: Requests = [
    {"cmd": "get", "paths": ["machine.tick", "one.outputs.y"]},
    {"cmd": "eval", "expression": "one.outputs.y > machine.tick"},
    {"cmd": "state"},
    {"cmd": "list"},
]
LOOKING_VEHICLE: Requests = [{"cmd": "get", "paths": ["machine.tick"]}, {"cmd": "state"}, {"cmd": "list"}]
SETTING: Requests = [{"cmd": "set", "values": {"one.inputs.x": 1.5}}]


def vars_figures(folder: Path) -> dict[str, Any]:
    """`trips_us`: quantiles of a `get` of one client, machine running, and of an echo of as many bytes; `instructions`:
    per scenario how many stretches of the step thread had so many instructions, as pairs."""
    program = compile_program(["subjects/vars/steps.c"], folder / "vars_steps")
    facts: dict[str, Any] = {"trips_us": _round_trips(folder)}
    slow = build_machine(SLOW).library
    floods: dict[str, Requests] = {"alone": [], "64 looking": LOOKING, "64 setting": SETTING}
    facts["instructions"] = {
        name: sorted(Counter(instructions(folder, slow, program, requests)).items())
        for name, requests in floods.items()
    }
    floods = {"alone": [], "63 looking": LOOKING_VEHICLE}
    facts["tick_time_ns"] = {name: _step_time(folder, requests) for name, requests in floods.items()}
    return facts


@contextmanager
def _flying(folder: Path, library: Path, *options: str) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    path = folder / "vars.sock"
    line = ["fcsl-fc", str(library), "--socket", str(path), *options]
    process = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 20
        while not path.exists():
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"`{' '.join(line)}` does not serve")
            time.sleep(0.01)
        yield process, path
    finally:
        process.terminate()
        process.wait(20)


def _round_trips(folder: Path) -> dict[str, Any]:
    library = build_machine(VEHICLE).library
    with (
        _flying(folder, library) as (_, path),
        connect(path) as client,
        echo(folder, trip(client, GET)) as echoing,
    ):
        return in_turns({"get": lambda: trip(client, GET), "echo": lambda: trip(echoing, GET)})


@contextmanager
def _flood(path: Path, requests: Requests, count: int = CLIENTS) -> Iterator[list[int]]:
    """So many connections that always have requests under way; counts the replies' bytes. Raises OSError when one is dropped."""
    lines = b"".join(json.dumps(r).encode() + b"\n" for r in requests) * 8
    over = threading.Event()
    received = [0]
    dropped: list[OSError] = []

    def push(clients: list[socket.socket]) -> None:
        left = dict.fromkeys(clients, b"")
        try:
            while not over.is_set():
                for client in clients:
                    left[client] = left[client] or lines
                    with suppress(BlockingIOError):
                        left[client] = left[client][client.send(left[client]) :]
                    with suppress(BlockingIOError):
                        received[0] += len(client.recv(1 << 20))
        except OSError as error:
            dropped.append(error)

    with ExitStack() as stack:
        clients = [stack.enter_context(connect(path)) for _ in range(count if requests else 0)]
        for client in clients:
            client.setblocking(False)
        thread = threading.Thread(target=push, args=(clients,))
        if clients:
            thread.start()
            time.sleep(0.5)
        try:
            yield received
        finally:
            over.set()
            if clients:
                thread.join()
        if dropped:
            raise dropped[0]


def _address(process: int) -> int:
    """Where fcsl_run_step lies in this process."""
    maps = [line.split() for line in Path(f"/proc/{process}/maps").read_text().splitlines()]
    (base, library), *_ = [(int(m[0].split("-")[0], 16), m[5]) for m in maps if m[5:] and "libfcsl_run.so" in m[5]]
    symbols = subprocess.run(["nm", "-D", library], capture_output=True, text=True, check=True).stdout
    return base + next(int(s.split()[0], 16) for s in symbols.splitlines() if s.endswith(" fcsl_run_step"))


def instructions(
    folder: Path,
    library: Path,
    program: Path,
    requests: Requests,
    *options: str,
    ready: Callable[[], None] = lambda: None,
) -> list[int]:
    """Of TICKS ticks in a row of fcsl-fc with these options, under a flood of requests, once `ready` returned in its flight."""
    with _flying(folder, library, *options) as (process, path), _flood(path, requests) as received:
        ready()
        before = received[0]
        line = [str(program), str(process.pid), f"{_address(process.pid):x}", str(TICKS)]
        done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)
        if done.returncode != 0:
            raise RuntimeError(done.stderr.strip())
        if requests and received[0] == before:
            raise RuntimeError("the flood does not flow")
    return [int(line) for line in done.stdout.split()]


def _step_time(folder: Path, requests: Requests) -> dict[str, int]:
    """The step's own histogram at 1 kHz (fcsl-fc's `stats`), of a run of a few seconds."""
    with _flying(folder, build_machine(VEHICLE).library) as (_, path), connect(path) as client:
        with _flood(path, requests, CLIENTS - 1):  # who asks for the figures is a client, too
            time.sleep(SECONDS)
            client.sendall(b'{"cmd":"stats"}\n')
            reply: dict[str, Any] = json.loads(client.makefile().readline())
    return dict(reply["tick_time_ns"])


def vars_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    trips = facts["trips_us"]
    rows = [
        (what, f"{trips[name]['median']:.1f} / {trips[name]['p99']:.1f} µs{goal}")
        for name, what, goal in (
            ("get", "get of one client, p50 / p99", " (goal 12)"),
            ("echo", "    a bare echo in C of the same bytes", ""),
        )
    ]
    for name, counts in facts["instructions"].items():
        times = [n for n, count in counts for _ in range(count)]
        median = times[len(times) // 2]
        rows.append((f"instructions of a tick, {name}", f"{times[0]} / {median} / {times[-1]} least / median / most"))
    for name, found in facts["tick_time_ns"].items():
        rows.append((f"time of a step, {name}", f"{found['p50']} / {found['p99']} ns p50 / p99"))
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        figures = vars_figures(Path(name))
    for what, figure in vars_rows(figures):
        print(f"{what:<44}{figure:>34}")
    for scenario, counts in figures["instructions"].items():
        print(f"{scenario}:")
        most = max(count for _, count in counts)
        for number, count in counts:
            print(f"  {number:8d} instructions  {count:4d}  {'#' * max(1, 40 * count // most)}")
    sys.exit(0)
