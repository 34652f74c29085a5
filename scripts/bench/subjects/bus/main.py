# SPDX-License-Identifier: Apache-2.0
"""The bus beside what others would take: round trips of a lander's tick over FCSL's wires, bare sockets, Zenoh and Fast DDS; the
step thread's instructions with the bus and without it; and what flight computers on one listener take of the processors.

python3 scripts/bench bus
"""

from __future__ import annotations

import functools
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zenoh

from fcsl_bridge.domain import own_domain
from fcsl_bridge.loopback import loopback_environment
from fcsl_compiler.driver.cache import build_machine
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint

from ...harness.native import compile_program
from ...harness.size import sized
from ..lander import ROOT
from ..link.main import lockstep_over, lockstep_program
from ..vars.main import instructions

HERE = Path(__file__).resolve().parent
SIM = ROOT / "examples/lander/sim/lander.sim.json"
MACHINE = ROOT / "examples/lander/fc/lander_control.json"
ROUNDS = sized(3, 1)
TRIPS = sized(5000, 50)
TICKS = sized({"unix": 30_000, "udp": 10_000, "zenoh": 10_000}, dict.fromkeys(("unix", "udp", "zenoh"), 200))
#: An observer is there when so many messages came.
SEEN = 10
COMPUTERS = sized(10, 1)
#: Ticks a second of each flight computer: the lander's 100 Hz at this speed.
SPEED, RATE_HZ = 10, 1000
#: Of a lander's tick there, as a message (docs/reference/transports.md).
BYTES = 64
LIMIT_S = 300


def bus_figures(folder: Path) -> dict[str, Any]:
    return {
        "round_trips_us": round_trips(folder),
        "instructions": step_instructions(folder),
        "computers": computers(folder),
        "load": os.getloadavg()[0],
    }


# ---- round trips -------------------------------------------------------------------------------------------------------


def round_trips(folder: Path) -> dict[str, dict[str, float]]:
    """p50, p99, max in µs and rate of each way; ways take turns, and the medians of the rounds count."""
    program = lockstep_program(folder)
    ways: dict[str, Callable[[], dict[str, float]]] = {}
    for kind, ticks in TICKS.items():
        ways[f"lock-step over {kind}"] = functools.partial(lockstep_over, program, kind, folder, ticks)
        if kind != "zenoh":
            ways[f"bare sockets, {kind}"] = functools.partial(lockstep_over, program, kind, None, ticks)
    ways["zenoh's own ping (Python)"] = _ping_zenoh
    ways["Fast DDS (rclpy, raw)"] = _ping_dds
    rounds: dict[str, list[dict[str, float]]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, measure in ways.items():
            rounds[name].append(measure())
    keys = ("p50_us", "p99_us", "max_us", "ticks_per_s")
    return {name: {key: statistics.median(f[key] for f in facts) for key in keys} for name, facts in rounds.items()}


def _ping(script: str, where: Sequence[str], env: dict[str, str]) -> dict[str, float]:
    line = [sys.executable, str(HERE / script)]
    pipe = subprocess.PIPE
    with subprocess.Popen([*line, "pong", *where], stdin=pipe, stdout=pipe, text=True, env=env) as other:
        try:
            assert other.stdout is not None
            other.stdout.readline()
            said = subprocess.run(
                [*line, "ping", *where, str(BYTES), str(TRIPS)],
                stdout=pipe,
                text=True,
                check=True,
                env=env,
                timeout=LIMIT_S,
            ).stdout
        finally:
            other.kill()
    trips = sorted(json.loads(said))
    at = lambda share: trips[min(len(trips) - 1, int(len(trips) * share))] / 1e3  # noqa: E731
    return {"p50_us": at(0.5), "p99_us": at(0.99), "max_us": at(1.0), "ticks_per_s": 1e9 * len(trips) / sum(trips)}


def _ping_zenoh() -> dict[str, float]:
    return _ping("ping_zenoh.py", [zenoh_locator(free_endpoint())], dict(os.environ))


def _ping_dds() -> dict[str, float]:
    with own_domain() as domain:
        env = {**os.environ, **loopback_environment(os.environ), "ROS_DOMAIN_ID": str(domain)}
        return _ping("ping_dds.py", [], env)


# ---- the step thread ---------------------------------------------------------------------------------------------------


def step_instructions(folder: Path) -> dict[str, list[int]]:
    """Least, median and most of a tick: without observers, with their bus, and with one that takes everything."""
    program = compile_program(["subjects/vars/steps.c"], folder / "bus_steps")
    library = build_machine(MACHINE).library
    endpoint = free_endpoint()
    counts = {
        "without the bus": instructions(folder, library, program, []),
        "observers, nobody there": instructions(folder, library, program, [], "--observers", endpoint),
    }
    with ExitStack() as stack:
        watch = functools.partial(_observe, endpoint, stack)
        counts["observers, one there"] = instructions(
            folder, library, program, [], "--observers", endpoint, ready=watch
        )
    return {name: [min(found), int(statistics.median(found)), max(found)] for name, found in counts.items()}


def _observe(endpoint: str, stack: ExitStack) -> None:
    """Takes all messages until the stack is closed; returns when some came."""
    config = zenoh.Config.from_json5('{mode: "client", scouting: {multicast: {enabled: false}}}')
    config.insert_json5("connect/endpoints", json.dumps([zenoh_locator(endpoint)]))
    config.insert_json5("connect/timeout_ms", "30000")
    came = threading.Semaphore(0)
    bus = stack.enter_context(zenoh.open(config))
    bus.declare_subscriber("**", lambda _: came.release())
    for _ in range(SEEN):
        if not came.acquire(timeout=30):
            raise RuntimeError("the observer saw nothing")


# ---- flight computers on one listener ----------------------------------------------------------------------------------


def computers(folder: Path) -> dict[str, float]:
    """COMPUTERS landers, each with a simulator and a flight computer, at RATE_HZ. All are clients of this process."""
    library = build_machine(MACHINE).library
    endpoint = free_endpoint()
    with ExitStack() as stack:

        def begin(*line: object) -> subprocess.Popen[str]:
            pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
            process = stack.enter_context(subprocess.Popen([str(word) for word in line], **pipes))
            stack.callback(process.kill)
            return process

        config = zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
        config.insert_json5("listen/endpoints", json.dumps([zenoh_locator(endpoint)]))
        stack.enter_context(zenoh.open(config))
        simulators, flying = [], []
        for i in range(COMPUTERS):
            where = ["--external", f"zenoh-client:{endpoint}", "--namespace", f"c{i}"]
            simulators.append(begin("fcsl-sim", "run", SIM, *where, "--speed", SPEED, "--timeout", 60, "--json"))
            where = ["--hal", f"zenoh:{endpoint}", "--namespace", f"c{i}", "--timeout", "60"]
            flying.append(begin("fcsl-fc", library, *where, "--summary", folder / f"c{i}.json"))
        used = 0.0
        for process in flying:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            _, said = process.communicate(timeout=LIMIT_S)
            if process.returncode:
                raise RuntimeError(said)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used += after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        wall_s = [json.loads(process.communicate(timeout=LIMIT_S)[0])["wall_s"] for process in simulators]
        ticks = sum(json.loads((folder / f"c{i}.json").read_text())["tick"] for i in range(COMPUTERS))
    return {
        "computers": COMPUTERS,
        "cpu_us_per_tick": 1e6 * used / ticks,
        "percent_of_a_core_each": 100 * used / ticks * RATE_HZ,
        "ticks_per_s_each": ticks / COMPUTERS / max(wall_s),
    }


def bus_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, f in facts["round_trips_us"].items():
        rows.append((name, f"{f['p50_us']:.0f} / {f['p99_us']:.0f} / {f['max_us']:.0f} µs, {f['ticks_per_s']:.0f}/s"))
    for name, (least, median, most) in facts["instructions"].items():
        rows.append((f"instructions of a tick, {name}", f"{least} / {median} / {most}"))
    many = facts["computers"]
    rows.append(
        (
            f"{many['computers']} flight computers at one listener",
            f"{many['percent_of_a_core_each']:.0f} % of a core each at 1 kHz",
        )
    )
    rows.append(("    ticks/s of each", f"{many['ticks_per_s_each']:.0f}"))
    rows.append(("    load of the computer", f"{facts['load']:.1f}"))
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        figures = bus_figures(Path(scratch))
    print(json.dumps(figures))
    for what, figure in bus_rows(figures):
        print(f"{what:<50}{figure:>50}")
